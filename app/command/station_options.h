// What `serve`, `run` and `dry-run` share: how their station page is reached.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "app/station/station.h"

namespace plumbline::app {

struct ServeOptions {
  bool serve = false;  ///< --serve of `run` and `dry-run`
  std::string listen = "127.0.0.1:8080";
  std::string token_file;
  std::vector<std::string> names;
  bool control = false;
};

/// Declares --listen, --token-file, --host-name and --control.
void add_listen_options(CLI::App& command, ServeOptions& options);
/// Declares --serve beside them, which they need.
void add_serve_options(CLI::App& command, ServeOptions& options);

/// Nothing to declare tokens with: everything from the options is checked here.
Result<GuardOptions> guard_options(const ServeOptions& options);

/// The station of a single run, or nothing without --serve. Says on stderr where it is.
Result<std::unique_ptr<Station>> station_of_run(const ServeOptions& options,
                                                const std::filesystem::path& database,
                                                const std::filesystem::path& out);

}  // namespace plumbline::app
