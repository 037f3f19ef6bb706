#include "estimator/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "estimator/noise/longest_stretch.h"
#include "tests/estimator/synthetic_run.h"

namespace plumbline {
namespace {

using testing::HasSubstr;
using testing::SizeIs;

TEST(Calibrate, FindsTheUnitAndItsNoise) {
  const SyntheticRun data = synthetic_run(1, kSixteenBits);
  const Calibration result = calibrated(data);

  EXPECT_EQ(result.poses, 60u);
  EXPECT_EQ(result.samples, 1200u);
  EXPECT_EQ(result.diagnosis.verdict, Verdict::clean) << result.diagnosis.reason;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const AxisEstimate& batch = result.estimates.batch_ls[axis];
    for (Eigen::Index j = 0; j < 4; ++j) {
      const double u = std::sqrt(batch.covariance(j, j));
      EXPECT_NEAR(batch.value(j), data.truth[axis][static_cast<std::size_t>(j)], 4 * u);
      // 60 poses of σ/√20 and a design of condition near 4.
      EXPECT_GT(u, 3e-4 / std::sqrt(20.0 * 60));
      EXPECT_LT(u, 6 * 3e-4 / std::sqrt(20.0 * 60));
    }
    EXPECT_LT((result.estimates.rls->at(axis).value - batch.value).norm(), 1e-10);
    EXPECT_LT(result.estimates.agreement_en[axis], 0.2);
    const double expected_mps2 = 3e-4 / std::sqrt(20.0) * std::sqrt(56.0 / 60) / 0.032 * 9.80665;
    EXPECT_NEAR(result.floor_pose_rms_mps2[axis], expected_mps2, 0.15 * expected_mps2);
    EXPECT_NEAR(result.before.fit_pose_rms_mps2[axis], expected_mps2, 0.35 * expected_mps2);
    EXPECT_GT(result.before.heldout_pose_rms_mps2[axis], result.before.fit_pose_rms_mps2[axis]);
    EXPECT_GT(result.before.heldout_pose_max_abs_mps2[axis],
              result.before.heldout_pose_rms_mps2[axis]);
    EXPECT_EQ(result.after.fit_pose_rms_mps2[axis], result.before.fit_pose_rms_mps2[axis]);
  }
  EXPECT_EQ(result.decision.status, DecisionStatus::none);
}

/// What a reason says of the x axis, m/s².
struct ReasonOfX {
  double residual = 0, expected = 0, u = 0;
};
ReasonOfX reason_of_x(const std::string& reason) {
  ReasonOfX x;
  const std::size_t at = std::min(reason.find("x axis: "), reason.size());
  EXPECT_EQ(std::sscanf(reason.c_str() + at, "x axis: residual %lf m/s² where %lf ± %lf",
                        &x.residual, &x.expected, &x.u),
            3)
      << reason;
  return x;
}

// White noise on 60 poses: their RMS scatters by 1/√(2·56).
TEST(Calibrate, SaysHowFarChanceTakesTheResidual) {
  const ReasonOfX x = reason_of_x(calibrated(synthetic_run(1, kSixteenBits)).diagnosis.reason);
  EXPECT_NEAR(x.u / x.expected, 1 / std::sqrt(2.0 * 56), 0.03);
}

TEST(Calibrate, FollowsTheEstimateFromPoseToPose) {
  const SyntheticRun data = synthetic_run(2, kSixteenBits);
  const Calibration result = calibrated(data);
  ASSERT_EQ(result.convergence.rls.size(), 60u);
  ASSERT_EQ(result.convergence.ekf.size(), 60u);
  ASSERT_EQ(result.convergence.batch_ls.size(), 60u);
  // The first ring, h = 0, says nothing about K_z: the batch fit has no estimate, the others keep
  // their wide priors.
  EXPECT_TRUE(std::isnan(result.convergence.batch_ls[10][0].value(0)));
  EXPECT_GT(result.convergence.rls[10][0].covariance(2, 2), 1e5);
  EXPECT_NEAR(result.convergence.ekf[10][0].covariance(2, 2), 1.0, 1e-3);
  for (const std::size_t pose : {20u, 40u, 59u})
    EXPECT_LT(
        (result.convergence.rls[pose][1].value - result.convergence.batch_ls[pose][1].value).norm(),
        1e-10);
}

TEST(Calibrate, SaysWhenTheModelLacksSomething) {
  SyntheticOptions options;
  options.delta_step_deg = 20;
  options.h_step_deg = 10;
  options.k2_x_V_per_g2 = 0.032 * 0.05;
  const Calibration result = calibrated(synthetic_run(3, kSixteenBits, options));
  EXPECT_EQ(result.diagnosis.verdict, Verdict::explained);
  const std::string& reason = result.diagnosis.reason;
  const ReasonOfX x = reason_of_x(reason);
  EXPECT_NEAR(x.residual, result.before.fit_pose_rms_mps2[0], 0.01 * x.residual);
  EXPECT_NEAR(x.expected, result.floor_pose_rms_mps2[0], 0.01 * x.expected);
  EXPECT_THAT(reason, HasSubstr("; explained by sensor.quadratic (x)"));
  double after = 0;
  const std::size_t at = std::min(reason.find("; after: "), reason.size());
  EXPECT_EQ(std::sscanf(reason.c_str() + at, "; after: x axis %lf m/s²", &after), 1) << reason;
  EXPECT_NEAR(after, x.expected, 3 * x.u);
  EXPECT_LT(result.diagnosis.p_value, 1e-6);
  ASSERT_EQ(result.diagnosis.effects.size(), 1u) << result.diagnosis.reason;
  const FoundEffect& effect = result.diagnosis.effects[0];
  EXPECT_EQ(effect.id, "sensor.quadratic");
  EXPECT_THAT(effect.axes, testing::ElementsAre(0u));
  ASSERT_EQ(effect.parameters.size(), 1u);
  EXPECT_NEAR(effect.parameters[0].value, 0.05, 4 * effect.parameters[0].u);
  EXPECT_LT(effect.parameters[0].u, 0.005);
  EXPECT_GT(effect.heldout_gain, 0.9);
  EXPECT_LT(result.after.heldout_pose_rms_mps2[0], 0.3 * result.before.heldout_pose_rms_mps2[0]);
}

TEST(Calibrate, NoiseFromTheBurstsWhenThereIsNoStaticRecord) {
  const SyntheticRun data = synthetic_run(4, kSixteenBits);
  const Calibration result = calibrate({data.run, nullptr, data.description}, {});
  EXPECT_EQ(result.noise[0].source, "bursts at the poses");
  EXPECT_NEAR(result.noise[0].N.value, 3e-4 / 10, 0.1 * 3e-4 / 10);
  EXPECT_EQ(result.diagnosis.verdict, Verdict::clean) << result.diagnosis.reason;
}

TEST(Calibrate, NamesWhatThePosesDoNotDetermine) {
  SyntheticOptions options;
  options.h_step_deg = 100;  // one ring
  const Calibration result = calibrated(synthetic_run(5, kSixteenBits, options));
  EXPECT_EQ(result.observability.rank, 3);
  EXPECT_THAT(result.observability.unobservable, HasSubstr("K_z"));
  EXPECT_TRUE(result.pose_results.empty());
}

TEST(Calibrate, FewPosesCannotBeJudged) {
  SyntheticOptions options;
  options.delta_step_deg = 120;
  options.h_step_deg = 40;
  const Calibration result = calibrated(synthetic_run(6, kSixteenBits, options));
  EXPECT_EQ(result.poses, 9u);
  EXPECT_EQ(result.diagnosis.verdict, Verdict::undetermined);
  EXPECT_THAT(result.diagnosis.reason, HasSubstr("9 poses"));
}

TEST(Calibrate, DeadAxisIsNamedAndGetsNoNumbers) {
  SyntheticRun data = synthetic_run(11, kSixteenBits);
  for (SampleTable* table : {&data.run.samples, &data.still})
    std::fill(table->u_V[2].begin(), table->u_V[2].end(), -2.5);
  data.description.limits = Limits{10.0};
  const Calibration result = calibrated(data);
  EXPECT_EQ(result.diagnosis.verdict, Verdict::undetermined);
  EXPECT_THAT(result.diagnosis.reason, HasSubstr("z axis: the output does not follow"));
  EXPECT_TRUE(std::isnan(result.before.fit_pose_rms_mps2[2]));
  EXPECT_TRUE(std::isnan(result.floor_pose_rms_mps2[2]));
  EXPECT_GT(result.before.fit_pose_rms_mps2[0], 0);
}

TEST(Calibrate, FourPosesFitExactly) {
  SyntheticRun data = synthetic_run(12, kSixteenBits);
  data.run.poses = {data.run.poses[0], data.run.poses[3], data.run.poses[6], data.run.poses[30]};
  const Calibration result = calibrated(data);
  EXPECT_EQ(result.observability.rank, 4);
  EXPECT_LT(result.before.fit_pose_rms_mps2[0], 1e-9);
  EXPECT_TRUE(std::isnan(result.before.heldout_pose_rms_mps2[0]));  // no pose can be spared
  EXPECT_EQ(result.diagnosis.verdict, Verdict::undetermined);
  EXPECT_LT((result.estimates.rls->at(0).value - result.estimates.batch_ls[0].value).norm(), 1e-9);
}

// Short dwells do not resolve what is looked for right after arrival; their zeros made the noise
// there look small, and transients were found in it.
TEST(Calibrate, DwellsMayDifferInLength) {
  SyntheticOptions options;
  options.samples_per_pose = 32;
  options.varied_dwells = true;
  for (const std::uint64_t seed : {1U, 2U, 3U, 4U}) {
    const SyntheticRun data = synthetic_run(seed, kSixteenBits, options);
    const Calibration result = calibrated(data);
    EXPECT_EQ(result.diagnosis.verdict, Verdict::clean) << result.diagnosis.reason;
  }
}

// How sure the means of a coarse converter are was told from the length of the first dwell.
TEST(Calibrate, AShortFirstDwellSaysNothingOfTheOthers) {
  constexpr Adc kEightBits{8, -5, 0};  // a step of 20 mV
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.samples_per_pose = 40;
  options.sigma_V = 4e-3;
  options.k2_x_V_per_g2 = 6e-3;
  const SyntheticRun data = synthetic_run(2, kEightBits, options);
  SyntheticRun cut = data;
  cut.run.poses.front().count = 2;
  const Calibration whole = calibrated(data), shorter = calibrated(cut);
  ASSERT_THAT(whole.diagnosis.effects, SizeIs(1)) << whole.diagnosis.reason;
  ASSERT_THAT(shorter.diagnosis.effects, SizeIs(1)) << shorter.diagnosis.reason;
  const EffectParameter &k2 = whole.diagnosis.effects[0].parameters[0],
                        &k2_of_shorter = shorter.diagnosis.effects[0].parameters[0];
  EXPECT_EQ(shorter.diagnosis.effects[0].id, "sensor.quadratic");
  EXPECT_NEAR(k2_of_shorter.u, k2.u, 0.1 * k2.u);
}

TEST(Calibrate, OneReadingAPose) {
  SyntheticOptions options;
  options.samples_per_pose = 1;
  const SyntheticRun data = synthetic_run(13, kSixteenBits, options);
  const Calibration result = calibrated(data);
  EXPECT_EQ(result.diagnosis.verdict, Verdict::clean) << result.diagnosis.reason;
  const double expected_mps2 = 3e-4 / 0.032 * 9.80665;
  EXPECT_NEAR(result.before.fit_pose_rms_mps2[0], expected_mps2, 0.35 * expected_mps2);
  EXPECT_NEAR(result.floor_pose_rms_mps2[0], expected_mps2, 0.2 * expected_mps2);
  const Calibration alone = calibrate({data.run, nullptr, data.description}, {});
  EXPECT_EQ(alone.diagnosis.verdict, Verdict::undetermined);
  EXPECT_THAT(alone.diagnosis.reason, HasSubstr("no noise could be identified"));
  // Then the residual says how sure the parameters are.
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const double u = std::sqrt(result.estimates.batch_ls[i].covariance(0, 0));
    EXPECT_NEAR(std::sqrt(alone.estimates.batch_ls[i].covariance(0, 0)), u, 0.3 * u);
  }
}

