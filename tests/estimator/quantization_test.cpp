// Estimation from codes against least squares from means, on the paper's grid and converter; the
// limits are those of a handful of trials, scripts/study-quantization has the figures of many.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "estimator/calibrate.h"
#include "estimator/fit/least_squares.h"
#include "estimator/fit/rounding.h"
#include "estimator/noise/covariance.h"
#include "estimator/noise/identify.h"
#include "estimator/quantization/interval_fit.h"
#include "tests/estimator/synthetic_run.h"

namespace plumbline {
namespace {

constexpr double kRadians = 3.14159265358979323846 / 180;

struct Case {
  double sigma = 0;  ///< steps
  int readings = 1;
  double positioning_arcsec = 0;
  double nonlinearity = 0;  ///< peak error of a code boundary, steps
};

/// RMS over the sphere of the error that the parameters make, mm/s², by both estimators.
struct Errors {
  double least_squares = 0;
  double intervals = 0;
};

Errors errors_of(const Case& c, int trials) {
  constexpr double kStep_mps2 = 0.374;
  constexpr double kStepsPerG = kStandardGravity_mps2 / kStep_mps2;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1, 1);
  Errors sum;
  for (int trial = 0; trial < trials; ++trial) {
    const Eigen::Vector4d truth(kStepsPerG * (1 + 0.01 * normal(random)),
                                0.05 * kStepsPerG * normal(random),
                                0.03 * kStepsPerG * normal(random), 30 * uniform(random));
    std::map<int, double> boundary;  // below the code, as an error in steps
    const auto moved = [&](int code) {
      const auto it = boundary.find(code);
      if (it != boundary.end()) return it->second;
      return boundary.emplace(code, c.nonlinearity * uniform(random)).first->second;
    };
    Eigen::MatrixXd A(324, 4);
    Eigen::VectorXd mean(324);
    std::vector<CodeCounts> codes;
    for (int k = 0; k < 324; ++k) {
      const auto row = [](double delta, double h) {
        return Eigen::Vector4d(std::cos(h) * std::cos(delta), -std::cos(h) * std::sin(delta),
                               std::sin(h), 1);
      };
      const double delta = kRadians * 10 * (k % 36), h = kRadians * 10 * (k / 36);
      const double u_rad = c.positioning_arcsec / 3600 * kRadians;
      const double exact =
          row(delta + u_rad * normal(random), h + u_rad * normal(random)).dot(truth);
      std::map<double, double> count;
      CodeCounts pose;
      for (int i = 0; i < c.readings; ++i) {
        const double u = exact + c.sigma * normal(random);
        int code = static_cast<int>(std::floor(u + 0.5));
        if (c.nonlinearity > 0) {
          while (u < code - 0.5 + moved(code)) --code;
          while (u >= code + 0.5 + moved(code + 1)) ++code;
        }
        count[code] += 1;
        pose.mean += code / static_cast<double>(c.readings);
      }
      pose.count.assign(count.begin(), count.end());
      A.row(k) = row(delta, h);
      mean(k) = pose.mean;
      codes.push_back(std::move(pose));
    }
    const auto square = [&](const Eigen::Vector4d& estimate) {
      const Eigen::Vector4d e = (estimate - truth) * kStep_mps2 * 1e3;
      return e.head<3>().squaredNorm() / 3 + e(3) * e(3);
    };
    const IntervalFit fit =
        fit_intervals(A, codes, Eigen::VectorXd::Zero(324), Eigen::VectorXd::Zero(324));
    EXPECT_TRUE(fit.converged);
    sum.least_squares += square(solve_least_squares(A, mean).x) / trials;
    sum.intervals += square(fit.value) / trials;
  }
  return {std::sqrt(sum.least_squares), std::sqrt(sum.intervals)};
}

TEST(IntervalFit, ManyTimesBetterThanLeastSquaresWhereStepsAreCoarse) {
  // Four to six trials of four parameters: the RMS is known to 14 to 18 %.
  const Errors single = errors_of({0, 1}, 6);
  EXPECT_LT(single.intervals, 7.5);
  EXPECT_LT(single.intervals, 0.5 * single.least_squares);
  const Errors fine = errors_of({0.03, 100}, 4);
  EXPECT_LT(fine.intervals, 1.3);
  EXPECT_LT(fine.intervals, 0.15 * fine.least_squares);
  const Errors tenth = errors_of({0.1, 100}, 4);
  EXPECT_LT(tenth.intervals, 2.2);
  EXPECT_LT(tenth.intervals, 0.3 * tenth.least_squares);
}

// As of recorded sensors: a few readings in a thousand are far out of the rest. One beyond an edge
// that is six standard deviations away does not put its pose near the edge.
TEST(RoundingFree, OneReadingOfWiderNoiseIsNoErrorOfItsPose) {
  constexpr Adc adc{12, -5, 0};
  constexpr double kSigma = 0.08, kReadings = 40;  // of a step
  const double step_V = adc.lsb_V();
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Eigen::VectorXd expected_V(300), mean_V(300);
  double square = 0;
  for (Eigen::Index k = 0; k < 300; ++k) {
    const double value = 0.137 * static_cast<double>(k);
    double sum = 0, sum_of_squares = 0;
    for (int i = 0; i < kReadings; ++i) {
      const double code = std::round(value + kSigma * normal(random));
      sum += code;
      sum_of_squares += code * code;
    }
    square += (sum_of_squares - sum * sum / kReadings) / (300 * kReadings);
    expected_V(k) = -2.5 + step_V * value;
    mean_V(k) = -2.5 + step_V * sum / kReadings;
  }
  // In the middle of a step, six standard deviations from its edges.
  constexpr Eigen::Index far = 73;
  static_assert(far * 0.137 - 10 < 0.002);
  mean_V(far) += step_V / kReadings;
  const RoundingFree free =
      free_of_rounding(mean_V, expected_V, scale_of(adc), std::sqrt(square) * step_V,
                       Eigen::VectorXd::Constant(mean_V.size(), kReadings));
  ASSERT_TRUE(free.coarse);
  EXPECT_LT(std::abs(free.mean_V(far) - expected_V(far)), 2 * std::sqrt(free.variance_V2(far)));
}

TEST(RoundingFree, MovesNoMeanByMoreThanRoundingDoes) {
  // A pose half a step off its expectation, where the staircase is flat: its mean is wrong by no
  // more than rounding with noise of 0.25 steps makes any mean wrong, 0.093 steps, and its own
  // noise.
  constexpr Adc adc{12, -5, 0};
  const double step_V = adc.lsb_V();
  Eigen::VectorXd expected_V(200), mean_V(200);
  for (Eigen::Index k = 0; k < 200; ++k) {
    expected_V(k) = -2.5 + step_V * 0.137 * static_cast<double>(k);
    mean_V(k) = expected_V(k) + rounding_bias(expected_V(k), -2.5, step_V, 0.25 * step_V).bias;
  }
  expected_V(0) = -2.5;  // in the middle of a code
  mean_V(0) = -2.5 + 0.7 * step_V;
  const RoundingFree free = free_of_rounding(mean_V, expected_V, scale_of(adc), 0.36 * step_V,
                                             Eigen::VectorXd::Constant(200, 50));
  ASSERT_TRUE(free.coarse);
  EXPECT_LT(std::abs(free.mean_V(0) - mean_V(0)), 0.2 * step_V);
}

// A pickup of one step in noise of a third: the mean of a dwell scatters by the noise alone.
TEST(RoundingFree, ALineInTheReadingsIsNoNoiseOfTheirMeans) {
  constexpr Adc adc{12, -5, 0};
  constexpr double kOfLine = 0.75;
  const double step_V = adc.lsb_V(), sample_sd_V = 0.6 * step_V;
  Eigen::VectorXd mean_V(200);
  for (Eigen::Index k = 0; k < 200; ++k) mean_V(k) = -2.5 + step_V * 0.137 * static_cast<double>(k);
  const RoundingFree noise = free_of_rounding(mean_V, mean_V, scale_of(adc), sample_sd_V,
                                              Eigen::VectorXd::Constant(200, 50));
  const RoundingFree line =
      free_of_rounding(mean_V, mean_V, scale_of(adc), sample_sd_V,
                       Eigen::VectorXd::Constant(200, 50), kOfLine * sample_sd_V * sample_sd_V);
  ASSERT_TRUE(noise.coarse);
  EXPECT_NEAR(noise.variance_V2.mean(), sample_sd_V * sample_sd_V / 50,
              0.1 * noise.variance_V2.mean());
  EXPECT_NEAR(line.variance_V2.mean() / noise.variance_V2.mean(), 1 - kOfLine, 0.05);
  EXPECT_EQ(line.mean_V, noise.mean_V);
}

// Readings taken all over the steps scatter by what rounding adds; the less noise, the more of it.
TEST(RoundingFree, NoiseIsToldFromWhatRoundingAddsHoweverSmall) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  constexpr int kPlaces = 4000, kReadings = 50;
  for (const double sigma : {0.03, 0.06, 0.12, 0.25, 0.5}) {
    double square = 0;
    for (int place = 0; place < kPlaces; ++place) {
      double sum = 0, of_squares = 0;
      for (int i = 0; i < kReadings; ++i) {
        const double code = std::round((place + 0.5) / kPlaces + sigma * normal(random));
        sum += code;
        of_squares += code * code;
      }
      square += (of_squares - sum * sum / kReadings) / (kReadings - 1) / kPlaces;
    }
    EXPECT_NEAR(sd_before_rounding_V(1, std::sqrt(square)), sigma, 0.05 * sigma);
  }
}

