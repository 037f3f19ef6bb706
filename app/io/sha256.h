// SHA-256 (FIPS 180-4) as 64 lower-case hexadecimal digits.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "estimator/measurement.h"

namespace plumbline::app {

std::string sha256(std::string_view bytes);
/// Of the bytes as they lie on the disk. Fails (input) with path and reason.
Result<std::string> sha256_of_file(const std::filesystem::path& path);

}  // namespace plumbline::app
