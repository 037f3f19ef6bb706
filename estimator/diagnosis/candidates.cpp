#include "estimator/diagnosis/candidates.h"

#include <Eigen/QR>
#include <algorithm>
#include <utility>

#include "estimator/effects/catalogue.h"
#include "estimator/effects/covariate.h"
#include "estimator/effects/smooth_term.h"
#include "estimator/parallel_for.h"

namespace plumbline {

void add_candidates(CandidateList& list, const VisitLog& log, const Effect& effect,
                    double handicap) {
  const std::size_t axes = effect.subject() == Subject::head ? 1 : kAxisCount;
  const auto infos = effect.parameters();
  for (std::size_t axis = 0; axis < axes; ++axis) {
    // Hypotheses that free the same amplitudes are the same family.
    std::vector<std::pair<std::vector<bool>, std::size_t>> families;
    for (Hypothesis& hypothesis : effect.hypotheses(log, axis)) {
      std::vector<bool> amplitudes;
      for (std::size_t k = 0; k < infos.size(); ++k) {
        amplitudes.push_back(infos[k].role == ParameterRole::amplitude && hypothesis.p[k] != 0);
      }
      auto family = std::find_if(families.begin(), families.end(),
                                 [&](const auto& f) { return f.first == amplitudes; });
      if (family == families.end()) {
        family = families.insert(families.end(), {amplitudes, list.family_size.size()});
        list.family_size.push_back(0);
      }
      ++list.family_size[family->second];
      list.candidates.push_back({&effect, axis, std::move(hypothesis), family->second, handicap});
    }
  }
}

CandidateList all_candidates(const VisitLog& log) {
  constexpr double kUnnamed = 7;
  CandidateList list;
  for (const Effect* effect : effect_catalogue()) add_candidates(list, log, *effect);
  for (auto& effect : covariate_effects(log)) {
    list.owned.push_back(std::move(effect));
    add_candidates(list, log, *list.owned.back());
  }
  for (auto& term : smooth_terms(log)) {
    list.owned.push_back(std::move(term));
    add_candidates(list, log, *list.owned.back(), kUnnamed);
  }
  return list;
}

namespace {

/// work(first, count) for blocks of neighbouring columns, on all cores.
template <class Work>
void for_column_blocks(Eigen::Index columns, const Work& work) {
  constexpr Eigen::Index kBlock = 128;
  parallel_for(static_cast<std::size_t>((columns + kBlock - 1) / kBlock), [&](std::size_t block) {
    const Eigen::Index first = static_cast<Eigen::Index>(block) * kBlock;
    work(first, std::min(kBlock, columns - first));
  });
}

/// The model as it stands, evaluated once for all candidates.
struct Baseline {
  const VisitLog& log;
  const EnlargedParameters& model;
  PerAxis<Eigen::VectorXd> mean_V;
  std::vector<Eigen::Vector3d> a_g;  ///< with the geometry of the model's effects
};

// What the mean readings of all axes change by when `active` joins the model, V, 3n rows. A sensor
// effect adds its term to one axis; a head effect moves everything.
void add_response(const Baseline& base, const ActiveEffect& active,
                  Eigen::Ref<Eigen::VectorXd> change) {
  const Eigen::Index n = base.mean_V[0].size();
  if (active.effect->subject() == Subject::sensor) {
    const Eigen::Vector4d& twelve = base.model.twelve[active.axis];
    const double K_ii = twelve(static_cast<Eigen::Index>(active.axis));
    const Eigen::Index at = static_cast<Eigen::Index>(active.axis) * n;
    for (Eigen::Index k = 0; k < n; ++k) {
      const auto visit = static_cast<std::size_t>(k);
      const double response_V = twelve.head<3>().dot(base.a_g[visit]);
      const TermInput input{
          base.log, visit, active.axis, base.a_g, response_V / K_ii, twelve(3) + response_V, K_ii};
      change(at + k) = K_ii * active.effect->term_g(input, active.p.data());
    }
    return;
  }
  EnlargedParameters with = base.model;
  with.effects.push_back(active);
  const auto predicted = predict_means_V(base.log, with);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    change.segment(static_cast<Eigen::Index>(i) * n, n) = predicted[i] - base.mean_V[i];
  }
}

}  // namespace

