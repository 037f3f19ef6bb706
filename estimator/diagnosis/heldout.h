// Errors of the enlarged model on poses that were left out of its fit.
#pragma once

#include "estimator/diagnosis/enlarged_fit.h"
#include "estimator/error_figures.h"

namespace plumbline {

/// What a model leaves of poses that it was not fitted to.
struct LeftOut {
  PerAxis<Eigen::VectorXd> residual_V;  ///< n each; NaN for poses in no block
  PerAxis<Eigen::VectorXd> sd_V;        ///< n each, under the noise and with shapes that are known
  /// Sum of squares of an axis in units of the noise, of which the readings outside a block tell a
  /// part: slow noise hides nothing here. About the number of poses for the truth; infinite, and no
  /// residual, for a fit that is not determined.
  PerAxis<double> power{};
};

/// Leaves blocks of poses out of fits that share their measured means and noise.
class Heldout {
 public:
  /// mean_V: the measured pose means. The arguments must outlive this.
  Heldout(const VisitLog& log, const PerAxis<Eigen::VectorXd>& mean_V,
          const PoseWhitening& whitening);

  /// Each axis's poses against the fit to all poses outside their block (all three axes of a block
  /// are left out together), to first order in the parameters, without refitting; one for each
  /// partition. `fit` was made with the same whitening.
  std::vector<LeftOut> leave_out(const EnlargedFit& fit,
                                 const std::vector<Blocks>& partitions) const;

 private:
  const VisitLog& log_;
  const PerAxis<Eigen::VectorXd>& mean_V_;
  PerAxis<Eigen::MatrixXd> inverse_;  ///< of the covariance of the pose means
  PerAxis<Eigen::VectorXd> mean_V2_;  ///< their variances
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
