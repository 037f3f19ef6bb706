// The five terms from records whose terms are known, and pose-mean covariance against averages.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "estimator/diagnosis/residual_test.h"
#include "estimator/noise/covariance.h"
#include "estimator/noise/identify.h"
#include "estimator/noise/powers_allowance.h"
#include "estimator/noise/spectrum.h"

namespace plumbline {
namespace {

/// Quantization, white noise, random walk and ramp, each from its definition.
std::vector<double> simulate(std::size_t n, double rate_hz, double Q, double N, double K, double R,
                             std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> unit;
  const double step_s = 1 / rate_hz;
  double walk = 0;
  double code = unit(engine);
  std::vector<double> record;
  for (std::size_t i = 0; i < n; ++i) {
    walk += K * std::sqrt(step_s) * unit(engine);
    const double next = unit(engine);
    record.push_back(N / std::sqrt(step_s) * unit(engine) + walk +
                     R * step_s * static_cast<double>(i) + Q / step_s * (next - code));
    code = next;
  }
  return record;
}

TEST(CosineTransform, OrthonormalAndExactForOneCosine) {
  std::vector<double> record(60);
  for (std::size_t i = 0; i < 60; ++i)
    record[i] = 5 + 2 * std::cos(std::numbers::pi * 7 * (static_cast<double>(i) + 0.5) / 60);
  const std::vector<double> c = cosine_transform(record);
  ASSERT_EQ(c.size(), 60U);
  EXPECT_NEAR(c[0], 5 * std::sqrt(60.0), 1e-12);
  for (std::size_t k = 1; k < 60; ++k)
    EXPECT_NEAR(c[k], k == 7 ? 2 * std::sqrt(30.0) : 0, 1e-12) << k;
}

TEST(IdentifyNoise, FindsTheTermsThatAreThere) {
  const NoiseModel model = identify_noise(simulate(100000, 100, 1e-5, 1e-3, 1e-3, 0, 11), 100);
  EXPECT_TRUE(model.adequate) << model.remark;
  EXPECT_NEAR(model.N.value, 1e-3, 4 * model.N.u);
  EXPECT_NEAR(model.K.value, 1e-3, 4 * model.K.u);
  EXPECT_TRUE(model.N.present);
  EXPECT_TRUE(model.K.present);
  EXPECT_FALSE(model.B.present);
  EXPECT_FALSE(model.R.present);
  EXPECT_LT(model.N.u, 0.005 * model.N.value);
  ASSERT_EQ(model.fitted.size(), model.oadev.tau_s.size());
}

TEST(IdentifyNoise, RampIsATrendWithItsUncertainty) {
  const NoiseModel model = identify_noise(simulate(50000, 100, 0, 1e-3, 0, 2e-5, 12), 100);
  EXPECT_TRUE(model.R.present);
  EXPECT_NEAR(model.R.value, 2e-5, 4 * model.R.u);
  // Straight line through white noise: u = N·√(12/T³), T = 500 s.
  EXPECT_NEAR(model.R.u, 1e-3 * std::sqrt(12 / std::pow(500.0, 3)), 0.3 * model.R.u);
}

TEST(IdentifyNoise, AbsentTermsAreRarelyCalledPresent) {
  int quantization = 0;
  int flicker = 0;
  int walk = 0;
  int ramp = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const NoiseModel model = identify_noise(simulate(4000, 100, 0, 1, 0, 0, seed), 100);
    quantization += model.Q.present ? 1 : 0;
    flicker += model.B.present ? 1 : 0;
    walk += model.K.present ? 1 : 0;
    ramp += model.R.present ? 1 : 0;
  }
  EXPECT_LE(quantization, 6);
  EXPECT_LE(flicker, 6);
  EXPECT_LE(walk, 6);
  EXPECT_LE(ramp, 6);
}

TEST(IdentifyNoise, ScalesWithTheRecord) {
  std::vector<double> record = simulate(20000, 100, 0, 1, 0.5, 0, 5);
  const NoiseModel one = identify_noise(record, 100);
  for (double& y : record) y = 1e-4 * y + 2.5;
  const NoiseModel other = identify_noise(record, 100);
  EXPECT_NEAR(other.N.value, 1e-4 * one.N.value, 1e-3 * other.N.value);
  EXPECT_NEAR(other.K.value, 1e-4 * one.K.value, 1e-2 * other.K.value);
}

TEST(IdentifyNoise, PeriodicLineIsNotNoise) {
  std::vector<double> record = simulate(50000, 100, 0, 0.1, 0, 0, 6);
  for (std::size_t i = 0; i < record.size(); ++i)
    record[i] += 0.3 * std::sin(2 * std::numbers::pi * 0.56 * static_cast<double>(i) / 100);
  const NoiseModel model = identify_noise(record, 100);
  EXPECT_FALSE(model.adequate);
  EXPECT_NE(model.remark.find("periodic line at 0.5"), std::string::npos) << model.remark;
}

TEST(IdentifyNoise, SaysWhenARecordCannotTell) {
  const auto refused = [](const std::vector<double>& record, const std::string& word) {
    const NoiseModel model = identify_noise(record, 100);
    EXPECT_EQ(model.source, "none");
    EXPECT_FALSE(model.adequate);
    EXPECT_NE(model.remark.find(word), std::string::npos) << model.remark;
    EXPECT_EQ(model.N.value, 0);
  };
  refused({1, 2, 3}, "too short");
  refused({}, "too short");
  refused(std::vector<double>(1000, 2.5), "constant");
  std::vector<double> holed(1000, 2.5);
  holed[7] = std::numeric_limits<double>::quiet_NaN();
  refused(holed, "sample 7");
}

TEST(IdentifyNoise, BurstsGiveTheWhiteNoise) {
  SampleTable samples;
  std::vector<Pose> poses;
  std::mt19937_64 engine(3);
  std::normal_distribution<double> unit;
  for (std::size_t p = 0; p < 200; ++p) {
    poses.push_back({.number = static_cast<long long>(p), .first = p * 40, .count = 40});
    for (int i = 0; i < 40; ++i) {
      samples.t_s.push_back(6.4 * static_cast<double>(p) + 0.01 * i);
      samples.u_V[1].push_back(static_cast<double>(p) + 0.1 * unit(engine));
    }
  }
  const NoiseModel model = identify_noise_from_bursts(samples, poses, 1);
  EXPECT_EQ(model.source, "bursts at the poses");
  EXPECT_NEAR(model.rate_hz, 100, 1e-9);
  EXPECT_NEAR(model.N.value, 0.01, 4 * model.N.u);  // 0.1·√(1/100 Hz)
}

TEST(MeanCovariance, HandWorkedDiagonals) {
  // Two windows of 4 samples each, 1 s apart, the second after a pause.
  const auto unit = unit_covariances({{1, 1, 4}, {11, 1, 4}}, 0);
  EXPECT_NEAR(unit[kTermN](0, 0), 1.0 / 4, 1e-15);
  EXPECT_NEAR(unit[kTermQ](0, 0), 2.0 / 16, 1e-15);
  // Walk w1…w4 with unit steps: variance of the mean is (16 + 9 + 4 + 1)/16.
  EXPECT_NEAR(unit[kTermK](0, 0), 30.0 / 16, 1e-14);
  EXPECT_NEAR(unit[kTermK](1, 1), 10 + 30.0 / 16, 1e-14);
  EXPECT_NEAR(unit[kTermK](0, 1), 2.5, 1e-14);
  // Mean of ln|t − s| over one window of width w is ln w − 3/2; five spans are 70 s.
  EXPECT_NEAR(unit[kTermB](0, 0), (std::log(2 * 14.0) - std::log(4.0) + 1.5) / std::numbers::pi,
              1e-12);
}

TEST(MeanCovariance, FlickerAllanVarianceOfNeighbours) {
  // Half the variance of the difference of neighbouring means is the Allan variance 2·ln2/π.
  const auto unit = unit_covariances({{0.01, 0.01, 100}, {1.01, 0.01, 100}}, 0);
  const double avar = 0.5 * (unit[kTermB](0, 0) + unit[kTermB](1, 1)) - unit[kTermB](0, 1);
  EXPECT_NEAR(avar, 2 * std::numbers::ln2 / std::numbers::pi, 1e-12);
}

TEST(MeanCovariance, ClosedFormMeetsItsSeriesFarApart) {
  std::vector<SampleWindow> windows;
  for (int i = 0; i < 400; ++i) windows.push_back({1.0 * i, 0.01, 40});
  const Eigen::MatrixXd flicker = unit_covariances(windows, 0)[kTermB];
  // Smooth through the change of formula at 100 widths (80 s): third differences vanish.
  for (Eigen::Index j = 75; j < 85; ++j)
    EXPECT_NEAR(flicker(0, j + 3) - 3 * flicker(0, j + 2) + 3 * flicker(0, j + 1) - flicker(0, j),
                -2 / std::numbers::pi / std::pow(static_cast<double>(j) + 1.5, 3), 2e-7);
}

TEST(MeanCovariance, PositiveDefinite) {
  NoiseModel model;
  model.N.value = 1e-6;
  model.B.value = 1;
  model.K.value = 0.1;
  std::vector<SampleWindow> windows;
  for (int i = 0; i < 100; ++i) windows.push_back({6.4 * i, 0.01, 40});
  const Eigen::MatrixXd covariance = mean_covariance(model, windows);
  EXPECT_EQ(Eigen::LLT<Eigen::MatrixXd>(covariance).info(), Eigen::Success);
}

TEST(MeanCovariance, RoundingVarianceLimits) {
  EXPECT_NEAR(rounding_variance(2, 0), 4.0 / 12, 1e-15);
  EXPECT_LT(rounding_variance(2, 2), 1e-15);
  // One term is left at σ = step/2: step²/(2π²)·exp(−π²).
  EXPECT_NEAR(rounding_variance(1, 0.5),
              std::exp(-std::numbers::pi * std::numbers::pi) / (2 * std::pow(std::numbers::pi, 2)),
              1e-12);
}

/// A small serpentine run with white noise and random walk.
struct SmallRun {
  Eigen::MatrixXd a;
  Eigen::MatrixXd design;
  Eigen::VectorXd mean;
  std::vector<SampleWindow> windows;
  NoiseModel noise;
};
SmallRun make_run(std::uint64_t seed, double quadratic) {
  constexpr int kTilts = 6;
  constexpr int kTurns = 24;
  constexpr std::size_t kStatic = 10000;
  const std::vector<double> record =
      simulate(kStatic + kTilts * kTurns * 200, 100, 0, 1e-3, 3e-4, 0, seed);
  SmallRun run;
  const int n = kTilts * kTurns;
  run.a.resize(n, 3);
  run.design.resize(n, 4);
  run.mean.resize(n);
  for (int i = 0; i < n; ++i) {
    const int tilt = i / kTurns;
    const int turn = tilt % 2 == 0 ? i % kTurns : kTurns - 1 - i % kTurns;
    const double h = tilt * std::numbers::pi / 12;
    const double delta = turn * 2 * std::numbers::pi / kTurns;
    run.a.row(i) << std::cos(h) * std::cos(delta), -std::cos(h) * std::sin(delta), std::sin(h);
    run.design.row(i) << run.a.row(i), 1;
    const std::size_t first = kStatic + static_cast<std::size_t>(i) * 200;
    double sum = 0;
    for (std::size_t k = 0; k < 40; ++k) sum += record[first + k];
    run.mean(i) = sum / 40 + run.a(i, 0) + quadratic * run.a(i, 0) * run.a(i, 0);
    run.windows.push_back({0.01 * static_cast<double>(first), 0.01, 40});
  }
  run.noise = identify_noise({record.begin(), record.begin() + kStatic}, 100);
  return run;
}

TEST(ResidualTest, QuietOnCleanRuns) {
  int alarms = 0;
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    const SmallRun run = make_run(seed, 0);
    const ResidualTestResult result = test_residual(
        run.noise, {run.mean, run.design, run.a, noise_processes(run.windows), Eigen::VectorXd()});
    EXPECT_TRUE(result.noise.converged);
    alarms += result.p_value < 0.003 ? 1 : 0;
  }
  EXPECT_EQ(alarms, 0);
}

