// Poses at which nothing recorded decides what an effect does.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "estimator/calibrate.h"
#include "estimator/effects/catalogue.h"
#include "tests/estimator/synthetic_run.h"

namespace plumbline {
namespace {

using testing::ElementsAre;
using testing::Field;
using testing::IsEmpty;

const Adc kConverter{16, -5.0, 0.0};

constexpr double kHalfWidth_V = 3e-4;

/// In random order, x off by ±kHalfWidth_V after its force rose or fell. Where it came back to what
/// it was, `at_tie` makes the sign from the one before.
template <typename AtTie>
SyntheticRun with_hysteresis(AtTie at_tie) {
  SyntheticOptions options;
  options.samples_per_pose = 5;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  options.random_order = true;
  options.more_x_V = [=, last_g = 0.0, last_s = -10.0, sign = 1.0](const auto& all_g,
                                                                   double t_s) mutable {
    const double a_g = all_g[0];
    constexpr double kSame_g = 1e-9, kBetweenPoses_s = 1;
    if (t_s > last_s + kBetweenPoses_s)
      sign = std::abs(a_g - last_g) < kSame_g ? at_tie(sign) : (a_g > last_g ? 1 : -1);
    last_g = a_g;
    last_s = t_s;
    return kHalfWidth_V * sign;
  };
  return synthetic_run(3, kConverter, options);
}

void expect_hysteresis_alone(const SyntheticRun& data) {
  const Calibration result = calibrate({data.run, &data.still, data.description}, {});
  ASSERT_THAT(result.diagnosis.effects, ElementsAre(Field(&FoundEffect::id, "sensor.hysteresis")));
  EXPECT_THAT(result.diagnosis.unlisted, IsEmpty());
  const EffectParameter& w = result.diagnosis.effects[0].parameters[0];
  EXPECT_NEAR(w.value, 2 * kHalfWidth_V / data.truth[0][0], 4 * w.u);
}

// Symmetry brings the force of an axis back: cos 10° cos 20° is cos 20° cos 10°. With the wrong
// sign at these few poses the effect went without its name, and poses were blamed.
TEST(Hysteresis, LeavesWhatWasLeftBeforeWhereTheForceComesBack) {
  expect_hysteresis_alone(with_hysteresis([](double sign) { return sign; }));
}

TEST(Hysteresis, LeavesNothingWhereTheForceComesBack) {
  expect_hysteresis_alone(with_hysteresis([](double) { return 0.0; }));
}

TEST(Hysteresis, IsLeftOpenWhereTheForceComesBackAndNobodyKnows) {
  std::mt19937 random(5);
  expect_hysteresis_alone(
      with_hysteresis([=](double) mutable { return random() % 2 == 0 ? 1.0 : -1.0; }));
}

// One ring after the other z rises between two rings only: kept from there on, that is a step.
TEST(Hysteresis, OfAForceThatNeverFallsIsNotKept) {
  const SyntheticRun data = synthetic_run(3, kConverter);
  const VisitLog log = make_visit_log(data.run, data.description);
  const auto& all = effect_catalogue();
  const Effect& hysteresis = **std::find_if(all.begin(), all.end(), [](const Effect* effect) {
    return effect->id() == "sensor.hysteresis";
  });
  for (const Hypothesis& hypothesis : hysteresis.hypotheses(log, 2)) EXPECT_EQ(hypothesis.p[2], 0);
}

}  // namespace
}  // namespace plumbline
