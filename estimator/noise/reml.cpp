#include "estimator/noise/reml.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>

#include "estimator/linear_algebra.h"
#include "estimator/noise/nonnegative.h"
#include "estimator/noise/powers_posterior.h"
#include "estimator/noise/square.h"

namespace plumbline {

namespace {

// By so much, of −2 ln L, must record and run be likelier with slow noise of their own each.
constexpr double kPriceOfApart = 8;

/// Looks at the lower triangle only.
bool has_diagonal_only(const Eigen::MatrixXd& covariance) {
  for (Eigen::Index column = 0; column < covariance.cols(); ++column)
    if ((covariance.col(column).tail(covariance.rows() - column - 1).array() != 0).any())
      return false;
  return true;
}

}  // namespace

Projector make_projector(Eigen::MatrixXd covariance, const Eigen::MatrixXd& design) {
  Projector result;
  Eigen::MatrixXd white_design;
  if (has_diagonal_only(covariance)) {
    const Eigen::VectorXd variance = covariance.diagonal();
    result.log_determinant = variance.array().log().sum();
    white_design = variance.cwiseSqrt().cwiseInverse().asDiagonal() * design;
    result.P = variance.cwiseInverse().asDiagonal();
  } else {
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> cholesky(covariance);
    assert(cholesky.info() == Eigen::Success);
    result.log_determinant = 2 * covariance.diagonal().array().log().sum();
    white_design = cholesky.matrixL().solve(design);
    result.P = inverse_from_factor(std::move(covariance));
  }
  const Eigen::LLT<Eigen::MatrixXd> normal(white_design.transpose() * white_design);
  result.log_determinant_of_design = 2 * normal.matrixLLT().diagonal().array().log().sum();
  result.log_determinant += result.log_determinant_of_design;
  const Eigen::MatrixXd weighted = result.P * design;
  result.P.noalias() -= weighted * normal.solve(weighted.transpose());
  return result;
}

/// What the unit covariances do to P·y and P.
struct NoisePool::Seen {
  Eigen::MatrixXd unit_times_py;  ///< one column per process
  Eigen::VectorXd trace;          ///< of P times the unit covariance
};

/// Where a search for the powers stands. `normal` and `right` give the scoring step: the powers
/// that solve normal·power = right are the next estimate, and normal/2 is the information.
struct NoisePool::Point {
  Eigen::VectorXd power;
  double deviance = 0;
  double likelihood_deviance = 0;
  Eigen::MatrixXd normal;
  Eigen::VectorXd right;
  /// Of χ², what the run shows of each process and what its power makes expect.
  Eigen::VectorXd seen = {}, expected = {};
};

/// Where a search ended.
struct NoisePool::Climb {
  Point top;
  bool converged = false;
};

NoisePool::NoisePool(const NoiseProcesses& processes, const NoiseModel& model,
                     const Eigen::VectorXd& extra_variance)
    : processes_(&processes), model_(model) {
  const Eigen::Index n = processes.unit.front().rows();
  assert(extra_variance.size() == 0 || extra_variance.size() == n);
  known_V2_ = Eigen::VectorXd::Zero(n);
  if (extra_variance.size() > 0) known_V2_ = extra_variance;
  own_noise_ = known_V2_.minCoeff() > 0;

  if (model.descriptions.empty() || model.descriptions.front().bins.size() < 4) return;
  // The record was described by walks that forget at different rates; each process takes the
  // nearest of them. One that remembers for longer than the record lasts looks like a walk there.
  const auto& descriptions = model.descriptions;
  const auto bins = std::ssize(descriptions.front().bins);
  Eigen::MatrixXd& densities = record_.shared;
  densities.setZero(bins, processes.count());
  const auto density = [&](std::size_t description, Eigen::Index bin) -> const Eigen::Vector4d& {
    return descriptions[description].bins[static_cast<std::size_t>(bin)].density;
  };
  for (Eigen::Index bin = 0; bin < bins; ++bin)
    densities.row(bin).head<NoiseProcesses::kFirstMarkov>() = density(0, bin).transpose();
  for (std::size_t m = 0; m < processes.decay_per_s.size(); ++m) {
    std::size_t nearest = 0;
    double distance = std::log(2.0);  // beyond the slowest by more than this: a walk
    for (std::size_t d = 1; d < descriptions.size(); ++d) {
      const double away =
          std::abs(std::log(descriptions[d].walk_decay_per_s / processes.decay_per_s[m]));
      const bool fastest_of_all = d + 1 == descriptions.size() &&
                                  processes.decay_per_s[m] > descriptions[d].walk_decay_per_s;
      if (away < distance || fastest_of_all) {
        distance = away;
        nearest = d;
      }
    }
    const Eigen::Index column = NoiseProcesses::kFirstMarkov + static_cast<Eigen::Index>(m);
    // The nearest rate is off by a factor of √2 at most; the level at low frequencies must fit.
    const double level =
        nearest == 0 ? 1
                     : square(descriptions[nearest].walk_decay_per_s / processes.decay_per_s[m]);
    for (Eigen::Index bin = 0; bin < bins; ++bin) {
      const double same_rate = density(nearest, bin)(kTermK);
      densities(bin, column) =
          std::min(level * same_rate, density(0, bin)(kTermK));  // no process exceeds the walk
    }
  }
  for (std::size_t r = 0; r < processes.bend_rad_per_s.size(); ++r) {
    const double bend4 = square(square(processes.bend_rad_per_s[r]));
    for (Eigen::Index bin = 0; bin < bins; ++bin) {
      const SpectrumBin& of_walk = descriptions.front().bins[static_cast<std::size_t>(bin)];
      const double omega2 = square(2 * std::numbers::pi * of_walk.frequency_hz);
      densities(bin, processes.first_smooth() + static_cast<Eigen::Index>(r)) =
          of_walk.density(kTermK) * omega2 / (square(omega2) + bend4);
    }
  }
  record_.own.resize(bins);
  for (Eigen::Index bin = 0; bin < bins; ++bin)
    record_.own(bin) = descriptions.front().bins[static_cast<std::size_t>(bin)].known;
  record_apart_ = apart();
}

NoisePool::Climb NoisePool::climb_of_record() const {
  // Its lines were taken out of the record.
  std::vector<bool> free = free_powers();
  std::fill(free.begin() + processes_->first_band(), free.end(), false);
  Eigen::VectorXd first = starting_powers();
  first.tail(std::ssize(processes_->bands)).setZero();
  return climb(first, free,
               [this](const Eigen::VectorXd& power) { return record_at(power, record_); });
}

double NoisePool::deviance_of_record() const {
  return record_.shared.size() > 0 ? climb_of_record().top.deviance : 0;
}

NoisePool::Record NoisePool::apart() const {
  const Eigen::VectorXd power = climb_of_record().top.power;
  Record apart = record_;
  apart.price = kPriceOfApart;
  for (const Eigen::Index i : processes_->walks()) {
    apart.own += record_.shared.col(i) * power(i);
    apart.shared.col(i).setZero();
  }
  return apart;
}

Eigen::MatrixXd NoisePool::lower_covariance(const Eigen::VectorXd& power) const {
  const Eigen::Index n = known_V2_.size();
  Eigen::MatrixXd sum = known_V2_.asDiagonal();
  std::vector<Eigen::Index> slow;
  for (Eigen::Index i = 0; i < power.size(); ++i) {
    if (!(power(i) > 0)) continue;
    if (processes_->is_diagonal[static_cast<std::size_t>(i)])
      sum.diagonal() += power(i) * processes_->unit[static_cast<std::size_t>(i)].diagonal();
    else
      slow.push_back(i);
  }
  for (Eigen::Index column = 0; column < n; ++column)
    for (const Eigen::Index i : slow)
      sum.col(column).tail(n - column) +=
          power(i) * processes_->unit[static_cast<std::size_t>(i)].col(column).tail(n - column);
  return sum;
}

Eigen::MatrixXd NoisePool::covariance(const Eigen::VectorXd& power) const {
  Eigen::MatrixXd sum = lower_covariance(power);
  sum.triangularView<Eigen::StrictlyUpper>() = sum.transpose();
  return sum;
}

NoisePool::Point NoisePool::record_at(const Eigen::VectorXd& power, const Record& record) const {
  const Eigen::Index count = processes_->count();
  Point point{.power = power,
              .deviance = record.price,
              .normal = Eigen::MatrixXd::Zero(count, count),
              .right = Eigen::VectorXd::Zero(count)};
  if (record.shared.size() == 0) return point;
  const std::vector<SpectrumBin>& bins = model_.descriptions.front().bins;
  const Eigen::VectorXd variance = record.shared * power + record.own;
  // The straight line is profiled out; what is left of it gives back one degree of freedom.
  double cross = 0, ramp = 0;
  for (Eigen::Index j = 0; j < variance.size(); ++j) {
    cross += bins[static_cast<std::size_t>(j)].cross / variance(j);
    ramp += bins[static_cast<std::size_t>(j)].ramp / variance(j);
  }
  const double slope = ramp > 0 ? cross / ramp : 0;
  const double slope_variance = ramp > 0 ? 1 / ramp : 0;
  if (ramp > 0) point.deviance += std::log(ramp);
  Eigen::VectorXd weight(variance.size()), mixed(variance.size()), single(variance.size()),
      excess(variance.size());
  for (Eigen::Index j = 0; j < variance.size(); ++j) {
    const SpectrumBin& bin = bins[static_cast<std::size_t>(j)];
    const double square_left =
        std::max(0.0, bin.square - slope * (2 * bin.cross - slope * bin.ramp));
    point.deviance += bin.count * std::log(variance(j)) + square_left / variance(j);
    const double inverse = 1 / square(variance(j));
    weight(j) = bin.count * inverse;
    mixed(j) = bin.ramp * inverse / variance(j);
    single(j) = bin.ramp * inverse;
    excess(j) = inverse * (square_left + slope_variance * bin.ramp - bin.count * variance(j));
  }
  const Eigen::MatrixXd& shared = record.shared;
  const Eigen::VectorXd once = shared.transpose() * single;
  const Eigen::MatrixXd normal =
      shared.transpose() * (weight - 2 * slope_variance * mixed).asDiagonal() * shared +
      square(slope_variance) * once * once.transpose();
  point.normal += normal;
  point.right += shared.transpose() * excess + normal * power;
  return point;
}

NoisePool::Point NoisePool::evaluate(const Eigen::VectorXd& power, const Eigen::VectorXd& mean,
                                     const Eigen::MatrixXd& design, const Record& record) const {
  const Projector projector = make_projector(lower_covariance(power), design);
  const Eigen::VectorXd py = projector.P * mean;
  Point point = scoring_step(power, projector.P, py, record);
  point.deviance += projector.log_determinant + mean.dot(py);
  point.likelihood_deviance = point.deviance - projector.log_determinant_of_design;
  return point;
}

NoisePool::Point NoisePool::scoring_step(const Eigen::VectorXd& power, const Eigen::MatrixXd& P,
                                         const Eigen::VectorXd& py, const Record& record) const {
  Point point = record_at(power, record);
  // The average information (Gilmour, Thompson & Cullis, 1995) has the expected one's mean and
  // costs products with vectors only.
  const Seen seen = see(P, py);
  const Eigen::VectorXd square = seen.unit_times_py.transpose() * py;
  const Eigen::MatrixXd normal = seen.unit_times_py.transpose() * (P * seen.unit_times_py);
  point.normal += normal;
  point.right += normal * power + square - seen.trace;
  point.seen = power.cwiseProduct(square);
  point.expected = power.cwiseProduct(seen.trace);
  return point;
}

// The matrices are large and the arithmetic on them little: memory decides, so each lower triangle
// is gone through once for both.
NoisePool::Seen NoisePool::see(const Eigen::MatrixXd& P, const Eigen::VectorXd& py) const {
  const Eigen::Index n = py.size(), count = processes_->count();
  Seen seen{Eigen::MatrixXd::Zero(n, count), Eigen::VectorXd::Zero(count)};
  for (Eigen::Index column = 0; column < n; ++column) {
    const Eigen::Index below = n - column - 1;
    for (Eigen::Index i = 0; i < count; ++i) {
      const auto index = static_cast<std::size_t>(i);
      const auto unit = processes_->unit[index].col(column);
      seen.unit_times_py(column, i) += unit(column) * py(column);
      seen.trace(i) += unit(column) * P(column, column);
      if (processes_->is_diagonal[index]) continue;
      seen.unit_times_py(column, i) += unit.tail(below).dot(py.tail(below));
      seen.unit_times_py.col(i).tail(below) += py(column) * unit.tail(below);
      seen.trace(i) += 2 * unit.tail(below).dot(P.col(column).tail(below));
    }
  }
  return seen;
}

Eigen::MatrixXd NoisePool::information_of(const PooledNoise& noise, const Eigen::MatrixXd& P,
                                          const std::vector<Eigen::Index>& wanted) const {
  std::vector<Eigen::MatrixXd> seen;
  for (const Eigen::Index i : wanted) {
    const auto index = static_cast<std::size_t>(i);
    const Eigen::MatrixXd& unit = processes_->unit[index];
    if (processes_->is_diagonal[index])
      seen.emplace_back(P * unit.diagonal().asDiagonal());
    else
      seen.emplace_back(P * unit);
  }
  Eigen::MatrixXd information = record_at(noise.power, record_for(noise)).normal(wanted, wanted);
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      const auto row = static_cast<Eigen::Index>(i), column = static_cast<Eigen::Index>(j);
      information(row, column) += seen[i].cwiseProduct(seen[j].transpose()).sum();
      information(column, row) = information(row, column);
    }
  }
  return 0.5 * information;
}