// Readings all alike say in which step the voltage lies; some of them on the other side of an edge
// say where it is to a small part of the step.
TEST(RoundingFree, MeansInsideAStepWithEdgesCountForLittle) {
  const Adc adc{10, -5.0, 0.0};
  const double step_V = adc.lsb_V(), sigma = 0.06;
  constexpr int kMeans = 100, kReadings = 40;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  Eigen::VectorXd mean_V(kMeans), expected_V(kMeans), true_V(kMeans);
  for (int k = 0; k < kMeans; ++k) {
    const double place = 0.01 * k - 0.5;  // of the step, from its middle
    true_V(k) = adc.volts(7) + step_V * place;
    expected_V(k) = true_V(k) + 0.02 * step_V * normal(random);
    double sum = 0;
    for (int i = 0; i < kReadings; ++i) sum += std::round(place + sigma * normal(random));
    // As in a file.
    mean_V(k) = std::round(1e5 * (adc.volts(7) + step_V * sum / kReadings)) / 1e5;
  }
  const double recorded_V = step_V * std::sqrt(sigma * 0.56);
  const RoundingFree free = free_of_rounding(mean_V, expected_V, scale_of(adc), recorded_V,
                                             Eigen::VectorXd::Constant(mean_V.size(), kReadings));
  ASSERT_TRUE(free.coarse);
  ASSERT_TRUE(free.beyond_V2);
  const double sd_in_the_middle = std::sqrt(free.variance_V2(kMeans / 2)) / step_V;
  EXPECT_GT(sd_in_the_middle, 0.9);
  EXPECT_LT(std::sqrt(free.variance_V2(0)) / step_V, 0.05);
  const Eigen::VectorXd off =
      (free.mean_V - true_V).cwiseAbs().cwiseQuotient(free.variance_V2.cwiseSqrt());
  EXPECT_LT(off.maxCoeff(), 4);
  // Errors are those of the means as measured: a step is about that wide.
  const double stated_V2 = *free.beyond_V2 + free.variance_V2.mean();
  EXPECT_NEAR(stated_V2, (mean_V - true_V).squaredNorm() / kMeans, 0.3 * stated_V2);
}

