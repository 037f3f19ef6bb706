#include "estimator/uncertainty/monte_carlo.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/kinematics.h"
#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

constexpr std::size_t kParameters = 12;
constexpr std::size_t kBlock = 10000, kChunk = 1250, kMostBlocks = 8;
constexpr double kCoverage = 1.959963984540054;

/// xoshiro256+ (Blackman & Vigna 2018): the draws are most of the work here.
class Random {
 public:
  explicit Random(std::uint64_t seed) {
    for (std::uint64_t& word : state_) {  // splitmix64
      std::uint64_t z = (seed += 0x9E3779B97F4A7C15U);
      z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
      z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
      word = z ^ (z >> 31U);
    }
  }
  /// In (−1, 1).
  double symmetric() { return static_cast<double>(static_cast<std::int64_t>(next())) * 0x1p-63; }
  double normal() {
    if (spare_) {
      spare_ = false;
      return second_;
    }
    for (;;) {  // Marsaglia's polar method
      const double u = symmetric(), v = symmetric();
      const double s = u * u + v * v;
      if (s >= 1 || s == 0) continue;
      const double factor = std::sqrt(-2 * std::log(s) / s);
      second_ = v * factor;
      spare_ = true;
      return u * factor;
    }
  }

 private:
  std::uint64_t next() {
    const std::uint64_t result = state_[0] + state_[3];
    const std::uint64_t t = state_[1] << 17U;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = (state_[3] << 45U) | (state_[3] >> 19U);
    return result;
  }
  std::array<std::uint64_t, 4> state_{};
  double second_ = 0;
  bool spare_ = false;
};

/// A matrix whose product with itself transposed is `covariance`, semidefinite or not quite.
Eigen::MatrixXd root_of(const Eigen::MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
}

/// Everything about the poses that a trial needs, computed once.
struct Model {
  const PropagationInput& input;
  double u_delta_rad, u_h_rad, u_gamma;
  /// Outputs' derivatives by δ and h and halves of the second ones, V: n × 5 per axis
  /// [δ, h, δδ, δh, hh].
  PerAxis<Eigen::MatrixXd> slope;
  PerAxis<Eigen::VectorXd> rounding_half_V;
  PerAxis<Eigen::Matrix4d> noise_root;
  PerAxis<bool> rounds{};
  /// Whether angles of these uncertainties bend the outputs enough to be felt. If not, what they do
  /// to the parameters is Gaussian, 12 × 12, and is drawn as such instead of angle by angle.
  bool bends = false;
  Eigen::MatrixXd angle_root;
};

/// Twelve parameters' deviations by one of the slopes of each pose, 12 × n.
Eigen::MatrixXd through_gain(const Model& model, Eigen::Index slope) {
  Eigen::MatrixXd shift(kParameters, std::ssize(model.input.poses));
  for (std::size_t i = 0; i < kAxisCount; ++i)
    shift.middleRows<4>(4 * static_cast<Eigen::Index>(i)) =
        model.input.axis[i].gain * model.slope[i].col(slope).asDiagonal();
  return shift;
}

void decide_on_angles(Model& model) {
  constexpr double kFelt = 1e-3;  // of what the straight part does
  const double u_delta = model.u_delta_rad, u_h = model.u_h_rad;
  const Eigen::MatrixXd by_delta = u_delta * through_gain(model, 0),
                        by_h = u_h * through_gain(model, 1),
                        by_delta2 = u_delta * u_delta * through_gain(model, 2),
                        by_both = u_delta * u_h * through_gain(model, 3),
                        by_h2 = u_h * u_h * through_gain(model, 4);
  const Eigen::MatrixXd covariance = by_delta * by_delta.transpose() + by_h * by_h.transpose();
  model.angle_root = root_of(covariance);
  const Eigen::VectorXd mean = by_delta2.rowwise().sum() + by_h2.rowwise().sum();
  const Eigen::VectorXd variance = 2 * by_delta2.rowwise().squaredNorm() +
                                   by_both.rowwise().squaredNorm() +
                                   2 * by_h2.rowwise().squaredNorm();
  model.bends =
      ((mean.cwiseAbs2() + variance).array() > kFelt * kFelt * covariance.diagonal().array()).any();
}

