#include "estimator/scalar/scalar_alternatives.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/fit/least_squares.h"
#include "estimator/linear_algebra.h"

namespace plumbline {
ScalarDirections::ScalarDirections(const ScalarData& data, const CandidateList& list,
                                   const ScalarFit& fit, const Eigen::MatrixXd& covariance) {
  const auto whitening = Whitening::of(covariance);
  ScalarData ideal = data;
  const Eigen::PartialPivLU<Eigen::Matrix3d> matrix(scalar_matrix(fit.parameters.nine));
  const auto measured = scalar_forces_mps2(data, fit.parameters);
  const Eigen::Index n = std::ssize(measured);
  for (std::size_t k = 0; k < measured.size(); ++k) {
    const Eigen::Vector3d excess =
        measured[k].normalized() * (measured[k].norm() - data.local_mps2);
    ideal.reading[k] -= matrix.solve(excess);
  }
  set_attitudes(ideal, fit.parameters.nine);
  model_basis_ = orthonormal_basis(whitening->apply(scalar_jacobian(ideal, fit.parameters)));
  const auto force = scalar_forces_mps2(ideal, fit.parameters);
  std::vector<Eigen::Vector3d> a_g = force;
  for (Eigen::Vector3d& a : a_g) a /= kStandardGravity_mps2;

  std::vector<Eigen::VectorXd> responses;
  for (const Candidate& candidate : list.candidates) {
    const auto infos = candidate.effect->parameters();
    const ActiveEffect active = candidate.active();
    std::vector<std::size_t> amplitudes;
    for (std::size_t k = 0; k < infos.size(); ++k) {
      if (infos[k].role == ParameterRole::amplitude && active.p[k] != 0) amplitudes.push_back(k);
    }
    amplitude_.push_back(amplitudes);
    first_column_.push_back(std::ssize(responses));
    const auto add = [&](const ActiveEffect& single, double size) {
      Eigen::VectorXd response = effect_terms_g(ideal, fit.parameters.nine, a_g, single);
      for (Eigen::Index k = 0; k < n; ++k) {
        response(k) *=
            -kStandardGravity_mps2 / size *
            force[static_cast<std::size_t>(k)].normalized()(static_cast<Eigen::Index>(single.axis));
      }
      responses.push_back(std::move(response));
    };
    if (amplitudes.empty()) add(active, 1);
    for (const std::size_t amplitude : amplitudes) {
      ActiveEffect single = active;
      for (const std::size_t other : amplitudes) {
        if (other != amplitude) single.p[other] = 0;
      }
      add(single, active.p[amplitude]);
    }
  }
  Eigen::MatrixXd all(n, std::ssize(responses));
  for (Eigen::Index j = 0; j < all.cols(); ++j) all.col(j) = responses[static_cast<std::size_t>(j)];
  all = whitening->apply(all);
  const Eigen::VectorXd before = all.colwise().norm();
  all -= model_basis_ * (model_basis_.transpose() * all);
  columns_ = all;

  basis_.resize(n, all.cols());
  Eigen::Index used = 0;
  for (std::size_t c = 0; c < list.candidates.size(); ++c) {
    first_.push_back(used);
    const Eigen::Index end =
        c + 1 < list.candidates.size() ? first_column_[c + 1] : columns_.cols();
    for (Eigen::Index j = first_column_[c]; j < end; ++j) {
      Eigen::VectorXd direction = all.col(j);
      for (Eigen::Index k = first_[c]; k < used; ++k) {
        direction -= basis_.col(k).dot(direction) * basis_.col(k);
      }
      const double norm = direction.norm();
      // What is left of an absorbed effect is rounding, not evidence.
      if (!(norm > 1e-2 * before(j)) || !(norm > 0)) continue;
      basis_.col(used++) = direction / norm;
    }
    dof_.push_back(static_cast<int>(used - first_[c]));
  }
  basis_.conservativeResize(Eigen::NoChange, used);
}

Eigen::VectorXd ScalarDirections::gains(const Eigen::VectorXd& projected) const {
  const Eigen::VectorXd square = (basis_.transpose() * projected).cwiseAbs2();
  Eigen::VectorXd gain(std::ssize(dof_));
  for (std::size_t c = 0; c < dof_.size(); ++c) {
    gain(static_cast<Eigen::Index>(c)) = square.segment(first_[c], dof_[c]).sum();
  }
  return gain;
}

Eigen::VectorXd ScalarDirections::project(const Eigen::VectorXd& whitened) const {
  return whitened - model_basis_ * (model_basis_.transpose() * whitened);
}

Eigen::MatrixXd ScalarDirections::basis(std::size_t candidate) const {
  return basis_.middleCols(first_[candidate], dof_[candidate]);
}

Eigen::MatrixXd ScalarDirections::transform(const Candidate& candidate, std::size_t index) const {
  const std::vector<std::size_t>& amplitudes = amplitude_[index];
  const Eigen::Index count = std::max<Eigen::Index>(std::ssize(amplitudes), 1);
  // What depends on the others stands for no amplitude of its own.
  if (dof_[index] < count) return Eigen::MatrixXd(0, count);
  Eigen::MatrixXd columns = columns_.middleCols(first_column_[index], count);
  const ActiveEffect active = candidate.active();
  for (std::size_t k = 0; k < amplitudes.size(); ++k) {
    columns.col(static_cast<Eigen::Index>(k)) *= active.p[amplitudes[k]];
  }
  const Eigen::MatrixXd triangle = basis(index).transpose() * columns;
  return triangle.triangularView<Eigen::Upper>()
      .solve(Eigen::MatrixXd::Identity(count, count))
      .transpose();
}

ActiveEffect ScalarDirections::started(const Candidate& candidate,
                                       const Eigen::VectorXd& whitened_residual,
                                       std::size_t index) const {
  ActiveEffect active = candidate.active();
  const std::vector<std::size_t>& amplitudes = amplitude_[index];
  if (amplitudes.empty()) return active;
  const Eigen::MatrixXd columns = columns_.middleCols(first_column_[index], std::ssize(amplitudes));
  const LeastSquaresResult solved =
      solve_least_squares(columns, -project(whitened_residual), {.rank_tolerance = 1e-6});
  for (std::size_t k = 0; k < amplitudes.size(); ++k) {
    active.p[amplitudes[k]] = solved.x(static_cast<Eigen::Index>(k));
  }
  return active;
}

std::vector<std::string> scalar_alternatives(ScalarData& data, const CandidateList& list,
                                             const ScalarFit& fit,
                                             const Eigen::MatrixXd& covariance, std::size_t index) {
  constexpr double kIndistinguishable = 4;  // in χ²: two standard uncertainties
  constexpr std::size_t kMostListed = 6;
  const ActiveEffect& own = fit.parameters.effects[index];
  ScalarParameters fewer = fit.parameters;
  fewer.effects.erase(fewer.effects.begin() + static_cast<std::ptrdiff_t>(index));
  const ScalarFit without = fit_scalar(data, fewer, covariance);
  const ScalarDirections directions(data, list, without, covariance);
  const Eigen::VectorXd projected = directions.project(without.whitened_residual);
  const double chi2_with = fit.whitened_residual.squaredNorm();
  const double chi2_without = without.whitened_residual.squaredNorm();

  struct Rival {
    double cost;
    std::string name;
  };
  const Eigen::VectorXd gains = directions.gains(projected);
  std::vector<Rival> rivals;
  std::vector<std::size_t> singles;
  for (std::size_t c = 0; c < list.candidates.size(); ++c) {
    const Candidate& candidate = list.candidates[c];
    if (directions.dof(c) == 0 || candidate.handicap > 0) continue;
    if (candidate.effect == own.effect && candidate.axis == own.axis) continue;
    const double cost = chi2_without - gains(static_cast<Eigen::Index>(c)) - chi2_with;
    if (cost < kIndistinguishable) rivals.push_back({cost, candidate.effect->id()});
    // Sums are looked for among functions of the attitude: those of time do not cancel.
    if (directions.dof(c) == 1 && candidate.active().p.size() <= 3) singles.push_back(c);
  }
  if (rivals.empty()) {
    for (std::size_t i = 0; i < singles.size(); ++i) {
      const Eigen::VectorXd first = directions.basis(singles[i]).col(0);
      const double first_gain = std::pow(first.dot(projected), 2);
      for (std::size_t j = 0; j < i; ++j) {
        Eigen::VectorXd second = directions.basis(singles[j]).col(0);
        second -= first.dot(second) * first;
        const double norm = second.norm();
        if (norm < 1e-2) continue;
        const double cost =
            chi2_without - first_gain - std::pow(second.dot(projected) / norm, 2) - chi2_with;
        // A second parameter has to be paid for.
        if (cost + 2 > kIndistinguishable) continue;
        const std::string a = list.candidates[singles[j]].effect->id();
        const std::string b = list.candidates[singles[i]].effect->id();
        rivals.push_back({cost + 2, a + "+" + b});
      }
    }
  }
  std::stable_sort(rivals.begin(), rivals.end(),
                   [](const Rival& a, const Rival& b) { return a.cost < b.cost; });
  std::vector<std::string> names;
  for (const Rival& rival : rivals) {
    if (names.size() == kMostListed) break;
    if (std::find(names.begin(), names.end(), rival.name) == names.end()) {
      names.push_back(rival.name);
    }
  }
  set_attitudes(data, fit.parameters.nine);
  return names;
}

}  // namespace plumbline
