// Calibration without angles: simulated triads with known parameters, and recorded data whose
// figures are known from others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include <cmath>
#include <random>

#include "estimator/kinematics.h"
#include "estimator/scalar/calibrate_scalar.h"
#include "estimator/scalar/rest_detector.h"
#include "tests/estimator/example_loader.h"

namespace plumbline {
namespace {

using testing::HasSubstr;

constexpr double kG = 9.81012;

/// [bias (V), scale (m/s² per V), yz zy zx]
ScalarVector truth() {
  ScalarVector nine;
  nine << -2.5, -2.4, -2.3, 300, 310, 290, 0.004, -0.009, 0.02;
  return nine;
}

/// What the triad adds to the specific force (g) at rest number k.
using Extra = Eigen::Vector3d (*)(const Eigen::Vector3d& a_g, double k);
Eigen::Vector3d nothing(const Eigen::Vector3d&, double) { return Eigen::Vector3d::Zero(); }
Eigen::Vector3d quadratic_y(const Eigen::Vector3d& a_g, double) {
  return {0, 0.005 * a_g.y() * a_g.y(), 0};
}

/// `rests` attitudes all over the sphere (a spiral, visited in random order), 50 readings each.
MeasurementSet tumble(std::size_t rests, unsigned seed, Extra extra, double noise_mps2 = 0.01) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Eigen::Vector3d> directions;
  for (std::size_t k = 0; k < rests; ++k) {
    const double z = 2 * (static_cast<double>(k) + 0.5) / static_cast<double>(rests) - 1;
    const double turn = 2.399963 * static_cast<double>(k), r = std::sqrt(1 - z * z);
    directions.emplace_back(r * std::cos(turn), r * std::sin(turn), z);
  }
  std::shuffle(directions.begin(), directions.end(), random);
  const Eigen::Matrix3d inverse = scalar_matrix(truth()).inverse();
  MeasurementSet set;
  set.has_angles = false;
  constexpr std::size_t kReadings = 50;
  for (std::size_t k = 0; k < rests; ++k) {
    const Eigen::Vector3d a_g = kG / kStandardGravity_mps2 * directions[k];
    const Eigen::Vector3d force =
        kStandardGravity_mps2 * (a_g + extra(a_g, static_cast<double>(k)));
    set.poses.push_back({static_cast<long long>(k), 0, 0, set.samples.size(), kReadings});
    for (std::size_t i = 0; i < kReadings; ++i) {
      const Eigen::Vector3d noise(normal(random), normal(random), normal(random));
      const Eigen::Vector3d u = truth().head<3>() + inverse * (force + noise_mps2 * noise);
      set.samples.t_s.push_back(10.0 * static_cast<double>(k) + 0.01 * static_cast<double>(i));
      for (std::size_t axis = 0; axis < kAxisCount; ++axis)
        set.samples.u_V[axis].push_back(u(static_cast<Eigen::Index>(axis)));
    }
  }
  return set;
}

RunDescription at_local_gravity(double local_mps2 = kG) {
  RunDescription description;
  description.gravity.local_mps2 = local_mps2;
  return description;
}

TEST(Scalar, RecoversAKnownTriadWithinItsUncertainty) {
  // Nine parameters of 40 sets: the mean of χ² is 9, its standard error √(18/40) = 0.67.
  double chi2 = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const auto result = calibrate_scalar({tumble(40, seed, nothing), at_local_gravity()}, {});
    ASSERT_TRUE(result) << result.error().message;
    const ScalarVector error = result->estimate.value - truth();
    chi2 += error.dot(result->estimate.covariance.ldlt().solve(error)) / 40;
    EXPECT_TRUE(result->diagnosis.effects.empty()) << seed << " " << result->diagnosis.reason;
    EXPECT_EQ(result->diagnosis.verdict, Verdict::clean) << result->diagnosis.reason;
  }
  EXPECT_NEAR(chi2, 9, 2.5);
}

TEST(Scalar, ResidualIsWhatTheNoiseLeaves) {
  const auto result = calibrate_scalar({tumble(200, 3, nothing), at_local_gravity()}, {});
  ASSERT_TRUE(result) << result.error().message;
  const double expected_mps2 = 0.01 / std::sqrt(50.0);
  EXPECT_NEAR(result->expected_rms_mps2, expected_mps2, 0.02 * expected_mps2);
  EXPECT_NEAR(result->residual_rms_mps2, expected_mps2, 0.15 * expected_mps2);
}

