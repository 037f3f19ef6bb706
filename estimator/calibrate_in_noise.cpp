#include "estimator/calibrate_in_noise.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/decision.h"
#include "estimator/diagnosis/detection_limits.h"
#include "estimator/diagnosis/explain.h"
#include "estimator/diagnosis/noise_drivers.h"
#include "estimator/diagnosis/residual_test.h"
#include "estimator/diagnosis/verdict.h"
#include "estimator/effects/code_evidence.h"
#include "estimator/error_figures.h"
#include "estimator/fit/axis_tools.h"
#include "estimator/fit/eight_state_filter.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/fit/least_squares.h"
#include "estimator/fit/recursive_least_squares.h"
#include "estimator/fit/rounding.h"
#include "estimator/kinematics.h"
#include "estimator/noise/covariance.h"
#include "estimator/noise/powers_allowance.h"
#include "estimator/parallel_for.h"
#include "estimator/pose_means.h"
#include "estimator/quantization/quantized_axis.h"

namespace plumbline {
namespace {

/// Parameters and rounding depend on each other; the second round changes nothing that is felt.
constexpr int kRoundingRounds = 3;
constexpr int kEdgeRounds = 10;  // the same where the steps keep their edges
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// What all axes share.
struct Experiment {
  const CalibrationInput& input;
  const std::vector<PoseMean>& poses;
  const Eigen::MatrixXd& A;   ///< n × 4
  Eigen::MatrixXd drivers;    ///< n × k, temperature and covariates
  PerAxis<double> white_V{};  ///< white noise of one reading; negative when unknown
  PerAxis<double> line_V2{};  ///< VisitLog's, where there is one
  NoiseProcesses processes;
  /// Variance of each mean beyond that of a quiet dwell, where the noise follows something.
  PerAxis<Eigen::VectorXd> noisier_V2;
};

/// One axis on its way through the engine.
struct AxisWork {
  NoiseModel noise;   ///< with the powers that the run, too, supports
  NoiseModel record;  ///< what the static record says about the run
  PooledNoise pooled;
  Eigen::VectorXd y;  ///< pose means freed of rounding, V
  /// To be added to errors of y, and to their mean square, where errors are those of the means as
  /// measured (RoundingFree::beyond_V2).
  Eigen::VectorXd rounding_V;
  double rounding_V2 = 0;
  Eigen::VectorXd known_V2;  ///< of each pose, by positioning and by bursts of noise
  Eigen::VectorXd own_V2;    ///< variance that each pose has for itself: that and rounding
  GeneralisedFit fit;
  Eigen::MatrixXd V;
  ResidualTestResult test;
  bool noise_known = false;
  /// What the poses' codes are worth, where they are better than mean voltages: the estimators then
  /// take these in place of y, the residuals stay those of the mean voltages.
  std::optional<QuantizedAxis> quantized;
};

double squared(double value) { return value * value; }

double samples_per_pose(const MeasurementSet& run) {
  return static_cast<double>(run.samples.size()) / static_cast<double>(run.poses.size());
}

Eigen::VectorXd readings_of_poses(const MeasurementSet& run) {
  Eigen::VectorXd readings(std::ssize(run.poses));
  for (Eigen::Index k = 0; k < readings.size(); ++k)
    readings(k) = static_cast<double>(run.poses[static_cast<std::size_t>(k)].count);
  return readings;
}

/// White noise of one reading: within the dwells, or in the record when every pose is read once;
/// negative when nothing tells.
double white_noise_V(const CalibrationInput& input, std::size_t axis) {
  if (samples_per_pose(input.run) > 1) return white_scatter_V(input.run, axis);
  const SampleTable* record = input.static_record;
  if (record == nullptr || record->size() < 2) return -1;
  MeasurementSet one_dwell;
  one_dwell.samples.u_V[axis] = record->u_V[axis];
  one_dwell.poses = {Pose{0, 0, 0, 0, record->size()}};
  return white_scatter_V(one_dwell, axis);
}

/// Positioning errors, independent from pose to pose, seen through the sensitivities `K_V_per_g`.
Eigen::VectorXd positioning_variance_V2(const Experiment& experiment,
                                        const Eigen::Vector3d& K_V_per_g) {
  constexpr double kRadiansPerArcsecond = 3.14159265358979323846 / 180.0 / 3600.0;
  const RunDescription& description = experiment.input.description;
  const double gamma = description.gravity.local_mps2 / kStandardGravity_mps2;
  const double u_delta_rad = description.angles.delta_arcsec * kRadiansPerArcsecond;
  const double u_h_rad = description.angles.h_arcsec * kRadiansPerArcsecond;
  Eigen::VectorXd variance(experiment.A.rows());
  for (Eigen::Index row = 0; row < variance.size(); ++row) {
    const Pose& pose = experiment.poses[static_cast<std::size_t>(row)].pose;
    const SpecificForce force = specific_force(pose.delta_deg, pose.h_deg, gamma);
    variance(row) = squared(u_delta_rad * force.d_delta_g_per_rad.dot(K_V_per_g)) +
                    squared(u_h_rad * force.d_h_g_per_rad.dot(K_V_per_g));
  }
  return variance;
}

/// The covariance of estimates under noise V, the powers of the noise being estimates, too.
Eigen::Matrix4d with_allowance_for_noise(const Experiment& experiment, const AxisWork& work,
                                         const Eigen::MatrixXd& V, const Eigen::Matrix4d& C) {
  return with_allowance(
      C, {allowance_for_powers(experiment.processes, work.test.powers, V, experiment.A, C)});
}

/// Estimates from the codes where rounding matters.
void use_codes(const Experiment& experiment, std::size_t axis, AxisWork& work) {
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
  const double twice_V2 = std::min(squared(quantized->use.scatter_V), V.diagonal().mean());
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

AxisWork fit_axis(const Experiment& experiment, const NoiseModel& identified, std::size_t axis) {
  AxisWork work;
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
  RoundingFree free;
  if (experiment.input.description.adc && experiment.white_V[axis] >= 0) {
    const auto free_means = [&](const Eigen::VectorXd& expected_V) {
      free = free_of_rounding(mean_V, expected_V, scale_of(*experiment.input.description.adc),
                              experiment.white_V[axis], readings_of_poses(experiment.input.run),
                              experiment.line_V2[axis]);
      work.y = free.mean_V;
      // Where the steps keep their edges, few means say more than the others together.
      const Eigen::VectorXd weight =
          free.beyond_V2 ? Eigen::VectorXd(free.variance_V2.cwiseSqrt().cwiseInverse())
                         : Eigen::VectorXd::Ones(n);
      ordinary =
          solve_least_squares(weight.asDiagonal() * experiment.A, weight.cwiseProduct(work.y));
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
  }
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

/// Filter, recursive and batch estimates after each pose; the last ones are those of the run.
void follow_convergence(const Experiment& experiment, const AxisWork& work, double inflation,
                        std::size_t axis, Convergence& convergence) {
  constexpr double kPriorSd = 1e3;  // V/g and V: leaves a part in 1e16
  const Gravity& gravity = experiment.input.description.gravity;
  const auto& unit = experiment.processes.unit;
  Eigen::VectorXd white_V2 = work.own_V2 + work.pooled.power(kTermQ) * unit[kTermQ].diagonal() +
                             work.pooled.power(kTermN) * unit[kTermN].diagonal();
  for (Eigen::Index row = 0; row < white_V2.size(); ++row)
    white_V2(row) += experiment.processes.variance_of_bands(work.pooled.power, row);

  RecursiveLeastSquares recursive(kPriorSd);
  EightStateFilter filter(work.noise, filter_options(experiment.poses),
                          experiment.poses.front().t_arrival_s);
  for (Eigen::Index row = 0; row < experiment.A.rows(); ++row) {
    const auto pose = static_cast<std::size_t>(row);
    recursive.add(work.fit.whitened.row(row).head<4>(), work.fit.whitened(row, 4));
    convergence.rls[pose][axis] = with_gravity(recursive.estimate(), gravity, inflation);

    filter.predict(experiment.poses[pose].t_mean_s);
    const double variance_V2 = work.quantized     ? work.quantized->variance_V2(row)
                               : work.noise_known ? white_V2(row)
                                                  : work.V(row, row);
    filter.update(experiment.A.row(row).head<3>(),
                  work.quantized ? work.quantized->mean_V(row) : work.y(row), variance_V2);
    convergence.ekf[pose][axis] = with_gravity(filter.parameters(), gravity, inflation);

    AxisEstimate batch{Eigen::Vector4d::Constant(kNan), Eigen::Matrix4d::Constant(kNan)};
    const LeastSquaresResult so_far = solve_least_squares(
        work.fit.whitened.topLeftCorner(row + 1, 4), work.fit.whitened.col(4).head(row + 1));
    if (so_far.rank == 4) batch = {so_far.x, so_far.cofactor};
    convergence.batch_ls[pose][axis] = with_gravity(batch, gravity, inflation);
  }
}

/// Expected pose RMS under the noise, and its uncertainty from that of the noise powers.
void floor_of(const Experiment& experiment, const AxisWork& work, double mps2_per_V,
              double& floor_mps2, double& u_floor_mps2) {
  const double mean_square =
      expected_mean_square_V2(experiment.A, work.fit.gain, work.V) + work.rounding_V2;
  floor_mps2 = std::abs(mps2_per_V) * std::sqrt(mean_square);
  u_floor_mps2 = 0;

  const Eigen::MatrixXd& covariance = work.test.powers.covariance;
  if (!work.noise_known || covariance.size() == 0) return;
  Eigen::VectorXd slope(covariance.rows());
  for (Eigen::Index i = 0; i < slope.size(); ++i)
    slope(i) = expected_mean_square_V2(experiment.A, work.fit.gain,
                                       experiment.processes.unit[static_cast<std::size_t>(i)]);
  const double variance = slope.dot(covariance * slope);
  u_floor_mps2 =
      std::abs(mps2_per_V) * std::sqrt(std::max(variance, 0.0)) / (2.0 * std::sqrt(mean_square));
}

/// Errors of one axis; returns the held-out errors of both partitions one after the other.
Eigen::VectorXd error_figures(const Experiment& experiment, const AxisWork& work, std::size_t axis,
                              double mps2_per_V, ErrorFigures& errors) {
  const MeasurementSet& run = experiment.input.run;
  errors.fit_pose_rms_mps2[axis] = rms(mps2_per_V * (work.fit.residual_V + work.rounding_V));
  errors.sample_rms_mps2[axis] =
      std::abs(mps2_per_V) * sample_rms_V(run, experiment.A * work.fit.estimate.value, axis);
  Eigen::VectorXd heldout(2 * work.y.size());
  heldout << heldout_residuals_V(experiment.A, work.y, work.V, time_blocks(experiment.poses)),
      heldout_residuals_V(experiment.A, work.y, work.V, position_blocks(experiment.poses));
  heldout += work.rounding_V.replicate<2, 1>();
  heldout *= mps2_per_V;
  errors.heldout_pose_rms_mps2[axis] = rms(heldout);
  errors.heldout_pose_max_abs_mps2[axis] = max_abs(heldout);
  return heldout;
}

/// The fit of every axis by itself; `inflation` of its covariance.
PropagatedEstimate propagated(const PerAxis<AxisWork>& work, const PerAxis<double>& inflation) {
  PropagatedEstimate estimate;
  estimate.covariance = Eigen::MatrixXd::Zero(4 * kAxisCount, 4 * kAxisCount);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const AxisWork& w = work[axis];
    const auto first = 4 * static_cast<Eigen::Index>(axis);
    estimate.value[axis] = w.fit.estimate.value;
    estimate.gain[axis] = Eigen::MatrixXd::Zero(4 * kAxisCount, w.y.size());
    estimate.gain[axis].middleRows<4>(first) = w.fit.gain;
    estimate.covariance.block<4, 4>(first, first) = inflation[axis] * w.fit.estimate.covariance;
    // Rounding that was estimated from the codes is part of the noise there.
    estimate.rounding_V2[axis] = w.quantized ? Eigen::VectorXd(Eigen::VectorXd::Zero(w.y.size()))
                                             : Eigen::VectorXd(w.own_V2 - w.known_V2);
  }
  return estimate;
}

}  // namespace

Calibration calibrate_in_noise(const FurtherNoise& further, const PreparedRun& run,
                               const CalibrationOptions& options) {
  const CalibrationInput& input = run.input;
  Calibration result;
  result.poses = run.poses.size();
  result.samples = input.run.samples.size();
  result.skipped_rows = input.run.skipped_rows;
  result.ranges = column_ranges(input.run.samples);
  result.observability = observability(run.A);
  if (result.observability.rank < 4) return result;

  Experiment experiment{input, run.poses, run.A, driver_means(input.run.samples, input.run.poses),
                        {},    {},        {},    {}};
  const std::size_t n = experiment.poses.size();
  result.convergence.rls.resize(n);
  result.convergence.ekf.resize(n);
  result.convergence.batch_ls.resize(n);
  result.estimates.rls.emplace();
  result.pose_results.resize(n);

  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    experiment.white_V[axis] = white_noise_V(input, axis);
    experiment.noisier_V2[axis] = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(n));
  }
  std::optional<VisitLog> log;
  std::vector<NoiseDriver> noise_follows;
  if (n >= kFewestPosesToDecide) {
    log = make_visit_log(input.run, input.description, further.bands);
    experiment.line_V2 = log->line_V2;
    noise_follows = noise_drivers(
        *log, input.run, {time_blocks(experiment.poses), position_blocks(experiment.poses)});
    for (const NoiseDriver& driver : noise_follows)
      experiment.noisier_V2[driver.axis] += driver.excess_V2;
  }

