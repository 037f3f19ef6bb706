#include "estimator/diagnosis/enlarged_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "estimator/effects/driver.h"
#include "estimator/effects/function_of_driver.h"
#include "tests/estimator/synthetic_run.h"

namespace plumbline {
namespace {

// White noise of 0.1 mV in every mean.
PoseWhitening white_noise(const VisitLog& log) {
  PoseWhitening whitening;
  const auto n = std::ssize(log.visits);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    whitening.set(i, 1e-8 * Eigen::MatrixXd::Identity(n, n));
    whitening.dwell_sd_V[i] = Eigen::VectorXd::Ones(log.dwell_contrasts());
  }
  return whitening;
}

EnlargedParameters truth_of(const SyntheticRun& data) {
  EnlargedParameters truth;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    truth.twelve[i] = Eigen::Map<const Eigen::Vector4d>(data.truth[i].data());
  return truth;
}

// Two waves of the x axis in the time, of so many cycles in the run each, fitted with their periods
// held to readings that hold the sum of two waves of 3 and of 5 cycles.
EnlargedFit fit_of_two_waves(double cycles, double other_cycles, const FitLimits& limits = {}) {
  SyntheticRun data = synthetic_run(3, kSixteenBits);
  const VisitLog log = make_visit_log(data.run, data.description);
  Observations observed = observe(data.run, log);
  std::shared_ptr<const Driver> clock;
  for (Driver& driver : instantaneous_drivers(log))
    if (driver.is_clock()) clock = shared(std::move(driver));
  const std::vector<double>& t_s = clock->value[0];
  const double span_s = t_s.back() - t_s.front();
  for (Eigen::Index k = 0; k < observed.mean_V[0].size(); ++k) {
    const double turn = 2 * std::numbers::pi * t_s[static_cast<std::size_t>(k)] / span_s;
    observed.mean_V[0](k) += 1e-3 * (std::sin(3 * turn) + std::sin(5 * turn));
  }
  const auto wave_in_time = wave(clock, {TermForm::bias}, {1.5, 0.5, 40});
  EnlargedParameters start = truth_of(data);
  for (const double each : {cycles, other_cycles})
    start = with_effect(
        std::move(start),
        with_shapes_held(activate(*wave_in_time, 0, {{t_s.front(), span_s / each, 1e-3, 1e-3}})));
  return fit_enlarged(log, observed, white_noise(log), start, limits);
}

TEST(EnlargedFit, IsGivenUpWhereItStaysFarAboveWhatIsOfInterest) {
  const EnlargedFit of_both = fit_of_two_waves(3, 5);
  const FitLimits limits{.chi2_of_interest = of_both.chi2 + 1};
  EXPECT_EQ(fit_of_two_waves(3, 5, limits).chi2, of_both.chi2);
  const EnlargedFit of_one = fit_of_two_waves(4, 5, limits);
  EXPECT_TRUE(of_one.given_up);
  EXPECT_FALSE(of_one.determined);
}

TEST(EnlargedFit, IsNotDeterminedWhereEffectsAreLargeDifferencesOfEachOther) {
  EXPECT_TRUE(fit_of_two_waves(3, 5).determined);
  EXPECT_TRUE(fit_of_two_waves(4, 5).determined);
  // Of next to the same period they make a wave that swells, each many times what both are.
  const EnlargedFit fit = fit_of_two_waves(4, 4.01);
  EXPECT_GT(std::hypot(fit.parameters.effects[0].p[2], fit.parameters.effects[0].p[3]), 0.01);
  EXPECT_FALSE(fit.determined);
}

// A fifth power that was a cube and a polynomial at once made a sensitivity of its axis that grew
// fit by fit, to five million times what it was.
TEST(EnlargedFit, IsNotDeterminedWhereASensitivityIsFarFromWhatAnyWas) {
  const SyntheticRun data = synthetic_run(3, kSixteenBits);
  const VisitLog log = make_visit_log(data.run, data.description);
  const Observations observed = observe(data.run, log);
  const auto fit_from = [&](double share_of_K_yy, double share_of_others) {
    EnlargedParameters start = truth_of(data);
    for (Eigen::Index i = 0; i < 3; ++i)
      start.twelve[static_cast<std::size_t>(i)](i) *= i == 1 ? share_of_K_yy : share_of_others;
    return fit_enlarged(log, observed, white_noise(log), start);
  };
  EXPECT_TRUE(fit_from(0.8, 0.8).determined);
  EXPECT_FALSE(fit_from(0.4, 0.4).determined);
  // The axes of a triad are alike: what one comes back to is no unlikely size.
  EXPECT_TRUE(fit_from(0.4, 1).determined);
}

}  // namespace
}  // namespace plumbline
