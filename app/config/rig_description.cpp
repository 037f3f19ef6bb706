#include "app/config/rig_description.h"

#include <fmt/format.h>

#include <algorithm>

#include "app/config/run_description.h"

namespace plumbline::app {

namespace {

using rig::StrictTable;

constexpr const char* kRigTables[] = {"head", "sensor", "plan", "settling", "recovery"};

PlanOptions read_plan_options(StrictTable table) {
  PlanOptions plan;
  plan.order =
      visit_order_from(table.choice_or("order", to_string(plan.order), visit_order_names()))
          .value_or(plan.order);
  plan.one_sided = table.flag_or("one_sided", plan.one_sided);
  plan.approach_deg = table.number_or("approach_deg", plan.approach_deg, {0.01, 45});
  plan.soak_s = table.number_or("soak_s", plan.soak_s, {0, 1e6});
  plan.soak_delta_deg = table.number_or("soak_delta_deg", plan.soak_delta_deg, {-360, 360});
  plan.soak_h_deg = table.number_or("soak_h_deg", plan.soak_h_deg, {-90, 90});
  plan.samples_per_pose =
      static_cast<int>(table.integer_or("samples_per_pose", plan.samples_per_pose, {1, 1e6}));
  plan.verification_poses =
      static_cast<int>(table.integer_or("verification_poses", plan.verification_poses, {0, 10000}));
  plan.seed = static_cast<std::uint64_t>(
      table.integer_or("seed", static_cast<std::int64_t>(plan.seed), {0, 9e18}));
  return plan;
}

SettlingOptions read_settling_options(StrictTable table) {
  SettlingOptions settling;
  settling.hold_s = table.number_or("hold_s", settling.hold_s, {0, 600});
  settling.window =
      static_cast<int>(table.integer_or("window", settling.window, {kSmallestWindow, 100000}));
  settling.sigma_factor = table.number_or("sigma_factor", settling.sigma_factor, {1, 1000});
  settling.cap_s = table.number_or("cap_s", settling.cap_s, {0.01, 3600});
  settling.noise_V = table.number_or("noise_V", settling.noise_V, {0, 1000});
  settling.angle_tolerance_deg =
      table.number_or("angle_tolerance_deg", settling.angle_tolerance_deg, {1e-6, 10});
  if (settling.cap_s < settling.hold_s) {
    table.refuse("cap_s",
                 fmt::format("{} is shorter than hold_s = {}", settling.cap_s, settling.hold_s));
  }
  return settling;
}

RecoveryOptions read_recovery_options(StrictTable table) {
  RecoveryOptions recovery;
  const auto count = [&](const char* key, int fallback, rig::Range range) {
    return static_cast<int>(table.integer_or(key, fallback, range));
  };
  recovery.attempts_per_pose = count("attempts_per_pose", recovery.attempts_per_pose, {1, 100});
  recovery.recoveries_per_run =
      count("recoveries_per_run", recovery.recoveries_per_run, {0, 100000});
  recovery.skipped_poses = count("skipped_poses", recovery.skipped_poses, {0, 10000});
  recovery.wait_s = table.number_or("wait_s", recovery.wait_s, {0, 1e6});
  recovery.compare_tolerance =
      table.number_or("compare_tolerance", recovery.compare_tolerance, {0, 1});
  return recovery;
}

/// [[suspend]]: the column must be one that is recorded, or the condition could never be met.
std::vector<SuspendCondition> read_suspend_conditions(StrictTable& root,
                                                      const rig::SensorConfig& sensor) {
  std::vector<std::string> columns = {"temp_C", kVibrationColumn};
  for (const rig::CovariateSignal& signal : sensor.covariates) columns.push_back(signal.column);
  std::vector<SuspendCondition> conditions;
  for (StrictTable& table : root.tables("suspend")) {
    SuspendCondition condition;
    condition.column = table.has("column") ? table.choice_or("column", columns.front(), columns)
                                           : table.text("column");
    condition.min = table.number_or("min", condition.min, {});
    condition.max = table.number_or("max", condition.max, {});
    condition.hysteresis = table.number_or("hysteresis", condition.hysteresis, {0, 1e9});
    condition.delay_s = table.number_or("delay_s", condition.delay_s, {0, 1e6});
    condition.hold_s = table.number_or("hold_s", condition.hold_s, {0, 1e6});
    if (!table.has("min") && !table.has("max")) table.refuse("column", "has neither min nor max");
    if (condition.max - condition.min < 2 * condition.hysteresis) {
      table.refuse("hysteresis", "leaves nothing of the band between min and max");
    }
    conditions.push_back(condition);
  }
  return conditions;
}

/// soft_limits = { delta_deg = [lower, upper], h_deg = [lower, upper] }
std::optional<rig::SoftLimits> read_soft_limits(StrictTable& head) {
  if (!head.has("soft_limits")) return std::nullopt;
  StrictTable table = head.table("soft_limits");
  const auto delta = table.numbers_or("delta_deg", {-1e6, 1e6}, 2);
  const auto h = table.numbers_or("h_deg", {-1e6, 1e6}, 2);
  if (delta.size() != 2 || h.size() != 2) return std::nullopt;  // refused already
  if (delta[0] > delta[1]) table.refuse("delta_deg", "the lower limit comes first");
  if (h[0] > h[1]) table.refuse("h_deg", "the lower limit comes first");
  return rig::SoftLimits{{delta[0], h[0]}, {delta[1], h[1]}};
}

bool same(const Adc& a, const Adc& b) {
  return a.bits == b.bits && a.min_V == b.min_V && a.max_V == b.max_V;
}

}  // namespace

bool is_rig_description(rig::StrictFile& file) {
  const StrictTable root = file.root();
  return std::any_of(std::begin(kRigTables), std::end(kRigTables),
                     [&](const char* table) { return root.has(table); });
}

Result<RigDescription> parse_rig_description(std::string_view text, const std::string& name) {
  auto file = rig::StrictFile::parse(text, name);
  if (!file) return fail(file.error());
  StrictTable root = file->root();
  RigDescription rig;
  rig.source = file->source();
  rig.run = read_run_tables(root);
  StrictTable head = root.table("head");
  auto head_config = rig::read_head_config(head);
  if (!head_config) return fail(head_config.error());
  rig.head = *std::move(head_config);
  rig.soft_limits = read_soft_limits(head);
  StrictTable sensor = root.table("sensor");
  auto sensor_config = rig::read_sensor_config(sensor, rig.run.adc);
  if (!sensor_config) return fail(sensor_config.error());
  rig.sensor = *std::move(sensor_config);
  if (!rig.run.adc) {
    rig.run.adc = rig.sensor.adc;
  } else if (!same(*rig.run.adc, rig.sensor.adc)) {
    root.refuse("adc", "contradicts the converter of [sensor]; give it once");
  }
  rig.plan = read_plan_options(root.table("plan"));
  rig.settling = read_settling_options(root.table("settling"));
  rig.recovery = read_recovery_options(root.table("recovery"));
  rig.suspend = read_suspend_conditions(root, rig.sensor);
  if (auto done = file->finish(); !done) return fail(done.error());
  return rig;
}

Result<RigDescription> read_rig_description(const std::filesystem::path& path) {
  const auto file = rig::StrictFile::read(path);
  if (!file) return fail(file.error());
  return parse_rig_description(file->source(), path.string());
}

}  // namespace plumbline::app