Model make_model(const PropagationInput& input) {
  constexpr double kRadPerArcsec = std::numbers::pi / 180 / 3600;
  const RunDescription& run = input.description;
  const double gamma = run.gravity.local_mps2 / kStandardGravity_mps2;
  Model model{input,
              run.angles.delta_arcsec * kRadPerArcsec,
              run.angles.h_arcsec * kRadPerArcsec,
              run.gravity.u_mps2 / run.gravity.local_mps2,
              {},
              {},
              {},
              {},
              false,
              {}};
  const auto n = std::ssize(input.poses);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const PropagationAxis& axis = input.axis[i];
    const Eigen::Vector3d K = axis.value.head<3>();
    model.slope[i].resize(n, 5);
    for (Eigen::Index k = 0; k < n; ++k) {
      const Pose& pose = input.poses[static_cast<std::size_t>(k)];
      const auto at = [&](double delta, double h) { return specific_force(delta, h, gamma); };
      const SpecificForce force = at(pose.delta_deg, pose.h_deg);
      // The second derivatives of sines and cosines are the functions 90° further on.
      const SpecificForce lifted = at(pose.delta_deg, pose.h_deg + 90);
      const SpecificForce both = at(pose.delta_deg + 90, pose.h_deg + 90);
      Eigen::Vector3d delta2 = at(pose.delta_deg + 180, pose.h_deg).a_g;
      delta2.z() = 0;
      Eigen::Vector3d mixed = both.a_g;
      mixed.z() = 0;
      model.slope[i].row(k) << force.d_delta_g_per_rad.dot(K), force.d_h_g_per_rad.dot(K),
          0.5 * delta2.dot(K), mixed.dot(K), 0.5 * lifted.d_h_g_per_rad.dot(K);
    }
    model.rounding_half_V[i] = (3 * axis.rounding_V2.array().max(0)).sqrt();
    model.rounds[i] = model.rounding_half_V[i].maxCoeff() > 0;
    model.noise_root[i] = root_of(axis.noise);
  }
  decide_on_angles(model);
  return model;
}

/// Deviations of the twelve parameters in `count` trials, 12 × count.
Eigen::MatrixXd trials(const Model& model, std::uint64_t seed, std::size_t count) {
  Random random(seed);
  const auto n = std::ssize(model.input.poses);
  Eigen::MatrixXd result(kParameters, static_cast<Eigen::Index>(count));
  Eigen::ArrayXd error_V(n), delta_rad = Eigen::ArrayXd::Zero(n), h_rad = delta_rad;
  Eigen::VectorXd by_angles = Eigen::VectorXd::Zero(kParameters), draws = by_angles;
  const bool turns = model.u_delta_rad > 0 || model.u_h_rad > 0;
  for (Eigen::Index trial = 0; trial < result.cols(); ++trial) {
    const double relative = model.u_gamma * random.normal();
    if (turns && !model.bends) {
      for (double& draw : draws) draw = random.normal();
      by_angles = model.angle_root * draws;
    }
    for (Eigen::Index k = 0; model.bends && k < n; ++k) {
      delta_rad(k) = model.u_delta_rad * random.normal();
      h_rad(k) = model.u_h_rad * random.normal();
    }
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const PropagationAxis& axis = model.input.axis[i];
      Eigen::Vector4d normals;
      for (Eigen::Index j = 0; j < 4; ++j) normals(j) = random.normal();
      Eigen::Vector4d estimate = axis.value + model.noise_root[i] * normals +
                                 by_angles.segment<4>(4 * static_cast<Eigen::Index>(i));
      const Eigen::MatrixXd& s = model.slope[i];
      if (model.bends) {
        error_V = delta_rad *
                      (s.col(0).array() + s.col(2).array() * delta_rad + s.col(3).array() * h_rad) +
                  h_rad * (s.col(1).array() + s.col(4).array() * h_rad);
      } else {
        error_V.setZero();
      }
      if (model.rounds[i]) {
        for (Eigen::Index k = 0; k < n; ++k)
          error_V(k) += model.rounding_half_V[i](k) * random.symmetric();
      }
      if (model.bends || model.rounds[i]) estimate += axis.gain.lazyProduct(error_V.matrix());
      // The outputs came from g(1 + e), the design says g: the sensitivities come out too large.
      estimate.head<3>() += relative * estimate.head<3>();
      result.block<4, 1>(4 * static_cast<Eigen::Index>(i), trial) = estimate - axis.value;
    }
  }
  return result;
}

ParameterBudget budget_of(const Model& model, std::size_t i, Eigen::Index j) {
  const PropagationAxis& axis = model.input.axis[i];
  const Eigen::VectorXd square = axis.gain.row(j).cwiseAbs2().transpose();
  ParameterBudget budget;
  budget.noise = std::sqrt(std::max(axis.noise(j, j), 0.0));
  budget.positioning =
      std::sqrt(square.dot((model.u_delta_rad * model.slope[i].col(0)).cwiseAbs2() +
                           (model.u_h_rad * model.slope[i].col(1)).cwiseAbs2()));
  budget.rounding = std::sqrt(square.dot(axis.rounding_V2.cwiseMax(0)));
  budget.gravity = j < 3 ? std::abs(axis.value(j)) * model.u_gamma : 0;
  budget.combined = std::hypot(std::hypot(budget.noise, budget.positioning),
                               std::hypot(budget.rounding, budget.gravity));
  return budget;
}

