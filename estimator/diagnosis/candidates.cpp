#include "estimator/diagnosis/candidates.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "estimator/effects/catalogue.h"
#include "estimator/effects/covariate.h"
#include "estimator/effects/function_of_driver.h"
#include "estimator/effects/smooth_term.h"
#include "estimator/linear_algebra.h"
#include "estimator/parallel_for.h"

namespace plumbline {

double looks_on_axes(const CandidateList& list, const Candidate& candidate) {
  return kAxisCount * static_cast<double>(list.family_size[candidate.family]);
}

void add_candidates(CandidateList& list, const VisitLog& log, const Effect& effect,
                    double handicap) {
  if (!log.lacking(effect.columns()).empty()) return;
  const std::size_t axes = effect.subject() == Subject::head ? 1 : kAxisCount;
  const auto infos = effect.parameters();
  for (std::size_t axis = 0; axis < axes; ++axis) {
    if (!effect.acts_on(axis)) continue;
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

bool imitates_proven_rounding(const VisitLog& log, const Effect& effect) {
  const auto* term = dynamic_cast<const SmoothTerm*>(&effect);
  if (term == nullptr) return false;
  const bool repeats = is_wave(effect) || is_saw_tooth(effect);
  for (std::size_t i = 0; i < kAxisCount; ++i)
    if (term->driver() == std::string("code_") + kAxisName[i] ||
        (repeats && term->driver() == std::string("a_") + kAxisName[i]))
      return log.codes[i].any();
  return false;
}

namespace {

/// Once per amplitude; an effect of shapes and indices alone once as it stands.
std::vector<SingleAmplitude> single_amplitudes(const Candidate& candidate) {
  const auto infos = candidate.effect->parameters();
  const ActiveEffect active = candidate.active();
  std::vector<SingleAmplitude> singles;
  for (std::size_t k = 0; k < infos.size(); ++k) {
    if (infos[k].role != ParameterRole::amplitude || active.p[k] == 0) continue;
    ActiveEffect single = active;
    for (std::size_t other = 0; other < infos.size(); ++other) {
      if (other != k && infos[other].role == ParameterRole::amplitude) single.p[other] = 0;
    }
    singles.push_back({std::move(single), {}});
  }
  if (singles.empty()) singles.push_back({active, {}});
  return singles;
}

/// Works out in advance what does not depend on a model.
void prepare(const VisitLog& log, Candidate& candidate) {
  std::vector<SingleAmplitude> singles = single_amplitudes(candidate);
  for (SingleAmplitude& single : singles)
    single.number =
        candidate.effect->numbers_of_visits(log, candidate.axis, single.active.p.data());
  candidate.singles = std::make_shared<const std::vector<SingleAmplitude>>(std::move(singles));
}

}  // namespace

CandidateList all_candidates(const VisitLog& log,
                             const std::vector<std::shared_ptr<const Effect>>& own) {
  CandidateList list;
  for (const Effect* effect : effect_catalogue()) add_candidates(list, log, *effect);
  if (log.is_coarse()) {
    for (Candidate& candidate : list.candidates)
      candidate.of_one_coarse_reading = candidate.effect->concerns_one_visit();
  }
  for (auto& effect : covariate_effects(log)) {
    list.owned.push_back(std::move(effect));
    add_candidates(list, log, *list.owned.back());
  }
  for (auto& term : smooth_terms(log, SmoothTermSelection::shown_by_these_visits)) {
    if (imitates_proven_rounding(log, *term)) continue;
    const double handicap = kHandicapOfUnnamed + term->log_choices();
    list.owned.push_back(std::move(term));
    add_candidates(list, log, *list.owned.back(), handicap);
  }
  for (const auto& effect : own) {
    list.owned.push_back(effect);
    add_candidates(list, log, *effect);
  }
  parallel_for(list.candidates.size(), [&](std::size_t c) { prepare(log, list.candidates[c]); });
  return list;
}

namespace {

constexpr std::array kAngles = {&HeadGeometry::delta_rad,  &HeadGeometry::h_rad,
                                &HeadGeometry::roll_rad,   &HeadGeometry::skew_rad,
                                &HeadGeometry::seat_x_rad, &HeadGeometry::seat_y_rad,
                                &HeadGeometry::lift};
using PerAngle = Eigen::Matrix<double, kAxisCount, kAngles.size()>;

/// What each angle, or the lift, does to the outputs of the three axes, V/rad or V.
PerAngle slopes_V(const EnlargedParameters& model, const HeadGeometry& head, double gamma) {
  PerAngle slopes;
  for (std::size_t angle = 0; angle < kAngles.size(); ++angle) {
    const Eigen::Vector3d per_rad = slope_g_per_rad(head, kAngles[angle], gamma);
    for (std::size_t i = 0; i < kAxisCount; ++i)
      slopes(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(angle)) =
          model.twelve[i].head<3>().dot(per_rad);
  }
  return slopes;
}

/// The model as it stands, evaluated once for all candidates.
struct Baseline {
  const VisitLog& log;
  const EnlargedParameters& model;
  std::vector<HeadGeometry> head;    ///< with the model's own effects
  std::vector<Eigen::Vector3d> a_g;  ///< seen through that geometry
  std::vector<PerAngle> slope_V;     ///< of the outputs, at every visit
  PerAxis<std::vector<TermInput>> inputs;

  Baseline(const VisitLog& of_log, const EnlargedParameters& of_model)
      : log(of_log),
        model(of_model),
        head(head_geometries(of_log, of_model)),
        a_g(specific_forces_g(of_log, of_model)),
        slope_V(head.size()) {
    parallel_for(head.size(),
                 [this](std::size_t k) { slope_V[k] = slopes_V(model, head[k], log.gamma); });
    parallel_for(kAxisCount, [this](std::size_t axis) {
      for (std::size_t k = 0; k < a_g.size(); ++k)
        inputs[axis].push_back(term_input(log, model, axis, a_g, k));
    });
  }
  // The inputs refer to the forces.
  Baseline(const Baseline&) = delete;
  Baseline& operator=(const Baseline&) = delete;

  const TermInput& input(std::size_t axis, Eigen::Index visit) const {
    return inputs[axis][static_cast<std::size_t>(visit)];
  }
};

// Term of a sensor effect on its axis, V, n rows.
void set_sensor_response(const Baseline& base, const SingleAmplitude& single,
                         Eigen::Ref<Eigen::VectorXd> change) {
  const ActiveEffect& active = single.active;
  for (Eigen::Index k = 0; k < change.size(); ++k) {
    const TermInput& input = base.input(active.axis, k);
    const double term_g = single.number.empty()
                              ? active.effect->term_g(input, active.p.data())
                              : active.effect->term_of_number_g(input, single.number[input.visit]);
    change(k) = input.K_V_per_g * term_g;
  }
}

// What a head effect changes on all axes, V, 3n rows, to first order. What it changes in the terms
// of sensor effects that are in the model already is left to the refit, as all else that a large
// angle does.
void add_head_response(const Baseline& base, const SingleAmplitude& single,
                       Eigen::Ref<Eigen::VectorXd> change) {
  const Effect& effect = *single.active.effect;
  const auto n = static_cast<Eigen::Index>(base.head.size());
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto visit = static_cast<std::size_t>(k);
    HeadGeometry head = base.head[visit];
    if (single.number.empty())
      effect.displace(base.log, visit, single.active.p.data(), head);
    else
      effect.displace_by_number(base.log, visit, single.number[visit], single.active.p.data(),
                                head);
    if (head == base.head[visit]) continue;  // most candidates concern few visits
    Eigen::Vector<double, kAngles.size()> turned_rad;
    for (std::size_t angle = 0; angle < kAngles.size(); ++angle)
      turned_rad(static_cast<Eigen::Index>(angle)) =
          head.*kAngles[angle] - base.head[visit].*kAngles[angle];
    const Eigen::Vector3d moved_V = base.slope_V[visit] * turned_rad;
    for (Eigen::Index i = 0; i < moved_V.size(); ++i) change(i * n + k) = moved_V(i);
  }
}

constexpr std::size_t kHead = 2 * kAxisCount;
constexpr std::size_t kGroups = std::tuple_size_v<decltype(CandidateResponses::groups)>;

bool is_head(std::size_t group) { return group >= kHead; }
bool is_within_dwell(std::size_t group) { return group >= kAxisCount && group != kHead; }

std::size_t group_of(const Candidate& candidate) {
  const bool within_dwell = candidate.effect->within_dwell();
  if (candidate.effect->subject() == Subject::head) return kHead + (within_dwell ? 1 : 0);
  return candidate.axis + (within_dwell ? kAxisCount : 0);
}

// The course of the dwells that a sensor effect makes, V, n rows a contrast.
void set_dwell_response(const Baseline& base, const ActiveEffect& active,
                        Eigen::Ref<Eigen::VectorXd> change) {
  const auto n = static_cast<Eigen::Index>(base.a_g.size());
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::VectorXd contrasts = dwell_contrasts_V(base.input(active.axis, k), active);
    for (Eigen::Index d = 0; d < contrasts.size(); ++d) change(d * n + k) = contrasts(d);
  }
}

// The same of a head effect, axis by axis.
void set_head_dwell_response(const Baseline& base, const ActiveEffect& active,
                             Eigen::Ref<Eigen::VectorXd> change) {
  const auto n = static_cast<Eigen::Index>(base.head.size());
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto visit = static_cast<std::size_t>(k);
    const HeadCourse course = head_course(base.log, visit, base.head[visit], active);
    Eigen::Index row = k;
    for (const Eigen::Vector4d& twelve : base.model.twelve)
      for (const double contrast_V : course.contrasts_V(twelve)) {
        change(row) = contrast_V;
        row += n;
      }
  }
}

}  // namespace

