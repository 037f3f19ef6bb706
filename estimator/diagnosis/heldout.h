// Errors of the enlarged model on poses that were left out of its fit.
#pragma once

#include "estimator/diagnosis/enlarged_model.h"
#include "estimator/error_figures.h"

namespace plumbline {

/// Leaves blocks of poses out of fits that share their measured means and noise.
class Heldout {
 public:
  /// mean_V: the measured pose means. The arguments must outlive this.
  Heldout(const VisitLog& log, const PerAxis<Eigen::VectorXd>& mean_V,
          const PoseWhitening& whitening);

  /// Residuals, V, of each axis's poses against the fit to all poses outside their block (all three
  /// axes of a block are left out together), to first order in the parameters, without refitting.
  /// One vector of n per axis for each partition; poses in no block are NaN. `fit` was made with
  /// the same whitening.
  std::vector<PerAxis<Eigen::VectorXd>> residuals_V(const EnlargedFit& fit,
                                                    const std::vector<Blocks>& partitions) const;

 private:
  const VisitLog& log_;
  const PerAxis<Eigen::VectorXd>& mean_V_;
  PerAxis<Eigen::MatrixXd> inverse_;  ///< of the covariance of the pose means
};

/// Share of the excess of a sum of squares over what noise leaves of it that an effect removes.
double share_removed(double without, double with, double expected);

/// Share of what effect `k` of a fitted model has to explain within the dwells (sum of squares of
/// the whitened contrasts beyond noise) that it explains on visits which its size was not taken
/// from. 0 for an effect that is constant within the dwells. `whitening` is that of the fit.
double heldout_dwell_gain(const VisitLog& log, const Observations& observed,
                          const PoseWhitening& whitening, const EnlargedFit& fit, std::size_t k,
                          const std::vector<Blocks>& partitions);

}  // namespace plumbline
