#include "estimator/diagnosis/validated_search.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <utility>

#include "estimator/diagnosis/heldout.h"
#include "estimator/diagnosis/stuck_bits.h"
#include "estimator/error_figures.h"
#include "estimator/fit/generalised_fit.h"

namespace plumbline {
namespace {

/// What left-out poses say of models of the same readings.
class Validation {
 public:
  /// log: that `found` is a model of; both must outlive this.
  Validation(const VisitLog& log, const std::vector<PoseMean>& poses, const SearchResult& found)
      : log_(log),
        found_(found),
        partitions_{time_blocks(poses), position_blocks(poses)},
        heldout_(log, found.observed.mean_V, found.whitening) {}

  std::vector<LeftOut> leave_out(const EnlargedFit& fit) const {
    return heldout_.leave_out(fit, partitions_);
  }

  PerAxis<LeftOutErrors> errors(const EnlargedFit& fit) const {
    const std::vector<LeftOut> parts = leave_out(fit);
    PerAxis<LeftOutErrors> all;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const double factor = fit.parameters.mps2_per_V(i);
      const auto n = parts[0].residual_V[i].size();
      all[i] = {Eigen::VectorXd(2 * n), Eigen::VectorXd(2 * n)};
      all[i].error_mps2 << factor * parts[0].residual_V[i], factor * parts[1].residual_V[i];
      all[i].u_mps2 << std::abs(factor) * parts[0].sd_V[i], std::abs(factor) * parts[1].sd_V[i];
    }
    return all;
  }
  double rms_mps2(const EnlargedFit& fit, std::size_t axis) const {
    return rms(errors(fit)[axis].error_mps2);
  }

  EnlargedFit fit_without(std::size_t k) const {
    return fit_enlarged(log_, found_.observed, found_.whitening,
                        without_effect(found_.fit.parameters, k));
  }

  /// The model without one of its effects, and the share of the left-out excess that the effect
  /// removes, of which `with` is what is left with it.
  struct Without {
    EnlargedFit fit;
    double gain = 0;
  };
  Without without(std::size_t k, const std::vector<LeftOut>& with) const {
    Without without{fit_without(k)};
    if (!without.fit.determined) return without;
    // What changes within the dwell may hardly be seen in the means.
    without.gain = std::max(
        gain(leave_out(without.fit), with, axes_of(found_.fit.parameters.effects[k])),
        heldout_dwell_gain(log_, found_.observed, found_.whitening, found_.fit, k, partitions_));
    return without;
  }

 private:
  /// Share of the excess held-out residual power that an effect removes.
  static double gain(const std::vector<LeftOut>& without, const std::vector<LeftOut>& with,
                     const std::vector<std::size_t>& axes) {
    double power_without = 0, power_with = 0, expected = 0;
    for (std::size_t part = 0; part < with.size(); ++part)
      for (const std::size_t axis : axes) {
        power_without += without[part].power[axis];
        power_with += with[part].power[axis];
        expected += static_cast<double>(with[part].residual_V[axis].size());
      }
    return share_removed(power_without, power_with, expected);
  }

  const VisitLog& log_;
  const SearchResult& found_;
  std::vector<Blocks> partitions_;
  Heldout heldout_;
};

/// Effects that do not help where they were not fitted are no effects. Says which were dropped, one
/// after the other, by their places in what was left of the model; `gains`: of those that stay.
std::vector<std::size_t> drop_what_does_not_carry(const VisitLog& log, const Validation& validation,
                                                  SearchResult& found, std::vector<double>& gains) {
  std::vector<std::size_t> all_dropped;
  for (bool dropped = true; dropped && !found.evidence.empty();) {
    dropped = false;
    gains.clear();
    const std::vector<LeftOut> with = validation.leave_out(found.fit);
    for (std::size_t k = 0; k < found.evidence.size(); ++k) {
      const ActiveEffect& active = found.fit.parameters.effects[k];
      Validation::Without without = validation.without(k, with);
      // One pose's own error cannot be predicted from other poses.
      const bool own =
          active.effect->concerns_one_visit() || active.effect->certain(log, active.axis);
      if (without.gain > 0 || own || !without.fit.determined) {
        gains.push_back(std::max(without.gain, 0.0));
        continue;
      }
      found.remove(k);
      found.fit = std::move(without.fit);
      all_dropped.push_back(k);
      dropped = true;
      break;
    }
  }
  return all_dropped;
}

/// Effects with which the poses of an axis that were left out of the fit come out far worse than by
/// the 12 parameters are none, however much more like noise they make the rest; nor are those that
/// leave its sensitivity unknown. Of them the one without which the poses come out best, and with
/// which the sensitivity goes if one alone takes it; nothing where there are none.
std::optional<std::size_t> what_worsens(const SearchInput& search,
                                        const std::vector<PoseMean>& poses,
                                        const SearchResult& found,
                                        const PerAxis<double>& before_mps2) {
  constexpr double kFar = 2;  // slow noise alone may make it worse by a little
  if (found.evidence.empty()) return {};
  const VisitLog& log = search.log;
  const Validation validation(log, poses, found);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const bool is_known = knows_sensitivity(found.fit, search.start, axis);
    if (is_known && !(validation.rms_mps2(found.fit, axis) > kFar * before_mps2[axis])) continue;
    std::optional<std::size_t> worst;
    bool worst_takes_it = false;
    double least_mps2 = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < found.evidence.size(); ++k) {
      const ActiveEffect& active = found.fit.parameters.effects[k];
      if (active.effect->subject() != Subject::sensor || active.axis != axis ||
          active.effect->certain(log, axis))
        continue;
      const EnlargedFit without = validation.fit_without(k);
      if (!without.determined) continue;
      const bool takes_it = !is_known && knows_sensitivity(without, search.start, axis);
      if (worst_takes_it && !takes_it) continue;
      const double left_mps2 = validation.rms_mps2(without, axis);
      if (!worst || (takes_it && !worst_takes_it) || left_mps2 < least_mps2) {
        least_mps2 = left_mps2;
        worst = k;
        worst_takes_it = takes_it;
      }
    }
    if (worst) return worst;
  }
  return {};
}

