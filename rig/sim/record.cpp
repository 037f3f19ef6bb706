#include "rig/sim/record.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cassert>
#include <cmath>

#include "rig/sim/effects/effect.h"
#include "rig/sim/head_errors.h"
#include "rig/sim/unit.h"

namespace plumbline::sim {

namespace {

/// Sums over the samples of one pose.
struct PoseSums {
  PerAxis<double> sent_V{};   ///< as read
  PerAxis<double> plain_V{};  ///< without [[effects]]
};

/// One part of a set while it grows.
struct Part {
  MeasurementSet set;
  std::vector<PoseSums> sums;

  void reserve(std::size_t samples) {
    SampleTable& table = set.samples;
    table.t_s.reserve(samples);
    for (auto& column : table.u_V) column.reserve(samples);
    table.temp_C.reserve(samples);
    for (const char* name : {"rh_pct", "supply_V", "motor_A"}) {
      table.covariates.push_back({name, {}});
      table.covariates.back().value.reserve(samples);
    }
  }
};

/// Time of a move at the drives' speed and acceleration.
double move_time_s(double travel_deg, const AxisDynamics& axis) {
  const double distance = std::abs(travel_deg);
  const double ramp = axis.speed_deg_s * axis.speed_deg_s / axis.acceleration_deg_s2;
  if (distance < ramp) return 2 * std::sqrt(distance / axis.acceleration_deg_s2);
  return distance / axis.speed_deg_s + axis.speed_deg_s / axis.acceleration_deg_s2;
}

/// Walks along the route, one visit after another.
class Recorder {
 public:
  Recorder(const World& world, const RecordOptions& options)
      : world_(world), options_(options), unit_(world, options.seed) {}

  /// Goes there and adds the samples of the visit to `part` as a pose with this number.
  /// `known_as` is the number by which effects know the pose.
  void visit(const Visit& visit, long long number, long long known_as, Part& part) {
    double delta_travel = visit.delta_deg - delta_deg_;
    if (visit.via_delta_deg) {
      arrive_s_ += move_time_s(*visit.via_delta_deg - delta_deg_, world_.drive.axis[0]);
      delta_travel = visit.delta_deg - *visit.via_delta_deg;
    }
    if (started_) {
      arrive_s_ += std::max(move_time_s(delta_travel, world_.drive.axis[0]),
                            move_time_s(visit.h_deg - h_deg_, world_.drive.axis[1])) +
                   options_.settle_s;
    }
    started_ = true;
    delta_deg_ = visit.delta_deg;
    h_deg_ = visit.h_deg;
    const int approach = delta_travel == 0 ? 0 : (delta_travel > 0 ? 1 : -1);
    unit_.jump_to_pose({arrive_s_, delta_deg_, h_deg_, approach, known_as});

    HeadState head;
    head.delta.angle_deg = delta_deg_;
    head.h.angle_deg = h_deg_;
    head.delta.in_position = head.h.in_position = true;
    const double turns = std::floor(visit.delta_deg / 360.0);
    const double shown_delta_deg =
        visit.delta_deg >= 360 ? visit.delta_deg - 360 * turns : visit.delta_deg;
    part.set.poses.push_back({number, shown_delta_deg, visit.h_deg, part.set.samples.size(),
                              static_cast<std::size_t>(visit.samples)});
    PoseSums sums;
    for (int i = 0; i < visit.samples; ++i) add(unit_.next(head), part.set.samples, sums);
    part.sums.push_back(sums);
    arrive_s_ = unit_.next_time_s();
  }

  void home() {
    arrive_s_ += options_.homing_s;
    delta_deg_ = h_deg_ = 0;
  }

 private:
  void add(const NodeSample& sample, SampleTable& table, PoseSums& sums) {
    table.t_s.push_back(sample.t_s);
    table.temp_C.push_back(sample.temp_C);
    table.covariates[0].value.push_back(sample.rh_pct);
    table.covariates[1].value.push_back(sample.supply_V);
    table.covariates[2].value.push_back(sample.motor_A);
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const double u_V = world_.adc.volts(sample.code[axis]);
      table.u_V[axis].push_back(u_V);
      sums.sent_V[axis] += u_V;
      sums.plain_V[axis] += world_.adc.volts(unit_.truth().plain_code[axis]);
    }
  }

  const World& world_;
  const RecordOptions& options_;
  Unit unit_;
  bool started_ = false;
  double arrive_s_ = 0;
  double delta_deg_ = 0;
  double h_deg_ = 0;
};

/// Nominal regressors [a_x a_y a_z 1] of the poses.
Eigen::MatrixXd regressors(const std::vector<Pose>& poses, double gravity_g) {
  Eigen::MatrixXd rows(static_cast<Eigen::Index>(poses.size()), 4);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const auto up = attitude({}, poses[k].delta_deg, poses[k].h_deg).up;
    rows.row(static_cast<Eigen::Index>(k)) << gravity_g * up[0], gravity_g * up[1],
        gravity_g * up[2], 1.0;
  }
  return rows;
}