EstimatedPowers NoisePool::estimated(const PooledNoise& found, const Eigen::MatrixXd& P,
                                     const Eigen::VectorXd& mean,
                                     const Eigen::MatrixXd& design) const {
  Point point = scoring_step(found.power, P, P * mean, record_for(found));
  if (!quantization_is_free()) {
    point.normal.row(kTermQ).setZero();
    point.normal.col(kTermQ).setZero();
  }
  return {found.power, covariance_of_powers(0.5 * point.normal, 0.5 * point.right),
          gain_of_slow_noise(found, mean, design)};
}

Eigen::VectorXd NoisePool::starting_powers() const {
  Eigen::VectorXd power = Eigen::VectorXd::Zero(processes_->count());
  power.head<NoiseProcesses::kFirstMarkov>() =
      noise_powers(model_).head<NoiseProcesses::kFirstMarkov>();
  // A process that the record puts at zero starts at one per cent of the white variance.
  const Eigen::Index middle = known_V2_.size() / 2;
  const auto variance = [&](Eigen::Index i) {
    return processes_->unit[static_cast<std::size_t>(i)](middle, middle);
  };
  const double white = power(kTermN) * variance(kTermN) + known_V2_(middle);
  for (Eigen::Index i = kTermB; i < power.size(); ++i)
    if (!(power(i) > 0)) power(i) = 0.01 * white / variance(i);
  return power;
}