Eigen::MatrixXd CandidateResponses::Group::products(const Eigen::MatrixXd& stacked) const {
  Eigen::MatrixXd result = means.transpose() * stacked.middleRows(first_row, means.rows());
  if (dwells.rows() > 0)
    result += dwells.transpose() * stacked.middleRows(first_dwell_row, dwells.rows());
  return result;
}

namespace {

struct Block {  // of neighbouring columns of a group
  std::size_t group;
  Eigen::Index first, count;
};
std::vector<Block> blocks_of(const CandidateResponses& responses) {
  constexpr Eigen::Index kColumns = 192;
  std::vector<Block> blocks;
  for (std::size_t g = 0; g < kGroups; ++g) {
    const Eigen::Index columns = responses.groups[g].means.cols();
    for (Eigen::Index first = 0; first < columns; first += kColumns)
      blocks.push_back({g, first, std::min(kColumns, columns - first)});
  }
  return blocks;
}

std::size_t first_axis(std::size_t group) { return is_head(group) ? 0 : group % kAxisCount; }

}  // namespace

CandidateResponses candidate_responses_V(const VisitLog& log, const CandidateList& list,
                                         const EnlargedParameters& model) {
  const auto n = static_cast<Eigen::Index>(log.visits.size());
  CandidateResponses responses;
  std::array<std::vector<const SingleAmplitude*>, kGroups> singles;
  std::vector<std::vector<SingleAmplitude>> own(list.candidates.size());
  for (std::size_t c = 0; c < own.size(); ++c) {
    const Candidate& candidate = list.candidates[c];
    if (!candidate.singles) own[c] = single_amplitudes(candidate);
    const auto& of_candidate = candidate.singles ? *candidate.singles : own[c];
    const std::size_t group = group_of(candidate);
    responses.place.push_back({group, std::ssize(singles[group]), std::ssize(of_candidate)});
    for (const SingleAmplitude& single : of_candidate) singles[group].push_back(&single);
  }
  for (std::size_t g = 0; g < kGroups; ++g) {
    CandidateResponses::Group& group = responses.groups[g];
    const Eigen::Index columns = std::ssize(singles[g]);
    const auto axis = static_cast<Eigen::Index>(first_axis(g));
    const Eigen::Index rows = is_head(g) ? mean_rows(log) : n;
    group.first_row = axis * n;
    group.means.resize(rows, columns);
    group.first_dwell_row = mean_rows(log) + axis * log.dwell_contrasts() * n;
    group.dwells.resize(is_within_dwell(g) ? log.dwell_contrasts() * rows : 0, columns);
  }
  const Baseline base(log, model);
  const std::vector<Block> blocks = blocks_of(responses);
  parallel_for(blocks.size(), [&](std::size_t b) {
    const auto& [g, first, count] = blocks[b];
    CandidateResponses::Group& group = responses.groups[g];
    auto means = group.means.middleCols(first, count);
    auto dwells = group.dwells.middleCols(first, count);
    if (is_head(g)) means.setZero();
    for (Eigen::Index j = 0; j < count; ++j) {
      const SingleAmplitude& single = *singles[g][static_cast<std::size_t>(first + j)];
      if (is_head(g)) {
        add_head_response(base, single, means.col(j));
        if (is_within_dwell(g)) set_head_dwell_response(base, single.active, dwells.col(j));
      } else {
        set_sensor_response(base, single, means.col(j));
        if (is_within_dwell(g)) set_dwell_response(base, single.active, dwells.col(j));
      }
    }
  });
  return responses;
}