TEST(Scalar, NamesANonlinearityAndLowersTheErrorOnRestsLeftOut) {
  const auto result = calibrate_scalar({tumble(80, 5, quadratic_y), at_local_gravity()}, {});
  ASSERT_TRUE(result) << result.error().message;
  const Diagnosis& diagnosis = result->diagnosis;
  EXPECT_EQ(diagnosis.verdict, Verdict::explained) << diagnosis.reason;
  ASSERT_EQ(diagnosis.effects.size(), 1U) << diagnosis.reason;
  EXPECT_EQ(diagnosis.effects[0].id, "sensor.quadratic");
  EXPECT_EQ(diagnosis.effects[0].axes, (std::vector<std::size_t>{1}));
  const EffectParameter& k2 = diagnosis.effects[0].parameters.at(0);
  EXPECT_NEAR(k2.value, 0.005, 4 * k2.u);
  EXPECT_LT(result->after.heldout_pose_rms_mps2[1], 0.2 * result->before.heldout_pose_rms_mps2[1]);
  // Without angles y³ cannot be told from −y·x² − y·z²: both must be named.
  EXPECT_THAT(diagnosis.effects[0].alternatives,
              testing::Contains("sensor.cross_product+sensor.cross_product"));
  EXPECT_NE(diagnosis.effects[0].separate_by, "");
}

TEST(Scalar, StatesHowLargeAnEffectWouldHaveBeenSeen) {
  const auto limit_of = [](const ScalarCalibration& calibration, const std::string& id,
                           std::size_t axis) {
    for (const DetectionLimit& limit : calibration.diagnosis.not_found) {
      if (limit.id == id && limit.axis == axis) return limit.limit;
    }
    return 0.0;
  };
  const auto clean = calibrate_scalar({tumble(80, 5, nothing), at_local_gravity()}, {});
  const auto curved = calibrate_scalar({tumble(80, 5, quadratic_y), at_local_gravity()}, {});
  ASSERT_TRUE(clean && curved);
  // The same attitudes and the same noise: 5 standard uncertainties of what was found there.
  const double limit = limit_of(*clean, "sensor.quadratic", 1);
  EXPECT_NEAR(limit, 5 * curved->diagnosis.effects.at(0).parameters.at(0).u, 0.1 * limit);
  // What is in the model is no longer looked for; the other axes are.
  EXPECT_EQ(limit_of(*curved, "sensor.quadratic", 1), 0);
  EXPECT_NEAR(limit_of(*curved, "sensor.quadratic", 2), limit, limit);
  // Sizes without amplitude: a triad that clips at its largest reading shows it.
  EXPECT_NEAR(limit_of(*clean, "sensor.saturation", 0), 1, 0.1);
  EXPECT_GT(limit_of(*clean, "sensor.dead_zone", 0), 1e-5);
  EXPECT_LT(limit_of(*clean, "sensor.dead_zone", 0), 1e-2);
}

TEST(Scalar, SaysTooMuchWhenTheCauseIsNotToBeFound) {
  // From rest to rest at random: a triad that was not held still.
  const Extra restless = [](const Eigen::Vector3d& a_g, double k) -> Eigen::Vector3d {
    return 5e-4 * std::sin(1e4 * (k + 1) * (k + 1)) * a_g;
  };
  const auto result = calibrate_scalar({tumble(80, 5, restless), at_local_gravity()}, {});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->diagnosis.verdict, Verdict::unexplained) << result->diagnosis.reason;
  EXPECT_THAT(result->diagnosis.reason, HasSubstr("too much"));
  EXPECT_GT(result->residual_rms_mps2, 2 * result->expected_rms_mps2);
}

