// The parameters of an enlarged model and its noise fitted to what was measured.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>

#include "estimator/diagnosis/enlarged_model.h"

namespace plumbline {

/// n × n lower Cholesky factors of the pose-mean covariance per axis with their inverses, and the
/// standard deviations of the contrasts, which are independent from visit to visit.
struct PoseWhitening {
  struct Factor {
    Eigen::MatrixXd lower, inverse;
  };
  PerAxis<std::shared_ptr<const Factor>> factor;  ///< models that leave an axis as it is share it
  PerAxis<Eigen::VectorXd> dwell_sd_V;            ///< one a contrast
  const Eigen::MatrixXd& lower(std::size_t axis) const { return factor[axis]->lower; }
  const Eigen::MatrixXd& inverse(std::size_t axis) const { return factor[axis]->inverse; }
  /// Takes over the covariance of one axis.
  void set(std::size_t axis, const Eigen::MatrixXd& covariance_V2);
  /// Whitens n rows, the means of one axis, in place.
  void apply_to_means(std::size_t axis, Eigen::Ref<Eigen::MatrixXd> means_V) const;
  /// Whitens a matrix of stacked rows, or of the means alone.
  Eigen::MatrixXd apply(const Eigen::MatrixXd& stacked) const;
};

struct EnlargedEstimate {
  EnlargedParameters parameters;
  Eigen::MatrixXd covariance;  ///< of the free parameters
};

struct EnlargedFit : EnlargedEstimate {
  Eigen::VectorXd whitened_residual;  ///< stacked
  Eigen::MatrixXd whitened_jacobian;  ///< stacked × free
  double chi2 = 0;
  bool converged = false;
  /// No direction of the free parameters is unobservable, the effects are no large differences of
  /// each other, and they neither leave a sensitivity open nor take its place.
  bool determined = true;
  bool given_up = false;  ///< out of reach of FitLimits::chi2_of_interest, and not determined
};

/// Whether the sensitivity of each axis to its own direction is within a ratio of `most` of what it
/// or that of another axis was. Where it is not, effects have taken its place; beside creep that of
/// rest may be anything.
bool keeps_sensitivities(const EnlargedParameters& parameters, const EnlargedParameters& start,
                         double most);

/// Whether the sensitivity of an axis to its own direction is known at all, against what it is and
/// was. In a model that is complete it is, even beside creep.
bool knows_sensitivity(const EnlargedFit& fit, const EnlargedParameters& start, std::size_t axis);

/// Whether the tangent says nothing of a time constant, a width or the like of an effect: its
/// standard uncertainty is `most` times what it is, or more.
bool leaves_a_size_open(const EnlargedFit& fit, double most);

/// What the amplitudes of one effect add to the whitened readings, to first order; as long as the
/// rows of the fit's Jacobian.
Eigen::VectorXd whitened_contribution(const EnlargedFit& fit, std::size_t effect);

/// How far a fit is taken.
struct FitLimits {
  int most_iterations = 20;  ///< as many as it takes to settle
  /// A fit that settles far above this χ² is given up on the way: most of those that are made to
  /// be compared are hopeless after two steps.
  double chi2_of_interest = std::numeric_limits<double>::infinity();
};

/// Weighted nonlinear least squares from `start` (Gauss–Newton with step halving, orthogonal
/// factorisation).
EnlargedFit fit_enlarged(const VisitLog& log, const Observations& observed,
                         const PoseWhitening& whitening, const EnlargedParameters& start,
                         const FitLimits& limits = {});

/// The same; where that leaves something undetermined, the shapes of the effects from `first_new`
/// on stay where they ended up: a boundary between two readings, say, that the visits do not place.
EnlargedFit fit_holding_shapes(const VisitLog& log, const Observations& observed,
                               const PoseWhitening& whitening, const EnlargedParameters& start,
                               std::size_t first_new, const FitLimits& limits = {});

/// The best of the same fits from several levels U_0 of the axis of the last effect, as far apart
/// as the effect swings: what follows the codes hangs on the level more finely than the level is
/// known without it. Not determined where none is.
EnlargedFit fit_from_levels(const VisitLog& log, const Observations& observed,
                            const PoseWhitening& whitening, const EnlargedParameters& start);

}  // namespace plumbline