TEST(Calibrate, DecidesAgainstTheLimit) {
  SyntheticRun data = synthetic_run(7, kSixteenBits);
  data.description.limits = Limits{10.0};
  EXPECT_EQ(calibrated(data).decision.status, DecisionStatus::pass);
  data.description.limits = Limits{1e-4};
  EXPECT_EQ(calibrated(data).decision.status, DecisionStatus::fail);
}

TEST(Calibrate, UncertainGravityScalesAllOfK) {
  SyntheticRun data = synthetic_run(8, kSixteenBits);
  data.description.gravity.u_mps2 = 0.0981;  // one per cent
  const AxisEstimate estimate = calibrated(data).estimates.batch_ls[0];
  EXPECT_NEAR(std::sqrt(estimate.covariance(0, 0)), 0.01 * estimate.value(0),
              1e-3 * estimate.value(0));
  const double correlation =
      estimate.covariance(0, 1) / std::sqrt(estimate.covariance(0, 0) * estimate.covariance(1, 1));
  EXPECT_LT(correlation, -0.5);  // K_xx > 0, K_xy < 0
}

// The step of 12 bits is 1.22 mV; without noise each pose keeps its own rounding offset.
TEST(Calibrate, RoundingWithoutNoiseIsNotAveragedAway) {
  SyntheticOptions options;
  options.sigma_V = 1e-6;
  const SyntheticRun data = synthetic_run(9, kTwelveBits, options);
  const Calibration result = calibrated(data);
  const double expected_mps2 = kTwelveBits.lsb_V() / std::sqrt(12.0) / 0.032 * 9.80665;
  EXPECT_NEAR(result.before.fit_pose_rms_mps2[0], expected_mps2, 0.3 * expected_mps2);
  // Codes say a little more than means with independent errors would, but the run alone has to say
  // that there is no slow noise, and 60 poses say so within limits.
  const double independent_V = kTwelveBits.lsb_V() / std::sqrt(12.0 * 60);
  const double u_U0_V = std::sqrt(result.estimates.batch_ls[0].covariance(3, 3));
  EXPECT_GT(u_U0_V, 0.75 * independent_V);
  EXPECT_LT(u_U0_V, 4.0 * independent_V);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const AxisEstimate& batch = result.estimates.batch_ls[axis];
    for (Eigen::Index j = 0; j < 4; ++j)
      EXPECT_NEAR(batch.value(j), data.truth[axis][static_cast<std::size_t>(j)],
                  3 * std::sqrt(batch.covariance(j, j)));
  }
}

