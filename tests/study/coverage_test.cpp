// The coverage study on few units; the whole one is scripts/study-coverage.
#include "tests/study/coverage.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <thread>

namespace plumbline::study {
namespace {

constexpr int kUnits = 40;
constexpr std::uint64_t kFirstSeed = 1001;  // others than those of the whole study
// One fair study in a thousand would fall outside.
constexpr double kProbability = 0.999;

class CoverageOfSimulatedUnits : public ::testing::TestWithParam<Converter> {};

TEST_P(CoverageOfSimulatedUnits, StatedUncertaintiesHold) {
  UnitSeries series;
  series.first_seed = kFirstSeed;
  series.units = kUnits;
  series.delta_step_deg = 20;  // an eighth of the time of 324 poses
  series.threads = static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, 4U));
  const Coverage coverage = summarise(calibrate_units(GetParam(), series));

  const Interval share = binomial_interval(kUnits * static_cast<int>(kParameters), kProbability);
  EXPECT_GE(coverage.overall_share, share.lower);
  EXPECT_LE(coverage.overall_share, share.upper);
  EXPECT_GE(coverage.filter_share, share.lower);
  EXPECT_LE(coverage.filter_share, share.upper);
  const Interval nees = nees_interval(kUnits, kProbability);
  EXPECT_GE(coverage.mean_nees, nees.lower);
  EXPECT_LE(coverage.mean_nees, nees.upper);
  // Twelve means of 40 standard normal values; 4 standard deviations each.
  EXPECT_LE(coverage.mean.cwiseAbs().maxCoeff(), 4 / std::sqrt(kUnits));
  EXPECT_DOUBLE_EQ(coverage.en_within_share, 1);
  EXPECT_DOUBLE_EQ(coverage.undecided_share, 0);
  EXPECT_LE(coverage.unexplained_share, 0.05);
}

INSTANTIATE_TEST_SUITE_P(Converters, CoverageOfSimulatedUnits,
                         ::testing::Values(converters()[0], converters()[2]),
                         [](const auto& tested) {
                           return "Bits" + std::to_string(tested.param.bits) + "NoiseTenthsOfStep" +
                                  std::to_string(static_cast<int>(10 * tested.param.noise_steps));
                         });

TEST(CoverageStudy, DoesNotDependOnTheNumberOfThreads) {
  const Converter converter = converters()[2];
  UnitSeries series{.first_seed = 7, .units = 3, .delta_step_deg = 40, .threads = 1};
  const auto one = calibrate_units(converter, series);
  series.threads = 3;
  const auto three = calibrate_units(converter, series);
  ASSERT_EQ(one.size(), three.size());
  for (std::size_t unit = 0; unit < one.size(); ++unit) {
    EXPECT_EQ(one[unit].normalised_error, three[unit].normalised_error) << unit;
    EXPECT_EQ(one[unit].nees, three[unit].nees) << unit;
    EXPECT_EQ(one[unit].en, three[unit].en) << unit;
    EXPECT_EQ(one[unit].verdict, three[unit].verdict) << unit;
  }
  EXPECT_NE(one[0].normalised_error, one[1].normalised_error);
}

TEST(CoverageStudy, SummaryOfTwoUnitsByHand) {
  UnitOutcome first;
  first.normalised_error = ParameterVector::Constant(1.0);
  first.filter_normalised_error = ParameterVector::Constant(1.0);
  first.nees = 10;
  first.en = {0.1, 0.2, 1.5};
  first.verdict = Verdict::clean;
  UnitOutcome second;
  second.normalised_error = ParameterVector::Constant(-1.0);
  second.normalised_error(0) = -1.98;  // beyond 1.96, within 2
  second.normalised_error(5) = 3.0;
  second.filter_normalised_error = ParameterVector::Constant(1.0);
  second.filter_normalised_error.head<6>().setConstant(2.5);
  second.nees = 20;
  second.en = {0.1, 0.2, 0.3};
  second.verdict = Verdict::unexplained;

  const Coverage coverage = summarise({first, second});
  EXPECT_EQ(coverage.units, 2);
  EXPECT_DOUBLE_EQ(coverage.overall_share, 22.0 / 24);
  EXPECT_DOUBLE_EQ(coverage.overall_share_k2, 23.0 / 24);
  EXPECT_DOUBLE_EQ(coverage.filter_share, 0.75);
  EXPECT_DOUBLE_EQ(coverage.share(0), 0.5);
  EXPECT_DOUBLE_EQ(coverage.share_k2(0), 1);
  EXPECT_DOUBLE_EQ(coverage.share_k2(5), 0.5);
  EXPECT_DOUBLE_EQ(coverage.mean(1), 0);
  EXPECT_DOUBLE_EQ(coverage.mean(5), 2);
  EXPECT_DOUBLE_EQ(coverage.sd(5), std::sqrt(2.0));
  // Shares 1 and 5/6 of the units: their mean scatters by half the difference.
  EXPECT_NEAR(coverage.u_overall_share, 1.0 / 12, 1e-12);
  EXPECT_DOUBLE_EQ(coverage.mean_nees, 15);
  EXPECT_NEAR(coverage.en_within_share, 5.0 / 6, 1e-12);
  EXPECT_DOUBLE_EQ(coverage.largest_en, 1.5);
  EXPECT_DOUBLE_EQ(coverage.unexplained_share, 0.5);
  EXPECT_DOUBLE_EQ(coverage.undecided_share, 0);
}

TEST(CoverageStudy, IntervalsByHand) {
  const Interval share = binomial_interval(1900, 0.95);  // sd √(0.0475/1900) = 0.005
  EXPECT_NEAR(share.lower, 0.95 - 1.96 * 0.005, 1e-5);
  EXPECT_NEAR(share.upper, 0.95 + 1.96 * 0.005, 1e-5);
  const Interval nees = nees_interval(1, 0.95);  // tables of χ² with 12 degrees of freedom
  EXPECT_NEAR(nees.lower, 4.404, 5e-4);
  EXPECT_NEAR(nees.upper, 23.337, 5e-4);
  EXPECT_EQ(parameter_name(0), "K_xx");
  EXPECT_EQ(parameter_name(6), "K_yz");
  EXPECT_EQ(parameter_name(11), "U_z0");
}

}  // namespace
}  // namespace plumbline::study
