#include "app/sequencer/separation_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "app/calibration_job.h"
#include "app/io/read_file.h"

namespace plumbline::app {

namespace {

constexpr std::string_view kHeader = "ordinal,kind,delta_deg,h_deg,samples,via";

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (std::size_t from = 0;;) {
    const std::size_t at = text.find(separator, from);
    parts.push_back(text.substr(from, at == std::string_view::npos ? at : at - from));
    if (at == std::string_view::npos) return parts;
    from = at + 1;
  }
}

template <class Number>
std::optional<Number> number(std::string_view text) {
  Number value{};
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc{} || stop != end) return std::nullopt;
  if constexpr (std::is_floating_point_v<Number>) {
    if (!std::isfinite(value)) return std::nullopt;
  }
  return value;
}

std::optional<storage::PoseKind> kind_from(std::string_view text) {
  for (const auto kind :
       {storage::PoseKind::soak, storage::PoseKind::grid, storage::PoseKind::verification})
    if (text == storage::to_string(kind)) return kind;
  return std::nullopt;
}

std::optional<rig::HeadAngles> angles_from(std::string_view delta, std::string_view h) {
  const auto delta_deg = number<double>(delta), h_deg = number<double>(h);
  if (!delta_deg || !h_deg) return std::nullopt;
  return rig::HeadAngles{*delta_deg, *h_deg};
}

/// Nothing when a cell is wrong.
std::optional<PlanStep> step_from(std::string_view line) {
  constexpr std::size_t kCells = 6;
  const auto cells = split(line, ',');
  if (cells.size() != kCells) return std::nullopt;
  const auto ordinal = number<long long>(cells[0]);
  const auto kind = kind_from(cells[1]);
  const auto target = angles_from(cells[2], cells[3]);
  const auto samples = number<int>(cells[4]);
  if (!ordinal || !kind || !target || !samples || *samples < 1) return std::nullopt;
  PlanStep step{*ordinal, *kind, *target, {}, *samples};
  if (cells[5].empty()) return step;
  for (const std::string_view position : split(cells[5], ' ')) {
    const auto angles = split(position, ':');
    const auto via = angles.size() == 2 ? angles_from(angles[0], angles[1]) : std::nullopt;
    if (!via) return std::nullopt;
    step.via.push_back(*via);
  }
  return step;
}

}  // namespace

HeadReach reach_of(const RigDescription& rig) {
  constexpr double kUpright_deg = 90;
  const auto [delta_start, delta_stop] =
      std::minmax(rig.run.grid.delta.start_deg, rig.run.grid.delta.stop_deg);
  const auto [h_start, h_stop] = std::minmax(rig.run.grid.h.start_deg, rig.run.grid.h.stop_deg);
  if (!rig.soft_limits) return {delta_start, delta_stop, h_start, h_stop, true};
  const rig::SoftLimits& limits = *rig.soft_limits;
  return {.delta_min_deg = std::max(delta_start, limits.lower.delta_deg),
          .delta_max_deg = std::min(delta_stop, limits.upper.delta_deg),
          .h_min_deg = std::max(-kUpright_deg, limits.lower.h_deg),
          .h_max_deg = std::min(kUpright_deg, limits.upper.h_deg),
          .is_limit = true};
}

std::vector<PlanStep> separating_steps(const Diagnosis& diagnosis, int samples_per_pose) {
  std::vector<PlanStep> steps;
  for (const auto& [name, ambiguity] : diagnosis.findings()) {
    const SeparatingPlan& plan = ambiguity.separating_plan;
    for (const SeparatingPlan::Stop& stop : plan.stops)
      steps.push_back({std::ssize(steps),
                       storage::PoseKind::grid,
                       {stop.delta_deg, stop.h_deg},
                       {},
                       static_cast<int>(std::lround(samples_per_pose * plan.samples_factor))});
  }
  return steps;
}

Plan separation_plan(const CalibrationJob& job, const Diagnosis& diagnosis) {
  Plan plan;
  const auto& poses = job.run.poses;
  const int samples = poses.empty() ? 1 : static_cast<int>(poses.front().count);
  const std::vector<PlanStep> further = separating_steps(diagnosis, samples);
  if (further.empty()) return plan;
  const auto add = [&](storage::PoseKind kind, const rig::HeadAngles& target, std::size_t count) {
    plan.steps.push_back({std::ssize(plan.steps), kind, target, {}, static_cast<int>(count)});
  };
  if (job.static_record.size() > 0)
    add(storage::PoseKind::soak, {poses.front().delta_deg, poses.front().h_deg},
        job.static_record.size());
  for (const Pose& pose : poses)
    add(storage::PoseKind::grid, {pose.delta_deg, pose.h_deg}, pose.count);
  for (const PlanStep& step : further)
    add(step.kind, step.target, static_cast<std::size_t>(step.samples));
  for (const Pose& pose : job.verification.poses)
    add(storage::PoseKind::verification, {pose.delta_deg, pose.h_deg}, pose.count);
  return plan;
}

Result<Plan> plan_from_csv(std::string_view text, const std::string& name) {
  Plan plan;
  std::size_t line_number = 0;
  for (std::string_view line : split(text, '\n')) {
    ++line_number;
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    if (line.empty()) continue;
    if (line_number == 1) {
      if (line == kHeader) continue;
      return fail(ErrorCode::input,
                  fmt::format("{}:1: is not a plan; the first line must be {}", name, kHeader));
    }
    auto step = step_from(line);
    if (!step)
      return fail(ErrorCode::input,
                  fmt::format("{}:{}: is not a step of a plan ({})", name, line_number, kHeader));
    if (step->ordinal != std::ssize(plan.steps))
      return fail(ErrorCode::input,
                  fmt::format("{}:{}: step {} where {} is next; steps are numbered from 0", name,
                              line_number, step->ordinal, plan.steps.size()));
    plan.steps.push_back(*std::move(step));
  }
  if (plan.steps.empty()) return fail(ErrorCode::input, name + ": holds no step");
  return plan;
}

Result<Plan> read_plan_file(const std::filesystem::path& path) {
  const auto text = read_file(path);
  if (!text) return fail(text.error());
  return plan_from_csv(*text, path.string());
}

}  // namespace plumbline::app
