#include "estimator/scalar/scalar_model.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace plumbline {
namespace {

std::vector<Eigen::Vector3d> bare_forces_mps2(const ScalarData& data, const ScalarVector& nine) {
  std::vector<Eigen::Vector3d> force;
  force.reserve(data.reading.size());
  for (const Eigen::Vector3d& reading : data.reading) {
    force.push_back(scalar_force_mps2(nine, reading));
  }
  return force;
}

// Biases move by parts of a reading's range, scales by parts of themselves, angles by radians.
double difference_step(Eigen::Index index, const ScalarVector& nine, double local_mps2) {
  if (index < 3) return 1e-5 * local_mps2 / std::abs(nine(3 + index));
  return index < 6 ? 1e-5 * std::abs(nine(index)) : 1e-5;
}

}  // namespace

Eigen::Index ScalarParameters::free_count() const {
  Eigen::Index count = kScalarCount;
  for (const ActiveEffect& active : effects) {
    for (const bool is_free : active.free) count += is_free ? 1 : 0;
  }
  return count;
}

Eigen::VectorXd ScalarParameters::free_values() const {
  Eigen::VectorXd values(free_count());
  values.head<kScalarCount>() = nine;
  Eigen::Index row = kScalarCount;
  for (const ActiveEffect& active : effects) {
    for (std::size_t k = 0; k < active.p.size(); ++k) {
      if (active.free[k]) values(row++) = active.p[k];
    }
  }
  return values;
}

void ScalarParameters::set_free_values(const Eigen::VectorXd& values) {
  nine = values.head<kScalarCount>();
  Eigen::Index row = kScalarCount;
  for (ActiveEffect& active : effects) {
    for (std::size_t k = 0; k < active.p.size(); ++k) {
      if (active.free[k]) active.p[k] = values(row++);
    }
  }
}

Eigen::Matrix3d scalar_matrix(const ScalarVector& nine) {
  Eigen::Matrix3d T;
  T << 1, -nine(6), nine(7), 0, 1, -nine(8), 0, 0, 1;
  return T * nine.segment<3>(3).asDiagonal();
}

Eigen::Vector3d scalar_force_mps2(const ScalarVector& nine, const Eigen::Vector3d& reading) {
  return scalar_matrix(nine) * (reading - nine.head<3>());
}

void set_attitudes(ScalarData& data, const ScalarVector& nine) {
  int direction = 0;
  for (std::size_t k = 0; k < data.reading.size(); ++k) {
    const Eigen::Vector3d up = scalar_force_mps2(nine, data.reading[k]).normalized();
    Visit& visit = data.log.visits[k];
    visit.h_rad = std::asin(std::clamp(up.z(), -1.0, 1.0));
    visit.delta_rad = std::atan2(-up.y(), up.x());
    visit.delta_direction = {direction, direction, direction};
  }
}

Eigen::VectorXd effect_terms_g(const ScalarData& data, const ScalarVector& nine,
                               const std::vector<Eigen::Vector3d>& a_g,
                               const ActiveEffect& active) {
  const auto axis = static_cast<Eigen::Index>(active.axis);
  Eigen::VectorXd term(std::ssize(data.reading));
  for (Eigen::Index row = 0; row < term.size(); ++row) {
    const auto visit = static_cast<std::size_t>(row);
    const TermInput input{data.log,
                          visit,
                          active.axis,
                          a_g,
                          a_g[visit](axis),
                          data.reading[visit](axis),
                          kStandardGravity_mps2 / nine(3 + axis)};
    term(row) = active.effect->term_g(input, active.p.data());
  }
  return term;
}

std::vector<Eigen::Vector3d> scalar_forces_mps2(const ScalarData& data,
                                                const ScalarParameters& parameters) {
  std::vector<Eigen::Vector3d> force = bare_forces_mps2(data, parameters.nine);
  if (parameters.effects.empty()) return force;
  // The terms are functions of the true specific force; the bare one differs from it by the terms
  // themselves, so one repetition leaves their square.
  const std::vector<Eigen::Vector3d> bare = force;
  for (int pass = 0; pass < 2; ++pass) {
    std::vector<Eigen::Vector3d> a_g = force;
    for (Eigen::Vector3d& a : a_g) a /= kStandardGravity_mps2;
    force = bare;
    for (const ActiveEffect& active : parameters.effects) {
      const Eigen::VectorXd term_g = effect_terms_g(data, parameters.nine, a_g, active);
      for (std::size_t k = 0; k < force.size(); ++k) {
        force[k](static_cast<Eigen::Index>(active.axis)) -=
            kStandardGravity_mps2 * term_g(static_cast<Eigen::Index>(k));
      }
    }
  }
  return force;
}

Eigen::VectorXd scalar_residual_mps2(const ScalarData& data, const ScalarParameters& parameters) {
  const std::vector<Eigen::Vector3d> force = scalar_forces_mps2(data, parameters);
  Eigen::VectorXd residual(std::ssize(force));
  for (Eigen::Index row = 0; row < residual.size(); ++row) {
    residual(row) = force[static_cast<std::size_t>(row)].norm() - data.local_mps2;
  }
  return residual;
}

Eigen::MatrixXd scalar_jacobian(const ScalarData& data, const ScalarParameters& parameters) {
  const Eigen::VectorXd values = parameters.free_values();
  Eigen::MatrixXd jacobian(std::ssize(data.reading), values.size());
  for (Eigen::Index j = 0; j < values.size(); ++j) {
    const double step = j < kScalarCount ? difference_step(j, parameters.nine, data.local_mps2)
                                         : std::max(1e-3 * std::abs(values(j)), 1e-6);
    ScalarParameters moved = parameters;
    Eigen::VectorXd at = values;
    at(j) = values(j) + step;
    moved.set_free_values(at);
    jacobian.col(j) = scalar_residual_mps2(data, moved);
    at(j) = values(j) - step;
    moved.set_free_values(at);
    jacobian.col(j) -= scalar_residual_mps2(data, moved);
    jacobian.col(j) /= 2 * step;
  }
  return jacobian;
}

}  // namespace plumbline