PooledNoise NoisePool::pool(const Eigen::VectorXd& mean, const Eigen::MatrixXd& design,
                            const Eigen::VectorXd* start) const {
  assert(mean.size() == design.rows() && mean.size() > design.cols());
  const std::vector<bool> free = free_powers();
  Eigen::VectorXd first = starting_powers();
  if (!free[kTermQ]) first(kTermQ) = 0;
  // Powers that were found to be zero need a little to find the way back.
  if (start != nullptr) first = start->cwiseMax(0.02 * first);
  const Climb shared = climb(first, free, mean, design, record_);
  // Of χ²: with less missing in the run, nothing pays the price.
  constexpr double kMissing = 2;
  double missing = 0;
  for (const Eigen::Index i : processes_->walks())
    missing += shared.top.expected(i) - shared.top.seen(i);
  if (record_.shared.size() == 0 || missing < kMissing) return pooled(shared, false);
  const PooledNoise apart =
      pooled(climb(shared.top.power, free, mean, design, record_apart_), true);
  const bool is_apart = apart.deviance < shared.top.deviance &&
                        walk_variance_V2(apart.power) < walk_variance_V2(shared.top.power);
  return is_apart ? apart : pooled(shared, false);
}

double NoisePool::walk_variance_V2(const Eigen::VectorXd& power) const {
  double sum_V2 = 0;
  for (const Eigen::Index i : processes_->walks())
    sum_V2 += power(i) * processes_->variance_over_run(i);
  return sum_V2;
}

