#include "estimator/diagnosis/candidate_responses.h"

#include <algorithm>
#include <utility>

#include "estimator/parallel_for.h"

namespace plumbline {

namespace {

/// The model as it stands, evaluated once for all candidates.
struct Baseline {
  const VisitLog& log;
  const EnlargedParameters& model;
  std::vector<Eigen::Vector3d> a_g;  ///< with the model's own effects on the head
  PerAxis<std::vector<TermInput>> inputs;
  Eigen::MatrixXd angles;  ///< n × kHeadAngles, rad, with those effects
  /// What each angle does to the outputs of each axis, n × kHeadAngles, V/rad; the lift: V.
  PerAxis<Eigen::MatrixXd> slopes_V;

  Baseline(const VisitLog& of_log, const EnlargedParameters& of_model)
      : log(of_log),
        model(of_model),
        a_g(specific_forces_g(of_log, of_model)),
        angles(visits(), std::ssize(kHeadAngles)) {
    parallel_for(kAxisCount, [this](std::size_t axis) {
      for (std::size_t k = 0; k < a_g.size(); ++k)
        inputs[axis].push_back(term_input(log, model, axis, a_g, k));
    });
    slopes_V.fill(Eigen::MatrixXd(angles.rows(), angles.cols()));
    const std::vector<HeadGeometry> heads = head_geometries(log, model);
    for (Eigen::Index k = 0; k < angles.rows(); ++k)
      for (Eigen::Index a = 0; a < angles.cols(); ++a) {
        const auto angle = kHeadAngles[static_cast<std::size_t>(a)];
        const HeadGeometry& head = heads[static_cast<std::size_t>(k)];
        angles(k, a) = head.*angle;
        const Eigen::Vector3d slope_g = slope_g_per_rad(head, angle, log.gamma);
        for (std::size_t i = 0; i < kAxisCount; ++i)
          slopes_V[i](k, a) = model.twelve[i].head<3>().dot(slope_g);
      }
  }
  // The inputs refer to the forces.
  Baseline(const Baseline&) = delete;
  Baseline& operator=(const Baseline&) = delete;