TEST(Calibrate, IsDeterministic) {
  const SyntheticRun data = synthetic_run(10, kSixteenBits);
  const Calibration first = calibrated(data);
  const Calibration second = calibrated(data);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    EXPECT_EQ(first.estimates.batch_ls[axis].value, second.estimates.batch_ls[axis].value);
    EXPECT_EQ(first.estimates.ekf[axis].covariance, second.estimates.ekf[axis].covariance);
  }
  EXPECT_EQ(first.diagnosis.p_value, second.diagnosis.p_value);
}

// Of finer converters CoverageOfSimulatedUnits tells. 60 units: 720 parameters, 95 % of them within
// 2 u give 684 ± 5.8; four standard deviations.
TEST(Calibrate, StatedUncertaintiesHoldWithNoiseOfATwentiethOfAStep) {
  SyntheticOptions options;
  options.sigma_V = 0.05 * kTwelveBits.lsb_V();
  options.samples_per_pose = 10;
  int inside = 0;
  for (std::uint64_t seed = 100; seed < 160; ++seed) {
    const SyntheticRun data = synthetic_run(seed, kTwelveBits, options);
    const Calibration result = calibrated(data);
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const AxisEstimate& batch = result.estimates.batch_ls[axis];
      for (Eigen::Index j = 0; j < 4; ++j)
        inside += std::abs(batch.value(j) - data.truth[axis][static_cast<std::size_t>(j)]) <=
                  1.96 * std::sqrt(batch.covariance(j, j));
    }
  }
  EXPECT_NEAR(inside, 684, 24);
}

