// What rig.toml says about the head and the sensor: [head] and [sensor], read strictly.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "estimator/measurement.h"
#include "rig/dividing_head.h"
#include "rig/frame_layout.h"
#include "rig/register_map.h"
#include "rig/sample_source.h"
#include "rig/strict_toml.h"

namespace plumbline::rig {

/// [head]: how the drive is reached and how its registers are laid out.
/// The defaults are those of the simulated rig.
struct HeadConfig {
  std::string modbus;                             ///< "tcp:HOST:PORT" or "rtu:DEVICE,115200,8E1"
  std::array<int, 2> unit_id = {1, 1};            ///< of δ and h
  std::array<int, 2> axis_base = {0x000, 0x100};  ///< register base of δ and h
  RegisterMap registers;
  std::array<double, 2> counts_per_deg = {10000.0, 10000.0};
  double speed_deg_s = 30.0;
  double acceleration_deg_s2 = 60.0;
  std::chrono::milliseconds response_timeout{1000};
  std::chrono::milliseconds poll_interval{20};
  std::chrono::milliseconds watchdog{3000};  ///< 0 = off
  /// Registers that tell one drive from another (serial number …), absolute; count 0: none.
  int identity_address = 0;
  int identity_count = 0;
  /// HOME END stays set until homing is lost. False for drives that clear it at the next motion.
  bool home_end_latched = true;
};

/// [sensor]: where the frames come from and what they mean.
struct SensorConfig {
  std::string can;                          ///< "can:can0", "unix:PATH" or "log:FILE"
  std::string dbc_file;                     ///< empty: the layout that comes with the program
  double rate_hz = 100;                     ///< nominal sample rate of the node
  Adc adc;                                  ///< span of the codes
  SignalRoles signals;                      ///< [sensor.signals]
  std::vector<CovariateSignal> covariates;  ///< kIdentityColumn among them when identity is given
  bool tells_identity = false;              ///< [sensor] identity names a signal
  std::chrono::milliseconds silence_timeout{3000};
};

/// Contradictions are reported through `table`, like wrong values.
Result<HeadConfig> read_head_config(StrictTable& table);
/// `adc` is what [adc] says, if it stands in the file: the default for bits, min_V and max_V.
Result<SensorConfig> read_sensor_config(StrictTable& table,
                                        const std::optional<Adc>& adc = std::nullopt);

/// Not yet connected. ErrorCode::input when the endpoint is missing or malformed.
Result<std::unique_ptr<DividingHead>> make_dividing_head(const HeadConfig& config);
/// Not yet opened. ErrorCode::input when the address or the DBC file is wrong.
Result<std::unique_ptr<SampleSource>> make_sample_source(const SensorConfig& config);

}  // namespace plumbline::rig
