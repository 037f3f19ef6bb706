// A DBC file, and binding its signals to the roles of a sample.
#include <cstddef>
#include <cstdint>

#include "rig/dbc.h"
#include "rig/frame_layout.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto dbc = plumbline::rig::parse_dbc({reinterpret_cast<const char*>(data), size}, "input");
  if (!dbc) return 0;
  const auto layout = plumbline::rig::FrameLayout::bind(*dbc, {}, {{"rh_pct", "ENV.Humidity"}});
  if (!layout) return 0;
  plumbline::rig::CanFrame frame;
  frame.id = 416;
  frame.length = 8;
  static_cast<void>(layout->covariates(frame));
  if (layout->classify(frame) == plumbline::rig::FrameLayout::Kind::both) {
    static_cast<void>(layout->decode(layout->cut(frame)));
  }
  return 0;
}
