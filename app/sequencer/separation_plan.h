// From poses that would tell effects apart to steps of the sequencer.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "app/config/rig_description.h"
#include "app/sequencer/plan.h"
#include "estimator/calibrate.h"

namespace plumbline::app {

struct CalibrationJob;

/// Where the head may go by its soft limits, as far as it turns the triad once round.
HeadReach reach_of(const RigDescription& rig);

/// The poses that the diagnosis asks for, as grid steps numbered from 0; none: nothing to decide.
std::vector<PlanStep> separating_steps(const Diagnosis& diagnosis, int samples_per_pose);

/// The run that `job` holds once more (soak, poses, verification) with those poses after its own;
/// no steps: nothing to decide.
Plan separation_plan(const CalibrationJob& job, const Diagnosis& diagnosis);

/// What to_csv() has written. Refused with file and line. ErrorCode::input.
Result<Plan> plan_from_csv(std::string_view text, const std::string& name);
Result<Plan> read_plan_file(const std::filesystem::path& path);

}  // namespace plumbline::app
