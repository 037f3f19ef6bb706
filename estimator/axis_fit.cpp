#include "estimator/axis_fit.h"

#include <algorithm>
#include <cmath>

#include "estimator/angle_units.h"
#include "estimator/effects/code_evidence.h"
#include "estimator/fit/axis_tools.h"
#include "estimator/fit/least_squares.h"
#include "estimator/fit/rounding.h"
#include "estimator/kinematics.h"
#include "estimator/noise/covariance.h"
#include "estimator/noise/powers_allowance.h"
#include "estimator/noise/square.h"

namespace plumbline {
namespace {

/// Parameters and rounding depend on each other; the second round changes nothing that is felt.
constexpr int kRoundingRounds = 3;
constexpr int kEdgeRounds = 10;  // the same where the steps keep their edges

double samples_per_pose(const MeasurementSet& run) {
  return static_cast<double>(run.samples.size()) / static_cast<double>(run.poses.size());
}

Eigen::VectorXd readings_of_poses(const MeasurementSet& run) {
  Eigen::VectorXd readings(std::ssize(run.poses));
  for (Eigen::Index k = 0; k < readings.size(); ++k)
    readings(k) = static_cast<double>(run.poses[static_cast<std::size_t>(k)].count);
  return readings;
}

/// Positioning errors, independent from pose to pose, seen through the sensitivities `K_V_per_g`.
Eigen::VectorXd positioning_variance_V2(const Experiment& experiment,
                                        const Eigen::Vector3d& K_V_per_g) {
  const RunDescription& description = experiment.input.description;
  const double gamma = description.gravity.local_mps2 / kStandardGravity_mps2;
  const double u_delta_rad = description.angles.delta_arcsec * kRadPerArcsec;
  const double u_h_rad = description.angles.h_arcsec * kRadPerArcsec;
  Eigen::VectorXd variance(experiment.A.rows());
  for (Eigen::Index row = 0; row < variance.size(); ++row) {
    const Pose& pose = experiment.poses[static_cast<std::size_t>(row)].pose;
    const SpecificForce force = specific_force(pose.delta_deg, pose.h_deg, gamma);
    variance(row) = square(u_delta_rad * force.d_delta_g_per_rad.dot(K_V_per_g)) +
                    square(u_h_rad * force.d_h_g_per_rad.dot(K_V_per_g));
  }
  return variance;
}

/// The covariance of estimates under noise V, the powers of the noise being estimates, too.
Eigen::Matrix4d with_allowance_for_noise(const Experiment& experiment, const AxisFit& work,
                                         const Eigen::MatrixXd& V, const Eigen::Matrix4d& C) {
  return with_allowance(
      C, {allowance_for_powers(experiment.processes, work.test.powers, V, experiment.A, C)});
}

/// Estimates from the codes where rounding matters.
void use_codes(const Experiment& experiment, std::size_t axis, AxisFit& work) {
  if (!experiment.input.description.adc) return;
  auto quantized = quantized_axis(experiment.input.run, experiment.A, work.known_V2,
                                  Eigen::VectorXd::Zero(work.y.size()),
                                  scale_of(*experiment.input.description.adc), axis);
  if (!quantized) return;
  // Quantization and white noise are those of single readings: in the intervals already.
  const Eigen::Index n = work.y.size();
  Eigen::MatrixXd V = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t i = 0; i < experiment.processes.unit.size(); ++i) {
    const double power = work.pooled.power(static_cast<Eigen::Index>(i));
    if (i != kTermQ && i != kTermN && power > 0) V += power * experiment.processes.unit[i];
  }
  // The scatter found between the codes of different poses holds the slow noise once more.
  const double twice_V2 = std::min(square(quantized->use.scatter_V), V.diagonal().mean());
  quantized->variance_V2 = quantized->variance_without_V2(twice_V2);
  V.diagonal() += quantized->variance_V2;
  const auto fit = fit_generalised(experiment.A, quantized->mean_V, V);
  if (!fit) return;
  work.fit.estimate = {fit->estimate.value,
                       with_allowance_for_noise(experiment, work, V, fit->estimate.covariance)};
  work.fit.whitened = fit->whitened;
  work.fit.gain = fit->gain;
  work.fit.residual_V = work.y - experiment.A * fit->estimate.value;
  work.quantized = std::move(quantized);
}

bool rounded_as_declared(const CalibrationInput& input, std::size_t axis) {
  const auto& adc = input.description.adc;
  if (!adc) return true;
  return !code_faults(input.run, axis, *adc).any();
}

/// Means of an axis freed of rounding, once with what the parameters say of it and, where rounding
/// is coarse, with what the noise of the others foretells; adds what is uncertain of them to
/// own_V2.
RoundingFree take_out_rounding(const Experiment& experiment, const NoiseModel& identified,
                               std::size_t axis, const Eigen::VectorXd& mean_V,
                               LeastSquaresResult& ordinary, AxisFit& work) {
  RoundingFree free;
  if (!experiment.input.description.adc || experiment.white_V[axis] < 0) return free;
  const Eigen::Index n = mean_V.size();
  const auto free_means = [&](const Eigen::VectorXd& expected_V) {
    free = free_of_rounding(mean_V, expected_V, scale_of(*experiment.input.description.adc),
                            experiment.white_V[axis], readings_of_poses(experiment.input.run),
                            experiment.line_V2[axis]);
    work.y = free.mean_V;
    // Where the steps keep their edges, few means say more than the others together.
    const Eigen::VectorXd weight =
        free.beyond_V2 ? Eigen::VectorXd(free.variance_V2.cwiseSqrt().cwiseInverse())
                       : Eigen::VectorXd::Ones(n);
    ordinary = solve_least_squares(weight.asDiagonal() * experiment.A, weight.cwiseProduct(work.y));
  };
  for (int round = 0; round < (free.beyond_V2 ? kEdgeRounds : kRoundingRounds); ++round)
    free_means(experiment.A * ordinary.x);
  if (free.coarse && n > 4) {
    work.record = record_beside_rounding(identified, *experiment.input.description.adc,
                                         experiment.white_V[axis]);
    const NoisePool pool(experiment.processes, work.record, work.known_V2 + free.variance_V2);
    const Eigen::MatrixXd V = pool.pool(work.y, experiment.A).covariance;
    free_means(experiment.A * ordinary.x +
               expected_from_others(V, work.y - experiment.A * ordinary.x));
  }
  work.own_V2 += free.variance_V2;
  return free;
}

}  // namespace

