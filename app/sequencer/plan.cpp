#include "app/sequencer/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <iterator>
#include <random>
#include <utility>

namespace plumbline::app {

namespace {

using rig::HeadAngles;

constexpr double kFullTurn_deg = 360.0;
constexpr double kVerificationClearance_deg = 1.0;
/// Far below any encoder step; absorbs the rounding of start + i·step.
constexpr double kAngleRounding_deg = 1e-9;
constexpr double kNodeParts = 1e9;
constexpr double kVerificationParts = 100;

/// To the nearest multiple of 1 / `parts`.
double rounded(double value, double parts) { return std::round(value * parts) / parts; }

std::vector<double> nodes(const AngleRange& range) {
  assert(range.step_deg != 0 && (range.stop_deg - range.start_deg) / range.step_deg >= 0);
  const auto steps = static_cast<int>(
      std::floor((range.stop_deg - range.start_deg) / range.step_deg + kAngleRounding_deg));
  std::vector<double> angles;
  for (int i = 0; i <= steps; ++i)
    angles.push_back(rounded(range.start_deg + i * range.step_deg, kNodeParts));
  return angles;
}

double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * std::generate_canonical<double, 53>(random);
}

std::vector<HeadAngles> grid_positions(const Grid& grid, VisitOrder order,
                                       std::mt19937_64& random) {
  std::vector<HeadAngles> positions;
  const std::vector<double> deltas = nodes(grid.delta);
  double turned_deg = 0;  // whole turns of the spiral so far
  bool backwards = false;
  for (const double h : nodes(grid.h)) {
    std::vector<HeadAngles> ring;
    for (const double delta : deltas) ring.push_back({delta + turned_deg, h});
    if (backwards) std::reverse(ring.begin(), ring.end());
    positions.insert(positions.end(), ring.begin(), ring.end());
    if (order == VisitOrder::snake) backwards = !backwards;
    if (order == VisitOrder::spiral) turned_deg += kFullTurn_deg;
  }
  if (order == VisitOrder::random) std::shuffle(positions.begin(), positions.end(), random);
  return positions;
}

double distance_to_node(double angle_deg, const std::vector<double>& axis_nodes) {
  double nearest_deg = kFullTurn_deg;
  for (const double node : axis_nodes)
    nearest_deg = std::min(nearest_deg, std::abs(angle_deg - node));
  return nearest_deg;
}

std::vector<HeadAngles> verification_positions(const Grid& grid, int count,
                                               std::mt19937_64& random) {
  const std::vector<double> deltas = nodes(grid.delta);
  const std::vector<double> tilts = nodes(grid.h);
  std::vector<HeadAngles> positions;
  if (deltas.size() * tilts.size() == 1) return positions;
  const double delta_clearance =
      std::min(kVerificationClearance_deg, std::abs(grid.delta.step_deg) / 4);
  const double h_clearance = std::min(kVerificationClearance_deg, std::abs(grid.h.step_deg) / 4);
  while (std::ssize(positions) < count) {
    const HeadAngles candidate{
        rounded(uniform(random, deltas.front(), deltas.back()), kVerificationParts),
        rounded(uniform(random, tilts.front(), tilts.back()), kVerificationParts)};
    if (distance_to_node(candidate.delta_deg, deltas) >= delta_clearance ||
        distance_to_node(candidate.h_deg, tilts) >= h_clearance)
      positions.push_back(candidate);
  }
  return positions;
}

std::string describe(const PlanStep& step, const HeadAngles& position, const char* how) {
  return fmt::format("plan step {} ({} pose{} at δ = {}°, h = {}°)", step.ordinal,
                     storage::to_string(step.kind), how, position.delta_deg, position.h_deg);
}

Result<void> check_axis(const std::string& where, const char* name, double angle_deg,
                        double lower_deg, double upper_deg) {
  if (angle_deg >= lower_deg - kAngleRounding_deg && angle_deg <= upper_deg + kAngleRounding_deg)
    return {};
  const bool above = angle_deg > upper_deg;
  return fail(
      ErrorCode::input,
      fmt::format("{}: {} = {}° is {} the soft limit of {}°; change [grid] or [plan], or the "
                  "limits of the drive",
                  where, name, angle_deg, above ? "above" : "below",
                  above ? upper_deg : lower_deg));
}

}  // namespace

const std::vector<std::string>& visit_order_names() {
  static const std::vector<std::string> names = {"raster", "snake", "spiral", "random"};
  return names;
}

