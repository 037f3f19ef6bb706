// Decides whether rounding matters on one axis of a run and, if so, what its codes are worth.
#pragma once

#include <optional>

#include "estimator/calibrate.h"
#include "estimator/quantization/interval_fit.h"

namespace plumbline {

/// The poses of one axis as measurements with Gaussian error, V.
struct QuantizedAxis {
  Eigen::VectorXd mean_V;       ///< n
  Eigen::VectorXd variance_V2;  ///< n, positioning and noise included
  QuantizationUse use;

  /// n: variance_V2 without that part of the scatter from pose to pose; at least a tenth of it,
  /// since the scatter is an estimate.
  Eigen::VectorXd variance_without_V2(double scatter_V2) const {
    return (variance_V2.array() - scatter_V2).max(0.1 * variance_V2.array());
  }
};

/// Nothing when the noise is large enough to smooth the steps (readings scatter by more than 0.9
/// steps: least squares is then as good), when the voltages are no codes, when there are fewer than
/// 12 poses or when the estimation does not converge. A: n × 4; known_V2: n; known_V: n, what
/// the output is known to be beside A·x.
std::optional<QuantizedAxis> quantized_axis(const MeasurementSet& run, const Eigen::MatrixXd& A,
                                            const Eigen::VectorXd& known_V2,
                                            const Eigen::VectorXd& known_V, const CodeScale& scale,
                                            std::size_t axis);

}  // namespace plumbline
