#include "estimator/diagnosis/candidates.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "estimator/diagnosis/enlarged_model.h"
#include "estimator/effects/catalogue.h"
#include "estimator/effects/covariate.h"
#include "estimator/effects/function_of_driver.h"
#include "estimator/effects/smooth_term.h"
#include "estimator/parallel_for.h"

namespace plumbline {

double looks_on_axes(const CandidateList& list, const Candidate& candidate) {
  return kAxisCount * static_cast<double>(list.family_size[candidate.family]);
}

namespace {

/// Of an effect on each axis (the head: on the first); none where it lacks a column.
PerAxis<std::vector<Hypothesis>> hypotheses_of(const VisitLog& log, const Effect& effect) {
  PerAxis<std::vector<Hypothesis>> of_axis;
  if (!log.lacking(effect.columns()).empty()) return of_axis;
  const std::size_t axes = effect.subject() == Subject::head ? 1 : kAxisCount;
  for (std::size_t axis = 0; axis < axes; ++axis)
    if (effect.acts_on(axis)) of_axis[axis] = effect.hypotheses(log, axis);
  return of_axis;
}

void add_candidates(CandidateList& list, const Effect& effect, double handicap,
                    PerAxis<std::vector<Hypothesis>> hypotheses) {
  const auto infos = effect.parameters();
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    // Hypotheses that free the same amplitudes are the same family.
    std::vector<std::pair<std::vector<bool>, std::size_t>> families;
    for (Hypothesis& hypothesis : hypotheses[axis]) {
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

}  // namespace

void add_candidates(CandidateList& list, const VisitLog& log, const Effect& effect,
                    double handicap) {
  add_candidates(list, effect, handicap, hypotheses_of(log, effect));
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

/// Values with one of the amplitudes each; of shapes and indices alone as they stand.
std::vector<std::vector<double>> one_by_one(const ActiveEffect& active) {
  const auto infos = active.effect->parameters();
  std::vector<std::vector<double>> all;
  for (std::size_t k = 0; k < infos.size(); ++k) {
    if (infos[k].role != ParameterRole::amplitude || active.p[k] == 0) continue;
    std::vector<double>& p = all.emplace_back(active.p);
    for (std::size_t other = 0; other < infos.size(); ++other) {
      if (other != k && infos[other].role == ParameterRole::amplitude) p[other] = 0;
    }
  }
  if (all.empty()) all.push_back(active.p);
  return all;
}

std::vector<SingleAmplitude::Displacement> displacements(const VisitLog& log, const Effect& effect,
                                                         const double* p) {
  Eigen::MatrixXd by(std::ssize(log.visits), std::ssize(kHeadAngles));
  for (std::size_t k = 0; k < log.visits.size(); ++k) {
    HeadGeometry displaced;
    effect.displace(log, k, p, displaced);
    for (std::size_t a = 0; a < kHeadAngles.size(); ++a)
      by(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(a)) = displaced.*kHeadAngles[a];
  }
  std::vector<SingleAmplitude::Displacement> all;
  for (Eigen::Index a = 0; a < by.cols(); ++a)
    if ((by.col(a).array() != 0).any()) all.push_back({a, by.col(a)});
  return all;
}

SingleAmplitude::Course course(const VisitLog& log, const Effect& effect, const double* p) {
  SingleAmplitude::Course course;
  course.contrasts_rad.resize(std::ssize(log.visits), log.dwell_contrasts());
  for (std::size_t k = 0; k < log.visits.size(); ++k) {
    const AngleCourse at = effect.angle_course(log, k, p);
    course.angle =
        std::find(kHeadAngles.begin(), kHeadAngles.end(), at.angle) - kHeadAngles.begin();
    course.contrasts_rad.row(static_cast<Eigen::Index>(k)) = contrasts_rad(log, k, at).transpose();
  }
  return course;
}

}  // namespace

std::vector<SingleAmplitude> single_amplitudes(const VisitLog& log, const ActiveEffect& active) {
  const Effect& effect = *active.effect;
  std::vector<SingleAmplitude> singles;
  for (std::vector<double>& p : one_by_one(active)) {
    SingleAmplitude& single = singles.emplace_back();
    if (effect.subject() == Subject::sensor) {
      single.number = effect.numbers_of_visits(log, active.axis, p.data());
    } else {
      single.displaced = displacements(log, effect, p.data());
      if (effect.within_dwell()) single.course = course(log, effect, p.data());
    }
    single.p = std::move(p);
  }
  return singles;
}

namespace {

/// Which of the candidates each has its single amplitudes from: itself, or the one like it of the
/// first axis that its effect acts on.
std::vector<std::size_t> shared_with(const std::vector<Candidate>& candidates) {
  std::vector<std::size_t> from(candidates.size());
  std::size_t first_of_effect = 0, first_of_axis = 0;
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    const Candidate& candidate = candidates[c];
    if (candidate.effect != candidates[first_of_effect].effect) first_of_effect = c;
    if (c == first_of_effect || candidate.axis != candidates[c - 1].axis) first_of_axis = c;
    const std::size_t like_it = first_of_effect + (c - first_of_axis);
    const bool shares = candidate.effect->same_numbers_on_axes() &&
                        candidates[like_it].axis == candidates[first_of_effect].axis &&
                        candidates[like_it].hypothesis.p == candidate.hypothesis.p;
    from[c] = shares ? like_it : c;
  }
  return from;
}

void work_out_singles(const VisitLog& log, std::vector<Candidate>& candidates) {
  const std::vector<std::size_t> from = shared_with(candidates);
  parallel_for(candidates.size(), [&](std::size_t c) {
    if (from[c] == c)
      candidates[c].singles = std::make_shared<const std::vector<SingleAmplitude>>(
          single_amplitudes(log, candidates[c].active()));
  });
  for (std::size_t c = 0; c < candidates.size(); ++c)
    candidates[c].singles = candidates[from[c]].singles;
}

}  // namespace

CandidateList all_candidates(const VisitLog& log,
                             const std::vector<std::shared_ptr<const Effect>>& own) {
  CandidateList list;
  struct Asked {
    const Effect* effect;
    double handicap;
  };
  std::vector<Asked> asked;
  const auto ask = [&](std::shared_ptr<const Effect> effect, double handicap) {
    asked.push_back({effect.get(), handicap});
    list.owned.push_back(std::move(effect));
  };
  for (const Effect* effect : effect_catalogue()) asked.push_back({effect, 0});
  for (auto& effect : covariate_effects(log)) ask(std::move(effect), 0);
  for (auto& term : smooth_terms(log, SmoothTermSelection::shown_by_these_visits)) {
    if (imitates_proven_rounding(log, *term)) continue;
    const double handicap = kHandicapOfUnnamed + term->log_choices();
    ask(std::move(term), handicap);
  }
  for (const auto& effect : own) ask(effect, 0);

  std::vector<PerAxis<std::vector<Hypothesis>>> hypotheses(asked.size());
  parallel_for(asked.size(),
               [&](std::size_t k) { hypotheses[k] = hypotheses_of(log, *asked[k].effect); });
  for (std::size_t k = 0; k < asked.size(); ++k)
    add_candidates(list, *asked[k].effect, asked[k].handicap, std::move(hypotheses[k]));
  if (log.is_coarse()) {
    for (Candidate& candidate : list.candidates)
      candidate.of_one_coarse_reading = candidate.effect->concerns_one_visit();
  }
  work_out_singles(log, list.candidates);
  return list;
}

}  // namespace plumbline
