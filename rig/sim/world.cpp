#include "rig/sim/world.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "rig/sim/effects/effect.h"
#include "rig/sim/random.h"
#include "rig/strict_toml.h"

namespace plumbline::sim {

namespace {

using rig::Range;
using rig::StrictTable;

constexpr Range kNotNegative{.min = 0};
constexpr Range kPositive{.min = 1e-12};

void read_unit(StrictTable table, World& world) {
  world.serial = table.text_or("serial", world.serial);
  world.model = table.text_or("model", world.model);
  world.scatter.random = table.flag_or("random", false);
  world.scatter.scale_rel =
      table.number_or("scatter_scale_rel", world.scatter.scale_rel, kNotNegative);
  world.scatter.cross_V_per_g =
      table.number_or("scatter_cross_V_per_g", world.scatter.cross_V_per_g, kNotNegative);
  world.scatter.bias_V = table.number_or("scatter_bias_V", world.scatter.bias_V, kNotNegative);
  const auto row = [&](const char* key, PerAxis<double>& values) {
    const auto numbers = table.numbers_or(key, {values.begin(), values.end()}, kAxisCount);
    std::copy(numbers.begin(), numbers.end(), values.begin());
  };
  row("K_x_V_per_g", world.triad.K_V_per_g[0]);
  row("K_y_V_per_g", world.triad.K_V_per_g[1]);
  row("K_z_V_per_g", world.triad.K_V_per_g[2]);
  row("U0_V", world.triad.U0_V);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    if (world.triad.K_V_per_g[i][i] == 0) {
      table.refuse(fmt::format("K_{}_V_per_g", kAxisName[i]),
                   "its own element of the row is zero: the axis would measure nothing");
    }
  }
}

void read_electronics(StrictTable adc, StrictTable node, World& world) {
  world.adc.bits = static_cast<int>(adc.integer_or("bits", world.adc.bits, {12, 24}));
  world.adc.min_V = adc.number_or("min_V", world.adc.min_V);
  world.adc.max_V = adc.number_or("max_V", world.adc.max_V);
  if (!(world.adc.min_V < world.adc.max_V)) adc.refuse("max_V", "must be above min_V");
  world.rate_hz = node.number_or("rate_hz", world.rate_hz, {1, 20000});
  world.node_serial_number = static_cast<std::uint32_t>(
      node.integer_or("serial_number", world.node_serial_number, {0, 4294967295.0}));
}

void read_noise_terms(StrictTable table, double volts_per_g, NoiseTerms& terms) {
  const std::string unit = table.choice_or("unit", "V", {"V", "g"});
  const double factor = unit == "g" ? volts_per_g : 1.0;
  const auto read = [&](const char* key, double& value) {
    if (table.has(key))
      value = factor * table.number(key, kNotNegative);
    else
      table.number_or(key, 0);
  };
  read("Q", terms.Q);
  read("N", terms.N);
  read("B", terms.B);
  read("K", terms.K);
  read("R", terms.R);
  read("relaxation", terms.relaxation);
  terms.relaxation_tau_s =
      table.numbers_or("relaxation_tau_s", terms.relaxation_tau_s, 0, kPositive);
}

void read_noise(StrictTable table, World& world) {
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const double volts_per_g = std::abs(world.triad.K_V_per_g[i][i]);
    read_noise_terms(table, volts_per_g, world.noise_V[i]);
    read_noise_terms(table.table(kAxisName[i]), volts_per_g, world.noise_V[i]);
  }
}

void read_room(StrictTable table, Room& room) {
  const auto any = [&](const char* key, double& value) { value = table.number_or(key, value); };
  const auto size = [&](const char* key, double& value) {
    value = table.number_or(key, value, kNotNegative);
  };
  const auto time = [&](const char* key, double& value) {
    value = table.number_or(key, value, kPositive);
  };
  any("temperature_C", room.temperature_C);
  any("drift_C_per_h", room.drift_C_per_h);
  any("cycle_C", room.cycle_C);
  time("cycle_period_s", room.cycle_period_s);
  any("cycle_phase_deg", room.cycle_phase_deg);
  size("wander_C", room.wander_C);
  time("wander_tau_s", room.wander_tau_s);
  size("sensor_lag_s", room.sensor_lag_s);
  any("self_heating_C", room.self_heating_C);
  time("self_heating_tau_s", room.self_heating_tau_s);
  size("thermometer_noise_C", room.thermometer_noise_C);
  any("thermometer_offset_C", room.thermometer_offset_C);
  any("rh_pct", room.rh_pct);
  any("rh_cycle_pct", room.rh_cycle_pct);
  time("rh_cycle_period_s", room.rh_cycle_period_s);
  size("rh_wander_pct", room.rh_wander_pct);
  time("rh_wander_tau_s", room.rh_wander_tau_s);
  size("rh_noise_pct", room.rh_noise_pct);
  any("supply_V", room.supply_V);
  size("supply_wander_V", room.supply_wander_V);
  time("supply_wander_tau_s", room.supply_wander_tau_s);
  any("supply_cycle_V", room.supply_cycle_V);
  time("supply_cycle_period_s", room.supply_cycle_period_s);
  any("supply_drop_V_per_A", room.supply_drop_V_per_A);
  size("supply_noise_V", room.supply_noise_V);
  size("hold_A", room.hold_A);
  size("lift_A", room.lift_A);
  size("move_A", room.move_A);
  size("motor_wander_A", room.motor_wander_A);
  time("motor_wander_tau_s", room.motor_wander_tau_s);
  size("motor_noise_A", room.motor_noise_A);
}

