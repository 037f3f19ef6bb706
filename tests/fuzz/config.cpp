// run.toml and rig.toml, the plan that follows from it included.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "app/config/rig_description.h"
#include "app/config/run_description.h"
#include "app/sequencer/plan.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  static_cast<void>(plumbline::app::parse_run_description(text, "input"));
  const auto rig = plumbline::app::parse_rig_description(text, "input");
  if (!rig) return 0;
  const plumbline::Grid& grid = rig->run.grid;
  const auto nodes = [](const plumbline::AngleRange& range) {
    return (range.stop_deg - range.start_deg) / range.step_deg;
  };
  if (nodes(grid.delta) * nodes(grid.h) > 1e4) return 0;
  static_cast<void>(to_csv(make_plan(grid, rig->plan, rig->sensor.rate_hz)));
  return 0;
}
