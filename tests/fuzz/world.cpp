// world.toml.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "rig/sim/world.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static_cast<void>(
      plumbline::sim::parse_world({reinterpret_cast<const char*>(data), size}, "input"));
  return 0;
}