  Eigen::Index visits() const { return std::ssize(a_g); }
  const TermInput& input(std::size_t axis, Eigen::Index visit) const {
    return inputs[axis][static_cast<std::size_t>(visit)];
  }
};

// Term of a sensor effect on its axis, V, n rows.
void set_sensor_response(const Baseline& base, const Candidate& candidate,
                         const SingleAmplitude& single, Eigen::Ref<Eigen::VectorXd> change) {
  const std::size_t axis = candidate.axis;
  const double K_V_per_g = base.model.twelve[axis](static_cast<Eigen::Index>(axis));
  if (single.number.empty()) {
    for (Eigen::Index k = 0; k < change.size(); ++k)
      change(k) = K_V_per_g * candidate.effect->term_g(base.input(axis, k), single.p.data());
    return;
  }
  const ForceFactor factor = candidate.effect->factor();
  for (std::size_t k = 0; k < single.number.size(); ++k)
    change(static_cast<Eigen::Index>(k)) =
        K_V_per_g * (single.number[k] * factor.of(base.a_g[k], axis));
}

// What a head effect changes on all axes, V, 3n rows, to first order. What it changes in the terms
// of sensor effects that are in the model already is left to the refit, as all else that a large
// angle does.
void set_head_response(const Baseline& base, const SingleAmplitude& single,
                       Eigen::Ref<Eigen::VectorXd> change) {
  const Eigen::Index n = base.visits();
  change.setZero();
  for (const auto& [angle, by] : single.displaced) {
    const auto before = base.angles.col(angle).array();
    const Eigen::ArrayXd displaced = (before + by.array()) - before;
    for (Eigen::Index i = 0; i < std::ssize(base.slopes_V); ++i)
      change.segment(i * n, n).array() +=
          base.slopes_V[static_cast<std::size_t>(i)].col(angle).array() * displaced;
  }
}

constexpr std::size_t kHead = 2 * kAxisCount;
constexpr std::size_t kGroups = CandidateResponses::kGroups;

bool is_head(std::size_t group) { return group >= kHead; }
bool is_within_dwell(std::size_t group) { return group >= kAxisCount && group != kHead; }
std::size_t first_axis(std::size_t group) { return is_head(group) ? 0 : group % kAxisCount; }

std::size_t group_of(const Candidate& candidate) {
  const bool within_dwell = candidate.effect->within_dwell();
  if (candidate.effect->subject() == Subject::head) return kHead + (within_dwell ? 1 : 0);
  return candidate.axis + (within_dwell ? kAxisCount : 0);
}

// The course of the dwells that a sensor effect makes, V, n rows a contrast.
void set_dwell_response(const Baseline& base, const Candidate& candidate,
                        const SingleAmplitude& single, Eigen::Ref<Eigen::VectorXd> change) {
  const Eigen::Index n = base.visits();
  const ActiveEffect active{candidate.effect, candidate.axis, single.p, {}};
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::VectorXd contrasts = dwell_contrasts_V(base.input(active.axis, k), active);
    for (Eigen::Index d = 0; d < contrasts.size(); ++d) change(d * n + k) = contrasts(d);
  }
}

// The same of a head effect, axis by axis.
void set_head_dwell_response(const Baseline& base, const SingleAmplitude::Course& course,
                             Eigen::Ref<Eigen::VectorXd> change) {
  const Eigen::Index n = base.visits();
  Eigen::Index row = 0;
  for (const Eigen::MatrixXd& slope_V : base.slopes_V)
    for (const auto& contrast_rad : course.contrasts_rad.colwise()) {
      change.segment(row, n) = slope_V.col(course.angle).cwiseProduct(contrast_rad);
      row += n;
    }
}

}  // namespace

Eigen::MatrixXd CandidateResponses::Group::products(Eigen::Index first, Eigen::Index count,
                                                    const Eigen::MatrixXd& stacked) const {
  Eigen::MatrixXd result =
      means.middleCols(first, count).transpose() * stacked.middleRows(first_row, means.rows());
  if (dwells.rows() > 0)
    result += dwells.middleCols(first, count).transpose() *
              stacked.middleRows(first_dwell_row, dwells.rows());
  return result;
}

std::vector<CandidateResponses::Block> CandidateResponses::blocks() const {
  constexpr Eigen::Index kLargest = 1 << 16;  // numbers
  std::vector<Block> all;
  std::array<std::vector<std::size_t>, kGroups> of_group;
  for (std::size_t c = 0; c < place.size(); ++c) of_group[place[c].group].push_back(c);
  for (std::size_t g = 0; g < kGroups; ++g) {
    const Eigen::Index rows = groups[g].means.rows() + groups[g].dwells.rows();
    for (const std::size_t c : of_group[g]) {
      const auto& [group, first, count] = place[c];
      const bool fits = !all.empty() && all.back().group == group &&
                        (all.back().count + count) * rows <= kLargest;
      if (!fits) all.push_back({group, first, 0, {}});
      all.back().count += count;
      all.back().candidates.push_back(c);
    }
  }
  return all;
}