TEST(Scalar, RefusesWhatCannotDetermineTheTriad) {
  const auto reason = [](const MeasurementSet& set) {
    const auto result = calibrate_scalar({set, at_local_gravity()}, {});
    return result ? std::string("accepted") : result.error().message;
  };
  EXPECT_THAT(reason(tumble(8, 1, nothing)), HasSubstr("8 intervals at rest cannot determine"));

  MeasurementSet still = tumble(40, 1, nothing);
  for (auto& axis : still.samples.u_V)
    for (std::size_t i = 50; i < axis.size(); ++i) axis[i] = axis[i % 50];
  EXPECT_THAT(reason(still), HasSubstr("output x does not follow the attitude"));

  MeasurementSet dead = tumble(40, 1, nothing);
  for (std::size_t i = 0; i < dead.samples.size(); ++i) dead.samples.u_V[1][i] = -2.4;
  EXPECT_THAT(reason(dead), HasSubstr("output y does not follow the attitude"));

  // Turned about one axis only: two circles of latitude at most.
  MeasurementSet ring = tumble(40, 1, nothing);
  const Eigen::Matrix3d inverse = scalar_matrix(truth()).inverse();
  for (std::size_t k = 0; k < 40; ++k) {
    const double turn = 0.157 * static_cast<double>(k);
    const Eigen::Vector3d u =
        truth().head<3>() +
        inverse * (kG * Eigen::Vector3d(0.6 * std::cos(turn), 0.6 * std::sin(turn), 0.8));
    for (std::size_t i = 0; i < 50; ++i)
      for (std::size_t axis = 0; axis < kAxisCount; ++axis)
        ring.samples.u_V[axis][50 * k + i] = u(static_cast<Eigen::Index>(axis));
  }
  EXPECT_THAT(reason(ring), testing::AnyOf(HasSubstr("determine no ellipsoid"),
                                           HasSubstr("do not determine"), HasSubstr("output z")));
}

TEST(Scalar, CrossChecksTheHead) {
  // The same triad on a head, once with true angles and once with a tilt that reads 0.3 % too far.
  const Eigen::Matrix3d inverse = scalar_matrix(truth()).inverse();
  const auto on_head = [&](double h_scale) {
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    MeasurementSet set;
    for (double h_deg = 0; h_deg <= 80; h_deg += 20) {
      for (double delta_deg = 0; delta_deg < 360; delta_deg += 30) {
        const SpecificForce force =
            specific_force(delta_deg, h_scale * h_deg, kG / kStandardGravity_mps2);
        const std::size_t first = set.samples.size();
        set.poses.push_back(
            {static_cast<long long>(set.poses.size()), delta_deg, h_deg, first, 50});
        for (int i = 0; i < 50; ++i) {
          const Eigen::Vector3d noise(normal(random), normal(random), normal(random));
          const Eigen::Vector3d u =
              truth().head<3>() + inverse * (kStandardGravity_mps2 * force.a_g + 0.005 * noise);
          set.samples.t_s.push_back(0.1 * static_cast<double>(set.samples.size()));
          for (std::size_t axis = 0; axis < kAxisCount; ++axis)
            set.samples.u_V[axis].push_back(u(static_cast<Eigen::Index>(axis)));
        }
      }
    }
    return calibrate_scalar({set, at_local_gravity()}, {});
  };
  const auto good = on_head(1.0);
  ASSERT_TRUE(good && good->head);
  EXPECT_LT(good->head->largest_en, 1.5);
  EXPECT_LT(good->head->direction_rms_deg, 2 * good->head->expected_direction_rms_deg);
  EXPECT_THAT(good->head->words, HasSubstr("no error of the head is seen"));

  const auto bad = on_head(1.003);
  ASSERT_TRUE(bad && bad->head);
  EXPECT_GT(bad->head->direction_rms_deg, 0.03);
  EXPECT_THAT(bad->head->words, HasSubstr("the head or the mounting has an error"));
}

TEST(RestDetector, FindsTheRestsAndNotTheTurns) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  SampleTable samples;
  for (int i = 0; i < 6000; ++i) {  // 60 s: 6 s of rest, 4 s of turning, six times
    const double t_s = 0.01 * i, phase_s = std::fmod(t_s, 10);
    const double swing = phase_s < 6 ? 0 : std::sin(3.14159 * (phase_s - 6));
    samples.t_s.push_back(t_s);
    for (auto& axis : samples.u_V)
      axis.push_back(std::floor(t_s / 10) + 2 * swing + 0.01 * normal(random));
  }
  const std::vector<Pose> rests = find_rests(samples);
  ASSERT_EQ(rests.size(), 6U);
  for (const Pose& rest : rests) {
    EXPECT_LT(std::fmod(samples.t_s[rest.first], 10), 1);
    EXPECT_LT(std::fmod(samples.t_s[rest.first + rest.count - 1], 10), 6);
    EXPECT_GT(rest.count, 400U);
  }
  samples.t_s.resize(3);
  for (auto& axis : samples.u_V) axis.resize(3);
  EXPECT_TRUE(find_rests(samples).empty());
}

