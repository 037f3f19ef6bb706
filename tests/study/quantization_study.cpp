#include "tests/study/quantization_study.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <vector>

#include "estimator/fit/least_squares.h"
#include "estimator/fit/rounding.h"
#include "estimator/parallel_for.h"
#include "estimator/quantization/quantized_axis.h"

namespace plumbline::study {
namespace {

constexpr double kRadians = std::numbers::pi / 180;
constexpr double kStep_mps2 = 0.374;
constexpr double kStepsPerG = kStandardGravity_mps2 / kStep_mps2;
constexpr Eigen::Index kPoses = 324;
// A step of 1 V, so that volts are steps.
constexpr Adc kAdc{12, -2048, 2048};

Eigen::Vector4d row_at(double delta_rad, double h_rad) {
  return {std::cos(h_rad) * std::cos(delta_rad), -std::cos(h_rad) * std::sin(delta_rad),
          std::sin(h_rad), 1};
}

/// What one trial measures.
struct Trial {
  Eigen::Vector4d truth;
  Eigen::MatrixXd A{kPoses, 4};
  MeasurementSet run;
  Eigen::VectorXd mean_V{kPoses};
  double sample_sd_V = 0;
};

Trial simulate(const CodeCase& c, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1, 1);
  Trial trial;
  trial.truth = {kStepsPerG * (1 + 0.01 * normal(random)), 0.05 * kStepsPerG * normal(random),
                 0.03 * kStepsPerG * normal(random), 30 * uniform(random)};
  std::map<int, double> boundary;  // below the code, as an error in steps
  const auto moved = [&](int code) {
    const auto it = boundary.find(code);
    if (it != boundary.end()) return it->second;
    return boundary.emplace(code, c.nonlinearity * uniform(random)).first->second;
  };
  std::vector<double>& u_V = trial.run.samples.u_V[0];
  double square = 0;
  for (Eigen::Index k = 0; k < kPoses; ++k) {
    const double delta_deg = 10.0 * static_cast<double>(k % 36);
    const double h_deg = 10.0 * static_cast<double>(k / 36);
    const double u_rad = c.positioning_arcsec / 3600 * kRadians;
    const Eigen::Vector4d at = row_at(kRadians * delta_deg + u_rad * normal(random),
                                      kRadians * h_deg + u_rad * normal(random));
    const double exact = at.dot(trial.truth);
    trial.run.poses.push_back(
        {k, delta_deg, h_deg, u_V.size(), static_cast<std::size_t>(c.readings)});
    double sum = 0, sum_square = 0;
    for (int i = 0; i < c.readings; ++i) {
      const double u = exact + c.sigma * normal(random);
      int code = static_cast<int>(std::floor(u + 0.5));
      if (c.nonlinearity > 0) {
        while (u < code - 0.5 + moved(code)) --code;
        while (u >= code + 0.5 + moved(code + 1)) ++code;
      }
      u_V.push_back(code);
      sum += code;
      sum_square += static_cast<double>(code) * code;
    }
    trial.A.row(k) = row_at(kRadians * delta_deg, kRadians * h_deg);
    trial.mean_V(k) = sum / c.readings;
    square += sum_square - sum * sum / c.readings;
  }
  trial.run.samples.t_s.resize(u_V.size());
  const double dof = static_cast<double>(u_V.size()) - kPoses;
  if (dof > 0) {
    trial.sample_sd_V = std::sqrt(square / dof);
  } else {
    const LeastSquaresResult fit = solve_least_squares(trial.A, trial.mean_V);
    trial.sample_sd_V =
        std::sqrt(fit.residual_sum_of_squares / static_cast<double>(fit.degrees_of_freedom));
  }
  return trial;
}

struct Estimate {
  Eigen::Vector4d value;
  Eigen::Matrix4d covariance;
};

Estimate weighted(const Eigen::MatrixXd& A, const Eigen::VectorXd& y, const Eigen::VectorXd& v) {
  const Eigen::VectorXd w = v.cwiseSqrt().cwiseInverse();
  const LeastSquaresResult fit = solve_least_squares(w.asDiagonal() * A, w.cwiseProduct(y));
  return {fit.x, fit.cofactor};
}

struct TrialErrors {
  double least_squares = 0, first_order = 0, chosen = 0;  ///< squares, (mm/s²)²
  double covered = 0;
  double sigma = 0;
};

TrialErrors estimate(const CodeCase& c, std::uint64_t seed) {
  const Trial trial = simulate(c, seed);
  const auto square = [&](const Eigen::Vector4d& value) {
    const Eigen::Vector4d e = (value - trial.truth) * kStep_mps2 * 1e3;
    return e.head<3>().squaredNorm() / 3 + e(3) * e(3);
  };
  TrialErrors errors;
  const LeastSquaresResult plain = solve_least_squares(trial.A, trial.mean_V);
  errors.least_squares = square(plain.x);

  Estimate first{plain.x, plain.cofactor};
  for (int round = 0; round < 3; ++round) {
    const RoundingFree free =
        free_of_rounding(trial.mean_V, trial.A * first.value, scale_of(kAdc), trial.sample_sd_V,
                         Eigen::VectorXd::Constant(kPoses, c.readings));
    const double white_V2 = trial.sample_sd_V * trial.sample_sd_V / c.readings;
    first = weighted(trial.A, free.mean_V,
                     free.coarse ? free.variance_V2 : Eigen::VectorXd::Constant(kPoses, white_V2));
  }
  errors.first_order = square(first.value);

  const double variance_V2 =
      plain.residual_sum_of_squares / static_cast<double>(plain.degrees_of_freedom);
  Estimate chosen{plain.x, variance_V2 * plain.cofactor};
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(kPoses);
  if (const auto codes = quantized_axis(trial.run, trial.A, none, none, scale_of(kAdc), 0)) {
    chosen = weighted(trial.A, codes->mean_V, codes->variance_V2);
    errors.sigma = codes->use.sigma_V;
  }
  errors.chosen = square(chosen.value);
  for (Eigen::Index j = 0; j < 4; ++j) {
    const double off = std::abs(chosen.value(j) - trial.truth(j));
    errors.covered += off <= 1.96 * std::sqrt(chosen.covariance(j, j)) ? 0.25 : 0;
  }
  return errors;
}

}  // namespace

std::string to_string(const CodeCase& c) {
  std::string text = fmt::format("{} steps, {} readings", c.sigma, c.readings);
  if (c.positioning_arcsec > 0) text += fmt::format(", {}″ positioning", c.positioning_arcsec);
  if (c.nonlinearity > 0) text += fmt::format(", {} step uneven", c.nonlinearity);
  return text;
}

CodeErrors study_codes(const CodeCase& c, int trials, std::uint64_t first_seed) {
  const auto count = static_cast<std::size_t>(trials);
  std::vector<TrialErrors> all(count);
  parallel_for(count, [&](std::size_t i) { all[i] = estimate(c, first_seed + i); });
  TrialErrors sum;
  for (const TrialErrors& one : all) {
    sum.least_squares += one.least_squares / trials;
    sum.first_order += one.first_order / trials;
    sum.chosen += one.chosen / trials;
    sum.covered += one.covered / trials;
    sum.sigma += one.sigma / trials;
  }
  return {std::sqrt(sum.least_squares), std::sqrt(sum.first_order), std::sqrt(sum.chosen),
          sum.covered, sum.sigma};
}

}  // namespace plumbline::study