CandidateDirections::CandidateDirections(const VisitLog& log, const CandidateList& list,
                                         const PoseWhitening& whitening, const EnlargedFit& fit) {
  const Eigen::Index rows = fit.whitened_residual.size();
  {
    const Eigen::VectorXd norms = fit.whitened_jacobian.colwise().norm();
    const Eigen::MatrixXd scaled = fit.whitened_jacobian * norms.cwiseInverse().asDiagonal();
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(scaled);
    model_basis_ = qr.householderQ() * Eigen::MatrixXd::Identity(rows, scaled.cols());
  }
  // One column for each amplitude; an effect of shapes alone is one column as it stands.
  std::vector<ActiveEffect> singles;
  std::vector<std::size_t> owner;
  for (std::size_t c = 0; c < list.candidates.size(); ++c) {
    const Candidate& candidate = list.candidates[c];
    const auto infos = candidate.effect->parameters();
    const ActiveEffect active = candidate.active();
    std::vector<std::size_t> amplitudes;
    for (std::size_t k = 0; k < infos.size(); ++k) {
      if (infos[k].role == ParameterRole::amplitude && active.p[k] != 0) amplitudes.push_back(k);
    }
    if (amplitudes.empty()) {
      singles.push_back(active);
      owner.push_back(c);
    }
    for (std::size_t amplitude : amplitudes) {
      singles.push_back(active);
      owner.push_back(c);
      for (std::size_t other : amplitudes) {
        if (other != amplitude) singles.back().p[other] = 0;
      }
    }
  }
  const Baseline base{log, fit.parameters, predict_means_V(log, fit.parameters),
                      specific_forces_g(log, fit.parameters)};
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(rows, std::ssize(singles));
  for_column_blocks(all.cols(), [&](Eigen::Index first, Eigen::Index count) {
    for (Eigen::Index j = first; j < first + count; ++j) {
      add_response(base, singles[static_cast<std::size_t>(j)], all.col(j));
    }
    all.middleCols(first, count) = whitening.apply(all.middleCols(first, count));
  });
  const Eigen::VectorXd before = all.colwise().norm();
  all = project(all);

  dof_.assign(list.candidates.size(), 0);
  first_.assign(list.candidates.size(), 0);
  basis_.resize(rows, all.cols());
  Eigen::Index used = 0;
  for (Eigen::Index j = 0; j < all.cols(); ++j) {
    const std::size_t c = owner[static_cast<std::size_t>(j)];
    if (dof_[c] == 0) first_[c] = used;
    Eigen::VectorXd direction = all.col(j);
    for (Eigen::Index k = first_[c]; k < used; ++k) {
      direction -= basis_.col(k).dot(direction) * basis_.col(k);
    }
    // What is left of an absorbed effect is rounding, not evidence.
    const double norm = direction.norm();
    if (!(norm > 1e-3 * before(j)) || !(norm > 0)) continue;
    basis_.col(used++) = direction / norm;
    ++dof_[c];
  }
  basis_.conservativeResize(Eigen::NoChange, used);
}

Eigen::MatrixXd CandidateDirections::project(const Eigen::MatrixXd& whitened) const {
  Eigen::MatrixXd projected(whitened.rows(), whitened.cols());
  for_column_blocks(whitened.cols(), [&](Eigen::Index first, Eigen::Index count) {
    const auto block = whitened.middleCols(first, count);
    projected.middleCols(first, count) = block - model_basis_ * (model_basis_.transpose() * block);
  });
  return projected;
}

Eigen::MatrixXd CandidateDirections::gains(const Eigen::MatrixXd& whitened) const {
  Eigen::MatrixXd squares(basis_.cols(), whitened.cols());
  for_column_blocks(basis_.cols(), [&](Eigen::Index first, Eigen::Index count) {
    squares.middleRows(first, count) =
        (basis_.middleCols(first, count).transpose() * whitened).cwiseAbs2();
  });
  Eigen::MatrixXd gain =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(dof_.size()), whitened.cols());
  for (std::size_t c = 0; c < dof_.size(); ++c) {
    if (dof_[c] > 0) {
      gain.row(static_cast<Eigen::Index>(c)) =
          squares.middleRows(first_[c], dof_[c]).colwise().sum();
    }
  }
  return gain;
}

}  // namespace plumbline