  result.noise = run.noise;
  for (NoiseModel& noise : result.noise)
    if (!further.bands.empty() && !noise.record.lines.empty())
      add_remark(noise.remark, "in the run the line wanders, and is counted as noise");
  experiment.processes = noise_processes(run.windows, further);
  PerAxis<AxisWork> work;
  parallel_for(kAxisCount, [&](std::size_t axis) {
    work[axis] = fit_axis(experiment, result.noise[axis], axis);
  });
  VerdictInput verdict;
  verdict.poses = n;
  double worst_error_mps2 = -1;
  double u_worst_mps2 = 0;
  PerAxis<double> inflation{};
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const AxisWork& w = work[axis];
    if (w.quantized) result.quantization[axis] = w.quantized->use;
    const double mps2_per_V = input_referred_mps2_per_V(w.fit.estimate, axis);
    result.diagnosis.axis_test[axis] = {w.test.chi2, w.test.dof, w.test.p_value};

    const Eigen::VectorXd heldout = error_figures(experiment, w, axis, mps2_per_V, result.before);
    floor_of(experiment, w, mps2_per_V, result.floor_pose_rms_mps2[axis],
             result.u_floor_pose_rms_mps2[axis]);
    verdict.axis[axis] = {
        w.noise_known,
        std::isfinite(mps2_per_V),
        w.test.p_value,
        result.before.fit_pose_rms_mps2[axis],
        result.floor_pose_rms_mps2[axis],
        std::hypot(result.u_floor_pose_rms_mps2[axis],
                   std::abs(mps2_per_V) * scatter_of_rms_V(w.fit.residual_covariance_V2))};

