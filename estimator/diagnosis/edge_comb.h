// Steps that come and go at regular times, each too small to be found by itself.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "estimator/diagnosis/candidate_responses.h"

namespace plumbline {

/// A train of pulses: up at first_up_s and every period after and before it, down a width later; of
/// negative size, the other way round.
struct EdgeComb {
  double period_s = 0;
  double first_up_s = 0;
  double width_s = 0;
  double size = 0;             ///< in unit steps
  double gain = 0;             ///< by which it lowers the sum of squares
  double looks = 0;            ///< trains that were looked at
  std::size_t first_step = 0;  ///< among the candidates, the first bias step of that axis
};

/// The train that explains most of a whitened residual r, to first order. Unit steps at the times
/// `at_s` (m, ascending, the first reading excluded) have the products `products` (m) with r and
/// the Gram matrix `gram` (m×m), both free of what the model's parameters take up; a train is the
/// sum of its steps. Every period from eight times the mean distance of the steps to two thirds of
/// their span, so finely that no edge is off by more than that distance, the best of them refined;
/// nothing for m < 12.
std::optional<EdgeComb> best_edge_comb(const std::vector<double>& at_s,
                                       const Eigen::VectorXd& products,
                                       const Eigen::MatrixXd& gram);

/// The best train of the bias steps of one axis beside a fitted model, its size in g; `responses`
/// are those of the candidates at about the model's parameters.
std::optional<EdgeComb> regular_steps(const CandidateList& list,
                                      const CandidateResponses& responses, const EnlargedFit& fit,
                                      std::size_t axis);

}  // namespace plumbline
