// What has no name and is the head's: seen by all axes through one angle.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <utility>

#include "estimator/diagnosis/structure_parts.h"
#include "tests/estimator/structure.h"

namespace plumbline {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

SyntheticOptions fine_turns() {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  return options;
}

// A straight line of the column without a slope, towards a direction of its own, had been both.
TEST(Structure, WhatIsThereAllTheTimeFollowsNoColumn) {
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  options.roll_error_deg = [](double, double) { return 9.4; };
  options.h_error_deg = [](double, double) { return 6.8; };
  const Calibration result = calibrated(
      with_column(options, "motor_A", [](double t_s) { return 0.4 + 0.1 * std::sin(t_s / 40); }));
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.unlisted, IsEmpty());
  ASSERT_THAT(result.diagnosis.effects, SizeIs(2));
  EXPECT_EQ(result.diagnosis.effects[0].id, "rig.base_roll");
  EXPECT_EQ(result.diagnosis.effects[1].id, "rig.tilt_index");
}

// As a step of h and a step of the base roll.
TEST(Structure, ABaseTiltsTowardsADirectionOfItsOwn) {
  constexpr double kTilt_deg = 0.8, kDirection_deg = 30;
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  const auto slipped = [](double t_s) { return t_s < 280 ? 0 : kTilt_deg * kRadPerDeg; };
  options.base_tilt_rad = [=](double t_s) {
    return slipped(t_s) * std::cos(kDirection_deg * kRadPerDeg);
  };
  options.base_roll_rad = [=](double t_s) {
    return slipped(t_s) * std::sin(kDirection_deg * kRadPerDeg);
  };
  const UnlistedStructure found =
      expect_only_structure(options, {"t_s", "geometry", "step, added to the tilt of the base"});
  EXPECT_THAT(found.axes, SizeIs(3));
  const EffectParameter& direction = parameter(found, "direction");
  EXPECT_NEAR(direction.value, kDirection_deg, 4 * direction.u);
  const EffectParameter& size = parameter(found, "p");
  EXPECT_NEAR(size.value, kTilt_deg, 4 * size.u);
}

// Little beside h, the roll was nothing of its own but a slip of the index.
TEST(Structure, ATiltAlmostAlongAnAxisOfTheBaseIsOne) {
  SyntheticOptions options = fine_turns();
  const auto course = [](double t_s) { return std::cos(t_s / 90) + 0.6 * std::cos(t_s / 31); };
  options.base_tilt_rad = [=](double t_s) { return 0.02 * course(t_s); };
  options.base_roll_rad = [=](double t_s) { return 0.004 * course(t_s); };
  SyntheticRun data = synthetic_run(7, kSixteenBits, options);
  for (const double t_s : data.run.samples.t_s) data.run.samples.temp_C.push_back(21 + course(t_s));
  const UnlistedStructure found = expect_only_structure(
      data, {"temp_C", "geometry", "polynomial of degree 1, added to the tilt of the base"});
  const EffectParameter& direction = parameter(found, "direction");
  EXPECT_NEAR(direction.value, std::atan2(0.004, 0.02) / kRadPerDeg, 4 * direction.u);
}

// As polynomials and waves of the time.
TEST(Structure, AnArmThatWarmsLateTiltsWithTheAverageOfThePast) {
  constexpr double kTau_s = 40;
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  // Steady until the run begins, then with a course of its own.
  const auto coolant_K = [](double t_s) {
    const double since_s = std::max(0.0, t_s - 61);
    return 1.5 * std::sin(since_s / 90) - 0.8 * std::sin(since_s / 31);
  };
  options.base_tilt_rad = [=, late_K = 0.0, last_s = 0.0](double t_s) mutable {
    // Called for every reading in turn.
    constexpr double kStep_s = 0.01;
    for (; last_s < t_s; last_s += kStep_s)
      late_K += kStep_s / kTau_s * (coolant_K(last_s) - late_K);
    return 0.02 * late_K;
  };
  const UnlistedStructure found = expect_only_structure(
      with_column(options, "coolant_C", [&](double t_s) { return 25 + coolant_K(t_s); }),
      {"coolant_C", "geometry", "straight line in the average of the past, added to h"});
  const EffectParameter& tau = parameter(found, "tau");
  EXPECT_NEAR(tau.value, kTau_s, 4 * tau.u);
}

