// Poses at which nothing recorded decides what an effect does.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimator/calibrate.h"
#include "tests/estimator/synthetic_run.h"

namespace plumbline {
namespace {

using testing::ElementsAre;
using testing::Field;
using testing::IsEmpty;
using testing::IsSupersetOf;

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
  options.more_V[0] = [=, last_g = 0.0, last_s = -10.0, sign = 1.0](const auto& all_g,
                                                                    double t_s) mutable {
    const double a_g = all_g[0];
    constexpr double kSame_g = 1e-9, kBetweenPoses_s = 1;
    if (t_s > last_s + kBetweenPoses_s)
      sign = std::abs(a_g - last_g) < kSame_g ? at_tie(sign) : (a_g > last_g ? 1 : -1);
    last_g = a_g;
    last_s = t_s;
    return kHalfWidth_V * sign;
  };
  return synthetic_run(3, kSixteenBits, options);
}

void expect_hysteresis_alone(const SyntheticRun& data) {
  const Calibration result = calibrated(data);
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

// One ring after the other z rises between two rings only: its hysteresis shows in the first ring
// alone, on which nothing had risen yet. So would a step between the codes of two rings, or in
// time.
TEST(Hysteresis, OfAForceThatNeverFallsShowsInTheFirstRing) {
  SyntheticRun data = synthetic_run(3, kSixteenBits);
  const double half_width_V = 6 * kSixteenBits.lsb_V();
  for (const Pose& pose : data.run.poses)
    for (std::size_t k = 0; k < pose.count; ++k)
      if (pose.h_deg > 0) data.run.samples.u_V[2][pose.first + k] += half_width_V;
  const Calibration result = calibrated(data);
  ASSERT_THAT(result.diagnosis.effects, ElementsAre(Field(&FoundEffect::id, "sensor.hysteresis")));
  const FoundEffect& found = result.diagnosis.effects[0];
  EXPECT_THAT(found.alternatives, IsSupersetOf({"adc.code_step", "sensor.bias_step"}));
  const EffectParameter& w = found.parameters[0];
  EXPECT_NEAR(w.value, 2 * half_width_V / data.truth[2][2], 4 * w.u);
}

// In random order the first pose shows that the head came to it from its zero: that pose was
// blamed, or a step behind it.
TEST(Settling, KnowsThatTheHeadMayComeFromItsZero) {
  SyntheticOptions options;
  options.random_order = true;
  options.delta_step_deg = 10;
  options.h_step_deg = 10;
  constexpr double kSettling_V_per_g = 1e-3, kTau_s = 0.1;
  const double gamma = 9.8101 / kStandardGravity_mps2;
  options.more_V[0] = [=, now_g = gamma, from_g = gamma, arrival_s = 0.0, last_s = 0.0](
                          const auto& all_g, double t_s) mutable {
    constexpr double kBetweenPoses_s = 1;
    if (t_s > last_s + kBetweenPoses_s) {
      from_g = now_g;
      arrival_s = t_s;
    }
    now_g = all_g[0];
    last_s = t_s;
    return kSettling_V_per_g * (from_g - now_g) * std::exp(-(t_s - arrival_s) / kTau_s);
  };
  const SyntheticRun data = synthetic_run(3, kSixteenBits, options);
  const Calibration result = calibrated(data);
  ASSERT_THAT(result.diagnosis.effects, ElementsAre(Field(&FoundEffect::id, "sensor.settling")));
  EXPECT_THAT(result.diagnosis.unlisted, IsEmpty());
  const auto& p = result.diagnosis.effects[0].parameters;
  EXPECT_NEAR(p[0].value, kSettling_V_per_g / data.truth[0][0], 4 * p[0].u);
  EXPECT_NEAR(p[1].value, kTau_s, 4 * p[1].u);
}

}  // namespace
}  // namespace plumbline
