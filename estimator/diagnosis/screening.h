// How likely the gains of candidates are in pure noise: each by itself, and as the best of a
// search.
#pragma once

#include <cstdint>
#include <vector>

#include "estimator/diagnosis/candidate_gains.h"

namespace plumbline {

/// log of P(χ²_dof > x), also where the probability itself is no longer a double.
double log_chi_squared_tail(double x, double dof);

/// z with P(|Z| > z) of the standard normal distribution of this logarithm, ≤ 0.
double sigmas_of(double log_p);

/// How many independent looks a search amounts to: the best p-value of a search over pure noise
/// (`rows` stacked rows, simulated `replicates` times) is that of the best of so many.
double effective_looks(const CandidateGains& gains_of, std::size_t candidates, Eigen::Index rows,
                       std::uint64_t seed, int replicates);

/// p-value of the best of so many looks.
double p_of_search(double log_p_local, double looks);

struct Scored {
  std::size_t candidate = 0;
  double log_p = 0;  ///< of its own test
  double score = 0;  ///< log_p plus the price of a large family and of having no name
  int dof = 0;
};

/// Best hypothesis of each family by its first-order gain (one entry a candidate), best family
/// first. What the model absorbs is left out.
std::vector<Scored> screen(const CandidateList& list, const CandidateGains& gains_of,
                           const Eigen::VectorXd& gains);

}  // namespace plumbline
