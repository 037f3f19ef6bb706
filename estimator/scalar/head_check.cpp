#include "estimator/scalar/head_check.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <cstdio>

#include "estimator/angle_units.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/fit/least_squares.h"
#include "estimator/pose_means.h"
#include "estimator/scalar/rest_means.h"

namespace plumbline {
namespace {

/// Twelve parameters in the gauge of the nine: a = K⁻¹·(U − U0), turned so that the matrix is upper
/// triangular.
ScalarVector in_scalar_gauge(const Eigen::Matrix3d& K_V_per_g, const Eigen::Vector3d& U0_V) {
  const Eigen::Matrix3d M = kStandardGravity_mps2 * K_V_per_g.inverse();
  const Eigen::LLT<Eigen::Matrix3d> llt(M.transpose() * M);
  const Eigen::Matrix3d U = llt.matrixU();
  ScalarVector nine;
  nine << U0_V, U.diagonal(), -U(0, 1) / U(1, 1), U(0, 2) / U(2, 2), -U(1, 2) / U(2, 2);
  return nine;
}

/// Rotation R that brings the rows of `from` (unit vectors) onto those of `to` best (Kabsch).
Eigen::Matrix3d best_rotation(const Eigen::MatrixXd& from, const Eigen::MatrixXd& to) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(to.transpose() * from,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  // An odd number of inverted axes makes the two triads of opposite hands: then it is a reflection.
  return svd.matrixU() * svd.matrixV().transpose();
}

}  // namespace

std::optional<HeadComparison> compare_with_head(const ScalarInput& input,
                                                const ScalarEstimate& scalar, double scatter_mps2) {
  const std::vector<PoseMean> poses = pose_means(input.set);
  const Gravity& gravity = input.description.gravity;
  const Eigen::MatrixXd A = design_matrix(poses, gravity);
  if (observability(A).rank < 4) return std::nullopt;
  const std::vector<RestMean> rests = rest_means(input.set);
  const auto n = std::ssize(rests);

  Eigen::Matrix3d K;
  Eigen::Vector3d U0;
  Eigen::Matrix<double, 12, 12> covariance = Eigen::Matrix<double, 12, 12>::Zero();
  double inner_rad2 = 0;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const LeastSquaresResult fit = solve_least_squares(A, mean_voltages(poses, i));
    K.row(row) = fit.x.head<3>().transpose();
    U0(row) = fit.x(3);
    covariance.block<4, 4>(4 * row, 4 * row) =
        fit.cofactor * fit.residual_sum_of_squares /
        static_cast<double>(std::max<Eigen::Index>(fit.degrees_of_freedom, 1));
    for (const RestMean& rest : rests) {
      const double seen = kStandardGravity_mps2 / fit.x(row) / gravity.local_mps2;
      inner_rad2 += seen * seen * rest.covariance(row, row) / static_cast<double>(rest.count);
    }
  }
  if (std::abs(K.determinant()) < 1e-30) return std::nullopt;

  HeadComparison head;
  const ScalarVector of_head = in_scalar_gauge(K, U0);
  head.difference = of_head - scalar.value;
  Eigen::Matrix<double, kScalarCount, 12> slope;
  for (Eigen::Index j = 0; j < 12; ++j) {
    const Eigen::Index row = j / 4, column = j % 4;
    Eigen::Matrix3d moved_K = K;
    Eigen::Vector3d moved_U0 = U0;
    const double step = 1e-5 * std::abs(K(row, row));
    (column < 3 ? moved_K(row, column) : moved_U0(row)) += step;
    slope.col(j) = (in_scalar_gauge(moved_K, moved_U0) - of_head) / step;
  }
  const Eigen::VectorXd head_variance = (slope * covariance * slope.transpose()).diagonal();
  // Both saw the same readings: the sum of the variances is too large rather than too small.
  head.u_difference = (head_variance + scalar.covariance.diagonal()).cwiseSqrt();
  head.largest_en = (head.difference.cwiseAbs().cwiseQuotient(2 * head.u_difference)).maxCoeff();

  Eigen::MatrixXd commanded(n, 3), calibrated(n, 3);
  for (Eigen::Index k = 0; k < n; ++k) {
    commanded.row(k) = A.row(k).head<3>().normalized();
    calibrated.row(k) = scalar_force_mps2(scalar.value, rests[static_cast<std::size_t>(k)].reading)
                            .normalized()
                            .transpose();
  }
  const Eigen::Matrix3d R = best_rotation(calibrated, commanded);
  double sum = 0;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Vector3d turned = R * calibrated.row(k).transpose();
    const double angle_deg = kDegPerRad * (turned - commanded.row(k).transpose()).norm();
    sum += angle_deg * angle_deg;
    head.direction_max_deg = std::max(head.direction_max_deg, angle_deg);
  }
  head.direction_rms_deg = std::sqrt(sum / static_cast<double>(n));
  const double sign = R.determinant() < 0 ? -1 : 1;
  head.mounting_deg = kDegPerRad * Eigen::AngleAxisd(Eigen::Matrix3d(sign * R)).angle();
  // Two of three components of the noise turn the direction; positioning adds both angles.
  const AngleUncertainty& u = input.description.angles;
  const double scatter_rad = scatter_mps2 / gravity.local_mps2;
  head.expected_direction_rms_deg =
      kDegPerRad *
      std::sqrt(2.0 / 3.0 * inner_rad2 / static_cast<double>(n) + 2 * scatter_rad * scatter_rad +
                kRadPerArcsec * kRadPerArcsec *
                    (u.delta_arcsec * u.delta_arcsec + u.h_arcsec * u.h_arcsec));
  char text[320];
  std::snprintf(text, sizeof text,
                "the commanded angles and the angle-free result %s (largest E_n %.2g); directions "
                "of gravity differ by %.2g° rms where noise and positioning leave %.2g°: %s",
                head.largest_en <= 1 ? "agree" : "disagree", head.largest_en,
                head.direction_rms_deg, head.expected_direction_rms_deg,
                head.direction_rms_deg > 2 * head.expected_direction_rms_deg
                    ? "the head or the mounting has an error of that size"
                    : "no error of the head is seen");
  head.words = text;
  return head;
}

}  // namespace plumbline
