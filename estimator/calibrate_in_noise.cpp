#include "estimator/calibrate_in_noise.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "estimator/axis_fit.h"
#include "estimator/decision.h"
#include "estimator/diagnosis/detection_limits.h"
#include "estimator/diagnosis/explain.h"
#include "estimator/diagnosis/noise_drivers.h"
#include "estimator/diagnosis/verdict.h"
#include "estimator/error_figures.h"
#include "estimator/fit/axis_tools.h"
#include "estimator/fit/eight_state_filter.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/fit/least_squares.h"
#include "estimator/fit/recursive_least_squares.h"
#include "estimator/noise/covariance.h"
#include "estimator/parallel_for.h"
#include "estimator/pose_means.h"

namespace plumbline {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// Filter, recursive and batch estimates after each pose; the last ones are those of the run.
void follow_convergence(const Experiment& experiment, const AxisFit& work, double inflation,
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
void floor_of(const Experiment& experiment, const AxisFit& work, double mps2_per_V,
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

/// The errors of one axis on left-out poses.
LeftOutErrors left_out_errors(const Experiment& experiment, const AxisFit& work,
                              double mps2_per_V) {
  const auto n = work.y.size();
  LeftOutErrors errors{Eigen::VectorXd(2 * n), Eigen::VectorXd(2 * n)};
  Eigen::Index at = 0;
  for (const Blocks& blocks : {time_blocks(experiment.poses), position_blocks(experiment.poses)}) {
    const HeldoutResiduals left = heldout_residuals(experiment.A, work.y, work.V, blocks);
    errors.error_mps2.segment(at, n) = mps2_per_V * (left.residual_V + work.rounding_V);
    errors.u_mps2.segment(at, n) =
        std::abs(mps2_per_V) * (left.sd_V.array().square() + work.rounding_V2).sqrt();
    at += n;
  }
  return errors;
}

/// The fit of every axis by itself; `inflation` of its covariance.
PropagatedEstimate propagated(const PerAxis<AxisFit>& work, const PerAxis<double>& inflation) {
  PropagatedEstimate estimate;
  estimate.covariance = Eigen::MatrixXd::Zero(4 * kAxisCount, 4 * kAxisCount);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const AxisFit& w = work[axis];
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

/// Everything that the fits and the search share, the noise that follows something included.
Experiment make_experiment(const FurtherNoise& further, const PreparedRun& run,
                           const std::optional<VisitLog>& log,
                           const std::vector<NoiseDriver>& noise_follows) {
  Experiment experiment{
      run.input, run.poses, run.A, driver_means(run.input.run.samples, run.input.run.poses),
      {},        {},        {},    {}};
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    experiment.white_V[axis] = white_noise_V(run.input, axis);
    experiment.noisier_V2[axis] = Eigen::VectorXd::Zero(std::ssize(run.poses));
  }
  if (log) experiment.line_V2 = log->line_V2;
  for (const NoiseDriver& driver : noise_follows)
    experiment.noisier_V2[driver.axis] += driver.excess_V2;
  experiment.processes = noise_processes(run.windows, further);
  return experiment;
}

/// What the result says of each pose, but for the residuals.
std::vector<PoseResult> pose_results(const std::vector<PoseMean>& poses) {
  std::vector<PoseResult> rows(poses.size());
  for (std::size_t k = 0; k < poses.size(); ++k) {
    rows[k].pose = poses[k].pose;
    rows[k].t_mean_s = poses[k].t_mean_s;
    rows[k].temp_C = poses[k].temp_C;
    rows[k].mean_V = poses[k].mean_V;
    rows[k].sd_V = poses[k].sd_V;
  }
  return rows;
}

/// Writes the fit of one axis into the result: its estimates, residuals and errors on poses of the
/// fit, and what the verdict goes by. Returns the factor by which its covariance is inflated.
double report_axis(const Experiment& experiment, const AxisFit& work, std::size_t axis,
                   double mps2_per_V, VerdictInput& verdict, Calibration& result) {
  if (work.quantized) result.quantization[axis] = work.quantized->use;
  result.diagnosis.axis_test[axis] = {work.test.chi2, work.test.dof, work.test.p_value};
  const Eigen::VectorXd residual_mps2 = mps2_per_V * (work.fit.residual_V + work.rounding_V);
  result.before.fit_pose_rms_mps2[axis] = rms(residual_mps2);
  result.before.sample_rms_mps2[axis] =
      std::abs(mps2_per_V) *
      sample_rms_V(experiment.input.run, experiment.A * work.fit.estimate.value, axis);
  for (std::size_t pose = 0; pose < result.pose_results.size(); ++pose) {
    PoseResult& row = result.pose_results[pose];
    row.residual_before_mps2[axis] = row.residual_after_mps2[axis] =
        residual_mps2(static_cast<Eigen::Index>(pose));
  }
  floor_of(experiment, work, mps2_per_V, result.floor_pose_rms_mps2[axis],
           result.u_floor_pose_rms_mps2[axis]);
  verdict.axis[axis] = {
      work.noise_known,
      std::isfinite(mps2_per_V),
      work.test.p_value,
      result.before.fit_pose_rms_mps2[axis],
      result.floor_pose_rms_mps2[axis],
      std::hypot(result.u_floor_pose_rms_mps2[axis],
                 std::abs(mps2_per_V) * scatter_of_rms_V(work.fit.residual_covariance_V2))};

  // An axis whose residual the noise does not explain is less certain than the noise says.
  const bool unexplained = is_unexplained(verdict, axis);
  const double inflation = unexplained ? std::max(1.0, work.test.chi2 / work.test.dof) : 1.0;
  follow_convergence(experiment, work, inflation, axis, result.convergence);
  result.estimates.batch_ls[axis] =
      with_gravity(work.fit.estimate, experiment.input.description.gravity, inflation);
  (*result.estimates.rls)[axis] = result.convergence.rls.back()[axis];
  result.estimates.ekf[axis] = result.convergence.ekf.back()[axis];
  result.estimates.agreement_en[axis] =
      largest_en(result.estimates.batch_ls[axis], result.estimates.ekf[axis]);
  return inflation;
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

  const std::size_t n = run.poses.size();
  std::optional<VisitLog> log;
  std::vector<NoiseDriver> noise_follows;
  if (n >= kFewestPosesToDecide) {
    log = make_visit_log(input.run, input.description, further.bands);
    noise_follows =
        noise_drivers(*log, input.run, {time_blocks(run.poses), position_blocks(run.poses)});
  }
  const Experiment experiment = make_experiment(further, run, log, noise_follows);
  result.noise = run.noise;
  for (NoiseModel& noise : result.noise)
    if (!further.bands.empty() && !noise.record.lines.empty())
      add_remark(noise.remark, "in the run the line wanders, and is counted as noise");
  PerAxis<AxisFit> work;
  parallel_for(kAxisCount, [&](std::size_t axis) {
    work[axis] = fit_axis(experiment, result.noise[axis], axis);
  });

  result.convergence.rls.resize(n);
  result.convergence.ekf.resize(n);
  result.convergence.batch_ls.resize(n);
  result.estimates.rls.emplace();
  result.pose_results = pose_results(run.poses);
  VerdictInput verdict;
  verdict.poses = n;
  PerAxis<double> inflation{};
  PerAxis<LeftOutErrors> left_out;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const double mps2_per_V = input_referred_mps2_per_V(work[axis].fit.estimate, axis);
    inflation[axis] = report_axis(experiment, work[axis], axis, mps2_per_V, verdict, result);
    left_out[axis] = left_out_errors(experiment, work[axis], mps2_per_V);
    result.before.heldout_pose_rms_mps2[axis] = rms(left_out[axis].error_mps2);
    result.before.heldout_pose_max_abs_mps2[axis] = max_abs(left_out[axis].error_mps2);
  }
  decide_verdict(verdict, result.diagnosis);
  result.final = result.estimates;
  result.final.rls.reset();
  result.after = result.before;
  WorstError worst = worst_of(left_out);
  PropagatedEstimate certified = propagated(work, inflation);
  if (result.diagnosis.verdict != Verdict::undetermined) {
    ExplainInput explain_input{input,        *log, noise_follows,        run.poses, run.windows,
                               result.noise, {},   experiment.processes, {}};
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      explain_input.known_V2[axis] = work[axis].known_V2;
      explain_input.pooled[axis] = work[axis].pooled;
    }
    if (auto explained = explain(explain_input, options, result)) {
      worst = explained->worst;
      certified = std::move(explained->estimate);
    }
    add_limits_of_samples(input.run, *log, result.final.batch_ls, result.diagnosis.effects,
                          result.diagnosis.not_found);
  }
  result.uncertainty =
      propagate_uncertainty(certified, input.run.poses, input.description, options.seed);
  if (input.description.limits && worst.error_mps2 >= 0)
    result.decision =
        decide(input.description.limits->max_abs_error_mps2, worst.error_mps2, worst.u_mps2);
  return result;
}

}  // namespace plumbline
