#include "estimator/noise/reml.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cassert>
#include <cmath>

#include "estimator/noise/nonnegative.h"
#include "estimator/noise/term_fit.h"

namespace plumbline {

namespace {

constexpr unsigned kAllTerms = 0b1111;  // Q, N, B, K
constexpr Eigen::Index kVarianceTerms = kTermR;

}  // namespace

Projector make_projector(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& design) {
  const Eigen::LLT<Eigen::MatrixXd> cholesky(covariance);
  assert(cholesky.info() == Eigen::Success);
  const Eigen::Index n = covariance.rows();
  const Eigen::MatrixXd white_design = cholesky.matrixL().solve(design);
  const Eigen::LLT<Eigen::MatrixXd> normal(white_design.transpose() * white_design);
  Projector result;
  const Eigen::MatrixXd inverse = cholesky.solve(Eigen::MatrixXd::Identity(n, n));
  const Eigen::MatrixXd weighted = inverse * design;
  result.P = inverse - weighted * normal.solve(weighted.transpose());
  result.log_determinant = 2 * cholesky.matrixLLT().diagonal().array().log().sum() +
                           2 * normal.matrixLLT().diagonal().array().log().sum();
  return result;
}

struct NoisePool::Point {
  Eigen::Vector4d power = Eigen::Vector4d::Zero();
  double deviance = 0;
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  bool converged = false;
};

NoisePool::NoisePool(const NoiseModel& model, const std::vector<SampleWindow>& windows,
                     const Eigen::VectorXd& mean, const Eigen::MatrixXd& design,
                     const Eigen::VectorXd& extra_variance)
    : model_(model),
      unit_(unit_covariances(windows, model.walk_decay_per_s)),
      mean_(mean),
      design_(design),
      start_(noise_powers(model)) {
  assert(mean.size() == design.rows() && mean.size() > design.cols());
  assert(extra_variance.size() == 0 || extra_variance.size() == mean.size());
  start_(kTermR) = 0;
  known_ = Eigen::MatrixXd::Zero(mean.size(), mean.size());
  if (extra_variance.size() > 0) known_.diagonal() += extra_variance;
  known_.diagonal().array() += shared_rounding_variance(model);
  pooled_ = pool();
}

Eigen::MatrixXd NoisePool::covariance(const NoisePowers& power) const {
  Eigen::MatrixXd sum = known_;
  for (Eigen::Index i = 0; i < kVarianceTerms; ++i)
    if (power(i) > 0) sum += power(i) * unit_[static_cast<std::size_t>(i)];
  return sum;
}

NoisePool::Point NoisePool::evaluate(const Eigen::Vector4d& power) const {
  Point point;
  point.power = power;
  if (!model_.spectrum.empty()) {
    const Likelihood record = spectrum_likelihood(model_.spectrum, power);
    point.deviance += record.deviance;
    point.normal += record.normal;
    point.right += record.right;
  }
  NoisePowers powers = start_;
  powers.head<kVarianceTerms>() = power;
  const Projector projector = make_projector(covariance(powers), design_);
  const Eigen::VectorXd py = projector.P * mean_;
  point.deviance += projector.log_determinant + mean_.dot(py);
  // The average information (Gilmour, Thompson & Cullis, 1995) has the expected one's mean and
  // costs products with vectors only.
  Eigen::Matrix<double, Eigen::Dynamic, kVarianceTerms> seen(mean_.size(), kVarianceTerms);
  Eigen::Vector4d score;
  for (Eigen::Index i = 0; i < kVarianceTerms; ++i) {
    const Eigen::MatrixXd& unit = unit_[static_cast<std::size_t>(i)];
    seen.col(i) = unit * py;
    score(i) = py.dot(seen.col(i)) - projector.P.cwiseProduct(unit).sum();
  }
  const Eigen::Matrix4d normal = seen.transpose() * projector.P * seen;
  point.normal += normal;
  point.right += normal * power + score;
  return point;
}

Eigen::Matrix4d NoisePool::expected_information(const Eigen::Vector4d& power) const {
  NoisePowers powers = start_;
  powers.head<kVarianceTerms>() = power;
  const Eigen::MatrixXd P = make_projector(covariance(powers), design_).P;
  std::array<Eigen::MatrixXd, kVarianceTerms> pc;
  for (std::size_t i = 0; i < kVarianceTerms; ++i) {
    // Quantization is nearly diagonal: windows that touch share a little.
    if (i == kTermB || i == kTermK)
      pc[i].noalias() = P * unit_[i];
    else
      pc[i] = P * unit_[i].diagonal().asDiagonal();
  }
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  if (!model_.spectrum.empty()) normal = spectrum_likelihood(model_.spectrum, power).normal;
  for (std::size_t i = 0; i < kVarianceTerms; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      const double value = pc[i].cwiseProduct(pc[j].transpose()).sum();
      const auto a = static_cast<Eigen::Index>(i);
      const auto b = static_cast<Eigen::Index>(j);
      normal(a, b) += value;
      if (a != b) normal(b, a) += value;
    }
  }
  return 0.5 * normal;
}