TEST(ResidualTest, FindsAQuadraticAndAWrongPose) {
  const SmallRun bent = make_run(1, 0.01);
  EXPECT_LT(test_residual(bent.noise, {bent.mean, bent.design, bent.a,
                                       noise_processes(bent.windows), Eigen::VectorXd()})
                .p_structure,
            1e-6);
  SmallRun slipped = make_run(1, 0);
  slipped.mean(50) += 0.02;
  EXPECT_LT(test_residual(slipped.noise, {slipped.mean, slipped.design, slipped.a,
                                          noise_processes(slipped.windows), Eigen::VectorXd()})
                .p_outlier,
            1e-6);
}

// While the record was taken something went on that did not in the run, or that its model explains.
TEST(NoisePool, LetsTheRecordKeepSlowNoiseThatTheRunHasNot) {
  const auto record = [](double walk, double wave) {
    std::vector<double> values = simulate(10000, 100, 0, 1e-3, walk, 0, 77);
    for (std::size_t k = 0; k < values.size(); ++k)
      values[k] += wave * std::sin(0.1 * 0.01 * static_cast<double>(k));
    return identify_noise(values, 100);
  };
  int contradicted = 0;
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    const SmallRun run = make_run(seed, 0);
    const NoiseProcesses processes = noise_processes(run.windows);
    const auto pooled = [&](const NoiseModel& noise) {
      return NoisePool(processes, noise, Eigen::VectorXd()).pool(run.mean, run.design);
    };
    const PooledNoise alike = pooled(run.noise), other = pooled(record(3e-4, 0.05)),
                      quieter = pooled(record(0, 0));
    contradicted += alike.record_apart ? 1 : 0;
    EXPECT_TRUE(other.record_apart);
    EXPECT_FALSE(quieter.record_apart) << "what the run has more of may be an effect";
    const auto slow_V2 = [](const PooledNoise& noise) {
      const Eigen::MatrixXd& V = noise.covariance;
      return V.diagonal().mean() - V.mean();
    };
    EXPECT_LT(slow_V2(other), 4 * slow_V2(alike));
  }
  EXPECT_EQ(contradicted, 0);
}