CandidateResponses whitened(CandidateResponses responses_V, const VisitLog& log,
                            const PoseWhitening& whitening) {
  const auto n = static_cast<Eigen::Index>(log.visits.size());
  const std::vector<Block> blocks = blocks_of(responses_V);
  parallel_for(blocks.size(), [&](std::size_t b) {
    const auto& [g, first, count] = blocks[b];
    auto means = responses_V.groups[g].means.middleCols(first, count);
    auto dwells = responses_V.groups[g].dwells.middleCols(first, count);
    const std::size_t axis = first_axis(g);
    const Eigen::Index contrasts = log.dwell_contrasts();
    for (Eigen::Index row = 0; row < means.rows(); row += n)
      whitening.apply_to_means(axis + static_cast<std::size_t>(row / n), means.middleRows(row, n));
    for (Eigen::Index d = 0; d * n < dwells.rows(); ++d)
      dwells.middleRows(d * n, n) /=
          whitening.dwell_sd_V[axis + static_cast<std::size_t>(d / contrasts)](d % contrasts);
  });
  return responses_V;
}

CandidateResponses candidate_responses(const VisitLog& log, const CandidateList& list,
                                       const PoseWhitening& whitening,
                                       const EnlargedParameters& model) {
  return whitened(candidate_responses_V(log, list, model), log, whitening);
}