class RecordedTriads : public testing::Test {
 protected:
  static std::filesystem::path file(const std::string& name) {
    return std::filesystem::path(PLUMBLINE_SHARED_DIR) / "data" / "multiposition" / name;
  }
};

TEST_F(RecordedTriads, XsensAgreesWithThePublishedFigures) {
  const auto path = file("xsens_mti_raw_acc.csv");
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
  auto columns = read_columns(path);
  MeasurementSet set;
  set.has_angles = false;
  set.samples.t_s = columns["t_s"];
  set.samples.u_V = {columns["ax_raw"], columns["ay_raw"], columns["az_raw"]};
  set.poses = find_rests(set.samples);
  EXPECT_EQ(set.poses.size(), 38U);
  const auto result = calibrate_scalar({set, at_local_gravity(9.81744)}, {});
  ASSERT_TRUE(result) << result.error().message;
  const ScalarVector& v = result->estimate.value;
  const double bias[] = {33123.8, 33275.1, 32364.5};
  const double scale[] = {0.00241301, 0.00242699, 0.00241185};
  const double angle[] = {0.0034, -0.0091, 0.0214};
  for (Eigen::Index i = 0; i < 3; ++i) {
    EXPECT_NEAR(v(i), bias[i], 1.5);
    EXPECT_NEAR(v(3 + i), scale[i], 2e-6);
    EXPECT_NEAR(v(6 + i), angle[i], 0.001);
  }
  EXPECT_NEAR(result->residual_rms_mps2, 1.2e-3, 0.15e-3);
}

TEST_F(RecordedTriads, Poses160HasTooMuchResidualAndSecondOrderTermsDriveIt) {
  const auto path = file("poses160_acc_g.csv");
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
  auto columns = read_columns(path);
  MeasurementSet set;
  set.has_angles = false;
  set.samples.u_V = {columns["ax_g"], columns["ay_g"], columns["az_g"]};
  const std::vector<double>& pose = columns["pose"];
  for (std::size_t i = 0; i < pose.size(); ++i) {
    set.samples.t_s.push_back(static_cast<double>(i));
    if (i == 0 || pose[i] != pose[i - 1])
      set.poses.push_back({static_cast<long long>(pose[i]), 0, 0, i, 0});
    ++set.poses.back().count;
  }
  const auto result = calibrate_scalar({set, at_local_gravity(kStandardGravity_mps2)}, {});
  ASSERT_TRUE(result) << result.error().message;
  const ScalarVector& v = result->estimate.value;
  const double bias_g[] = {-0.0205, 0.0085, 0.0153};
  const double scale[] = {1.0023, 1.0033, 1.0023};
  for (Eigen::Index i = 0; i < 3; ++i) {
    EXPECT_NEAR(v(i), bias_g[i], 2e-4);
    EXPECT_NEAR(v(3 + i) / kStandardGravity_mps2, scale[i], 2e-4);
  }
  EXPECT_NEAR(result->residual_rms_mps2 / kStandardGravity_mps2, 1.06e-3, 0.02e-3);
  EXPECT_LT(result->expected_rms_mps2 / kStandardGravity_mps2, 0.4e-3);
  EXPECT_THAT(result->diagnosis.reason, HasSubstr("too much"));
  EXPECT_EQ(result->diagnosis.verdict, Verdict::partly_explained) << result->diagnosis.reason;
  EXPECT_LT(result->final_residual_rms_mps2, 0.8 * result->residual_rms_mps2);
  ASSERT_FALSE(result->diagnosis.effects.empty());
  EXPECT_EQ(result->diagnosis.effects[0].id, "sensor.quadratic");
}

}  // namespace
}  // namespace plumbline
