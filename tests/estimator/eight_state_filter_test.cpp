#include "estimator/fit/eight_state_filter.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>
#include <random>
#include <utility>

#include "estimator/fit/least_squares.h"
#include "estimator/kinematics.h"

namespace {

std::atomic<long> allocations = 0;

}  // namespace

// Not inlined: beside one inlined and the other not, the compiler sees a pair that does not match.
[[gnu::noinline]] void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace plumbline {
namespace {

NoiseTerm present(double value) { return {value, 0, true, 0}; }

NoiseModel coloured_noise() {
  NoiseModel noise;
  noise.N = present(3e-5);
  noise.B = present(5e-5);
  noise.K = present(4e-6);
  noise.R = present(1e-7);
  return noise;
}

TEST(EightStateFilter, DriftVariancesFollowTheirProcesses) {
  EightStateOptions options;
  options.flicker_correlation_s = 50;
  options.ramp_frequency_rad_s = 1e-4;
  EightStateFilter filter(coloured_noise(), options, 10.0);
  filter.predict(10.0 + 30.0);
  filter.predict(10.0 + 100.0);
  const auto& P = filter.covariance();
  // Random walk: K²t, exactly. Gauss-Markov: stationary, and its largest Allan deviation, 0.6174 of
  // its standard deviation, is the flicker plateau 0.6643·B.
  EXPECT_NEAR(P(kStateRandomWalk, kStateRandomWalk), 16e-12 * 100, 1e-20);
  EXPECT_NEAR(std::sqrt(P(kStateFlicker, kStateFlicker)), 0.66428 * 5e-5 / 0.6174, 1e-9);
  // Ramp: over times short against 1/ω₀ a straight line of slope R from the start.
  EXPECT_NEAR(std::sqrt(P(kStateRamp, kStateRamp)), 1e-7 * 100, 0.02e-5);
}

TEST(EightStateFilter, OneStepEqualsManySteps) {
  EightStateFilter once(coloured_noise(), {}, 0.0);
  EightStateFilter often(coloured_noise(), {}, 0.0);
  once.update({1, 0, 0}, -2.55, 1e-9);
  often.update({1, 0, 0}, -2.55, 1e-9);
  once.predict(1000.0);
  for (const double t_s : {1.0, 1.5, 40.0, 41.0, 500.0, 999.0, 1000.0}) often.predict(t_s);
  EXPECT_LT((once.covariance() - often.covariance()).norm(), 1e-12 * once.covariance().norm());
  const auto tail_once = once.covariance().bottomRightCorner<4, 4>();
  const auto tail_often = often.covariance().bottomRightCorner<4, 4>();
  EXPECT_LT((tail_once - tail_often).norm(), 1e-9 * tail_once.norm());
  EXPECT_LT((once.state() - often.state()).norm(), 1e-12);
}

TEST(EightStateFilter, RampRateIsNotMeasured) {
  EightStateFilter filter(coloured_noise(), {}, 0.0);
  const double before = filter.covariance()(kStateRampRate, kStateRampRate);
  filter.update({1, 0, 0}, -2.5, 1e-9);
  EXPECT_EQ(filter.covariance()(kStateRampRate, kStateRampRate), before);
}

TEST(EightStateFilter, EqualsBatchUnderWhiteNoise) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  NoiseModel white;
  white.N = present(3e-5);
  const double sd_V = 5e-5;
  EightStateFilter filter(white, {}, 0.0);
  Eigen::MatrixXd A(324, 4);
  Eigen::VectorXd b(324);
  for (Eigen::Index row = 0; row < 324; ++row) {
    const double t_s = 3.0 * static_cast<double>(row);
    A.row(row) << specific_force(10.0 * static_cast<double>(row % 36),
                                 10.0 * static_cast<double>(row / 36), 1.0)
                      .a_g.transpose(),
        1.0;
    b(row) = A.row(row).dot(Eigen::Vector4d(0.032, -0.0017, 7e-5, -2.58)) + sd_V * normal(random);
    filter.predict(t_s);
    filter.update(A.row(row).head<3>(), b(row), sd_V * sd_V);
  }
  const LeastSquaresResult batch = solve_least_squares(A / sd_V, b / sd_V);
  const Eigen::Vector4d u = batch.cofactor.diagonal().cwiseSqrt();
  const AxisEstimate estimate = filter.parameters();
  EXPECT_LT((estimate.value - batch.x).cwiseQuotient(u).cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_LT((estimate.covariance - batch.cofactor).norm(), 1e-3 * batch.cofactor.norm());
}

// 200 runs drawn from the filter's own model, parameters from the prior: NEES of the parameters is
// χ² with 4, NIS with 1 degree of freedom; both means must lie in their two-sided 99.9 % bounds.
TEST(EightStateFilter, IsConsistent) {
  constexpr int kRuns = 200;
  constexpr int kPoses = 60;
  constexpr double kWhite_V = 5e-5;
  constexpr double kStep_s = 7.0;
  EightStateOptions options;
  options.prior_sd = {1e-2, 1e-2, 1e-2, 1e-1};
  options.flicker_correlation_s = 40;
  NoiseModel noise = coloured_noise();
  noise.R = {};
  const double flicker_sd = 0.66428 * 5e-5 / 0.6174;
  const double decay = std::exp(-kStep_s / 40.0);

  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  double nees = 0;
  double nis = 0;
  for (int run = 0; run < kRuns; ++run) {
    Eigen::Vector4d truth;
    for (Eigen::Index i = 0; i < 4; ++i) truth(i) = options.prior_sd(i) * normal(random);
    double flicker = flicker_sd * normal(random);
    double walk = 0;
    EightStateFilter filter(noise, options, 0.0);
    for (int pose = 0; pose < kPoses; ++pose) {
      if (pose > 0) {
        flicker = decay * flicker + flicker_sd * std::sqrt(1 - decay * decay) * normal(random);
        walk += 4e-6 * std::sqrt(kStep_s) * normal(random);
      }
      const Eigen::Vector3d a_g = specific_force(70.0 * pose, 13.0 * (pose % 7), 1.0).a_g;
      filter.predict(kStep_s * pose);
      nis += filter
                 .update(a_g,
                         truth.head<3>().dot(a_g) + truth(3) + flicker + walk +
                             kWhite_V * normal(random),
                         kWhite_V * kWhite_V)
                 .nis();
    }
    const AxisEstimate estimate = filter.parameters();
    const Eigen::Vector4d error = estimate.value - truth;
    nees += error.dot(estimate.covariance.ldlt().solve(error));
  }
  // Standard deviation of a mean of n χ²_k is √(2k/n); 3.29 of them are 99.9 %.
  EXPECT_NEAR(nees / kRuns, 4.0, 3.29 * std::sqrt(8.0 / kRuns));
  EXPECT_NEAR(nis / (kRuns * kPoses), 1.0, 3.29 * std::sqrt(2.0 / (kRuns * kPoses)));
}

// The same filter written down plainly: dense matrices, Joseph's form.
TEST(EightStateFilter, EqualsDenseMatricesSampleBySample) {
  const NoiseModel noise = coloured_noise();
  EightStateOptions options;
  options.prior_sd = {1e-2, 1e-2, 1e-2, 1e-1};
  options.flicker_correlation_s = 3;
  options.ramp_frequency_rad_s = 0.2;
  options.parameter_walk = {1e-6, 2e-6, 3e-6, 4e-6};
  EightStateFilter filter(noise, options, 0);
  EightStateFilter::State x = filter.state();
  EightStateFilter::Covariance P = filter.covariance();
  // Of a step, by one over the same time from a known covariance.
  const auto step_of = [&](double dt_s) {
    EightStateFilter fresh(noise, options, 0);
    const EightStateFilter::Covariance before = fresh.covariance();
    fresh.predict(dt_s);
    EightStateFilter::Covariance F = EightStateFilter::Covariance::Identity();
    F(4, 4) = std::exp(-dt_s / 3);
    const double w = 0.2, a = w / std::sqrt(2.0), e = std::exp(-a * dt_s);
    const double c = std::cos(a * dt_s), s = std::sin(a * dt_s);
    F(6, 6) = e * (c + s);
    F(6, 7) = e * s / a;
    F(7, 6) = -w * w * e * s / a;
    F(7, 7) = e * (c - s);
    return std::pair{F,
                     EightStateFilter::Covariance(fresh.covariance() - F * before * F.transpose())};
  };
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  double t_s = 0;
  for (int i = 0; i < 300; ++i) {
    const double dt_s = i % 50 == 0 ? 4.0 : 0.01 * (1 + i % 3);
    t_s += dt_s;
    const Eigen::Vector3d a_g = specific_force(70.0 * (i / 50), 13.0 * (i / 50), 1.0).a_g;
    const double voltage_V = -2.5 + 0.03 * a_g.x() + 1e-4 * normal(random);
    filter.predict(t_s);
    filter.update(a_g, voltage_V, 1e-8);
    const auto [F, Q] = step_of(dt_s);
    x = F * x;
    P = (F * P * F.transpose() + Q).eval();
    EightStateFilter::State h;
    h << a_g, 1, 1, 1, 1, 0;
    const double variance = h.dot(P * h) + 1e-8;
    const EightStateFilter::State gain = P * h / variance;
    x += gain * (voltage_V - h.dot(x));
    const EightStateFilter::Covariance keep =
        EightStateFilter::Covariance::Identity() - gain * h.transpose();
    P = (keep * P * keep.transpose() + 1e-8 * gain * gain.transpose()).eval();
  }
  const EightStateFilter::State sd = P.diagonal().cwiseSqrt();
  EXPECT_LT((filter.state() - x).cwiseQuotient(sd).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((filter.covariance() - P).cwiseQuotient(sd * sd.transpose()).cwiseAbs().maxCoeff(),
            1e-6);
  EXPECT_LT((filter.covariance() - filter.covariance().transpose())
                .cwiseQuotient(sd * sd.transpose())
                .cwiseAbs()
                .maxCoeff(),
            1e-9);
}

TEST(EightStateFilter, AsPrintedForgetsEverythingAtOnce) {
  // Unit noise on the parameters at every step: what four poses said is gone with the fifth.
  EightStateOptions options;
  options.as_printed = true;
  EightStateFilter printed(coloured_noise(), options, 0);
  EightStateFilter corrected(coloured_noise(), {}, 0);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d a_g = specific_force(70.0 * i, 13.0 * (i % 7), 1.0).a_g;
    for (EightStateFilter* filter : {&printed, &corrected}) {
      filter->predict(5.0 * i);
      filter->update(a_g, -2.5 + 0.032 * a_g.x(), 1e-9);
    }
  }
  EXPECT_GT(std::sqrt(printed.parameters().covariance(3, 3)), 0.1);
  EXPECT_LT(std::sqrt(corrected.parameters().covariance(3, 3)), 1e-3);
}

TEST(EightStateFilter, TakesNoMemoryInItsLoop) {
  EightStateFilter filter(coloured_noise(), {}, 0);
  allocations = 0;
  for (int i = 1; i <= 1000; ++i) {
    filter.predict(0.01 * i + 1e-4 * (i % 7));
    filter.update({0.1 * (i % 7), 0.2, 0.5}, 0.1, 1e-8);
  }
  EXPECT_EQ(allocations, 0);
  ::operator delete(::operator new(1));  // the counter counts
  EXPECT_EQ(allocations, 1);
}

}  // namespace
}  // namespace plumbline