TEST(AllowanceForPowers, OnePowerScalesEverythingAndMovesNothing) {
  const SmallRun run = make_run(1, 0);
  const NoiseProcesses processes = noise_processes(run.windows);
  const Eigen::MatrixXd V = 1e-8 * processes.unit[kTermK] + 1e-8 * processes.unit[kTermN];
  NoiseProcesses one = processes;
  one.unit[kTermK] = V;
  const Eigen::MatrixXd C =
      (run.design.transpose() * V.llt().solve(run.design)).llt().solve(Eigen::Matrix4d::Identity());
  const Eigen::VectorXd power = Eigen::VectorXd::Unit(one.count(), kTermK);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(one.count(), one.count());
  // The power is 1 with a standard deviation of 0.2: 50 degrees of freedom.
  covariance(kTermK, kTermK) = 0.04;
  const PowersAllowance allowance =
      allowance_for_powers(one, {power, covariance, 1e3}, V, run.design, C);
  EXPECT_LT((C * allowance.M * C).norm(), 1e-9 * C.norm());
  EXPECT_LT((with_allowance(C, {allowance}) - C * 50 / 48).norm(), 1e-9 * C.norm());
  const PowersAllowance nothing = allowance_for_powers(one, {}, V, run.design, C);
  EXPECT_EQ(with_allowance(C, {nothing}), C) << "noise that is known needs none";
}