// What a coarse converter says of white noise depends on the place within its step; what it says of
// slow noise only by how much of it the place lets through.
TEST(RecordBesideRounding, KeepsTheSlowNoise) {
  constexpr Adc adc{12, -5, 0};
  constexpr double kRate_hz = 100, kWalk_V = 3e-5;
  const double step_V = adc.lsb_V();
  // Noise of a reading, and its scatter over all places within the step; in steps.
  for (const auto& [sigma, recorded] : {std::pair(0.1, 0.2), {0.45, 0.53}}) {
    std::mt19937_64 random(4);
    std::normal_distribution<double> normal;
    std::vector<double> record;
    double walk_V = -2.5 + 0.2 * step_V;
    for (int k = 0; k < 30000; ++k) {
      walk_V += kWalk_V / std::sqrt(kRate_hz) * normal(random);
      record.push_back(step_V * std::round((walk_V + sigma * step_V * normal(random)) / step_V));
    }
    const NoiseModel whole = identify_noise(record, kRate_hz);
    const NoiseModel kept = record_beside_rounding(whole, adc, recorded * step_V);
    EXPECT_EQ(kept.N.value, 0);
    if (sigma < 0.15) {
      EXPECT_TRUE(kept.descriptions.empty()) << "steps with edges hide what is slow, too";
      continue;
    }
    ASSERT_FALSE(kept.descriptions.empty());
    EXPECT_NEAR(kept.K.value, kWalk_V, 0.5 * kWalk_V);
    for (const SpectrumBin& bin : kept.descriptions.front().bins) {
      EXPECT_EQ(bin.density(kTermN), 0);
      EXPECT_GT(bin.known, 0);
    }
  }
}