double white_noise_V(const CalibrationInput& input, std::size_t axis) {
  if (samples_per_pose(input.run) > 1) return white_scatter_V(input.run, axis);
  const SampleTable* record = input.static_record;
  if (record == nullptr || record->size() < 2) return -1;
  MeasurementSet one_dwell;
  one_dwell.samples.u_V[axis] = record->u_V[axis];
  one_dwell.poses = {Pose{0, 0, 0, 0, record->size()}};
  return white_scatter_V(one_dwell, axis);
}

AxisFit fit_axis(const Experiment& experiment, const NoiseModel& identified, std::size_t axis) {
  AxisFit work;
  const Eigen::VectorXd mean_V = mean_voltages(experiment.poses, axis);
  work.y = mean_V;
  const Eigen::Index n = work.y.size();
  LeastSquaresResult ordinary = solve_least_squares(experiment.A, work.y);
  work.known_V2 = positioning_variance_V2(experiment, ordinary.x.head<3>());
  // Edges between codes that are missing or doubled make dwells noisy, too.
  if (rounded_as_declared(experiment.input, axis)) {
    const auto& adc = experiment.input.description.adc;
    work.known_V2 += burst_variance_V2(experiment.input.run, axis, adc ? adc->lsb_V() : 0)
                         .cwiseMax(experiment.noisier_V2[axis]);
  }
  work.own_V2 = work.known_V2;
  work.record = identified;
  const RoundingFree free = take_out_rounding(experiment, identified, axis, mean_V, ordinary, work);
  work.rounding_V2 = free.beyond_V2.value_or(0);
  work.rounding_V = free.beyond_V2 ? Eigen::VectorXd(mean_V - work.y) : Eigen::VectorXd::Zero(n);
  const NoisePowers identified_powers = noise_powers(work.record);
  bool known = identified_powers.sum() > 0 || free.coarse;
  if (!known && !rounded_as_declared(experiment.input, axis)) {
    // Rounding hides the noise within the dwells; how the pose means scatter tells of both.
    work.record = without_record(identified);
    known = true;
  }
  work.pooled.power = Eigen::VectorXd::Zero(experiment.processes.count());
  work.pooled.power.head<NoiseProcesses::kFirstMarkov>() =
      identified_powers.head<NoiseProcesses::kFirstMarkov>();
  if (n > 4 && known) {
    const Eigen::MatrixXd a_g = experiment.A.leftCols<3>();
    work.test = test_residual(work.record, {work.y, experiment.A, a_g, experiment.processes,
                                            work.own_V2, experiment.drivers, free.coarse});
    work.pooled = work.test.noise;
  }
  const double span_s = experiment.poses.back().t_mean_s - experiment.poses.front().t_arrival_s;
  work.noise = in_filter_terms(work.record, experiment.processes, work.pooled, span_s);
  work.V = NoisePool(experiment.processes, work.record, work.own_V2).covariance(work.pooled.power);
  if (work.pooled.covariance.size() == 0) work.pooled.covariance = work.V;
  const auto fit = known ? fit_generalised(experiment.A, work.y, work.V) : std::nullopt;
  if (fit) {
    work.fit = *fit;
    work.noise_known = true;
    work.fit.estimate.covariance =
        with_allowance_for_noise(experiment, work, work.V, fit->estimate.covariance);
    use_codes(experiment, axis, work);
    return work;
  }
  // Nothing is known about the noise: the residual has to say how large it is.
  const double dof = static_cast<double>(std::max<Eigen::Index>(n - 4, 1));
  const double variance_V2 =
      std::max((work.y - experiment.A * ordinary.x).squaredNorm() / dof, 1e-24);
  work.V = Eigen::MatrixXd::Identity(n, n) * variance_V2;
  work.pooled.covariance = work.V;
  work.pooled.power(kTermN) = variance_V2 / experiment.processes.unit[kTermN](0, 0);
  work.fit = *fit_generalised(experiment.A, work.y, work.V);
  use_codes(experiment, axis, work);
  return work;
}

}  // namespace plumbline
