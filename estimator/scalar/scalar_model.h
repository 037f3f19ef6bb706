// The angle-free model: whatever the attitude, the specific force at rest has the magnitude of
// local gravity (Avrutov & Mazepa 2012).
//
//     a = T·S·(m − b) − effects,   |a| = g_local
//
// m is the reading, b the bias in its unit, S = diag(scale) in m/s² per unit, and T upper unit
// triangular, [[1, −yz, zy], [0, 1, −zx], [0, 0, 1]].
//
// Gauge: |a| does not change under a rotation of the whole triad, so three of the nine terms of a
// free 3 × 3 matrix are chosen, not measured: z_s is the sensitive axis z, and x_s is perpendicular
// to the sensitive axes y and z. Nor does |a| change its sign: the scales are positive by choice.
// What is measured are the angles between the sensitive axes.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/diagnosis/enlarged_model.h"
#include "estimator/effects/visit_log.h"

namespace plumbline {

inline constexpr Eigen::Index kScalarCount = 9;
/// [b_x b_y b_z, scale_x scale_y scale_z, yz zy zx]
using ScalarVector = Eigen::Matrix<double, kScalarCount, 1>;

struct ScalarParameters {
  ScalarVector nine = ScalarVector::Zero();
  std::vector<ActiveEffect> effects;  ///< sensor effects only

  Eigen::Index free_count() const;
  Eigen::VectorXd free_values() const;
  void set_free_values(const Eigen::VectorXd& values);
};

/// T·S, m/s² per unit.
Eigen::Matrix3d scalar_matrix(const ScalarVector& nine);
/// Specific force of one reading by the nine parameters alone, m/s².
Eigen::Vector3d scalar_force_mps2(const ScalarVector& nine, const Eigen::Vector3d& reading);

/// Readings of the rests together with what effects depend on.
struct ScalarData {
  std::vector<Eigen::Vector3d> reading;  ///< n means
  double local_mps2 = 0;
  /// Visits whose angles are those of the calibrated specific force, see with_attitudes().
  VisitLog log;
};

/// The angles (δ, h) under which a head would show the specific forces of these parameters, so that
/// effects that depend on attitude and order can be evaluated.
void set_attitudes(ScalarData& data, const ScalarVector& nine);

/// Specific force of every rest with the effects taken off, m/s².
std::vector<Eigen::Vector3d> scalar_forces_mps2(const ScalarData& data,
                                                const ScalarParameters& parameters);

/// The bracketed term of one effect at every rest, g, given the specific forces (g).
Eigen::VectorXd effect_terms_g(const ScalarData& data, const ScalarVector& nine,
                               const std::vector<Eigen::Vector3d>& a_g, const ActiveEffect& active);

/// |a| − g of every rest, m/s².
Eigen::VectorXd scalar_residual_mps2(const ScalarData& data, const ScalarParameters& parameters);
/// Its derivatives by the free parameters (central differences), n × free.
Eigen::MatrixXd scalar_jacobian(const ScalarData& data, const ScalarParameters& parameters);

}  // namespace plumbline
