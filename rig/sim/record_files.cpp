// The files of a recorded set.
#include <fmt/compile.h>
#include <fmt/format.h>

#include <cerrno>
#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <system_error>

#include "rig/sim/effects/effect.h"
#include "rig/sim/record.h"

namespace plumbline::sim {

namespace {

/// Enough decimals that a written voltage identifies its code beyond doubt.
int voltage_decimals(double lsb_V) { return static_cast<int>(std::ceil(-std::log10(lsb_V))) + 2; }

void append_values(std::string& out, const SampleTable& table, std::size_t row, int decimals) {
  auto end = std::back_inserter(out);
  fmt::format_to(end, ",{:.{}f},{:.{}f},{:.{}f}", table.u_V[0][row], decimals, table.u_V[1][row],
                 decimals, table.u_V[2][row], decimals);
  fmt::format_to(end, FMT_COMPILE(",{:.4f}"), table.temp_C[row]);
  for (const Covariate& covariate : table.covariates) {
    fmt::format_to(end, FMT_COMPILE(",{:.5f}"), covariate.value[row]);
  }
  out += '\n';
}

std::string value_columns(const SampleTable& table) {
  std::string columns = "ux_V,uy_V,uz_V,temp_C";
  for (const Covariate& covariate : table.covariates) columns += "," + covariate.name;
  return columns + "\n";
}

std::string poses_csv(const MeasurementSet& set, int decimals) {
  std::string out = "t_s,pose,delta_deg,h_deg," + value_columns(set.samples);
  out.reserve(100 * set.samples.size());
  for (const Pose& pose : set.poses) {
    const std::string where =
        fmt::format(",{},{:.4f},{:.4f}", pose.number, pose.delta_deg, pose.h_deg);
    for (std::size_t row = pose.first; row < pose.first + pose.count; ++row) {
      fmt::format_to(std::back_inserter(out), FMT_COMPILE("{:.6f}"), set.samples.t_s[row]);
      out += where;
      append_values(out, set.samples, row, decimals);
    }
  }
  return out;
}

std::string static_csv(const SampleTable& table, int decimals) {
  std::string out = "t_s," + value_columns(table);
  out.reserve(80 * table.size());
  for (std::size_t row = 0; row < table.size(); ++row) {
    fmt::format_to(std::back_inserter(out), FMT_COMPILE("{:.6f}"), table.t_s[row]);
    append_values(out, table, row, decimals);
  }
  return out;
}

/// A TOML basic string.
std::string quoted(const std::string& text) { return nlohmann::json(text).dump(); }

std::string range_toml(const AngleRange& range) {
  return fmt::format("{{ start = {}, stop = {}, step = {} }}", range.start_deg, range.stop_deg,
                     range.step_deg);
}

std::string run_toml(const RunDescription& run) {
  std::string out = fmt::format("[dut]\nserial = {}\nmodel = {}\n", quoted(run.dut.serial),
                                quoted(run.dut.model));
  out += fmt::format("[gravity]\nlocal_mps2 = {}\nu_mps2 = {}\n", run.gravity.local_mps2,
                     run.gravity.u_mps2);
  if (run.adc) {
    out += fmt::format("[adc]\nbits = {}\nmin_V = {}\nmax_V = {}\n", run.adc->bits, run.adc->min_V,
                       run.adc->max_V);
  }
  out += fmt::format("[temperature]\nreference_C = {}\n", run.reference_C);
  out += fmt::format("[grid]\ndelta_deg = {}\nh_deg = {}\n", range_toml(run.grid.delta),
                     range_toml(run.grid.h));
  out += fmt::format("[angles]\nu_delta_arcsec = {}\nu_h_arcsec = {}\n", run.angles.delta_arcsec,
                     run.angles.h_arcsec);
  return out;
}

/// The first parameter that is not zero: where a sine and a cosine stand for one size, either.
double amplitude(const EffectSetting& effect, const EffectInfo& info) {
  for (const ParameterInfo& parameter : info.parameters) {
    if (const double value = effect.parameters.at(parameter.name); value != 0) return value;
  }
  return 0;
}

std::string truth_json(const RecordedSet& set) {
  const RecordedTruth& truth = set.truth;
  nlohmann::ordered_json json;
  json["case"] = set.description.dut.serial;
  json["K"] = truth.triad.K_V_per_g;
  json["U0"] = truth.triad.U0_V;
  json["lsb"] = truth.lsb_V;
  json["effects"] = nlohmann::ordered_json::array();
  for (const EffectSetting& effect : truth.effects) {
    nlohmann::ordered_json entry;
    const EffectInfo* info = find_effect(effect.id);
    entry["id"] = effect.id;
    entry["listed"] = !effect.id.starts_with("own.");
    for (const std::size_t axis : effect.axes) entry["axes"].push_back(kAxisName[axis]);
    entry["amp"] = amplitude(effect, *info);
    entry["parameters"] = effect.parameters;
    if (!effect.poses.empty()) entry["poses"] = effect.poses;
    entry["driver"] = info->driver;
    entry["form"] = effect.id.starts_with("covariate:") ? effect.form.c_str() : info->form;
    json["effects"].push_back(entry);
  }
  json["oracle_pose_rms"] = truth.poses.oracle;
  json["before_pose_rms"] = truth.poses.before;
  json["confirm_oracle"] = truth.verification.oracle;
  json["confirm_before"] = truth.verification.before;
  return json.dump(1) + "\n";
}

Result<void> write_file(const std::filesystem::path& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) {
    return fail(ErrorCode::output, fmt::format("{}: cannot be written: {}", path.string(),
                                               std::generic_category().message(errno)));
  }
  return {};
}

}  // namespace

Result<void> write_set(const RecordedSet& set, const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    return fail(ErrorCode::output,
                fmt::format("{}: cannot be made: {}", folder.string(), error.message()));
  }
  const int decimals = voltage_decimals(set.truth.lsb_V);
  std::vector<std::pair<const char*, std::string>> files;
  if (set.run.samples.size() > 0) files.emplace_back("samples.csv", poses_csv(set.run, decimals));
  if (set.soak.size() > 0) files.emplace_back("static.csv", static_csv(set.soak, decimals));
  if (set.verification.samples.size() > 0) {
    files.emplace_back("confirm.csv", poses_csv(set.verification, decimals));
  }
  files.emplace_back("run.toml", run_toml(set.description));
  files.emplace_back("truth.json", truth_json(set));
  for (const auto& [name, text] : files) {
    if (auto written = write_file(folder / name, text); !written) return written;
  }
  return {};
}

}  // namespace plumbline::sim