NoisePool::Point NoisePool::maximise(const Eigen::Vector4d& start, unsigned free) const {
  constexpr int kIterations = 40;
  constexpr double kEnough = 1e-2;  // of −2 ln L: far below anything a test can feel
  Eigen::Vector4d fixed = start;
  for (int i = 0; i < 4; ++i)
    if ((free >> i & 1U) != 0) fixed(i) = 0;
  Point now = evaluate(start);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const Eigen::Vector4d target =
        fixed + nonnegative_solution(now.normal, now.right - now.normal * fixed, free);
    Point next;
    bool better = false;
    for (int quartering = 0; quartering < 5 && !better; ++quartering) {
      const double step = std::ldexp(1.0, -2 * quartering);
      const Eigen::Vector4d candidate = now.power + step * (target - now.power);
      if (!(candidate(kTermQ) + candidate(kTermN) > 0)) continue;  // Σ would be singular
      next = evaluate(candidate);
      better = next.deviance <= now.deviance;
    }
    if (!better) {
      now.converged = true;  // no descent left but rounding
      return now;
    }
    const double gained = now.deviance - next.deviance;
    now = next;
    if (gained < kEnough) {
      now.converged = true;
      return now;
    }
  }
  return now;
}

PooledNoise NoisePool::pool() const {
  Eigen::Vector4d start = start_.head<kVarianceTerms>();
  // A term that the record puts at zero starts at one per cent of the white variance of the means.
  const Eigen::Index middle = mean_.size() / 2;
  const double white = start(kTermN) * unit_[kTermN](middle, middle);
  if (!(start(kTermB) > 0)) start(kTermB) = 0.01 * white;
  if (!(start(kTermK) > 0)) start(kTermK) = 0.01 * white / unit_[kTermK](middle, middle);
  // The means cannot tell quantization from white noise: without a record it stays at zero.
  const unsigned free = model_.spectrum.size() > 4 ? kAllTerms : kAllTerms & ~1U;
  const Point best = maximise(start, free);
  PooledNoise result;
  result.power = start_;
  result.power.head<kVarianceTerms>() = best.power;
  result.walk_decay_per_s = model_.walk_decay_per_s;
  result.covariance = covariance(result.power);
  result.deviance = best.deviance;
  result.converged = best.converged;
  return result;
}

PooledNoise NoisePool::pooled_with_information() const {
  PooledNoise result = pooled_;
  result.information.topLeftCorner<kVarianceTerms, kVarianceTerms>() =
      expected_information(result.power.head<kVarianceTerms>());
  return result;
}

NoiseModel NoisePool::model() const {
  NoiseModel result = model_;
  result.Q.value = std::sqrt(pooled_.power(kTermQ));
  result.N.value = std::sqrt(pooled_.power(kTermN));
  result.B.value = std::sqrt(pooled_.power(kTermB));
  result.K.value = std::sqrt(pooled_.power(kTermK));
  return result;
}

NoisePool best_pool(const NoiseModel& model, const std::vector<SampleWindow>& windows,
                    const Eigen::VectorXd& mean, const Eigen::MatrixXd& design,
                    const Eigen::VectorXd& extra_variance) {
  const std::vector<SpectrumDescription>& descriptions = model.descriptions;
  if (descriptions.empty()) return {model, windows, mean, design, extra_variance};
  const auto pool_at = [&](std::size_t index, NoiseModel start) {
    start.walk_decay_per_s = descriptions[index].walk_decay_per_s;
    start.spectrum = descriptions[index].bins;
    return NoisePool(start, windows, mean, design, extra_variance);
  };
  // Downhill from the record's own favourite; longer correlation times come first, since the run is
  // what sees them.
  const auto favourite =
      std::min_element(descriptions.begin(), descriptions.end(),
                       [](const auto& a, const auto& b) { return a.deviance < b.deviance; });
  auto best = static_cast<std::size_t>(favourite - descriptions.begin());
  NoiseModel first = model;
  first.Q.value = std::sqrt(favourite->power(kTermQ));
  first.N.value = std::sqrt(favourite->power(kTermN));
  first.B.value = std::sqrt(favourite->power(kTermB));
  first.K.value = std::sqrt(favourite->power(kTermK));
  NoisePool pool = pool_at(best, first);
  const auto descend = [&](auto next) {
    bool moved = false;
    for (std::size_t index = next(best); index < descriptions.size(); index = next(index)) {
      // Powers change little from one correlation time to the next: a good place to start.
      NoiseModel start = pool.model();
      const double before = descriptions[best].power(kTermK);
      if (before > 0) start.K.value *= std::sqrt(descriptions[index].power(kTermK) / before);
      NoisePool candidate = pool_at(index, start);
      if (candidate.pooled().deviance >= pool.pooled().deviance) break;
      pool = std::move(candidate);
      best = index;
      moved = true;
    }
    return moved;
  };
  if (!descend([](std::size_t i) { return i - 1; })) descend([](std::size_t i) { return i + 1; });
  return pool;
}

}  // namespace plumbline
