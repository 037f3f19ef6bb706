// The file by which the simulated rig says that it serves, and where.
#pragma once

#include <filesystem>
#include <string>

#include "estimator/measurement.h"

namespace plumbline::sim {

/// Writes `modbus = "…"` and `can = "…"` as TOML. The file appears whole or not at all, so whoever
/// waits for it may read it at once. Errors: ErrorCode::output.
Result<void> write_ready_file(const std::filesystem::path& path, const std::string& modbus,
                              const std::string& can);

}  // namespace plumbline::sim
