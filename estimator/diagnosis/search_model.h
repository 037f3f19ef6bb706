// The model that a search has arrived at, with its noise and what each of its effects cost to find.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "estimator/diagnosis/candidate_gains.h"
#include "estimator/diagnosis/noise_stage.h"
#include "estimator/diagnosis/search.h"

namespace plumbline {

class SearchModel {
 public:
  /// Begins with input.start. All three must live as long.
  SearchModel(const SearchInput& input, const CandidateList& list, const SearchOptions& options);

  const SearchInput& input() const { return *input_; }
  const CandidateList& list() const { return *list_; }
  const SearchOptions& options() const { return *options_; }
  const Stage& stage() const { return stage_; }
  /// Whether the noise of the stage was estimated beside its model and nothing else.
  bool noise_is_own() const { return noise_is_own_; }

  /// Effects in the model, and which of the candidates each of them is.
  std::size_t size() const { return chosen_.size(); }
  std::size_t index(std::size_t effect) const { return chosen_[effect]; }
  const Candidate& candidate(std::size_t effect) const { return list().candidates[index(effect)]; }
  /// Whether the codes prove it.
  bool is_certain(const Candidate& candidate) const;
  /// An effect stands in the model once; a second pose, slip or step is another matter.
  bool is_chosen(const Candidate& candidate) const;
  /// The same of the model without some of its effects.
  bool is_chosen_beside(const std::vector<std::size_t>& effects, const Candidate& candidate) const;
  /// What proved superfluous once would come back and go again.
  bool is_dropped(const Candidate& candidate) const;

  /// How many independent looks the search amounts to.
  double looks() const { return looks_; }
  void set_looks(double looks) { looks_ = looks; }
  /// Whether the model has the same effect on another axis: what one shows is asked of the others
  /// first.
  bool is_on_another_axis(const Candidate& candidate) const;
  /// How many looks a candidate competes with.
  double looks_of(const Candidate& candidate) const;
  /// p-value of a candidate in the search as a whole.
  double p_of(const Candidate& candidate, double log_p_local) const;
  /// What counts as significant: of a candidate, and among the slow ones of each axis.
  double false_alarm(const Candidate& candidate) const;
  PerAxis<double> false_alarm_of_slow() const;
  /// log of the probability that noise alone gives a candidate what it gains over the fit `before`
  /// it. A single reading of a coarse converter strays further than Gaussian noise, but by no more
  /// than a step. Both fits with the noise as it stands.
  double log_p_of(std::size_t candidate, const EnlargedFit& before, const EnlargedFit& with,
                  int dof) const;
  /// What a candidate must gain in χ² to be worth its amplitudes, its choice among many (which its
  /// shapes are part of) and its want of a name.
  double price(std::size_t candidate) const;
  /// The same of the last effect of a fit. A transient of which the dwells do not show that it dies
  /// away has no more right to a name than what has none.
  double price_in(const EnlargedFit& with, std::size_t candidate) const;
  /// What some of the model's effects had to gain together.
  double price_of(const std::vector<std::size_t>& effects) const;
  double price() const;  ///< all of them
  /// −2 ln L of the readings of some axes, as freed of rounding for `freed`, each axis in the noise
  /// beside this model, and the price.
  double cost(const Stage& freed, const PerAxis<bool>& axes) const;

  /// The candidates beside the model as it stands.
  const CandidateResponses& responses();

  /// Fits with the noise as it stands: of a model with one more effect, of one with one more
  /// candidate (as fit_with_candidate()), of this one without some of its effects (ascending).
  EnlargedFit fit_with(const EnlargedParameters& model, const ActiveEffect& active,
                       const FitLimits& limits = {}) const;
  EnlargedFit fit_with(const CandidateGains& gains, std::size_t place, const Candidate& candidate,
                       double promised, const FitLimits& limits = {}) const;
  EnlargedFit fit_without(const std::vector<std::size_t>& effects) const;
  /// Such a fit with one of those close to its last effect (Effect::closer()) in its place, where
  /// that explains clearly more; and so on from there.
  EnlargedFit looked_closer(EnlargedFit fit) const;
  /// A candidate that may come into the model, and the model with it.
  struct Entry {
    std::size_t candidate = 0;
    double p = 1;  ///< of the search
    EnlargedParameters parameters;
  };
  /// Each takes over another model with noise of its own, if its parameters are determined, and
  /// says whether it did: with one more effect; with one in the place of some (ascending).
  bool add(const Entry& with);
  bool exchange(const std::vector<std::size_t>& effects, const Entry& with);
  /// With several, of which the last one's model holds all.
  bool exchange(const std::vector<std::size_t>& effects, std::vector<Entry> with);
  /// Goes on without some effects (ascending), which are not looked for again; false if that cannot
  /// be.
  bool drop(const std::vector<std::size_t>& effects);
  /// What a newcomer has made superfluous goes.
  void drop_superfluous();
  /// Where far more is left than the noise explains, what is found has to stand out of that: an
  /// effect that would not goes.
  void drop_what_excess_explains();
  /// Noise that was estimated beside more than the model is estimated beside it alone; false if
  /// that cannot be.
  bool take_own_noise() { return adopt(stage_.fit.parameters); }

  /// All but p_best_rest. Leaves nothing here.
  SearchResult take_result();

 private:
  bool adopt(const EnlargedParameters& parameters);
  std::optional<EnlargedFit> closer_to(const EnlargedFit& fit) const;
  void look_closer();
  void leave_ties_open();
  void forget(std::size_t effect);
  /// The p-value of what takes the place of some effects. The noise beside those was estimated as
  /// if nothing slow were noise: a slow newcomer is no surer than the readings say with noise of
  /// its own, or than those were.
  double p_in_place_of(const std::vector<std::size_t>& effects, const Entry& newcomer) const;
  bool drop(const std::vector<std::size_t>& effects, const EnlargedFit& without);
  double p_of_removal(std::size_t effect, const EnlargedFit& without, double excess = 1) const;
  /// What is left of the axes that an effect acts on, in χ² for each degree of freedom; 1 where it
  /// may be chance, or little.
  double excess(std::size_t effect) const;

  // Pointers: a model that was kept takes the place of another.
  const SearchInput* input_;
  const CandidateList* list_;
  const SearchOptions* options_;
  Stage stage_;
  bool noise_is_own_ = false;
  std::shared_ptr<const CandidateResponses> responses_;  ///< once they were asked for
  std::vector<std::size_t> chosen_;  ///< candidates, in the order of the model's effects
  std::vector<double> p_values_;
  std::vector<std::size_t> dropped_;  ///< families
  double looks_ = 0;
};

}  // namespace plumbline
