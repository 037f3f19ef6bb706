// Estimation from codes: a reading says between which two code boundaries the voltage was, no more
// and no less. Least squares takes rounding for noise; the likelihood of the interval does not.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// The readings of one axis at one pose, counted by code; everything in steps of the converter.
struct CodeCounts {
  /// (code, how many readings). Which code is zero does not matter, as long as it is the same.
  std::vector<std::pair<double, double>> count;
  double mean = 0;
  bool at_low_end = false;   ///< the lowest code is the converter's first: no lower boundary
  bool at_high_end = false;  ///< likewise above
};

/// What a converter makes of a voltage: the nearest of origin_V + code·step_V.
struct CodeScale {
  double origin_V = 0;
  double step_V = 0;
  double off_scale = 0;                ///< how far a reading may be from its code, steps
  double lowest_V = 0, highest_V = 0;  ///< first and last code of the converter
};
/// As declared; codes are counted from the middle of the span.
CodeScale scale_of(const Adc& adc);

/// Codes of all poses. Nothing when the voltages are not those of codes, as with readings that were
/// averaged or calibrated before.
std::optional<std::vector<CodeCounts>> count_codes(const SampleTable& samples,
                                                   const std::vector<Pose>& poses, std::size_t axis,
                                                   const CodeScale& scale);

/// n poses, everything in steps.
struct IntervalFit {
  Eigen::Vector4d value = Eigen::Vector4d::Zero();       ///< posterior mean
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();  ///< posterior covariance
  double sigma = 0;    ///< noise of one reading before rounding, estimated
  double scatter = 0;  ///< from pose to pose beyond the known one, estimated
  /// What the readings of each pose are worth: a measurement with Gaussian error that says the same
  /// about the parameters as the codes do. Usable by any least squares or filter.
  Eigen::VectorXd equivalent_mean;
  Eigen::VectorXd equivalent_variance;
  bool converged = false;
};

/// Parameters x of A·x (n × 4) given codes. Each pose's true output is known + A·x + e, e ~ N(0,
/// known_variance + scatter²) (positioning, model error: this is what keeps the intervals soft);
/// each reading adds N(0, sigma²) and is rounded; where that is clearly likelier, one in 200
/// readings adds N(0, 9 sigma²) instead (the contaminated normal distribution, Tukey 1960), as
/// recorded sensors do, so that a single reading beyond an edge says little; not in poses of which
/// more than one reading in 20 is off the most frequent code. The posterior under a
/// flat prior is approximated by expectation propagation (Minka 2001): moments of one pose's exact
/// likelihood at a time; sigma and scatter maximise the evidence. Preconditions: A has full rank, n
/// > 4.
IntervalFit fit_intervals(const Eigen::MatrixXd& A, const std::vector<CodeCounts>& codes,
                          const Eigen::VectorXd& known_variance, const Eigen::VectorXd& known);

/// What the codes of each pose say about its output, n poses, steps: a measurement with Gaussian
/// error.
struct CodeSites {
  Eigen::VectorXd mean;
  Eigen::VectorXd variance;
};

/// Where each output is expected at `expected`, independently of the others. How far off that is
/// maximises the evidence, as does whether readings are contaminated as in fit_intervals().
/// Variances are at most 1.
CodeSites sites_about(const Eigen::VectorXd& expected, const std::vector<CodeCounts>& codes,
                      double sigma);

}  // namespace plumbline
