#include "rig/rig_config.h"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "rig/can_source.h"
#include "rig/dbc.h"
#include "rig/modbus_head.h"

namespace plumbline::rig {

namespace {

std::chrono::milliseconds read_ms(StrictTable& table, const char* key,
                                  std::chrono::milliseconds fallback, Range range) {
  return std::chrono::milliseconds(table.integer_or(key, fallback.count(), range));
}

std::array<int, 2> read_pair(StrictTable& table, const char* key, std::array<int, 2> fallback,
                             Range range) {
  const auto values = table.numbers_or(
      key, {static_cast<double>(fallback[0]), static_cast<double>(fallback[1])}, 2, range);
  const std::array<int, 2> pair = {static_cast<int>(values[0]), static_cast<int>(values[1])};
  if (pair[0] != values[0] || pair[1] != values[1]) table.refuse(key, "must hold whole numbers");
  return pair;
}

Result<std::string> read_text_file(const std::string& path) {
  std::error_code error;
  std::ifstream stream(path, std::ios::binary);
  if (!stream || std::filesystem::is_directory(path, error)) {
    return fail(ErrorCode::input, fmt::format("{}: cannot read the DBC file", path));
  }
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

}  // namespace

Result<HeadConfig> read_head_config(StrictTable& table) {
  HeadConfig config;
  config.modbus = table.text_or("modbus", "");
  if (!config.modbus.empty()) {
    if (const auto endpoint = parse_modbus_endpoint(config.modbus); !endpoint) {
      table.refuse("modbus", endpoint.error().message);
    }
  }
  const auto unit = static_cast<int>(table.integer_or("unit_id", 1, {.min = 1, .max = 247}));
  config.unit_id = read_pair(table, "axis_unit_id", {unit, unit}, {.min = 1, .max = 247});
  config.axis_base = read_pair(table, "axis_base", config.axis_base, {.min = 0, .max = 65000});
  if (config.unit_id[0] == config.unit_id[1] && config.axis_base[0] == config.axis_base[1]) {
    table.refuse("axis_base", "both axes have the same unit id and the same registers");
  }
  config.registers = read_register_map(table);
  const auto counts = table.numbers_or(
      "counts_per_deg", {config.counts_per_deg[0], config.counts_per_deg[1]}, 2, {-1e8, 1e8});
  config.counts_per_deg = {counts[0], counts[1]};
  if (counts[0] == 0 || counts[1] == 0) table.refuse("counts_per_deg", "must not be zero");
  config.speed_deg_s = table.number_or("speed_deg_s", config.speed_deg_s, {0.01, 1000});
  config.acceleration_deg_s2 =
      table.number_or("acceleration_deg_s2", config.acceleration_deg_s2, {0.01, 10000});
  config.response_timeout =
      read_ms(table, "response_timeout_ms", config.response_timeout, {.min = 20, .max = 2000});
  config.poll_interval =
      read_ms(table, "poll_interval_ms", config.poll_interval, {.min = 1, .max = 1000});
  config.watchdog = read_ms(table, "watchdog_ms", config.watchdog, {.min = 0, .max = 65535});
  config.identity_address =
      static_cast<int>(table.integer_or("identity_address", 0, {.min = 0, .max = 65535}));
  config.identity_count =
      static_cast<int>(table.integer_or("identity_count", 0, {.min = 0, .max = 16}));
  config.home_end_latched = table.flag_or("home_end_latched", config.home_end_latched);
  return config;
}

Result<SensorConfig> read_sensor_config(StrictTable& table, const std::optional<Adc>& adc) {
  SensorConfig config;
  if (adc) config.adc = *adc;
  config.can = table.text_or("can", "");
  if (!config.can.empty()) {
    if (const auto carrier = make_carrier(config.can); !carrier) {
      table.refuse("can", carrier.error().message);
    }
  }
  config.dbc_file = table.text_or("dbc", "");
  config.rate_hz = table.number_or("rate_hz", config.rate_hz, {0.01, 100000});
  config.adc.bits =
      static_cast<int>(table.integer_or("bits", config.adc.bits, {.min = 8, .max = 32}));
  config.adc.min_V = table.number_or("min_V", config.adc.min_V, {-1e6, 1e6});
  config.adc.max_V = table.number_or("max_V", config.adc.max_V, {-1e6, 1e6});
  if (!(config.adc.min_V < config.adc.max_V)) table.refuse("max_V", "must be above min_V");
  config.silence_timeout =
      read_ms(table, "silence_timeout_ms", config.silence_timeout, {.min = 10, .max = 600000});

  StrictTable signals = table.table("signals");
  const std::initializer_list<std::pair<const char*, std::string*>> roles = {
      {"counter_a", &config.signals.counter_a},
      {"counter_b", &config.signals.counter_b},
      {"counter_high", &config.signals.counter_high},
      {"x", &config.signals.x},
      {"y", &config.signals.y},
      {"z", &config.signals.z},
      {"status", &config.signals.status},
      {"temp", &config.signals.temp},
      {"crc", &config.signals.crc}};
  for (const auto& [role, signal] : roles) *signal = signals.text_or(role, *signal);

  StrictTable covariates = table.table("covariates");
  for (const std::string& column : covariates.keys()) {
    config.covariates.push_back({column, covariates.text(column)});
  }
  const std::string identity = table.text_or("identity", "");
  config.tells_identity = !identity.empty();
  if (config.tells_identity) config.covariates.push_back({kIdentityColumn, identity});
  return config;
}

Result<std::unique_ptr<DividingHead>> make_dividing_head(const HeadConfig& config) {
  if (config.modbus.empty()) {
    return fail(ErrorCode::input, "[head] lacks the key modbus, which says where the drive is");
  }
  auto endpoint = parse_modbus_endpoint(config.modbus);
  if (!endpoint) return fail(endpoint.error());
  return std::make_unique<ModbusHead>(config, *std::move(endpoint));
}

Result<std::unique_ptr<SampleSource>> make_sample_source(const SensorConfig& config) {
  if (config.can.empty()) {
    return fail(ErrorCode::input, "[sensor] lacks the key can, which says where the node is");
  }
  auto carrier = make_carrier(config.can);
  if (!carrier) return fail(carrier.error());
  std::string text(default_dbc_text());
  if (!config.dbc_file.empty()) {
    auto read = read_text_file(config.dbc_file);
    if (!read) return fail(read.error());
    text = *std::move(read);
  }
  const auto dbc = parse_dbc(text, config.dbc_file.empty() ? "plumbline.dbc" : config.dbc_file);
  if (!dbc) return fail(dbc.error());
  auto layout = FrameLayout::bind(*dbc, config.signals, config.covariates);
  if (!layout) return fail(layout.error());
  return std::make_unique<CanSource>(*std::move(carrier), *std::move(layout), config.rate_hz,
                                     config.silence_timeout);
}

}  // namespace plumbline::rig
