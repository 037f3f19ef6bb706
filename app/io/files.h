// Whole files: read, also from gzip, and written so that a reader sees the old or the new content,
// never half of it.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "estimator/measurement.h"

namespace plumbline::app {

/// The content of a file, unpacked when it is gzipped. Fails (input) with path and reason.
Result<std::string> read_text(const std::filesystem::path& path);

/// "PATH: cannot write: REASON" (output) for an errno value.
tl::unexpected<Error> cannot_write(const std::filesystem::path& path, int error_number);

/// Writes a temporary file beside `path`, syncs it and renames it over `path`. A pipe or device is
/// written in place. Fails (output) with path and reason and then leaves no trace.
Result<void> write_file_atomically(const std::filesystem::path& path, std::string_view content);

}  // namespace plumbline::app
