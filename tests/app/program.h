// Runs the program `plumbline` as a process of its own.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace plumbline::app {

struct ProgramOutcome {
  int exit_code = -1;  ///< −signal when a signal ended it
  std::string out;
  std::string err;

  /// Number of complete lines on stderr.
  long error_lines() const;
};

struct ProgramOptions {
  std::optional<unsigned long> file_size_limit;  ///< RLIMIT_FSIZE, bytes
};

ProgramOutcome run_plumbline(const std::vector<std::string>& arguments,
                             const ProgramOptions& options = {});

}  // namespace plumbline::app