double NoisePool::gain_of_slow_noise(const PooledNoise& found, const Eigen::VectorXd& mean,
                                     const Eigen::MatrixXd& design) const {
  Eigen::VectorXd first = found.power;
  first.tail(first.size() - NoiseProcesses::kFirstSlow).setZero();
  if (first.sum() <= 0 && !own_noise_) return std::numeric_limits<double>::infinity();
  std::vector<bool> free(static_cast<std::size_t>(first.size()), false);
  free[kTermQ] = quantization_is_free();
  free[kTermN] = true;
  return climb(first, free, mean, design, record_for(found)).top.deviance - found.deviance;
}

template <typename Evaluate>
NoisePool::Climb NoisePool::climb(const Eigen::VectorXd& first, const std::vector<bool>& free,
                                  const Evaluate& evaluate) const {
  constexpr int kIterations = 60;
  constexpr double kEnough = 1e-2;  // of −2 ln L: far below anything a test can feel
  Climb climb{evaluate(first)};
  Point& now = climb.top;
  for (int iteration = 0; iteration < kIterations && !climb.converged; ++iteration) {
    const Eigen::VectorXd target = nonnegative_solution(now.normal, now.right, free);
    const Eigen::VectorXd step = target - now.power;
    const double promised =
        step.dot(now.right - now.normal * now.power) - 0.5 * step.dot(now.normal * step);
    climb.converged = promised < 0.1 * kEnough;
    if (climb.converged) break;
    Point next;
    bool better = false;
    for (int quartering = 0; quartering < 5 && !better; ++quartering) {
      const Eigen::VectorXd candidate = now.power + std::ldexp(1.0, -2 * quartering) * step;
      const bool singular = !(candidate(kTermQ) + candidate(kTermN) > 0) && !own_noise_;
      if (singular) continue;
      next = evaluate(candidate);
      better = next.deviance <= now.deviance;
    }
    climb.converged = !better || now.deviance - next.deviance < kEnough;
    if (better) now = std::move(next);
  }
  return climb;
}