CandidateResponses candidate_responses_V(const VisitLog& log, const CandidateList& list,
                                         const EnlargedParameters& model) {
  const auto n = static_cast<Eigen::Index>(log.visits.size());
  CandidateResponses responses;
  struct Column {
    const Candidate* candidate;
    const SingleAmplitude* single;
  };
  std::array<std::vector<Column>, kGroups> columns;
  std::vector<std::vector<SingleAmplitude>> own(list.candidates.size());
  for (std::size_t c = 0; c < own.size(); ++c) {
    const Candidate& candidate = list.candidates[c];
    if (!candidate.singles) own[c] = single_amplitudes(log, candidate.active());
    const auto& of_candidate = candidate.singles ? *candidate.singles : own[c];
    const std::size_t group = group_of(candidate);
    responses.place.push_back({group, std::ssize(columns[group]), std::ssize(of_candidate)});
    for (const SingleAmplitude& single : of_candidate)
      columns[group].push_back({&candidate, &single});
  }
  for (std::size_t g = 0; g < kGroups; ++g) {
    CandidateResponses::Group& group = responses.groups[g];
    const Eigen::Index count = std::ssize(columns[g]);
    const auto axis = static_cast<Eigen::Index>(first_axis(g));
    const Eigen::Index rows = is_head(g) ? mean_rows(log) : n;
    group.first_row = axis * n;
    group.means.resize(rows, count);
    group.first_dwell_row = mean_rows(log) + axis * log.dwell_contrasts() * n;
    group.dwells.resize(is_within_dwell(g) ? log.dwell_contrasts() * rows : 0, count);
  }
  const Baseline base(log, model);
  const std::vector<CandidateResponses::Block> blocks = responses.blocks();
  parallel_for(blocks.size(), [&](std::size_t b) {
    const auto& [g, first, count, candidates] = blocks[b];
    CandidateResponses::Group& group = responses.groups[g];
    auto means = group.means.middleCols(first, count);
    auto dwells = group.dwells.middleCols(first, count);
    for (Eigen::Index j = 0; j < count; ++j) {
      const auto& [candidate, single] = columns[g][static_cast<std::size_t>(first + j)];
      if (is_head(g)) {
        set_head_response(base, *single, means.col(j));
        if (is_within_dwell(g)) set_head_dwell_response(base, single->course, dwells.col(j));
      } else {
        set_sensor_response(base, *candidate, *single, means.col(j));
        if (is_within_dwell(g)) set_dwell_response(base, *candidate, *single, dwells.col(j));
      }
    }
  });
  return responses;
}

CandidateResponses whitened(CandidateResponses responses_V, const VisitLog& log,
                            const PoseWhitening& whitening) {
  const auto n = static_cast<Eigen::Index>(log.visits.size());
  const std::vector<CandidateResponses::Block> blocks = responses_V.blocks();
  responses_V.gram.resize(responses_V.place.size());
  parallel_for(blocks.size(), [&](std::size_t b) {
    const auto& [g, first, count, candidates] = blocks[b];
    auto means = responses_V.groups[g].means.middleCols(first, count);
    auto dwells = responses_V.groups[g].dwells.middleCols(first, count);
    const std::size_t axis = first_axis(g);
    const Eigen::Index contrasts = log.dwell_contrasts();
    for (Eigen::Index row = 0; row < means.rows(); row += n)
      whitening.apply_to_means(axis + static_cast<std::size_t>(row / n), means.middleRows(row, n));
    for (Eigen::Index d = 0; d * n < dwells.rows(); ++d)
      dwells.middleRows(d * n, n) /=
          whitening.dwell_sd_V[axis + static_cast<std::size_t>(d / contrasts)](d % contrasts);
    for (const std::size_t c : candidates) {
      const CandidateResponses::Place& at = responses_V.place[c];
      const auto of_means = means.middleCols(at.first - first, at.count);
      const auto of_dwells = dwells.middleCols(at.first - first, at.count);
      responses_V.gram[c] = of_means.transpose() * of_means + of_dwells.transpose() * of_dwells;
    }
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
    if (!responses.gram.empty()) some.gram.push_back(responses.gram[c]);
    for (Eigen::Index j = 0; j < count; ++j) columns[g].push_back(first + j);
  }
  parallel_for(kGroups, [&](std::size_t g) {
    const CandidateResponses::Group& whole = responses.groups[g];
    some.groups[g] = {whole.first_row, whole.means(Eigen::all, columns[g]), whole.first_dwell_row,
                      whole.dwells(Eigen::all, columns[g])};
  });
  return some;
}

}  // namespace plumbline
