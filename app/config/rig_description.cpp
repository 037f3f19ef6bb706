#include "app/config/rig_description.h"

#include <fmt/format.h>

#include <algorithm>

#include "app/config/run_description.h"

namespace plumbline::app {

namespace {

using rig::StrictTable;

constexpr const char* kRigTables[] = {"head", "sensor", "plan", "settling"};

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
  settling.window = static_cast<int>(table.integer_or("window", settling.window, {8, 100000}));
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
  if (auto done = file->finish(); !done) return fail(done.error());
  return rig;
}

Result<RigDescription> read_rig_description(const std::filesystem::path& path) {
  const auto file = rig::StrictFile::read(path);
  if (!file) return fail(file.error());
  return parse_rig_description(file->source(), path.string());
}

}  // namespace plumbline::app
