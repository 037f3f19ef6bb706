#include "rig/sim/route.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <string_view>
#include <utility>

#include "rig/sim/random.h"

namespace plumbline::sim {

namespace {

std::vector<double> positions(const AngleRange& range) {
  std::vector<double> all;
  const auto count =
      static_cast<int>(std::floor((range.stop_deg - range.start_deg) / range.step_deg + 1e-9));
  for (int i = 0; i <= count; ++i) all.push_back(range.start_deg + i * range.step_deg);
  return all;
}

std::vector<std::string_view> split(std::string_view line) {
  if (line.ends_with('\r')) line.remove_suffix(1);
  std::vector<std::string_view> cells;
  while (true) {
    const std::size_t comma = line.find(',');
    cells.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

std::optional<double> number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

}  // namespace

std::vector<Visit> grid_visits(const Grid& grid, RecordOrder order, int samples,
                               std::uint64_t seed) {
  const std::vector<double> deltas = positions(grid.delta);
  const std::vector<double> tilts = positions(grid.h);
  std::vector<Visit> visits;
  for (std::size_t ring = 0; ring < tilts.size(); ++ring) {
    for (std::size_t k = 0; k < deltas.size(); ++k) {
      const bool backwards = order == RecordOrder::snake && ring % 2 == 1;
      double delta = deltas[backwards ? deltas.size() - 1 - k : k];
      if (order == RecordOrder::spiral) delta += 360.0 * static_cast<double>(ring);
      visits.push_back({VisitKind::grid, delta, tilts[ring], samples, std::nullopt});
    }
  }
  if (order == RecordOrder::random) {
    Random random(seed, "route.order");
    for (std::size_t left = visits.size(); left > 1; --left) {
      std::swap(visits[left - 1], visits[random.index(left)]);
    }
  }
  return visits;
}

std::vector<Visit> verification_visits(const Grid& grid, int count, int samples,
                                       std::uint64_t seed) {
  Random random(seed, "route.verification");
  const auto draw = [&](const AngleRange& range) {
    return std::round(random.uniform(range.start_deg, range.stop_deg) * 10) / 10;
  };
  std::vector<Visit> visits;
  for (int i = 0; i < count; ++i) {
    const double delta = draw(grid.delta);
    const double h = draw(grid.h);
    visits.push_back({VisitKind::verification, delta, h, samples, std::nullopt});
  }
  return visits;
}

namespace {

/// One line of a plan; an empty text means that it is right.
std::string read_visit(const std::vector<std::string_view>& header,
                       const std::vector<std::string_view>& cells, Visit& visit) {
  for (std::size_t i = 0; i < header.size(); ++i) {
    const std::string_view name = header[i];
    const std::string_view cell = cells[i];
    if (name == "kind") {
      if (cell == "soak")
        visit.kind = VisitKind::soak;
      else if (cell == "grid")
        visit.kind = VisitKind::grid;
      else if (cell == "verification")
        visit.kind = VisitKind::verification;
      else
        return fmt::format("kind \"{}\" is none of soak, grid, verification", cell);
    } else if (name == "via") {
      // "delta:h delta:h …"; the last one decides from where the pose is approached.
      const std::string_view last = cell.substr(cell.rfind(' ') + 1);
      if (last.empty()) continue;
      visit.via_delta_deg = number(last.substr(0, last.find(':')));
      if (!visit.via_delta_deg) return fmt::format("via \"{}\" is not a list of delta:h", cell);
    } else if (name == "delta_deg" || name == "h_deg" || name == "samples") {
      const auto value = number(cell);
      if (!value) return fmt::format("{} \"{}\" is not a number", name, cell);
      if (name == "delta_deg") visit.delta_deg = *value;
      if (name == "h_deg") visit.h_deg = *value;
      if (name == "samples") {
        if (!(*value >= 1 && *value <= 1e8)) return "samples must be 1 … 1e8";
        visit.samples = static_cast<int>(*value);
      }
    } else if (name != "ordinal") {
      return fmt::format("unknown column {}", name);
    }
  }
  return {};
}

}  // namespace

Result<std::vector<Visit>> read_plan(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) return fail(ErrorCode::input, path.string() + ": cannot be read");
  std::string header_line;
  std::getline(file, header_line);
  const std::vector<std::string_view> header = split(header_line);
  for (const char* column : {"kind", "delta_deg", "h_deg", "samples"}) {
    if (std::find(header.begin(), header.end(), column) == header.end()) {
      return fail(ErrorCode::input,
                  fmt::format("{}:1: the column {} is missing", path.string(), column));
    }
  }
  std::vector<Visit> visits;
  std::string line;
  for (int row = 2; std::getline(file, line); ++row) {
    const std::vector<std::string_view> cells = split(line);
    Visit visit;
    const std::string wrong =
        cells.size() != header.size()
            ? fmt::format("{} columns where the header has {}", cells.size(), header.size())
            : read_visit(header, cells, visit);
    if (!wrong.empty()) {
      return fail(ErrorCode::input, fmt::format("{}:{}: {}", path.string(), row, wrong));
    }
    visits.push_back(visit);
  }
  if (visits.empty()) return fail(ErrorCode::input, path.string() + ": the plan has no step");
  return visits;
}

}  // namespace plumbline::sim