    // An axis whose residual the noise does not explain is less certain than the noise says.
    const bool unexplained = is_unexplained(verdict, axis);
    inflation[axis] = unexplained ? std::max(1.0, w.test.chi2 / w.test.dof) : 1.0;
    follow_convergence(experiment, w, inflation[axis], axis, result.convergence);
    result.estimates.batch_ls[axis] =
        with_gravity(w.fit.estimate, input.description.gravity, inflation[axis]);
    (*result.estimates.rls)[axis] = result.convergence.rls.back()[axis];
    result.estimates.ekf[axis] = result.convergence.ekf.back()[axis];
    result.estimates.agreement_en[axis] =
        largest_en(result.estimates.batch_ls[axis], result.estimates.ekf[axis]);

    for (Eigen::Index k = 0; k < heldout.size(); ++k) {
      if (!(std::abs(heldout(k)) > worst_error_mps2)) continue;
      worst_error_mps2 = std::abs(heldout(k));
      const Eigen::Index row = k % static_cast<Eigen::Index>(n);
      u_worst_mps2 =
          std::abs(mps2_per_V) *
          std::sqrt(std::max(w.fit.residual_covariance_V2(row, row) + w.rounding_V2, 0.0));
    }
    for (std::size_t pose = 0; pose < n; ++pose) {
      PoseResult& row = result.pose_results[pose];
      const auto k = static_cast<Eigen::Index>(pose);
      const double residual_mps2 = mps2_per_V * (w.fit.residual_V(k) + w.rounding_V(k));
      row.residual_before_mps2[axis] = row.residual_after_mps2[axis] = residual_mps2;
    }
  }
  for (std::size_t pose = 0; pose < n; ++pose) {
    const PoseMean& mean = experiment.poses[pose];
    PoseResult& row = result.pose_results[pose];
    row.pose = mean.pose;
    row.t_mean_s = mean.t_mean_s;
    row.temp_C = mean.temp_C;
    row.mean_V = mean.mean_V;
    row.sd_V = mean.sd_V;
  }

