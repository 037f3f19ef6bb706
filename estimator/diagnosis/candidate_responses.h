// What every candidate does to the readings.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "estimator/diagnosis/candidates.h"
#include "estimator/diagnosis/enlarged_fit.h"

namespace plumbline {

/// What each candidate would add to the whitened observations. A sensor effect moves one axis only,
/// so its columns hold n rows; those of the head hold 3n; what changes within the dwell has rows
/// for the contrasts besides.
struct CandidateResponses {
  struct Group {
    Eigen::Index first_row = 0;  ///< of `means` among the stacked rows
    Eigen::MatrixXd means;
    Eigen::Index first_dwell_row = 0;
    Eigen::MatrixXd dwells;  ///< no rows for what is constant within the dwell
    /// Products of `count` columns from `first` on with a stacked matrix, count × its columns.
    Eigen::MatrixXd products(Eigen::Index first, Eigen::Index count,
                             const Eigen::MatrixXd& stacked) const;
  };
  struct Place {
    std::size_t group = 0;
    Eigen::Index first = 0;
    Eigen::Index count = 0;
  };
  /// x, y, z; x, y, z within the dwell; head; head within the dwell.
  static constexpr std::size_t kGroups = 2 * kAxisCount + 2;
  std::array<Group, kGroups> groups;
  std::vector<Place> place;  ///< one per candidate
  /// Of whitened columns, one per candidate: the products of its columns with each other.
  std::vector<Eigen::MatrixXd> gram;

  /// Candidates whose columns are neighbours, few enough to stay in the cache.
  struct Block {
    std::size_t group;
    Eigen::Index first, count;
    std::vector<std::size_t> candidates;
  };
  std::vector<Block> blocks() const;
};

/// One column for each amplitude of each candidate, at the parameters of `model`.
CandidateResponses candidate_responses(const VisitLog& log, const CandidateList& list,
                                       const PoseWhitening& whitening,
                                       const EnlargedParameters& model);

/// The same before they are whitened, V.
CandidateResponses candidate_responses_V(const VisitLog& log, const CandidateList& list,
                                         const EnlargedParameters& model);
CandidateResponses whitened(CandidateResponses responses_V, const VisitLog& log,
                            const PoseWhitening& whitening);
/// Those of some of the candidates.
CandidateResponses some_of(const CandidateResponses& responses,
                           const std::vector<std::size_t>& candidates);

}  // namespace plumbline
