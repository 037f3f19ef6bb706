// Where a result comes from: program, time, inputs. The only part of a result that may differ
// between two runs over the same data.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::app {

/// "0.1.0"
std::string program_version();
/// Now, as "2026-01-31T12:34:56Z".
std::string utc_now();

struct Provenance {
  DeviceUnderTest dut;
  std::vector<std::pair<std::string, std::string>> input_sha256;  ///< what was read, and its hash
  std::string created_utc;
  std::uint64_t seed = 1;
  std::string chain_head{};  ///< of a stored run's hash chain; empty for files
};

}  // namespace plumbline::app