CandidateResponses some_of(const CandidateResponses& responses,
                           const std::vector<std::size_t>& candidates) {
  CandidateResponses some;
  std::array<std::vector<Eigen::Index>, kGroups> columns;
  for (const std::size_t c : candidates) {
    const auto& [g, first, count] = responses.place[c];
    some.place.push_back({g, std::ssize(columns[g]), count});
    for (Eigen::Index j = 0; j < count; ++j) columns[g].push_back(first + j);
  }
  for (std::size_t g = 0; g < kGroups; ++g) {
    const CandidateResponses::Group& whole = responses.groups[g];
    some.groups[g] = {whole.first_row, whole.means(Eigen::all, columns[g]), whole.first_dwell_row,
                      whole.dwells(Eigen::all, columns[g])};
  }
  return some;
}

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

CandidateGains::CandidateGains(const CandidateResponses& responses, const EnlargedFit& fit)
    : responses_(responses), fit_(fit) {
  model_basis_ = orthonormal_basis(fit.whitened_jacobian);
  residual_ = project(fit.whitened_residual);
  std::array<Eigen::MatrixXd, kGroups> taken;  // by the model's parameters, columns × p
  parallel_for(taken.size(),
               [&](std::size_t g) { taken[g] = responses.groups[g].products(model_basis_); });
  transform_.resize(responses.place.size());
  parallel_for(transform_.size(), [&](std::size_t c) {
    const auto& [g, first, count] = responses.place[c];
    const auto means = responses.groups[g].means.middleCols(first, count);
    const auto dwells = responses.groups[g].dwells.middleCols(first, count);
    const auto lost = taken[g].middleRows(first, count);
    const Eigen::MatrixXd whole = means.transpose() * means + dwells.transpose() * dwells;
    const Eigen::MatrixXd gram = whole - lost * lost.transpose();
    // Gram-Schmidt in the metric of what the model leaves.
    Eigen::MatrixXd transform(0, count);
    for (Eigen::Index j = 0; j < count; ++j) {
      Eigen::RowVectorXd direction = Eigen::RowVectorXd::Unit(count, j);
      for (Eigen::Index k = 0; k < transform.rows(); ++k)
        direction -= transform.row(k).dot(gram.col(j)) * transform.row(k);
      const double square = (direction * gram * direction.transpose()).value();
      // What is left of an absorbed effect is rounding, not evidence.
      constexpr double kAbsorbed = 1e-3;
      if (!(square > kAbsorbed * kAbsorbed * whole(j, j)) || !(square > 0)) continue;
      transform.conservativeResize(transform.rows() + 1, Eigen::NoChange);
      transform.row(transform.rows() - 1) = direction / std::sqrt(square);
    }
    transform_[c] = std::move(transform);
  });
}

Eigen::MatrixXd CandidateGains::project(const Eigen::MatrixXd& whitened) const {
  return whitened - model_basis_ * (model_basis_.transpose() * whitened);
}

Eigen::MatrixXd CandidateGains::of(const Eigen::MatrixXd& whitened) const {
  std::array<Eigen::MatrixXd, kGroups> seen;  // columns × replicates
  parallel_for(seen.size(),
               [&](std::size_t g) { seen[g] = responses_.groups[g].products(whitened); });
  Eigen::MatrixXd gain(std::ssize(transform_), whitened.cols());
  for (std::size_t c = 0; c < transform_.size(); ++c) {
    const auto& [g, first, count] = responses_.place[c];
    gain.row(static_cast<Eigen::Index>(c)) =
        (transform_[c] * seen[g].middleRows(first, count)).colwise().squaredNorm();
  }
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
    const double seen = whole.products(residual_).value();
    const double square = whole.means.squaredNorm() + whole.dwells.squaredNorm() -
                          whole.products(model_basis_).squaredNorm();
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