// As five periodic errors of the drive, by name.
TEST(Structure, ALoadThatIsThrownAcrossAPlayIsOne) {
  SyntheticOptions options = fine_turns();
  options.delta_error_deg = [](double delta_deg, double) {
    return 0.6 * std::tanh(8 * std::sin((delta_deg - 33) * kRadPerDeg));
  };
  expect_only_structure(options,
                        {"delta_deg", "geometry", "thrown from side to side, added to delta"});
}

// As a periodic error by name and what of it grows with the cosine of h.
TEST(Structure, ARunoutThatGrowsWithTheTiltIsOne) {
  SyntheticOptions options = fine_turns();
  options.h_step_deg = 10;
  options.delta_error_deg = [](double delta_deg, double h_deg) {
    return 0.8 * std::cos(3 * (delta_deg - 20) * kRadPerDeg) *
           std::pow(std::sin(h_deg * kRadPerDeg), 2);
  };
  expect_only_structure(
      options, {"h_deg", "geometry", "parabola, times a harmonic of delta_deg, added to delta"});
}

// As pickup by name, on two axes.
TEST(Structure, AServoThatHuntsSwingsTheSpindle) {
  constexpr double kSwing_rad = 5e-3, kFrequency_hz = 17.3;
  SyntheticOptions options = fine_turns();
  options.samples_per_pose = 40;
  const auto swing_rad = [](double t_s) {
    return kSwing_rad * std::sin(2 * std::numbers::pi * kFrequency_hz * t_s);
  };
  options.more_V[0] = [=](const auto& a_g, double t_s) { return 0.032 * a_g[1] * swing_rad(t_s); };
  options.more_V[1] = [=](const auto& a_g, double t_s) {
    return -0.0314 * a_g[0] * swing_rad(t_s);
  };
  const UnlistedStructure found =
      expect_only_structure(options, {"t_in_pose", "geometry", "sine, added to delta"});
  const EffectParameter &size = parameter(found, "amplitude"), &f = parameter(found, "f");
  EXPECT_NEAR(size.value, kSwing_rad / kRadPerDeg, std::max(4 * size.u, 0.03 * size.value));
  EXPECT_NEAR(f.value, kFrequency_hz, 4 * f.u);
}

// As a change of the scale of two axes by the components of each other.
TEST(Structure, ATriadThatTurnsInItsSeatIsOneOfTheHead) {
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  const auto warmth = [](double t_s) { return std::sin(t_s / 70) + 0.5 * std::sin(t_s / 23); };
  const auto turn_rad = [=](double t_s) { return 0.01 * warmth(t_s); };
  // Almost the sensitivities of the run.
  options.more_V[0] = [=](const auto& a_g, double t_s) { return -0.032 * turn_rad(t_s) * a_g[2]; };
  options.more_V[2] = [=](const auto& a_g, double t_s) { return -0.0328 * turn_rad(t_s) * a_g[0]; };
  const UnlistedStructure found =
      expect_only_structure(with_column(options, "block_K", warmth),
                            {"block_K", "geometry",
                             "polynomial of degree 1, added to the turn of the triad in its seat"});
  EXPECT_NEAR(parameter(found, "p1_x").value, 0, 0.05 * std::abs(parameter(found, "p1_y").value));
}

// As a step of h and a step back.
TEST(Structure, ABaseThatStandsCrookedForAWhileIsAWindow) {
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  options.base_tilt_rad = [](double t_s) { return t_s > 200 && t_s < 320 ? 0.012 : 0; };
  const UnlistedStructure found =
      expect_only_structure(options, {"t_s", "geometry", "window, added to h"});
  EXPECT_NEAR(parameter(found, "from").value, 200, 3);
  EXPECT_NEAR(parameter(found, "to").value, 320, 3);
}

