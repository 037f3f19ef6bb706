#include "estimator/uncertainty/monte_carlo.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "estimator/angle_units.h"
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
  const PropagatedEstimate& estimate;
  Eigen::Index poses;
  double u_delta_rad, u_h_rad, u_gamma;
  /// Outputs' derivatives by δ and h and halves of the second ones, V: n × 5 per axis
  /// [δ, h, δδ, δh, hh].
  PerAxis<Eigen::MatrixXd> slope{};
  PerAxis<Eigen::VectorXd> rounding_half_V{};
  PerAxis<bool> rounds{};
  Eigen::MatrixXd by_delta{}, by_h{};  ///< 12 × n, parameters' deviations by one u of each angle
  Eigen::MatrixXd noise{};             ///< 12 × 12, what the covariance holds beside the others
  Eigen::MatrixXd noise_root{};        ///< of that and of the alternatives
  /// Whether angles of these uncertainties bend the outputs enough to be felt. If not, what they do
  /// to the parameters is Gaussian, 12 × 12, and is drawn as such instead of angle by angle.
  bool bends = false;
  Eigen::MatrixXd angle_root{};
};

/// Twelve parameters' deviations by one of the slopes of each pose, which all axes share, 12 × n.
Eigen::MatrixXd through_gain(const Model& model, Eigen::Index slope) {
  Eigen::MatrixXd shift = Eigen::MatrixXd::Zero(kParameters, model.poses);
  for (std::size_t i = 0; i < kAxisCount; ++i)
    shift += model.estimate.gain[i] * model.slope[i].col(slope).asDiagonal();
  return shift;
}

void decide_on_angles(Model& model) {
  constexpr double kFelt = 1e-3;  // of what the straight part does
  const double u_delta = model.u_delta_rad, u_h = model.u_h_rad;
  model.by_delta = u_delta * through_gain(model, 0);
  model.by_h = u_h * through_gain(model, 1);
  const Eigen::MatrixXd by_delta2 = u_delta * u_delta * through_gain(model, 2),
                        by_both = u_delta * u_h * through_gain(model, 3),
                        by_h2 = u_h * u_h * through_gain(model, 4);
  const Eigen::MatrixXd covariance =
      model.by_delta * model.by_delta.transpose() + model.by_h * model.by_h.transpose();
  model.angle_root = root_of(covariance);
  const Eigen::VectorXd mean = by_delta2.rowwise().sum() + by_h2.rowwise().sum();
  const Eigen::VectorXd variance = 2 * by_delta2.rowwise().squaredNorm() +
                                   by_both.rowwise().squaredNorm() +
                                   2 * by_h2.rowwise().squaredNorm();
  model.bends =
      ((mean.cwiseAbs2() + variance).array() > kFelt * kFelt * covariance.diagonal().array()).any();
}

/// Of the outputs of one axis, n × 5.
Eigen::MatrixXd slopes(const std::vector<Pose>& poses, const Eigen::Vector3d& K, double gamma) {
  Eigen::MatrixXd slope(std::ssize(poses), 5);
  for (Eigen::Index k = 0; k < slope.rows(); ++k) {
    const Pose& pose = poses[static_cast<std::size_t>(k)];
    const auto at = [&](double delta, double h) { return specific_force(delta, h, gamma); };
    const SpecificForce force = at(pose.delta_deg, pose.h_deg);
    // The second derivatives of sines and cosines are the functions 90° further on.
    const SpecificForce lifted = at(pose.delta_deg, pose.h_deg + 90);
    const SpecificForce both = at(pose.delta_deg + 90, pose.h_deg + 90);
    Eigen::Vector3d delta2 = at(pose.delta_deg + 180, pose.h_deg).a_g;
    delta2.z() = 0;
    Eigen::Vector3d mixed = both.a_g;
    mixed.z() = 0;
    slope.row(k) << force.d_delta_g_per_rad.dot(K), force.d_h_g_per_rad.dot(K), 0.5 * delta2.dot(K),
        mixed.dot(K), 0.5 * lifted.d_h_g_per_rad.dot(K);
  }
  return slope;
}