/// Half a unit of the first significant digit of u (JCGM 101, 7.9.2).
double tolerance_of(double u) {
  return u > 0 ? 0.5 * std::pow(10.0, std::floor(std::log10(u))) : 0;
}

/// Mean, standard deviation and the ends of the symmetric 95 % interval.
struct Summary {
  double mean = 0, u = 0, low = 0, high = 0;
};

Summary summary_of(std::vector<double>& values) {
  Summary summary;
  for (const double v : values) summary.mean += v;
  summary.mean /= static_cast<double>(values.size());
  for (const double v : values) summary.u += (v - summary.mean) * (v - summary.mean);
  summary.u = std::sqrt(summary.u / static_cast<double>(values.size() - 1));
  const auto at = [&](double share) {
    const auto place = values.begin() +
                       static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), place, values.end());
    return *place;
  };
  summary.low = at(0.025);
  summary.high = at(0.975);
  return summary;
}

std::vector<double> row_of(const std::vector<Eigen::MatrixXd>& chunks, std::size_t first,
                           std::size_t count, Eigen::Index parameter) {
  std::vector<double> values;
  for (std::size_t c = first; c < first + count; ++c) {
    for (Eigen::Index t = 0; t < chunks[c].cols(); ++t) values.push_back(chunks[c](parameter, t));
  }
  return values;
}

/// Clause 7.9.4: twice the standard deviation of the block averages within the tolerance.
bool is_stable(const std::vector<std::array<Summary, kParameters>>& blocks,
               const std::array<double, kParameters>& tolerance) {
  const auto count = static_cast<double>(blocks.size());
  if (blocks.size() < 2) return false;
  for (std::size_t p = 0; p < kParameters; ++p) {
    for (const auto member : {&Summary::mean, &Summary::u, &Summary::low, &Summary::high}) {
      double mean = 0, square = 0;
      for (const auto& block : blocks) mean += block[p].*member / count;
      for (const auto& block : blocks) square += std::pow(block[p].*member - mean, 2);
      if (2 * std::sqrt(square / (count * (count - 1))) > tolerance[p]) return false;
    }
  }
  return true;
}

}  // namespace

UncertaintyReport propagate_uncertainty(const PropagationInput& input, std::uint64_t seed) {
  const Model model = make_model(input);
  UncertaintyReport report;
  std::array<double, kParameters> tolerance{};
  for (std::size_t p = 0; p < kParameters; ++p) {
    ParameterUncertainty& parameter = report.parameter[p / 4][p % 4];
    parameter.budget = budget_of(model, p / 4, static_cast<Eigen::Index>(p % 4));
    parameter.tolerance = tolerance[p] = tolerance_of(parameter.budget.combined);
  }

  constexpr std::size_t kChunks = kBlock / kChunk;
  std::vector<Eigen::MatrixXd> chunks;
  std::vector<std::array<Summary, kParameters>> blocks;
  while (blocks.size() < kMostBlocks && !report.stabilised) {
    const std::size_t first = chunks.size();
    chunks.resize(first + kChunks);
    parallel_for(kChunks, [&](std::size_t c) {
      chunks[first + c] = trials(model, seed * 0x9E3779B97F4A7C15U + first + c + 1, kChunk);
    });
    blocks.emplace_back();
    for (std::size_t p = 0; p < kParameters; ++p) {
      std::vector<double> values = row_of(chunks, first, kChunks, static_cast<Eigen::Index>(p));
      blocks.back()[p] = summary_of(values);
    }
    report.stabilised = is_stable(blocks, tolerance);
  }

  report.trials = chunks.size() * kChunk;
  report.validated = true;
  for (std::size_t p = 0; p < kParameters; ++p) {
    ParameterUncertainty& parameter = report.parameter[p / 4][p % 4];
    const double value = input.axis[p / 4].value(static_cast<Eigen::Index>(p % 4));
    std::vector<double> values = row_of(chunks, 0, chunks.size(), static_cast<Eigen::Index>(p));
    const Summary all = summary_of(values);
    const double expanded = kCoverage * parameter.budget.combined;
    parameter.gum_low = value - expanded;
    parameter.gum_high = value + expanded;
    parameter.mc_mean = value + all.mean;
    parameter.mc_u = all.u;
    parameter.mc_low = value + all.low;
    parameter.mc_high = value + all.high;
    parameter.difference_low = std::abs(-expanded - all.low);
    parameter.difference_high = std::abs(expanded - all.high);
    parameter.validated =
        std::max(parameter.difference_low, parameter.difference_high) <= parameter.tolerance;
    report.validated = report.validated && parameter.validated;
  }
  return report;
}

}  // namespace plumbline
