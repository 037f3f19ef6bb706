// A whole file as a text.
#pragma once

#include <filesystem>
#include <string>

#include "estimator/measurement.h"

namespace plumbline::app {

/// Fails (input) with path and reason when the file cannot be read.
Result<std::string> read_file(const std::filesystem::path& path);

}  // namespace plumbline::app