// What is hardly determined makes the expansion to second order as large as it likes.
TEST(AllowanceForPowers, NeverMakesAVarianceNegative) {
  const Eigen::Matrix3d C = Eigen::Vector3d(1, 1e6, 1e-6).asDiagonal();
  for (const double factor : {-1e3, -1.0, 1e3}) {
    const PowersAllowance allowance{factor * C.inverse(), Eigen::Vector3d::Zero()};
    const Eigen::Vector3d ratio =
        with_allowance(C, {allowance}).diagonal().cwiseQuotient(C.diagonal());
    EXPECT_GT(ratio.minCoeff(), 0.05) << factor;
    EXPECT_LT(ratio.maxCoeff(), 2.5) << factor;
  }
}

TEST(AllowanceForPowers, SlowNoiseThatMayNotBeThereCountsAsFarAsItIsLikely) {
  const SmallRun run = make_run(1, 0);
  const NoiseProcesses processes = noise_processes(run.windows);
  Eigen::VectorXd power = Eigen::VectorXd::Zero(processes.count());
  power(kTermN) = power(kTermK) = 1e-8;
  const auto covariance_under = [&](const Eigen::MatrixXd& V) -> Eigen::Matrix4d {
    return (run.design.transpose() * V.llt().solve(run.design))
        .llt()
        .solve(Eigen::Matrix4d::Identity());
  };
  const Eigen::MatrixXd white_V = 1e-8 * processes.unit[kTermN];
  const Eigen::MatrixXd V = white_V + 1e-8 * processes.unit[kTermK];
  const Eigen::Matrix4d C = covariance_under(V);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(power.size(), power.size());
  covariance(kTermN, kTermN) = 1e-20;
  covariance(kTermK, kTermK) = 1e-18;
  const auto variance_at_gain = [&](double gain) {
    return with_allowance(
        C, {allowance_for_powers(processes, {power, covariance, gain}, V, run.design, C)})(2, 2);
  };
  const double white = covariance_under(white_V)(2, 2);
  EXPECT_GT(variance_at_gain(0), white);
  EXPECT_LT(variance_at_gain(0), 0.5 * C(2, 2));
  EXPECT_GT(variance_at_gain(30), C(2, 2));
  // Powers of which next to nothing is known make nothing of the estimates:
  // doubled, and Student's t of three degrees of freedom.
  covariance(kTermK, kTermK) = 1e-10;
  EXPECT_LT(variance_at_gain(30), 6.01 * C(2, 2));
}