Model make_model(const PropagatedEstimate& estimate, const std::vector<Pose>& poses,
                 const RunDescription& run) {
  const double gamma = run.gravity.local_mps2 / kStandardGravity_mps2;
  Model model{.estimate = estimate,
              .poses = std::ssize(poses),
              .u_delta_rad = run.angles.delta_arcsec * kRadPerArcsec,
              .u_h_rad = run.angles.h_arcsec * kRadPerArcsec,
              .u_gamma = run.gravity.u_mps2 / run.gravity.local_mps2};
  model.noise = estimate.covariance;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    model.slope[i] = slopes(poses, estimate.value[i].head<3>(), gamma);
    const Eigen::VectorXd rounding_V2 = estimate.rounding_V2[i].cwiseMax(0);
    model.rounding_half_V[i] = (3 * rounding_V2).cwiseSqrt();
    model.rounds[i] = rounding_V2.maxCoeff() > 0;
    const Eigen::VectorXd own_V2 = rounding_V2 +
                                   (model.u_delta_rad * model.slope[i].col(0)).cwiseAbs2() +
                                   (model.u_h_rad * model.slope[i].col(1)).cwiseAbs2();
    model.noise -= estimate.gain[i] * own_V2.asDiagonal() * estimate.gain[i].transpose();
  }
  model.noise_root = root_of(model.noise + estimate.alternatives);
  decide_on_angles(model);
  return model;
}

/// Deviations of the twelve parameters in `count` trials, 12 × count.
Eigen::MatrixXd trials(const Model& model, std::uint64_t seed, std::size_t count) {
  Random random(seed);
  const Eigen::Index n = model.poses;
  const auto columns = static_cast<Eigen::Index>(count);
  const bool turns = model.u_delta_rad > 0 || model.u_h_rad > 0;
  Eigen::VectorXd relative(columns);
  Eigen::MatrixXd normals(kParameters, columns), turned = normals;
  Eigen::ArrayXd delta_rad(n), h_rad(n);
  PerAxis<Eigen::MatrixXd> error_V;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    if (model.bends || model.rounds[i]) error_V[i] = Eigen::MatrixXd::Zero(n, columns);
  for (Eigen::Index trial = 0; trial < columns; ++trial) {
    relative(trial) = model.u_gamma * random.normal();
    for (double& draw : normals.col(trial)) draw = random.normal();
    if (turns && !model.bends)
      for (double& draw : turned.col(trial)) draw = random.normal();
    for (Eigen::Index k = 0; model.bends && k < n; ++k) {
      delta_rad(k) = model.u_delta_rad * random.normal();
      h_rad(k) = model.u_h_rad * random.normal();
    }
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const Eigen::MatrixXd& s = model.slope[i];
      if (model.bends)
        error_V[i].col(trial) = delta_rad * (s.col(0).array() + s.col(2).array() * delta_rad +
                                             s.col(3).array() * h_rad) +
                                h_rad * (s.col(1).array() + s.col(4).array() * h_rad);
      for (Eigen::Index k = 0; model.rounds[i] && k < n; ++k)
        error_V[i](k, trial) += model.rounding_half_V[i](k) * random.symmetric();
    }
  }
  Eigen::MatrixXd deviation = model.noise_root * normals;
  if (turns && !model.bends) deviation += model.angle_root * turned;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    if (error_V[i].size() > 0) deviation += model.estimate.gain[i] * error_V[i];
  // The outputs came from g(1 + e), the design says g: the sensitivities come out too large.
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    auto K = deviation.middleRows<3>(4 * static_cast<Eigen::Index>(i));
    K += (K.colwise() + model.estimate.value[i].head<3>()) * relative.asDiagonal();
  }
  return deviation;
}

/// Of parameter p of the twelve.
ParameterBudget budget_of(const Model& model, Eigen::Index p) {
  ParameterBudget budget;
  budget.noise = std::sqrt(std::max(model.noise(p, p), 0.0));
  budget.delta = model.by_delta.row(p).norm();
  budget.h = model.by_h.row(p).norm();
  double rounding = 0;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    rounding +=
        model.estimate.gain[i].row(p).cwiseAbs2().dot(model.estimate.rounding_V2[i].cwiseMax(0));
  budget.rounding = std::sqrt(rounding);
  const double value = model.estimate.value[static_cast<std::size_t>(p / 4)](p % 4);
  budget.gravity = p % 4 < 3 ? std::abs(value) * model.u_gamma : 0;
  budget.alternatives = std::sqrt(std::max(model.estimate.alternatives(p, p), 0.0));
  budget.combined = Eigen::Vector<double, 6>{budget.noise,    budget.delta,   budget.h,
                                             budget.rounding, budget.gravity, budget.alternatives}
                        .norm();
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

UncertaintyReport propagate_uncertainty(const PropagatedEstimate& estimate,
                                        const std::vector<Pose>& poses,
                                        const RunDescription& description, std::uint64_t seed) {
  const Model model = make_model(estimate, poses, description);
  UncertaintyReport report;
  std::array<double, kParameters> tolerance{};
  for (std::size_t p = 0; p < kParameters; ++p) {
    ParameterUncertainty& parameter = report.parameter[p / 4][p % 4];
    parameter.budget = budget_of(model, static_cast<Eigen::Index>(p));
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
    const double value = estimate.value[p / 4](static_cast<Eigen::Index>(p % 4));
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
