// Names beside a structure that has none: which of them are parts of it.
#include "estimator/diagnosis/structure_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "estimator/diagnosis/restored_model.h"
#include "estimator/effects/catalogue.h"
#include "estimator/effects/smooth_term.h"
#include "tests/estimator/structure.h"

namespace plumbline {
namespace {

using testing::Each;
using testing::Field;
using testing::IsEmpty;

/// By how much a scale is larger, V/g.
double ageing(double t_s) { return 1e-4 * (t_s - 60) * 0.032; }
double swaying(double t_s) { return 1e-2 * std::sin(t_s / 7) * 0.032; }

TEST(StructureParts, ATrendBesideAnotherFunctionOfTheTimeIsAPartOfThat) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto& a, double t_s) { return (ageing(t_s) + swaying(t_s)) * a[0]; };
  const SyntheticRun data = synthetic_run(3, kSixteenBits, options);
  const Calibration result = calibrated(data);
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.effects, IsEmpty());
  ASSERT_EQ(result.diagnosis.unlisted.size(), 2U);
  EXPECT_THAT(result.diagnosis.unlisted, Each(Field(&UnlistedStructure::driver, "t_s")));
  EXPECT_THAT(result.diagnosis.unlisted, Each(Field(&UnlistedStructure::form, "scale")));
  const auto part = std::find_if(
      result.diagnosis.unlisted.begin(), result.diagnosis.unlisted.end(),
      [](const UnlistedStructure& found) { return part_like(found.shape).has_value(); });
  ASSERT_NE(part, result.diagnosis.unlisted.end());
  EXPECT_EQ(part_like(part->shape), "sensor.scale_drift");
  EXPECT_THAT(part->alternatives, testing::Contains("sensor.scale_drift"));

  // What is reported as a part is in the model of every other set like anything else.
  const VisitLog log = make_visit_log(data.run, data.description);
  const RestoredModel restored = restore_model(certified_model(result), log);
  EXPECT_THAT(restored.left_out, IsEmpty());
  EXPECT_EQ(restored.parameters.effects.size(), 2U);
  const auto predicted_V = predict_means_V(log, restored.parameters);
  for (std::size_t k = 0; k < result.pose_results.size(); ++k)
    EXPECT_NEAR(restored.parameters.mps2_per_V(0) *
                    (observe(data.run, log).mean_V[0](static_cast<Eigen::Index>(k)) -
                     predicted_V[0](static_cast<Eigen::Index>(k))),
                result.pose_results[k].residual_after_mps2[0], 1e-4);
}

TEST(StructureParts, OnAnotherAxisItHasItsName) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[0] = [](const auto& a, double t_s) { return ageing(t_s) * a[0]; };
  options.more_V[1] = [](const auto& a, double t_s) { return swaying(t_s) * a[1]; };
  const Calibration result = calibrated(synthetic_run(3, kSixteenBits, options));
  SCOPED_TRACE(result.diagnosis.reason);
  ASSERT_EQ(result.diagnosis.effects.size(), 1U);
  EXPECT_EQ(result.diagnosis.effects.front().id, "sensor.scale_drift");
  EXPECT_EQ(result.diagnosis.unlisted.size(), 1U);
}

/// A model of three visits made up of given effects, each as far above the noise as said.
class Model {
 public:
  Model() {
    VisitLog log;
    log.visits.resize(kVisits);
    log_ = std::make_unique<VisitLog>(log);
    terms_ = smooth_terms(*log_, SmoothTermSelection::any);
    found_.fit.whitened_jacobian = Eigen::MatrixXd::Zero(3 * kVisits, 12);
    for (Eigen::Index k = 0; k < 12; ++k) found_.fit.whitened_jacobian(3 * kVisits - 12 + k, k) = 1;
  }
  Model& with(const std::string& id, std::size_t axis, double sigmas, double size = 1) {
    for (const Effect* effect : effect_catalogue())
      if (effect->id() == id) add(*effect, axis, sigmas, size);
    return *this;
  }
  Model& with_term(const char* driver, const char* form, const char* shape, std::size_t axis,
                   double sigmas) {
    const SmoothTerm* term = find_term(terms_, driver, form, shape);
    EXPECT_NE(term, nullptr) << driver << " " << form << " " << shape;
    if (term != nullptr) add(*term, axis, sigmas, 1);
    return *this;
  }
  /// Whether the first effect is a part of the others.
  bool first_is_part() {
    mark_parts_of_structures(*log_, found_);
    return found_.fit.parameters.effects.front().part_of.has_value();
  }