NoisePool::Climb NoisePool::climb(const Eigen::VectorXd& first, const std::vector<bool>& free,
                                  const Eigen::VectorXd& mean, const Eigen::MatrixXd& design,
                                  const Record& record) const {
  return climb(first, free,
               [&](const Eigen::VectorXd& power) { return evaluate(power, mean, design, record); });
}

PooledNoise NoisePool::pooled(const Climb& climb, bool record_apart) const {
  return {climb.top.power,    covariance(climb.top.power),
          climb.top.deviance, climb.top.likelihood_deviance,
          climb.converged,    record_apart};
}

std::optional<Contradiction> NoisePool::contradiction(const PooledNoise& both,
                                                      const Eigen::VectorXd& mean,
                                                      const Eigen::MatrixXd& design) const {
  if (record_.shared.size() == 0) return std::nullopt;
  const Climb of_record = climb_of_record();
  const PooledNoise of_run =
      NoisePool(*processes_, without_record(model_), known_V2_).pool(mean, design, &both.power);
  Contradiction found{both.deviance - of_record.top.deviance - of_run.deviance, of_record.top.power,
                      of_run.power};
  const Eigen::Index bands = std::ssize(processes_->bands);
  found.power_of_record.tail(bands) = of_run.power.tail(bands);
  return found;
}