TEST(IntervalFit, AsGoodAsLeastSquaresWhereNoiseSmoothsTheSteps) {
  const Errors smooth = errors_of({1, 100}, 2);
  EXPECT_NEAR(smooth.intervals, smooth.least_squares, 0.05 * smooth.least_squares);
}

TEST(IntervalFit, StandsPositioningErrorsAndUnevenSteps) {
  const Errors restless = errors_of({0.1, 100, 60, 0}, 3);
  EXPECT_LT(restless.intervals, 2.6);
  const Errors uneven = errors_of({0.1, 100, 0, 0.25}, 2);
  EXPECT_LT(uneven.intervals, uneven.least_squares);
}

TEST(CountCodes, TakesOnlyVoltagesOfTheConverter) {
  const Adc adc{12, -5.0, 0.0};
  SampleTable samples;
  samples.t_s = {0, 1, 2, 3};
  for (auto& axis : samples.u_V)
    axis = {adc.volts(3), adc.volts(3), adc.volts(4), adc.volts(-2048)};
  const std::vector<Pose> poses = {{0, 0, 0, 0, 3}, {1, 10, 0, 3, 1}};
  const auto codes = count_codes(samples, poses, 0, scale_of(adc));
  ASSERT_TRUE(codes);
  EXPECT_THAT((*codes)[0].count, testing::ElementsAre(testing::Pair(3, 2), testing::Pair(4, 1)));
  EXPECT_FALSE((*codes)[0].at_low_end);
  EXPECT_TRUE((*codes)[1].at_low_end);
  samples.u_V[0][1] += 0.3 * adc.lsb_V();
  EXPECT_FALSE(count_codes(samples, poses, 0, scale_of(adc)));
}