// K_z hangs on what changes slowly, and a few slow noise values say little of their own variance.
TEST(AllowanceForPowers, EstimatesScatterAsWidelyAsItSays) {
  constexpr int kRuns = 80;
  double plain = 0, allowed = 0;
  for (std::uint64_t seed = 0; seed < kRuns; ++seed) {
    const SmallRun run = make_run(seed, 0);
    const NoiseProcesses processes = noise_processes(run.windows);
    const NoisePool pool(processes, run.noise, Eigen::VectorXd());
    const PooledNoise noise = pool.pool(run.mean, run.design);
    const Eigen::LLT<Eigen::MatrixXd> factor(noise.covariance);
    const Eigen::Matrix4d C = (run.design.transpose() * factor.solve(run.design))
                                  .llt()
                                  .solve(Eigen::Matrix4d::Identity());
    const Eigen::Vector4d x = C * (run.design.transpose() * factor.solve(run.mean));
    const EstimatedPowers powers =
        pool.estimated(noise, make_projector(noise.covariance, run.design).P, run.mean, run.design);
    const Eigen::Matrix4d with = with_allowance(
        C, {allowance_for_powers(processes, powers, noise.covariance, run.design, C)});
    EXPECT_GT(with.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0);
    plain += x(2) * x(2) / C(2, 2) / kRuns;
    allowed += x(2) * x(2) / with(2, 2) / kRuns;
  }
  EXPECT_GT(plain, allowed);
  EXPECT_NEAR(allowed, 1, 0.35) << "without: " << plain;
}

}  // namespace
}  // namespace plumbline
