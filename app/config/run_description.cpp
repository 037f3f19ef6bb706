#include "app/config/run_description.h"

#include <fmt/format.h>

#include <cmath>

#include "app/config/rig_description.h"

namespace plumbline::app {

namespace {

using rig::Range;
using rig::StrictTable;

/// Gravity at the surface of the Earth lies between 9.76 and 9.84 m/s².
constexpr Range kGravity_mps2{9.7, 9.9};
constexpr Range kUncertainty_mps2{0, 0.1};
constexpr Range kUncertainty_arcsec{0, 36000};
constexpr Range kDelta_deg{-360, 360};
constexpr Range kTilt_deg{-90, 90};
constexpr Range kTemperature_C{-273.15, 500};
constexpr Range kBits{4, 32};
constexpr Range kSpan_V{-1000, 1000};
constexpr double kMaxPositionsPerAngle = 36000;

AngleRange read_angle_range(StrictTable& grid, const char* key, const AngleRange& fallback,
                            Range allowed) {
  if (!grid.has(key)) {
    grid.table(key);
    return fallback;
  }
  StrictTable table = grid.table(key);
  const AngleRange range{.start_deg = table.number("start", allowed),
                         .stop_deg = table.number("stop", allowed),
                         .step_deg = table.number("step", {-720, 720})};
  if (!table.present()) return fallback;
  const double span = range.stop_deg - range.start_deg;
  const double steps = span / range.step_deg;
  if (range.step_deg == 0) {
    table.refuse("step", "must not be 0");
  } else if (steps < 0) {
    table.refuse("step",
                 fmt::format("{} leads away from stop = {}", range.step_deg, range.stop_deg));
  } else if (steps > kMaxPositionsPerAngle) {
    table.refuse("step", fmt::format("{} makes more than {} positions", range.step_deg,
                                     kMaxPositionsPerAngle));
  } else if (std::abs(steps - std::round(steps)) > 1e-6) {
    table.refuse("step", fmt::format("{} from start = {} does not reach stop = {}", range.step_deg,
                                     range.start_deg, range.stop_deg));
  }
  return range;
}

Adc read_adc(StrictTable& table) {
  const Adc adc{.bits = static_cast<int>(table.integer("bits", kBits)),
                .min_V = table.number("min_V", kSpan_V),
                .max_V = table.number("max_V", kSpan_V)};
  if (table.has("min_V") && table.has("max_V") && !(adc.min_V < adc.max_V)) {
    table.refuse("min_V", fmt::format("{} is not below max_V = {}", adc.min_V, adc.max_V));
  }
  return adc;
}

Limits read_limits(StrictTable& table) {
  const Limits limits{.max_abs_error_mps2 = table.number("max_abs_error_mps2", {0, 1000})};
  if (table.has("max_abs_error_mps2") && limits.max_abs_error_mps2 <= 0) {
    table.refuse("max_abs_error_mps2", "must be above 0; leave [limits] out for no limit");
  }
  return limits;
}

}  // namespace

RunDescription read_run_tables(StrictTable& root) {
  RunDescription run;
  if (StrictTable dut = root.table("dut"); dut.present()) {
    run.dut.serial = dut.text_or("serial", "");
    run.dut.model = dut.text_or("model", "");
  }
  StrictTable gravity = root.table("gravity");
  run.gravity.local_mps2 = gravity.number("local_mps2", kGravity_mps2);
  run.gravity.u_mps2 = gravity.number_or("u_mps2", 0, kUncertainty_mps2);
  if (StrictTable adc = root.table("adc"); adc.present()) run.adc = read_adc(adc);
  StrictTable temperature = root.table("temperature");
  run.reference_C = temperature.number_or("reference_C", run.reference_C, kTemperature_C);
  StrictTable grid = root.table("grid");
  run.grid.delta = read_angle_range(grid, "delta_deg", run.grid.delta, kDelta_deg);
  run.grid.h = read_angle_range(grid, "h_deg", run.grid.h, kTilt_deg);
  StrictTable angles = root.table("angles");
  run.angles.delta_arcsec = angles.number_or("u_delta_arcsec", 0, kUncertainty_arcsec);
  run.angles.h_arcsec = angles.number_or("u_h_arcsec", 0, kUncertainty_arcsec);
  if (StrictTable limits = root.table("limits"); limits.present()) run.limits = read_limits(limits);
  return run;
}

Result<RunDescription> parse_run_description(std::string_view text, const std::string& name) {
  auto file = rig::StrictFile::parse(text, name);
  if (!file) return fail(file.error());
  if (is_rig_description(*file)) {
    auto description = parse_rig_description(text, name);
    if (!description) return fail(description.error());
    return description->run;
  }
  StrictTable root = file->root();
  RunDescription run = read_run_tables(root);
  if (auto done = file->finish(); !done) return fail(done.error());
  return run;
}

Result<RunDescription> read_run_description(const std::filesystem::path& path) {
  const auto file = rig::StrictFile::read(path);
  if (!file) return fail(file.error());
  return parse_run_description(file->source(), path.string());
}

}  // namespace plumbline::app