PooledNoise NoisePool::at(const Eigen::VectorXd& power, const Eigen::VectorXd& mean,
                          const Eigen::MatrixXd& design) const {
  const Projector projector = make_projector(lower_covariance(power), design);
  const double of_run = projector.log_determinant + mean.dot(projector.P * mean);
  const double shared = record_at(power, record_).deviance;
  const double apart = record_at(power, record_apart_).deviance;
  const bool is_apart = apart < shared;
  const double deviance = of_run + (is_apart ? apart : shared);
  return {power, covariance(power), deviance, deviance - projector.log_determinant_of_design,
          true,  is_apart};
}

bool records_show_smooth_noise(const PerAxis<NoiseModel>& noise,
                               const std::vector<SampleWindow>& windows) {
  constexpr double kClearly = 8;  // of −2 ln L
  const NoiseProcesses rough = noise_processes(windows),
                       smooth = noise_processes(windows, {.smooth = true});
  return std::any_of(noise.begin(), noise.end(), [&](const NoiseModel& model) {
    return NoisePool(smooth, model, {}).deviance_of_record() <
           NoisePool(rough, model, {}).deviance_of_record() - kClearly;
  });
}

NoiseModel without_record(NoiseModel model) {
  model.descriptions.clear();
  model.Q.value = model.N.value = model.B.value = model.K.value = 0;
  return model;
}

NoiseModel with_slow_noise_only(NoiseModel model, double slope) {
  for (SpectrumDescription& description : model.descriptions) {
    for (SpectrumBin& bin : description.bins) {
      bin.known = (description.power.head<2>().dot(bin.density.head<2>())) / square(slope);
      bin.density.head<2>().setZero();
      bin.square /= square(slope);
      bin.cross /= slope;
    }
  }
  model.Q.value = model.N.value = 0;
  model.B.value /= slope;
  model.K.value /= slope;
  model.R.value /= slope;
  return model;
}

NoiseModel in_filter_terms(NoiseModel model, const NoiseProcesses& processes,
                           const PooledNoise& pooled, double span_s) {
  const auto set = [](NoiseTerm& term, double power) {
    term = {};
    term.value = std::sqrt(std::max(power, 0.0));
    term.present = power > 0;
  };
  set(model.Q, pooled.power(kTermQ));
  set(model.N, pooled.power(kTermN));
  set(model.R, 0);
  const auto markov = processes.decay_per_s.size();
  std::vector<double> variance(markov);
  for (std::size_t m = 0; m < markov; ++m)
    variance[m] = pooled.power(NoiseProcesses::kFirstMarkov + static_cast<Eigen::Index>(m)) /
                  (2 * processes.decay_per_s[m]);
  const auto strongest = std::max_element(variance.begin(), variance.end());
  double walk = pooled.power(kTermK);
  for (Eigen::Index i = processes.first_smooth(); i < processes.first_band(); ++i)
    walk += pooled.power(i) * processes.variance_over_run(i) / processes.variance_over_run(kTermK);
  model.walk_decay_per_s = 0;
  if (strongest != variance.end() && *strongest > walk * span_s / 3) {
    const auto m = static_cast<std::size_t>(strongest - variance.begin());
    model.walk_decay_per_s = processes.decay_per_s[m];
    walk = pooled.power(NoiseProcesses::kFirstMarkov + static_cast<Eigen::Index>(m));
    *strongest = 0;
  }
  set(model.K, walk);
  // Equal variances in every ratio of correlation times are flicker of this level.
  double flicker = pooled.power(kTermB);
  for (const double v : variance)
    flicker += std::numbers::pi * v /
               (std::log(NoiseProcesses::kMarkovRatio) * static_cast<double>(markov));
  set(model.B, flicker);
  return model;
}

}  // namespace plumbline
