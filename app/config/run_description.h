// Reads run.toml: what is known about the unit, gravity, the converter, the grid and the limits.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "estimator/measurement.h"
#include "rig/strict_toml.h"

namespace plumbline::app {

/// The description of a run. A rig.toml, which holds a run.toml and more, is taken as well.
/// Refused with file, line and column: unknown keys (the nearest known one is suggested), values of
/// the wrong type or out of range, and contradictions (a grid step that does not reach the stop, an
/// empty converter span …).
Result<RunDescription> read_run_description(const std::filesystem::path& path);
/// The same from a text; `name` stands for the file in messages.
Result<RunDescription> parse_run_description(std::string_view text, const std::string& name);

/// The tables of run.toml out of an open file; errors are collected in the file.
RunDescription read_run_tables(rig::StrictTable& root);

}  // namespace plumbline::app
