#include "app/certificate/sensor_terms.h"

#include <Eigen/Core>
#include <cmath>

namespace plumbline::app {
namespace {

Quantity propagate(double value, const Eigen::Vector4d& gradient, const Eigen::Matrix4d& cov) {
  return {value, std::sqrt(std::max(0.0, gradient.dot(cov * gradient)))};
}

struct Direction {
  Eigen::Vector3d unit;
  Eigen::Matrix3d covariance;
};

/// Unit vector along the input axis (towards positive output of a positive K_ii).
Direction input_axis(const AxisEstimate& estimate, Eigen::Index own) {
  const Eigen::Vector3d k = estimate.value.head<3>();
  const double length = std::copysign(k.norm(), k(own));
  const Eigen::Vector3d unit = k / length;
  const Eigen::Matrix3d projection =
      (Eigen::Matrix3d::Identity() - unit * unit.transpose()) / length;
  return {unit, projection * estimate.covariance.topLeftCorner<3, 3>() * projection.transpose()};
}

}  // namespace

SensorTerms sensor_terms(const TriadEstimate& estimate) {
  SensorTerms terms;
  PerAxis<Direction> axes;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto own = static_cast<Eigen::Index>(i);
    const AxisEstimate& e = estimate[i];
    axes[i] = input_axis(e, own);
    const Eigen::Vector3d k = e.value.head<3>();
    const double K1 = std::copysign(k.norm(), k(own));
    Eigen::Vector4d gradient = Eigen::Vector4d::Zero();
    gradient.head<3>() = k / K1;
    terms.axis[i].scale_V_per_g = propagate(K1, gradient, e.covariance);
    const double K0 = e.value(3) / K1;
    gradient.head<3>() = -K0 / (K1 * K1) * k;
    gradient(3) = 1 / K1;
    terms.axis[i].bias_g = propagate(K0, gradient, e.covariance);
    for (std::size_t j = 0; j < kAxisCount; ++j) {
      if (j == i) continue;
      const auto other = static_cast<Eigen::Index>(j);
      gradient.setZero();
      gradient(other) = 1 / k(own);
      gradient(own) = -k(other) / (k(own) * k(own));
      terms.axis[i].misalignment[j] = propagate(k(other) / k(own), gradient, e.covariance);
    }
  }
  for (std::size_t pair = 0; pair < kAxisCount; ++pair) {
    const Direction& a = axes[(pair + 1) % kAxisCount];
    const Direction& b = axes[(pair + 2) % kAxisCount];
    const double cosine = a.unit.dot(b.unit);
    const double variance = b.unit.dot(a.covariance * b.unit) + a.unit.dot(b.covariance * a.unit);
    // The angle is 90° + e with cos = −sin e.
    terms.nonorthogonality_rad[pair] = {-std::asin(cosine),
                                        std::sqrt(variance / (1 - cosine * cosine))};
  }
  return terms;
}

}  // namespace plumbline::app