// A coarser step than the converter's: its points are read as the nearest of the converter's codes.
TEST(CountCodes, TakesReadingsNearTheStepsOfAnotherConverterAndFoldsWhatIsKnownOfThem) {
  const Adc adc{12, -5.0, 0.0};
  const CodeScale coarser{.origin_V = -2.4001,
                          .step_V = 3.7 * adc.lsb_V(),
                          .off_scale = 0.6 / 3.7,
                          .lowest_V = adc.min_V,
                          .highest_V = adc.max_V - adc.lsb_V()};
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const Eigen::Vector2d truth(0.03, -2.43);
  constexpr int kPoses = 40, kReadings = 50;
  SampleTable samples;
  std::vector<Pose> poses;
  Eigen::MatrixXd A(kPoses, 4);
  Eigen::VectorXd known_V(kPoses);
  for (int k = 0; k < kPoses; ++k) {
    A.row(k) << std::cos(0.5 * k), std::sin(0.5 * k), std::cos(1.7 * k), 1;
    known_V(k) = 0.004 * std::sin(0.9 * k);
    poses.push_back({.first = samples.u_V[0].size(), .count = kReadings});
    for (int i = 0; i < kReadings; ++i) {
      const double exact_V = truth(0) * A(k, 0) + truth(1) + known_V(k) + 0.001 * normal(random);
      const double point_V =
          coarser.origin_V +
          coarser.step_V * std::round((exact_V - coarser.origin_V) / coarser.step_V);
      samples.u_V[0].push_back(adc.min_V +
                               adc.lsb_V() * std::round((point_V - adc.min_V) / adc.lsb_V()));
    }
  }
  const auto codes = count_codes(samples, poses, 0, coarser);
  ASSERT_TRUE(codes);
  EXPECT_FALSE(count_codes(
      samples, poses, 0,
      {coarser.origin_V, 1.3 * coarser.step_V, coarser.off_scale, adc.min_V, adc.max_V}));
  const IntervalFit fit =
      fit_intervals(A, *codes, Eigen::VectorXd::Zero(kPoses), known_V / coarser.step_V);
  ASSERT_TRUE(fit.converged);
  const Eigen::Vector4d expected(truth(0) / coarser.step_V, 0, 0,
                                 (truth(1) - coarser.origin_V) / coarser.step_V);
  for (Eigen::Index j = 0; j < 4; ++j)
    EXPECT_NEAR(fit.value(j), expected(j), 4 * std::sqrt(fit.covariance(j, j))) << j;
  EXPECT_LT(std::sqrt(fit.covariance(3, 3)), 0.02) << "of a step";
  EXPECT_NEAR(fit.sigma, 0.001 / coarser.step_V, 0.2 * fit.sigma);
}

double error_over_sphere(const TriadEstimate& estimate, const SyntheticRun& data) {
  double sum = 0;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    Eigen::Vector4d e = estimate[axis].value;
    for (std::size_t j = 0; j < 4; ++j) e(static_cast<Eigen::Index>(j)) -= data.truth[axis][j];
    sum += (e.head<3>().squaredNorm() / 3 + e(3) * e(3)) / 3;
  }
  return std::sqrt(sum) / 0.032 * kStandardGravity_mps2;
}

TEST(Calibrate, UsesTheCodesWhereStepsAreCoarseAndSaysSo) {
  // Noise of a tenth of the 12-bit step: 1.2 mV.
  const SyntheticRun coarse = synthetic_run(
      3, {12, -5.0, 0.0}, {.sigma_V = 1.2e-4, .delta_step_deg = 10, .h_step_deg = 10});
  const Calibration with = calibrate({coarse.run, &coarse.still, coarse.description}, {});
  RunDescription silent = coarse.description;
  silent.adc.reset();
  const Calibration without = calibrate({coarse.run, &coarse.still, silent}, {});
  EXPECT_LT(error_over_sphere(with.estimates.batch_ls, coarse),
            0.5 * error_over_sphere(without.estimates.batch_ls, coarse));
  // Limits of what samples show need no declared step.
  std::size_t limits = 0;
  for (const DetectionLimit& limit : without.diagnosis.not_found) {
    if (limit.id != "adc.mains_pickup") continue;
    ++limits;
    EXPECT_GT(limit.limit, 1e-4) << "g";
    EXPECT_LT(limit.limit, 1e-2) << "g";
  }
  EXPECT_EQ(limits, kAxisCount);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    ASSERT_TRUE(with.quantization[axis]);
    EXPECT_NEAR(with.quantization[axis]->sigma_V, 1.2e-4, 0.15e-4);
    EXPECT_FALSE(without.quantization[axis]);
    EXPECT_TRUE(without.final.batch_ls[axis].value.allFinite());
    EXPECT_LT(with.estimates.agreement_en[axis], 1);
    // The stated uncertainty holds.
    const AxisEstimate& batch = with.estimates.batch_ls[axis];
    for (Eigen::Index j = 0; j < 4; ++j)
      EXPECT_NEAR(batch.value(j), coarse.truth[axis][static_cast<std::size_t>(j)],
                  4.5 * std::sqrt(batch.covariance(j, j)));
  }
}