// In an order of visits that goes there and back it is a wave in time, too.
TEST(Structure, APlayThatTheLoadTakesUpTurnsWithTheSpindle) {
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  options.delta_error_deg = [last_deg = 0.0, up = 1.0](double delta_deg, double) mutable {
    if (delta_deg != last_deg) up = delta_deg > last_deg ? 1 : -1;
    last_deg = delta_deg;
    return 0.4 * up * std::sin(delta_deg * kRadPerDeg);
  };
  expect_only_structure(options, {"previous_pose", "geometry",
                                  "straight line, times a harmonic of delta_deg in the direction "
                                  "of the last turn of delta within 360 degrees, added to delta"});
}

// As polynomials of the change of h and of a_i.
TEST(Structure, AnArmThatStaysWoundUpGoesByTheSizeOfItsLastMove) {
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  options.h_error_deg = [at_deg = std::pair(0.0, 0.0), size_deg = 0.0](double delta_deg,
                                                                       double h_deg) mutable {
    if (const auto now_deg = std::pair(delta_deg, h_deg); now_deg != at_deg) {
      size_deg = std::abs(h_deg - at_deg.second);
      at_deg = now_deg;
    }
    return 0.012 * size_deg;
  };
  expect_only_structure(
      options, {"previous_pose", "geometry",
                "polynomial of degree 1 in the size of the change of h since, added to h"});
}

// As courses of the dwell of all three axes.
TEST(Structure, AnArmThatRingsAfterEveryMoveIsOne) {
  SyntheticOptions options = fine_turns();
  options.samples_per_pose = 40;
  options.base_tilt_rad = [](double t_s) {
    constexpr double kFirst_s = 61, kPose_s = 3;
    if (t_s < kFirst_s) return 0.0;
    const double since_s = std::fmod(t_s - kFirst_s + 1e-9, kPose_s);
    return 0.02 * std::exp(-since_s / 0.1) * std::cos(2 * std::numbers::pi * 6 * since_s);
  };
  const UnlistedStructure found = expect_only_structure(
      options, {"t_in_pose", "geometry", "ringing that dies away, added to h"});
  EXPECT_NEAR(parameter(found, "f").value, 6, 0.3);
}

// As harmonics of the spindle, and steps.
TEST(Structure, APlayThatTheLoadCrossesGoesByTheLoad) {
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  options.delta_error_deg = [side = 1.0](double delta_deg, double h_deg) mutable {
    const double load = -std::sin(delta_deg * kRadPerDeg) * std::cos(h_deg * kRadPerDeg);
    if (load > 0.33) side = 1;
    if (load < -0.33) side = -1;
    return 0.3 * side;
  };
  expect_only_structure(options, {"a_y", "geometry", "relay, added to delta"});
}

TEST(Structure, ADriveThatLagsGoesByItsLastTurn) {
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  options.delta_error_deg = [last_deg = 0.0, turn_deg = 0.0](double delta_deg, double) mutable {
    if (delta_deg != last_deg) turn_deg = delta_deg - last_deg;
    last_deg = delta_deg;
    return 0.003 * turn_deg;
  };
  const Calibration result = calibrated(synthetic_run(7, kSixteenBits, options));
  EXPECT_THAT(result.diagnosis.effects, IsEmpty()) << result.diagnosis.reason;
  ASSERT_THAT(result.diagnosis.unlisted, SizeIs(2)) << result.diagnosis.reason;
  EXPECT_EQ(result.diagnosis.unlisted[0].shape,
            "polynomial of degree 1 in the turn of delta within 360 degrees since, added to delta");
  // To one pose the head came without turning: what the turn before did stays, and that pose is not
  // at fault by itself.
  const UnlistedStructure& part = result.diagnosis.unlisted[1];
  EXPECT_EQ(part_like(part.shape), "rig.pose_outlier");
  EXPECT_EQ(part.driver, "previous_pose");
}