 private:
  static constexpr Eigen::Index kVisits = 8;

  /// Its first amplitude moves a reading of x at a visit of its own by as many sigmas.
  void add(const Effect& effect, std::size_t axis, double sigmas, double size) {
    const auto infos = effect.parameters();
    ActiveEffect active{&effect, axis, std::vector<double>(infos.size(), 0.0),
                        std::vector<bool>(infos.size(), false)};
    const auto amplitude = std::find_if(infos.begin(), infos.end(), [](const ParameterInfo& info) {
      return info.role == ParameterRole::amplitude;
    });
    const auto at = static_cast<std::size_t>(amplitude - infos.begin());
    ASSERT_LT(at, infos.size());
    active.p[at] = size;
    active.free[at] = true;
    found_.fit.parameters.effects.push_back(active);
    found_.evidence.push_back({{}, 0, sigmas});
    Eigen::MatrixXd& J = found_.fit.whitened_jacobian;
    J.conservativeResize(Eigen::NoChange, J.cols() + 1);
    J.rightCols(1).setZero();
    J(std::ssize(found_.evidence) - 1, J.cols() - 1) = sigmas;
  }

  std::unique_ptr<VisitLog> log_;
  std::vector<std::unique_ptr<SmoothTerm>> terms_;
  SearchResult found_;
};

TEST(StructureParts, ASmallRemnantTakesNoNameAway) {
  EXPECT_TRUE(
      Model().with("sensor.drift", 0, 40).with_term("t_s", "bias", "wave", 0, 12).first_is_part());
  EXPECT_FALSE(
      Model().with("sensor.drift", 0, 100).with_term("t_s", "bias", "wave", 0, 6).first_is_part());
}

TEST(StructureParts, DriverFormAndAxisAreTheSame) {
  const auto drift_beside = [](const char* driver, const char* form, std::size_t axis) {
    return Model()
        .with("sensor.drift", 0, 20)
        .with_term(driver, form, "wave", axis, 20)
        .first_is_part();
  };
  EXPECT_TRUE(drift_beside("t_s", "bias", 0));
  EXPECT_FALSE(drift_beside("t_s", "bias", 1));
  EXPECT_FALSE(drift_beside("t_s", "scale", 0));
  EXPECT_FALSE(drift_beside("a_x", "bias", 0));
  EXPECT_TRUE(Model()
                  .with("sensor.quadratic", 1, 20)
                  .with_term("a_y", "bias", "wave", 1, 20)
                  .first_is_part());
  EXPECT_FALSE(Model()
                   .with("sensor.quadratic", 1, 20)
                   .with_term("a_x", "bias", "wave", 1, 20)
                   .first_is_part());
  EXPECT_FALSE(Model()
                   .with("rig.base_roll", 0, 20)
                   .with_term("h_deg", "geometry", "wave, added to h", 0, 20)
                   .first_is_part());
}

TEST(StructureParts, WhatGoesToAndFroThreeTimesSwitches) {
  const auto steps = [](std::size_t axis_of_last, double size_of_last) {
    return Model()
        .with("sensor.bias_step", 0, 20, 1)
        .with("sensor.bias_step", 0, 20, 1)
        .with("sensor.bias_step", axis_of_last, 20, size_of_last)
        .first_is_part();
  };
  EXPECT_TRUE(steps(0, -1));
  EXPECT_FALSE(steps(0, 1));
  EXPECT_FALSE(steps(1, -1));
}

// Beside a function that moves the head as far, a pose at a wrong angle may be a pose at which the
// function is another.
TEST(StructureParts, APoseIsOneWhereTheHeadIsMovedAsFar) {
  const auto pose_beside = [](double sigmas) {
    return Model()
        .with("rig.pose_outlier", 0, sigmas)
        .with_term("t_s", "geometry", "wave, added to delta", 0, 10)
        .first_is_part();
  };
  EXPECT_TRUE(pose_beside(12));
  EXPECT_FALSE(pose_beside(60));
  EXPECT_FALSE(Model()
                   .with("rig.pose_outlier", 0, 12)
                   .with_term("t_s", "bias", "wave", 0, 10)
                   .first_is_part());
}

}  // namespace
}  // namespace plumbline
