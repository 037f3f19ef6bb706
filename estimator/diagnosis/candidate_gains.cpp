#include "estimator/diagnosis/candidate_gains.h"

#include <Eigen/QR>
#include <cmath>
#include <utility>

#include "estimator/linear_algebra.h"
#include "estimator/parallel_for.h"

namespace plumbline {

std::vector<std::size_t> special_cases(const CandidateResponses& responses, const EnlargedFit& fit,
                                       std::size_t general) {
  constexpr double kLeft = 1e-6;  // of what a candidate does
  const CandidateResponses::Place& whole = responses.place[general];
  const CandidateResponses::Group& group = responses.groups[whole.group];
  const Eigen::Index twelve = fit.parameters.first_free(0);
  Eigen::MatrixXd taken(group.means.rows(), twelve + whole.count);
  taken << fit.whitened_jacobian.block(group.first_row, 0, group.means.rows(), twelve),
      group.means.middleCols(whole.first, whole.count);
  const Eigen::MatrixXd both = orthonormal_basis(taken);
  const Eigen::MatrixXd twelve_alone = orthonormal_basis(taken.leftCols(twelve));
  const auto square_beside = [](const Eigen::MatrixXd& basis, const auto& means) {
    return (means - basis * (basis.transpose() * means)).squaredNorm();
  };
  // A difference of squares does for most, though not to tell how little is left.
  const Eigen::RowVectorXd squares = group.means.colwise().squaredNorm();
  const Eigen::RowVectorXd left =
      squares - (both.transpose() * group.means).colwise().squaredNorm();
  std::vector<std::size_t> found;
  for (std::size_t c = 0; c < responses.place.size(); ++c) {
    const auto& [of_group, first, count] = responses.place[c];
    if (c == general || of_group != whole.group) continue;
    constexpr double kRounding = 1e-10;
    if (left.segment(first, count).sum() > kRounding * squares.segment(first, count).sum())
      continue;
    const auto means = group.means.middleCols(first, count);
    if (square_beside(both, means) < kLeft * kLeft * square_beside(twelve_alone, means))
      found.push_back(c);
  }
  return found;
}

namespace {

/// From columns with these products among each other, of which the model takes up the products
/// `lost`, to orthonormal directions of what it leaves: Gram–Schmidt in that metric.
Eigen::MatrixXd to_orthonormal(const Eigen::MatrixXd& whole, const Eigen::MatrixXd& lost) {
  constexpr double kAbsorbed = 1e-3;  // what is left of an absorbed effect is rounding, no evidence
  const Eigen::Index count = whole.cols();
  const Eigen::MatrixXd gram = whole - lost;
  Eigen::MatrixXd transform(0, count);
  for (Eigen::Index j = 0; j < count; ++j) {
    Eigen::RowVectorXd direction = Eigen::RowVectorXd::Unit(count, j);
    for (Eigen::Index k = 0; k < transform.rows(); ++k)
      direction -= transform.row(k).dot(gram.col(j)) * transform.row(k);
    const double square = (direction * gram * direction.transpose()).value();
    if (!(square > kAbsorbed * kAbsorbed * whole(j, j)) || !(square > 0)) continue;
    transform.conservativeResize(transform.rows() + 1, Eigen::NoChange);
    transform.row(transform.rows() - 1) = direction / std::sqrt(square);
  }
  return transform;
}

/// Calls use(candidate, products of its columns with `stacked`) for each, on all cores.
template <class Use>
void for_each_seen(const CandidateResponses& responses, const Eigen::MatrixXd& stacked,
                   const Use& use) {
  const std::vector<CandidateResponses::Block> blocks = responses.blocks();
  parallel_for(blocks.size(), [&](std::size_t b) {
    const auto& [g, first, count, candidates] = blocks[b];
    const Eigen::MatrixXd seen = responses.groups[g].products(first, count, stacked);
    for (const std::size_t c : candidates) {
      const CandidateResponses::Place& at = responses.place[c];
      use(c, seen.middleRows(at.first - first, at.count));
    }
  });
}

}  // namespace

CandidateGains::CandidateGains(const CandidateResponses& responses, const EnlargedFit& fit)
    : responses_(responses), fit_(fit) {
  model_basis_ = orthonormal_basis(fit.whitened_jacobian);
  residual_ = project(fit.whitened_residual);
  transform_.resize(responses.place.size());
  of_residual_.resize(std::ssize(transform_));
  // In one product: memory decides.
  Eigen::MatrixXd both(model_basis_.rows(), model_basis_.cols() + 1);
  both << model_basis_, residual_;
  for_each_seen(responses, both, [&](std::size_t c, const auto& seen) {
    const auto lost = seen.leftCols(model_basis_.cols());  // to the model's parameters
    transform_[c] = to_orthonormal(responses.gram[c], lost * lost.transpose());
    of_residual_(static_cast<Eigen::Index>(c)) =
        (transform_[c] * seen.template rightCols<1>()).squaredNorm();
  });
}

Eigen::MatrixXd CandidateGains::project(const Eigen::MatrixXd& whitened) const {
  return whitened - model_basis_ * (model_basis_.transpose() * whitened);
}

Eigen::MatrixXd CandidateGains::of(const Eigen::MatrixXd& whitened) const {
  Eigen::MatrixXd gain(whitened.cols(), std::ssize(transform_));
  for_each_seen(responses_, whitened, [&](std::size_t c, const auto& seen) {
    gain.col(static_cast<Eigen::Index>(c)) =
        (transform_[c] * seen).colwise().squaredNorm().transpose();
  });
  return gain;
}

Eigen::VectorXd CandidateGains::of_residual_as_they_stand() const {
  Eigen::VectorXd gain(std::ssize(transform_));
  for (std::size_t c = 0; c < transform_.size(); ++c) {
    const auto& [g, first, count] = responses_.place[c];
    const CandidateResponses::Group& group = responses_.groups[g];
    const CandidateResponses::Group whole{
        group.first_row, group.means.middleCols(first, count).rowwise().sum(),
        group.first_dwell_row, group.dwells.middleCols(first, count).rowwise().sum()};
    const double seen = whole.products(0, 1, residual_).value();
    const double square = whole.means.squaredNorm() + whole.dwells.squaredNorm() -
                          whole.products(0, 1, model_basis_).squaredNorm();
    gain(static_cast<Eigen::Index>(c)) = 2 * seen - square;
  }
  return gain;
}

EnlargedParameters CandidateGains::linear_start(std::size_t place,
                                                const Candidate& candidate) const {
  const auto& [g, first, count] = responses_.place[place];
  const CandidateResponses::Group& group = responses_.groups[g];
  const Eigen::MatrixXd& model = fit_.whitened_jacobian;
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(model.rows(), model.cols() + count);
  columns.leftCols(model.cols()) = model;
  columns.block(group.first_row, model.cols(), group.means.rows(), count) =
      group.means.middleCols(first, count);
  columns.block(group.first_dwell_row, model.cols(), group.dwells.rows(), count) =
      group.dwells.middleCols(first, count);
  const Eigen::VectorXd norms = columns.colwise().norm().cwiseMax(1e-300);
  const Eigen::VectorXd step =
      norms.cwiseInverse().cwiseProduct((columns * norms.cwiseInverse().asDiagonal())
                                            .colPivHouseholderQr()
                                            .solve(fit_.whitened_residual));
  EnlargedParameters start = fit_.parameters;
  start.set_free_values(start.free_values() + step.head(model.cols()));
  ActiveEffect active = candidate.active();
  const auto infos = active.effect->parameters();
  Eigen::Index column = model.cols();
  for (std::size_t k = 0; k < infos.size(); ++k)
    if (infos[k].role == ParameterRole::amplitude && active.p[k] != 0)
      active.p[k] *= step(column++);
  return with_effect(std::move(start), active);
}

EnlargedFit fit_with_candidate(const FitInput& input, const CandidateGains& gains,
                               std::size_t place, const Candidate& candidate, double promised,
                               const FitLimits& limits) {
  constexpr double kMostOfIt = 0.95;
  const EnlargedFit& before = gains.fit();
  EnlargedFit with = fit_holding_shapes(input.log, input.observed, input.whitening,
                                        with_effect(before.parameters, candidate.active()),
                                        before.parameters.effects.size(), limits);
  if (with.determined && before.chi2 - with.chi2 > kMostOfIt * promised) return with;
  EnlargedFit other = fit_enlarged(input.log, input.observed, input.whitening,
                                   gains.linear_start(place, candidate), limits);
  if (other.determined && (!with.determined || other.chi2 < with.chi2)) return other;
  return with;
}

}  // namespace plumbline