// As a roll, a harmonic and a series.
TEST(Structure, APierThatLeansToOneSideOnlyIsHalfAWave) {
  SyntheticOptions options = fine_turns();
  options.roll_error_deg = [](double delta_deg, double) {
    return 0.3 * std::max(0.0, std::sin((delta_deg - 40) * kRadPerDeg));
  };
  expect_only_structure(options, {"delta_deg", "geometry", "half a wave, added to the base roll"});
}

// Positions 10 degrees apart do not tell a period of 120 degrees from one of 9.2.
TEST(Structure, AFrameThatTwistsWithTheTiltIsNoAliasOfItself) {
  SyntheticOptions options = fine_turns();
  options.h_step_deg = 10;
  options.roll_error_deg = [](double, double h_deg) {
    return -2.2 * std::sin(3 * h_deg * kRadPerDeg);
  };
  const UnlistedStructure found =
      expect_only_structure(options, {"h_deg", "geometry", "wave, added to the base roll"});
  EXPECT_NEAR(parameter(found, "period").value, 120 * kRadPerDeg, 5 * kRadPerDeg);
}

// About no axis of the triad: as a turn of delta and a tilt.
TEST(Structure, GlueThatCreepsTurnsTheTriadAboutAnAxisOfItsOwn) {
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  const auto turn_rad = [](double t_s) { return 0.012 * std::exp(-(t_s - 61) / 90); };
  // Almost the sensitivities of the run, turned about (0.6, 0.6, 0.53).
  options.more_V[0] = [=](const auto& a_g, double t_s) {
    return 0.032 * turn_rad(t_s) * (0.53 * a_g[1] - 0.6 * a_g[2]);
  };
  options.more_V[1] = [=](const auto& a_g, double t_s) {
    return 0.0314 * turn_rad(t_s) * (0.6 * a_g[2] - 0.53 * a_g[0]);
  };
  options.more_V[2] = [=](const auto& a_g, double t_s) {
    return -0.0328 * turn_rad(t_s) * (0.6 * a_g[0] - 0.6 * a_g[1]);
  };
  expect_only_structure(
      options, {"t_s", "geometry", "exponential, added to the turn of the triad in its seat"});
}

// As a wave in one direction and a parabola.
TEST(Structure, AFloorThatTheSunTiltsGoesAlongAnEllipse) {
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  options.base_roll_rad = [](double t_s) { return 0.01 * std::sin(t_s / 75); };
  options.base_tilt_rad = [](double t_s) { return 0.006 * std::cos(t_s / 75); };
  const UnlistedStructure found =
      expect_only_structure(options, {"t_s", "geometry", "wave, added to the tilt of the base"});
  EXPECT_NEAR(parameter(found, "period").value, 75 * 2 * std::numbers::pi, 10);
}

// As steps and polynomials.
TEST(Structure, ALoadThatGoesByTiltsTheFloorToAndFro) {
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  options.base_tilt_rad = [](double t_s) {
    const double u = (t_s - 310) / 20;
    return 0.012 * u / (1 + u * u);
  };
  const UnlistedStructure found =
      expect_only_structure(options, {"t_s", "geometry", "passage, added to h"});
  EXPECT_NEAR(parameter(found, "middle").value, 310, 5);
}

// As a hysteresis, and polynomials of the change of h.
TEST(Structure, AnArmThatCreepsBackGoesByTheDirectionOfItsMove) {
  SyntheticOptions options = fine_turns();
  options.random_order = true;
  options.samples_per_pose = 40;
  options.h_error_deg = [at_deg = 0.0, way = 0.0, sample = 0, last_delta_deg = 0.0](
                            double delta_deg, double h_deg) mutable {
    if (h_deg != at_deg) way = h_deg > at_deg ? -1 : 1;
    if (h_deg != at_deg || delta_deg != last_delta_deg) sample = 0;
    at_deg = h_deg;
    last_delta_deg = delta_deg;
    return 0.15 * way * std::exp(-0.01 * sample++ / 0.1);
  };
  expect_only_structure(options,
                        {"t_in_pose", "geometry",
                         "exponential after arrival, added to h, times the direction of the way"});
}

}  // namespace
}  // namespace plumbline
