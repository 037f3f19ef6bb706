// A whole set without any wires: static record, poses, verification poses, and the truth.
//
// For studies: record_set() keeps everything in memory, write_set() puts it into files. Neither
// looks at a clock; the same world, options and seed give the same bytes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "estimator/measurement.h"
#include "rig/sim/route.h"
#include "rig/sim/world.h"

namespace plumbline::sim {

struct RecordOptions {
  std::uint64_t seed = 1;
  Grid grid;
  RecordOrder order = RecordOrder::snake;
  double soak_s = 300;  ///< static record at the soak pose before the grid; 0 = none
  double soak_delta_deg = 0;
  double soak_h_deg = 0;
  int samples_per_pose = 40;
  int verification_poses = 24;  ///< 0 = none
  double settle_s = 1;          ///< waited after every move, before the first sample
  double homing_s = 30;         ///< between the poses and the verification poses
  std::vector<Visit> plan;      ///< when not empty it replaces grid, order, soak and counts
};

/// RMS over the poses of (pose mean − fit of the 12 parameters), m/s², input-referred with the true
/// K_ii. "before": with [[effects]] in the readings; "oracle": same unit, head and noise without.
struct PoseRms {
  PerAxis<double> before{};
  PerAxis<double> oracle{};
};

struct RecordedTruth {
  Triad triad;
  double lsb_V = 0;
  std::vector<EffectSetting> effects;
  PoseRms poses;         ///< of the poses that the fit was made to
  PoseRms verification;  ///< of the others, predicted by that fit; zero when there are none
};

struct RecordedSet {
  RunDescription description;
  MeasurementSet run;           ///< samples.csv
  SampleTable soak;             ///< static.csv; may be empty
  MeasurementSet verification;  ///< confirm.csv; later on the same clock, head homed in between
  RecordedTruth truth;
};

/// Precondition: the grid has at least one position, samples_per_pose ≥ 1. With fewer than 4 poses
/// the RMS values are zero, since there is no fit.
RecordedSet record_set(const World& world, const RecordOptions& options);

/// Writes samples.csv, static.csv, confirm.csv, run.toml and truth.json into `folder`, which is
/// made when absent; parts without samples are left out. Errors: ErrorCode::output.
Result<void> write_set(const RecordedSet& set, const std::filesystem::path& folder);

/// record_set() and write_set() in one.
Result<void> record(const World& world, const RecordOptions& options,
                    const std::filesystem::path& folder);

}  // namespace plumbline::sim
