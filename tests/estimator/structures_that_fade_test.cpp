// What has no name and remembers: what gathers and fades, and what goes with the way of the last
// move and not always alike.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "tests/estimator/structure.h"

namespace plumbline {
namespace {

constexpr double kFirst_s = 61, kPose_s = 3;  // of a synthetic run

SyntheticOptions fine_turns_at_random() {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.random_order = true;
  return options;
}

/// The average of the past of what holds from one reading to the next.
class PastAverage {
 public:
  explicit PastAverage(double tau_s) : tau_s_(tau_s) {}
  double operator()(double now, double t_s) {
    const double share = std::exp(-std::max(0.0, t_s - last_s_) / tau_s_);
    average_ = average_ * share + (1 - share) * held_;
    held_ = now;
    last_s_ = t_s;
    return average_;
  }

 private:
  double tau_s_, average_ = 0, held_ = 0, last_s_ = 0;
};

/// What a function makes of each new position and the time of arrival there, kept while it lasts.
class AtEveryPose {
 public:
  using Function = std::function<double(double delta_deg, double h_deg, double t_s)>;
  explicit AtEveryPose(Function function) : function_(std::move(function)) {}
  double operator()(double delta_deg, double h_deg) {
    if (delta_deg != delta_deg_ || h_deg != h_deg_) {
      kept_ = function_(delta_deg, h_deg, kFirst_s + kPose_s * poses_);
      poses_ += 1;
    }
    delta_deg_ = delta_deg;
    h_deg_ = h_deg;
    return kept_;
  }

 private:
  Function function_;
  double delta_deg_ = 0, h_deg_ = 0, kept_ = 0, poses_ = 0;
};

/// 1 where δ last went up, −1 where it went down, never past 360°.
class Direction {
 public:
  double operator()(double delta_deg) {
    if (delta_deg != last_deg_) way_ = delta_deg > last_deg_ ? 1 : -1;
    last_deg_ = delta_deg;
    return way_;
  }