Eigen::VectorXd pose_means(const Part& part, PerAxis<double> PoseSums::*which, std::size_t axis) {
  Eigen::VectorXd means(static_cast<Eigen::Index>(part.sums.size()));
  for (std::size_t k = 0; k < part.sums.size(); ++k) {
    means(static_cast<Eigen::Index>(k)) =
        (part.sums[k].*which)[axis] / static_cast<double>(part.set.poses[k].count);
  }
  return means;
}

double rms(const Eigen::VectorXd& residual_V, double K_ii_V_per_g) {
  return residual_V.norm() / std::sqrt(static_cast<double>(residual_V.size())) /
         std::abs(K_ii_V_per_g) * kStandardGravity_mps2;
}

void evaluate(const Part& run, const Part& verification, double gravity_g, RecordedTruth& truth) {
  if (run.sums.size() < 4) return;
  const Eigen::MatrixXd fitted = regressors(run.set.poses, gravity_g);
  const Eigen::MatrixXd fresh = regressors(verification.set.poses, gravity_g);
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(fitted);
  const auto score = [&](PerAxis<double> PoseSums::*which, PerAxis<double> PoseRms::*result) {
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const double k = truth.triad.K_V_per_g[axis][axis];
      const Eigen::VectorXd means = pose_means(run, which, axis);
      const Eigen::VectorXd parameters = qr.solve(means);
      (truth.poses.*result)[axis] = rms(means - fitted * parameters, k);
      if (!verification.sums.empty()) {
        (truth.verification.*result)[axis] =
            rms(pose_means(verification, which, axis) - fresh * parameters, k);
      }
    }
  };
  score(&PoseSums::sent_V, &PoseRms::before);
  score(&PoseSums::plain_V, &PoseRms::oracle);
}

std::vector<Visit> route(const World& world, const RecordOptions& options) {
  if (!options.plan.empty()) return options.plan;
  std::vector<Visit> visits;
  if (options.soak_s > 0) {
    visits.push_back({VisitKind::soak, options.soak_delta_deg, options.soak_h_deg,
                      std::max(1, static_cast<int>(std::lround(options.soak_s * world.rate_hz))),
                      std::nullopt});
  }
  const auto grid =
      grid_visits(options.grid, options.order, options.samples_per_pose, options.seed);
  const auto fresh = verification_visits(options.grid, options.verification_poses,
                                         options.samples_per_pose, options.seed);
  visits.insert(visits.end(), grid.begin(), grid.end());
  visits.insert(visits.end(), fresh.begin(), fresh.end());
  return visits;
}

RunDescription description(const World& world, const RecordOptions& options) {
  RunDescription run;
  run.dut = {world.serial, world.model};
  run.gravity = world.gravity;
  run.adc = world.adc;
  run.reference_C = world.reference_C;
  run.grid = options.grid;
  run.angles = {world.positioning.delta_arcsec, world.positioning.h_arcsec};
  return run;
}

}  // namespace

RecordedSet record_set(const World& world, const RecordOptions& options) {
  const std::vector<Visit> visits = route(world, options);
  assert(!visits.empty());
  Part soak;
  Part run;
  Part verification;
  const auto part_of = [&](VisitKind kind) -> Part& {
    if (kind == VisitKind::soak) return soak;
    return kind == VisitKind::grid ? run : verification;
  };
  for (const VisitKind kind : {VisitKind::soak, VisitKind::grid, VisitKind::verification}) {
    std::size_t samples = 0;
    for (const Visit& v : visits)
      samples += v.kind == kind ? static_cast<std::size_t>(v.samples) : 0;
    part_of(kind).reserve(samples);
  }

  Recorder recorder(world, options);
  for (const Visit& visit : visits) {
    Part& part = part_of(visit.kind);
    const auto number = static_cast<long long>(part.sums.size());
    if (visit.kind == VisitKind::verification && number == 0) recorder.home();
    // Homing cures what belonged to the run of the grid (a slipped index, a wrong pose), so the
    // other poses carry numbers that no such effect refers to.
    recorder.visit(visit, number, visit.kind == VisitKind::grid ? number : -1 - number, part);
  }

  RecordedSet set;
  set.description = description(world, options);
  set.truth.triad = draw_triad(world, options.seed);
  set.truth.lsb_V = world.adc.lsb_V();
  set.truth.effects = world.effects;
  evaluate(run, verification, world.gravity.local_mps2 / kStandardGravity_mps2, set.truth);
  set.run = std::move(run.set);
  set.soak = std::move(soak.set.samples);
  set.verification = std::move(verification.set);
  return set;
}

Result<void> record(const World& world, const RecordOptions& options,
                    const std::filesystem::path& folder) {
  return write_set(record_set(world, options), folder);
}

}  // namespace plumbline::sim