void drop_what_worsens(const SearchInput& search, const std::vector<PoseMean>& poses,
                       const PerAxis<double>& before_mps2, SearchResult& found) {
  while (const auto worst = what_worsens(search, poses, found, before_mps2)) {
    found.remove(*worst);
    found.fit = fit_enlarged(search.log, found.observed, found.whitening, found.fit.parameters);
  }
}

/// Of all candidates beside a model that has become smaller: what failed stays one for those who
/// ask what else the readings allow.
void renew_responses(const SearchInput& search, ValidatedSearch& result) {
  SearchResult& found = result.found;
  found.responses = std::make_shared<const CandidateResponses>(
      candidate_responses(search.log, result.candidates, found.whitening, found.fit.parameters));
}

/// Leaves what carries over to poses that were left out.
void keep_what_carries(const SearchInput& search, const std::vector<PoseMean>& poses,
                       ValidatedSearch& result) {
  result.gains.clear();
  result.left_out = {};
  SearchResult& found = result.found;
  if (found.evidence.empty()) return;
  const Validation validation(search.log, poses, found);
  if (result.codes) {
    // Edges of the bits hide what carries over.
    SearchResult& without = result.codes->before_converter;
    const std::vector<std::size_t> dropped = drop_what_does_not_carry(
        *result.log, Validation(*result.log, poses, without), without, result.gains);
    drop_effects(search, dropped, found, *result.codes);
    if (!dropped.empty()) renew_responses(search, result);
    const std::vector<LeftOut> with = validation.leave_out(found.fit);
    for (std::size_t k = result.gains.size(); k < found.evidence.size(); ++k)
      result.gains.push_back(std::max(0.0, validation.without(k, with).gain));
  } else {
    drop_what_does_not_carry(search.log, validation, found, result.gains);
  }
  if (!found.evidence.empty()) result.left_out = validation.errors(found.fit);
}

std::vector<std::size_t> families_of(const SearchResult& found) {
  std::vector<std::size_t> families;
  for (const Evidence& evidence : found.evidence) families.push_back(evidence.candidate.family);
  std::sort(families.begin(), families.end());
  return families;
}

/// Searches; again without what makes poses that are left out worse, or where nothing carries over
/// to them: what was found may have stood in the way of what does. Beside what does carry over,
/// what else seemed to be there is chance, and another name for it would be, too.
void search_past_what_fails(const SearchInput& search, const std::vector<PoseMean>& poses,
                            const PerAxis<double>& before_mps2, const SearchOptions& options,
                            ValidatedSearch& result) {
  constexpr int kMostSearches = 3;
  CandidateList open = result.candidates;
  for (int k = 0; k < kMostSearches; ++k) {
    result.found = search_effects(search, open, options);
    const std::vector<std::size_t> families = families_of(result.found);
    drop_what_worsens(search, poses, before_mps2, result.found);
    const bool worsened = result.found.evidence.size() < families.size();
    keep_what_carries(search, poses, result);
    std::vector<std::size_t> failed;
    const std::vector<std::size_t> kept = families_of(result.found);
    std::set_difference(families.begin(), families.end(), kept.begin(), kept.end(),
                        std::back_inserter(failed));
    if (failed.empty()) break;
    std::erase_if(open.candidates, [&](const Candidate& candidate) {
      return std::binary_search(failed.begin(), failed.end(), candidate.family);
    });
    if (!worsened && !result.found.evidence.empty()) break;
  }
  if (open.candidates.size() < result.candidates.candidates.size()) renew_responses(search, result);
}

}  // namespace

ValidatedSearch search_validated(const SearchInput& search, const CalibrationInput& measured,
                                 const std::vector<PoseMean>& poses,
                                 const PerAxis<double>& before_mps2,
                                 const std::vector<std::shared_ptr<const Effect>>& own,
                                 const SearchOptions& options) {
  ValidatedSearch result;
  if (auto beside_bits = search_beside_stuck_bits(
          search, measured, design_matrix(poses, measured.description.gravity), own, options)) {
    result.log = std::move(beside_bits->log);
    result.candidates = std::move(beside_bits->candidates);
    result.found = std::move(beside_bits->found);
    result.codes = std::move(beside_bits->given_back);
    keep_what_carries(search, poses, result);
  } else {
    result.candidates = all_candidates(search.log, own);
    search_past_what_fails(search, poses, before_mps2, options, result);
  }
  return result;
}

}  // namespace plumbline
