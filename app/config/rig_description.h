// Reads rig.toml: a run.toml, and how the head and the sensor are reached, what is visited in which
// order, and when a pose has settled.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/sequencer/engine.h"
#include "app/sequencer/plan.h"
#include "app/sequencer/settling.h"
#include "app/sequencer/suspend.h"
#include "estimator/measurement.h"
#include "rig/rig_config.h"
#include "rig/strict_toml.h"

namespace plumbline::app {

struct RigDescription {
  RunDescription run;  ///< without [adc], the converter is that of [sensor]
  rig::HeadConfig head;
  rig::SensorConfig sensor;
  PlanOptions plan;
  SettlingOptions settling;
  RecoveryOptions recovery;
  std::vector<SuspendCondition> suspend;
  /// [head] soft_limits, so that a plan can be checked without the drive.
  std::optional<rig::SoftLimits> soft_limits;
  std::string source;  ///< the text as it was read, to be stored with the run
};

/// Strict like read_run_description().
Result<RigDescription> read_rig_description(const std::filesystem::path& path);
Result<RigDescription> parse_rig_description(std::string_view text, const std::string& name);

/// True when the file has a table that only a rig.toml has.
bool is_rig_description(rig::StrictFile& file);

}  // namespace plumbline::app
