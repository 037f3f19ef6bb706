// What a search found, in words and numbers: effects, rivals, limits of what was not found.
#pragma once

#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/alternatives.h"
#include "estimator/diagnosis/noise_drivers.h"
#include "estimator/diagnosis/search.h"
#include "estimator/diagnosis/separation.h"

namespace plumbline {

/// What else a finding could be, and what would tell.
struct Rivals {
  std::vector<Alternative> alternatives;
  Separation separation;
};

/// Of each effect of the search's final model. `list` is that of the search; `reach` bounds the
/// poses that are suggested.
std::vector<Rivals> find_rivals(const SearchInput& input, const CandidateList& list,
                                const SearchResult& search, const HeadReach& reach);

/// The diagnosis of the search's final model: effects with what else they could be and what would
/// decide between them, structures that are not on the list, limits of what was not found, verdict.
/// `list` is that of the search, `rivals` those of its effects. Held-out gains and the filter's
/// estimates are attached to it afterwards.
Diagnosis describe_findings(const SearchInput& input, const CandidateList& list,
                            const SearchResult& search, const std::vector<Rivals>& rivals);

/// Adds the filter's estimate of the same model to every parameter, with E_n between it and
/// `batch`, both with the uncertainties they have if the model is the true one. What the diagnosis
/// states beyond those of `batch` is added to the filter's, too.
void attach_filter(const VisitLog& log, const EnlargedEstimate& batch,
                   const EnlargedEstimate& filter, Diagnosis& diagnosis);

/// Adds what speaks for each effect: the shares of the held-out excess that they remove, one for
/// each evidence, and the losses of fit without them.
void attach_gains(const SearchResult& found, const std::vector<double>& gains,
                  Diagnosis& diagnosis);

/// Adds what the noise follows, but for noise within the dwells on axes where something in the
/// model that was found changes the scatter there by itself.
void add_noise(const std::vector<NoiseDriver>& follows, const EnlargedParameters& model,
               Diagnosis& diagnosis);

}  // namespace plumbline