  decide_verdict(verdict, result.diagnosis);
  result.final = result.estimates;
  result.final.rls.reset();
  result.after = result.before;
  PropagatedEstimate certified = propagated(work, inflation);
  if (result.diagnosis.verdict != Verdict::undetermined) {
    ExplainInput explain_input{input,
                               *log,
                               noise_follows,
                               experiment.poses,
                               run.windows,
                               result.noise,
                               {},
                               experiment.processes,
                               {}};
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      explain_input.known_V2[axis] = work[axis].known_V2;
      explain_input.pooled[axis] = work[axis].pooled;
    }
    if (auto explained = explain(explain_input, options, result)) {
      worst_error_mps2 = explained->worst_error_mps2;
      u_worst_mps2 = explained->u_worst_mps2;
      certified = std::move(explained->estimate);
    }
    add_limits_of_samples(input.run, *log, result.final.batch_ls, result.diagnosis.effects,
                          result.diagnosis.not_found);
  }
  result.uncertainty =
      propagate_uncertainty(certified, input.run.poses, input.description, options.seed);
  if (input.description.limits && worst_error_mps2 >= 0)
    result.decision =
        decide(input.description.limits->max_abs_error_mps2, worst_error_mps2, u_worst_mps2);
  return result;
}

}  // namespace plumbline