 private:
  double last_deg_ = 0, way_ = 1;
};

TEST(Structure, ChargesThatGatherOnOneSideGoByThePastOfTheSign) {
  SyntheticOptions options = fine_turns_at_random();
  options.more_V[1] = [charge = PastAverage(40)](const auto& a_g, double t_s) mutable {
    return 5e-4 * charge(std::abs(a_g[1]) < 1e-9 ? 0 : std::copysign(1, a_g[1]), t_s);
  };
  expect_only_structure(
      options, {"previous_pose", "bias", "straight line in the average of the past of its sign"});
}

// As friction in the component of another axis, and a square.
TEST(Structure, ACoilThatWarmsItselfGoesByThePastOfTheSquare) {
  SyntheticOptions options = fine_turns_at_random();
  options.more_V[0] = [heat = PastAverage(40)](const auto& a_g, double t_s) mutable {
    return 2e-3 * heat(a_g[0] * a_g[0], t_s);
  };
  expect_only_structure(
      options, {"previous_pose", "bias", "straight line in the average of the past of its square"});
}

TEST(Structure, AnAxisThatFeelsWhichSideWasUpGoesByThePastOfAnother) {
  SyntheticOptions options = fine_turns_at_random();
  options.more_V[2] = [lag = PastAverage(30)](const auto& a_g, double t_s) mutable {
    return 1e-3 * lag(a_g[0], t_s);
  };
  expect_only_structure(options, {"previous_pose", "bias",
                                  "straight line in the change from the average of the past of "
                                  "the component of the next axis"});
}

TEST(Structure, MotorsThatWarmTheHeadGoByTheirFadingWays) {
  SyntheticOptions options = fine_turns_at_random();
  options.more_V[2] = [heat = 0.0, last_s = 0.0, at_deg = 0.0](const auto& a_g,
                                                               double t_s) mutable {
    heat *= std::exp((last_s - t_s) / 25);
    last_s = t_s;
    const double delta_deg = delta_deg_of(a_g);
    heat += std::abs(std::remainder(delta_deg - at_deg, 360)) / 180;
    at_deg = delta_deg;
    return 2e-4 * heat;
  };
  expect_only_structure(
      options, {"previous_pose", "bias", "straight line in the fading sum of the turns of delta"});
}

// As fading sums of the turns.
TEST(Structure, WhatRecoversAfterEveryPauseGoesByThePauses) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.pose_s = [](double delta_deg, double h_deg) {
    return delta_deg == 200 && h_deg < 80 ? 90.0 : 3.0;
  };
  options.more_V[1] = [last_s = 0.0, resumed_s = -1e9](const auto&, double t_s) mutable {
    if (t_s - last_s > 60) resumed_s = t_s;
    last_s = t_s;
    return 4e-4 * std::exp(-(t_s - resumed_s) / 25);
  };
  expect_only_structure(options, {"t_s", "bias", "straight line in the fading sum of the pauses"});
}

// As slips of the index.
TEST(Structure, ACableThatWindsUpGoesByTheSumOfTheTurns) {
  SyntheticOptions options = fine_turns_at_random();
  options.delta_error_deg =
      AtEveryPose([sum_deg = 0.0, at_deg = 0.0](double delta_deg, double, double) mutable {
        const double turn_deg = std::remainder(delta_deg - at_deg, 360);
        sum_deg += std::abs(turn_deg) == 180 ? 180 : turn_deg;
        at_deg = delta_deg;
        return 2e-4 * sum_deg;
      });
  expect_only_structure(
      options, {"previous_pose", "geometry",
                "polynomial of degree 1 in the sum of the turns of delta, added to delta"});
}

// As the past of the cosine of h, lines in time and harmonics.
TEST(Structure, ATiltThatCreepsAfterItsMovesGoesByTheirFadingSum) {
  SyntheticOptions options = fine_turns_at_random();
  options.h_error_deg = AtEveryPose(
      [creep_deg = 0.0, at_deg = 0.0, last_s = 0.0](double, double h_deg, double t_s) mutable {
        creep_deg *= std::exp(-(t_s - last_s) / 15);
        creep_deg += 6e-3 * std::abs(h_deg - at_deg);
        at_deg = h_deg;
        last_s = t_s;
        return creep_deg;
      });
  expect_only_structure(options, {"previous_pose", "geometry",
                                  "straight line in the fading sum of the turns of h, added to h"});
}

TEST(Structure, AnArmThatKeepsItsBendGoesByThePastOfTheWeight) {
  SyntheticOptions options = fine_turns_at_random();
  options.h_error_deg =
      AtEveryPose([bend = PastAverage(20)](double, double h_deg, double t_s) mutable {
        return 1.2 * bend(std::cos(h_deg * kRadPerDeg), t_s);
      });
  expect_only_structure(
      options, {"previous_pose", "geometry",
                "straight line in the average of the past of the cosine of h, added to h"});
}

// As slips and poses that were set wrong.
TEST(Structure, GreaseThatWarmsUpDragsLessAndLess) {
  SyntheticOptions options = fine_turns_at_random();
  options.delta_error_deg =
      AtEveryPose([way = Direction()](double delta_deg, double, double t_s) mutable {
        return 0.4 * way(delta_deg) * std::exp(-(t_s - kFirst_s) / 120);
      });
  expect_only_structure(options, {"previous_pose", "geometry",
                                  "exponential of the time in the direction of the last turn of "
                                  "delta within 360 degrees, added to delta"});
}

TEST(Structure, APlayThatFollowsAColumnIsOne) {
  const auto film = [](double t_s) { return std::sin(t_s / 50) + 0.4 * std::cos(t_s / 17); };
  SyntheticOptions options = fine_turns_at_random();
  options.delta_error_deg =
      AtEveryPose([way = Direction(), film](double delta_deg, double, double t_s) mutable {
        return 0.2 * way(delta_deg) * film(t_s);
      });
  expect_only_structure(with_column(options, "oil_bar", film),
                        {"previous_pose", "geometry",
                         "straight line, times that of oil_bar in the direction of the last turn "
                         "of delta within 360 degrees, added to delta"});
}

TEST(Structure, APlayThatIsTakenUpSlowlyFadesAfterAReversal) {
  SyntheticOptions options = fine_turns_at_random();
  options.delta_error_deg = AtEveryPose([way = Direction(), before = 0.0, since_s = 0.0](
                                            double delta_deg, double, double t_s) mutable {
    const double now = way(delta_deg);
    if (now != before) since_s = t_s;
    before = now;
    return 0.3 * now * std::exp((since_s - t_s) / 5);
  });
  expect_only_structure(options, {"previous_pose", "geometry",
                                  "fading after a reversal in the direction of the last turn of "
                                  "delta within 360 degrees, added to delta"});
}

TEST(Structure, AMassThatRemembersItsSideFadesAfterTheSignChanges) {
  SyntheticOptions options = fine_turns_at_random();
  options.random_order = false;
  options.more_V[1] = [side = 1.0, since_s = -1e9](const auto& a_g, double t_s) mutable {
    const double now = std::abs(a_g[1]) < 1e-9 ? side : std::copysign(1, a_g[1]);
    if (now != side) since_s = t_s;
    side = now;
    return 8e-4 * now * std::exp(-std::max(0.0, t_s - since_s - 0.2) / 8);
  };
  expect_only_structure(options,
                        {"previous_pose", "bias", "fading after a reversal in the sign of a_i"});
}

// As a polynomial and hysteresis.
TEST(Structure, WhatIsWithheldOfLargeChangesIsABend) {
  SyntheticOptions options = fine_turns_at_random();
  options.more_V[1] = [before = 0.0, at = 0.0, last_s = 0.0](const auto& a_g, double t_s) mutable {
    // Nothing recorded says where the head came from to the first pose.
    if (t_s > last_s + 1) before = t_s < kFirst_s + 1 ? a_g[1] : at;
    at = a_g[1];
    last_s = t_s;
    const double change = at - before;
    return t_s < kFirst_s ? 0
                          : -1e-3 * std::copysign(std::max(0.0, std::abs(change) - 0.8), change);
  };
  const UnlistedStructure found =
      expect_only_structure(options, {"previous_pose", "bias", "bend in the change of a_i since"});
  EXPECT_NEAR(parameter(found, "at").value, 0.8, 0.05);
}

// As an outlying pose and a polynomial of the turn.
TEST(Structure, AFilmThatBuildsUpWithTheTurnGoesByAPowerOfItsSize) {
  SyntheticOptions options = fine_turns_at_random();
  options.h_error_deg = AtEveryPose([last_deg = 0.0](double delta_deg, double, double) mutable {
    const double turn_deg = std::abs(std::remainder(delta_deg - last_deg, 360));
    last_deg = delta_deg;
    return 0.4 * std::sqrt(turn_deg / 180);
  });
  const UnlistedStructure found = expect_only_structure(
      options,
      {"previous_pose", "geometry", "power in the size of the turn of delta since, added to h"});
  EXPECT_NEAR(parameter(found, "power").value, 0.5, 0.15);
}

// As bells of other axes, and relays of the component itself.
TEST(Structure, ARangeThatSwitchesLateIsARelayOfTheSize) {
  SyntheticOptions options = fine_turns_at_random();
  options.more_V[0] = [coarse = false](const auto& a_g, double) mutable {
    if (std::abs(a_g[0]) > 0.79) coarse = true;
    if (std::abs(a_g[0]) < 0.37) coarse = false;
    return coarse ? 3e-4 : 0;
  };
  expect_only_structure(options, {"previous_pose", "bias", "relay in the size of a_i"});
}

}  // namespace
}  // namespace plumbline