const char* to_string(VisitOrder order) {
  return visit_order_names()[static_cast<std::size_t>(order)].c_str();
}

std::optional<VisitOrder> visit_order_from(std::string_view name) {
  const auto& names = visit_order_names();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) return std::nullopt;
  return static_cast<VisitOrder>(found - names.begin());
}

Plan make_plan(const Grid& grid, const PlanOptions& options, double rate_hz) {
  assert(rate_hz > 0 && options.samples_per_pose > 0);
  std::mt19937_64 random(options.seed);
  Plan plan;
  const auto add = [&](storage::PoseKind kind, HeadAngles target, int samples) {
    PlanStep step{std::ssize(plan.steps), kind, target, {}, samples};
    // The spindle still rests against the same flank when δ does not change.
    const bool backwards =
        plan.steps.empty() || target.delta_deg < plan.steps.back().target.delta_deg;
    if (options.one_sided && backwards)
      step.via.push_back({target.delta_deg - options.approach_deg, target.h_deg});
    plan.steps.push_back(std::move(step));
  };

  if (options.soak_s > 0)
    add(storage::PoseKind::soak, {options.soak_delta_deg, options.soak_h_deg},
        static_cast<int>(std::lround(options.soak_s * rate_hz)));
  for (const HeadAngles& position : grid_positions(grid, options.order, random))
    add(storage::PoseKind::grid, position, options.samples_per_pose);
  for (HeadAngles position : verification_positions(grid, options.verification_poses, random)) {
    if (options.order == VisitOrder::spiral) {  // goes on turning instead of unwinding
      const double ahead_deg = plan.steps.back().target.delta_deg - position.delta_deg;
      position.delta_deg =
          rounded(position.delta_deg + kFullTurn_deg * std::ceil(ahead_deg / kFullTurn_deg),
                  kVerificationParts);
    }
    add(storage::PoseKind::verification, position, options.samples_per_pose);
  }
  return plan;
}

Result<void> check_plan(const Plan& plan, const rig::SoftLimits& limits) {
  const auto check = [&](const std::string& where, const HeadAngles& position) -> Result<void> {
    if (auto ok = check_axis(where, "δ", position.delta_deg, limits.lower.delta_deg,
                             limits.upper.delta_deg);
        !ok)
      return ok;
    return check_axis(where, "h", position.h_deg, limits.lower.h_deg, limits.upper.h_deg);
  };
  for (const PlanStep& step : plan.steps) {
    for (const HeadAngles& position : step.via)
      if (auto ok = check(describe(step, position, ", approach position"), position); !ok)
        return ok;
    if (auto ok = check(describe(step, step.target, ""), step.target); !ok) return ok;
  }
  return {};
}

double travel_s(double way_deg, const AxisMotion& motion) {
  const double way = std::abs(way_deg);
  const double v = motion.speed_deg_s;
  const double a = motion.acceleration_deg_s2;
  return way < v * v / a ? 2 * std::sqrt(way / a) : way / v + v / a;
}

double travel_s(const HeadAngles& from, const HeadAngles& to, const AxisMotion& motion) {
  return std::max(travel_s(to.delta_deg - from.delta_deg, motion),
                  travel_s(to.h_deg - from.h_deg, motion));
}

PlanTime time_plan(const Plan& plan, const AxisMotion& motion, double rate_hz,
                   double settle_s_per_pose) {
  PlanTime time;
  const PlanStep* previous = nullptr;
  for (const PlanStep& step : plan.steps) {
    if (previous != nullptr) {
      HeadAngles at = previous->target;
      for (const HeadAngles& position : step.via) {
        time.moving_s += travel_s(at, position, motion);
        at = position;
      }
      time.moving_s += travel_s(at, step.target, motion);
    }
    time.sampling_s += step.samples / rate_hz;
    time.settling_s += settle_s_per_pose;
    previous = &step;
  }
  return time;
}

std::string to_csv(const Plan& plan) {
  std::string csv = "ordinal,kind,delta_deg,h_deg,samples,via\n";
  for (const PlanStep& step : plan.steps) {
    std::string via;
    for (const HeadAngles& position : step.via)
      via += fmt::format("{}{}:{}", via.empty() ? "" : " ", position.delta_deg, position.h_deg);
    csv += fmt::format("{},{},{},{},{},{}\n", step.ordinal, storage::to_string(step.kind),
                       step.target.delta_deg, step.target.h_deg, step.samples, via);
  }
  return csv;
}

}  // namespace plumbline::app
