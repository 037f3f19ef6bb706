// Where the head goes when a set is recorded without wires.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::sim {

enum class RecordOrder { raster, snake, spiral, random };

enum class VisitKind { soak, grid, verification };

/// One stop of the head.
struct Visit {
  VisitKind kind = VisitKind::grid;
  double delta_deg = 0;  ///< not reduced to one turn: a spiral goes on beyond 360°
  double h_deg = 0;
  int samples = 0;
  std::optional<double> via_delta_deg;  ///< passed through just before: decides the approach
};

/// All positions of the grid in the given order. Raster: every ring of h from the first δ on;
/// snake: every other ring backwards; spiral: the spindle turns on in one direction; random: all
/// positions shuffled.
std::vector<Visit> grid_visits(const Grid& grid, RecordOrder order, int samples,
                               std::uint64_t seed);
/// Random positions inside the grid's ranges, in steps of 0.1°.
std::vector<Visit> verification_visits(const Grid& grid, int count, int samples,
                                       std::uint64_t seed);
/// Reads a plan as `plumbline plan` prints it: columns kind, delta_deg, h_deg, samples, via.
/// Errors are ErrorCode::input with file, line and column name.
Result<std::vector<Visit>> read_plan(const std::filesystem::path& path);

}  // namespace plumbline::sim
