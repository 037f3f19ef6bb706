// The parameters in the terms of IEEE Std 1293: scale factors, biases, input axes.
#pragma once

#include "estimator/calibrate.h"

namespace plumbline::app {

/// A value with its standard uncertainty.
struct Quantity {
  double value = 0;
  double u = 0;
};

/// One axis. With k the row K_i of the sensitivity matrix and U_i0 its offset:
struct AxisTerms {
  Quantity scale_V_per_g;  ///< K1 = |k|, signed as K_ii
  Quantity bias_g;         ///< K0 = U_i0 / K1
  PerAxis<Quantity>
      misalignment;  ///< rad: k_j / k_i, the tilt of the input axis towards axis j ≠ i
};

struct SensorTerms {
  PerAxis<AxisTerms> axis;
  /// By how much the angles between input axes exceed 90°, rad: y–z, z–x, x–y. Unlike the
  /// misalignments they do not depend on how the unit was mounted.
  PerAxis<Quantity> nonorthogonality_rad;
};

/// Uncertainties by first-order propagation of each axis's covariance; the axes are independent
/// but for the local gravity, which changes none of the angles.
SensorTerms sensor_terms(const TriadEstimate& estimate);

}  // namespace plumbline::app