TEST(Uncertainty, MonteCarloAgreesWithTheLawOfPropagation) {
  SyntheticRun data = synthetic_run(4, kSixteenBits);
  data.description.angles = {20, 20};
  const Calibration result = calibrated(data);
  ASSERT_TRUE(result.uncertainty);
  const UncertaintyReport& report = *result.uncertainty;
  EXPECT_TRUE(report.stabilised);
  EXPECT_TRUE(report.validated);
  EXPECT_GE(report.trials, 20000U);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    for (std::size_t j = 0; j < 4; ++j) {
      const ParameterUncertainty& p = report.parameter[axis][j];
      const auto index = static_cast<Eigen::Index>(j);
      const double u = std::sqrt(result.estimates.batch_ls[axis].covariance(index, index));
      EXPECT_NEAR(p.budget.combined, u, 0.01 * u);
      EXPECT_NEAR(p.mc_u, u, 0.03 * u);
      EXPECT_GT(std::hypot(p.budget.delta, p.budget.h), 0);
      EXPECT_EQ(p.budget.gravity > 0, j < 3);
    }
  }
  // Positioning seen along an axis that it does not touch to first order leaves a bias of second
  // order; the same seed gives the same report.
  const Calibration again = calibrated(data);
  EXPECT_EQ(again.uncertainty->parameter[0][0].mc_low, report.parameter[0][0].mc_low);
}

TEST(Uncertainty, SaysWhenTheLawOfPropagationFails) {
  // Three degrees of positioning uncertainty: cosines are no longer straight.
  const SyntheticRun data = synthetic_run(5, kSixteenBits);
  RunDescription description = data.description;
  description.angles = {10800, 10800};
  Eigen::MatrixXd A(60, 4);
  for (Eigen::Index k = 0; k < 60; ++k) {
    const Pose& pose = data.run.poses[static_cast<std::size_t>(k)];
    const double d = pose.delta_deg * kRadians, h = pose.h_deg * kRadians;
    A.row(k) << std::cos(h) * std::cos(d), -std::cos(h) * std::sin(d), std::sin(h), 1;
  }
  const Eigen::MatrixXd gain =
      solve_least_squares(A, Eigen::VectorXd::Zero(60)).cofactor * A.transpose();
  PropagatedEstimate estimate;
  estimate.covariance = Eigen::MatrixXd::Zero(12, 12);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const auto first = static_cast<Eigen::Index>(axis);
    estimate.value[axis] = 0.032 * Eigen::Vector4d::Unit(first);
    estimate.gain[axis] = Eigen::MatrixXd::Zero(12, 60);
    estimate.gain[axis].middleRows<4>(4 * first) = gain;
    estimate.rounding_V2[axis] = Eigen::VectorXd::Zero(60);
  }
  const UncertaintyReport report = propagate_uncertainty(estimate, data.run.poses, description, 1);
  EXPECT_FALSE(report.validated);
  // E cos = exp(−u²/2) in each angle: K_xx comes out too small.
  EXPECT_LT(report.parameter[0][0].mc_mean, 0.032 * (1 - 0.5 * std::pow(3 * kRadians, 2)));
}

}  // namespace
}  // namespace plumbline