TEST(Calibrate, StaticRecordWithGapsIsUsedUpToThem) {
  SyntheticRun data = synthetic_run(8, kSixteenBits);
  const Calibration whole = calibrated(data);
  // 10 s and 40 s of record, 600 s between them; meanwhile the level has moved.
  for (std::size_t i = 1000; i < data.still.size(); ++i) {
    data.still.t_s[i] += 600;
    for (auto& axis : data.still.u_V) axis[i] += 0.01;
  }
  for (double& t_s : data.run.samples.t_s) t_s += 600;
  const Calibration parted = calibrated(data);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    EXPECT_THAT(parted.noise[axis].remark, testing::HasSubstr("1 gaps"));
    EXPECT_THAT(whole.noise[axis].remark, testing::Not(testing::HasSubstr("gaps")));
    EXPECT_NEAR(parted.noise[axis].rate_hz, 100, 0.01);
    EXPECT_NEAR(parted.noise[axis].N.value, whole.noise[axis].N.value,
                0.05 * whole.noise[axis].N.value);
    EXPECT_LT(parted.noise[axis].K.value, 1e-4);
  }
}

TEST(LongestStretch, OfThreeWithUnevenSteps) {
  std::vector<double> t_s;
  for (int i = 0; i < 10; ++i) t_s.push_back(0.1 * i);
  for (int i = 0; i < 20; ++i) t_s.push_back(5 + 0.1 * i + (i % 2 == 0 ? 0.02 : 0));
  for (int i = 0; i < 5; ++i) t_s.push_back(9 + 0.1 * i);
  const Stretch stretch = longest_stretch(t_s);
  EXPECT_EQ(stretch.first, 10U);
  EXPECT_EQ(stretch.count, 20U);
  EXPECT_EQ(stretch.gaps, 2U);
  EXPECT_NEAR(stretch.step_s, 0.1, 0.002);
  EXPECT_EQ(longest_stretch({}).count, 0U);
  EXPECT_EQ(longest_stretch({3.0}).count, 1U);
}

}  // namespace
}  // namespace plumbline