void read_head(StrictTable table, World& world) {
  const auto read = [&](const char* key, double& value) { value = table.number_or(key, 0); };
  HeadErrors& head = world.head;
  read("base_roll_deg", head.base_roll_deg);
  read("base_pitch_deg", head.base_pitch_deg);
  read("axis_skew_deg", head.axis_skew_deg);
  read("delta_index_deg", head.delta_index_deg);
  read("delta_eccentricity_c_deg", head.delta_eccentricity_c_deg);
  read("delta_eccentricity_s_deg", head.delta_eccentricity_s_deg);
  read("delta_ellipticity_c_deg", head.delta_ellipticity_c_deg);
  read("delta_ellipticity_s_deg", head.delta_ellipticity_s_deg);
  read("h_index_deg", head.h_index_deg);
  read("h_scale", head.h_scale);
  read("h_eccentricity_c_deg", head.h_eccentricity_c_deg);
  read("h_eccentricity_s_deg", head.h_eccentricity_s_deg);
  read("backlash_deg", head.backlash_deg);
  world.positioning.delta_arcsec = table.number_or("scatter_delta_arcsec", 0, kNotNegative);
  world.positioning.h_arcsec = table.number_or("scatter_h_arcsec", 0, kNotNegative);
}

std::vector<std::size_t> read_axes(StrictTable& table) {
  std::vector<std::size_t> axes;
  for (const std::string& name : table.texts_or("axes", {"x", "y", "z"})) {
    const auto* const found = std::find(kAxisName.begin(), kAxisName.end(), name);
    if (found == kAxisName.end()) {
      table.refuse("axes", fmt::format("\"{}\" is not an axis; x, y and z are", name));
    } else {
      axes.push_back(static_cast<std::size_t>(found - kAxisName.begin()));
    }
  }
  return axes;
}

EffectSetting read_effect(StrictTable table) {
  EffectSetting setting;
  setting.id = table.text("id");
  const EffectInfo* info = find_effect(setting.id);
  if (info == nullptr) {
    std::vector<std::string> known;
    for (const EffectInfo* effect : effect_catalogue()) known.emplace_back(effect->id);
    const std::string hint = rig::nearest(setting.id, known);
    table.refuse("id",
                 fmt::format("there is no effect \"{}\"{}", setting.id,
                             hint.empty() ? "" : fmt::format("; did you mean \"{}\"?", hint)));
    return setting;
  }
  setting.axes = {0, 1, 2};
  if (info->per_axis) setting.axes = read_axes(table);
  for (const ParameterInfo& p : info->parameters) {
    const Range range{.min = p.min, .max = p.max};
    setting.parameters[p.name] =
        p.required ? table.number(p.name, range) : table.number_or(p.name, p.fallback, range);
  }
  if (setting.id == "rig.pose_outlier") {
    for (const double pose : table.numbers_or("poses", {}, 0, kNotNegative)) {
      setting.poses.push_back(std::llround(pose));
    }
    if (setting.poses.empty()) table.refuse("poses", "must name at least one pose number");
  }
  if (setting.id.starts_with("covariate:")) {
    setting.form = table.choice_or("form", "bias", {"bias", "scale"});
  }
  return setting;
}

Result<World> read(rig::StrictFile& file, const std::string& name) {
  World world;
  world.name = name;
  world.source = file.source();
  StrictTable root = file.root();
  read_unit(root.table("unit"), world);
  read_electronics(root.table("adc"), root.table("node"), world);
  StrictTable gravity = root.table("gravity");
  world.gravity.local_mps2 = gravity.number_or("local_mps2", world.gravity.local_mps2, {9.7, 9.9});
  world.gravity.u_mps2 = gravity.number_or("u_mps2", world.gravity.u_mps2, kNotNegative);
  world.reference_C = root.table("temperature").number_or("reference_C", world.reference_C);
  read_noise(root.table("noise"), world);
  read_room(root.table("room"), world.room);
  world.drive = read_drive(root.table("drive"));
  read_head(root.table("head"), world);
  for (StrictTable& table : root.tables("effects")) world.effects.push_back(read_effect(table));
  world.faults = read_faults(root);
  if (auto done = file.finish(); !done) return fail(done.error());
  return world;
}

}  // namespace

Result<World> read_world(const std::filesystem::path& path) {
  auto file = rig::StrictFile::read(path);
  if (!file) return fail(file.error());
  return read(*file, path.string());
}

Result<World> parse_world(std::string_view text, const std::string& name) {
  auto file = rig::StrictFile::parse(text, name);
  if (!file) return fail(file.error());
  return read(*file, name);
}

Triad draw_triad(const World& world, std::uint64_t seed) {
  Triad triad = world.triad;
  if (!world.scatter.random) return triad;
  Random random(seed, "unit");
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    for (std::size_t j = 0; j < kAxisCount; ++j) {
      double& k = triad.K_V_per_g[i][j];
      const double spread =
          i == j ? world.scatter.scale_rel * std::abs(k) : world.scatter.cross_V_per_g;
      k += spread * random.normal();
    }
    triad.U0_V[i] += world.scatter.bias_V * random.normal();
  }
  return triad;
}

}  // namespace plumbline::sim
