// A candump log.
#include <cstddef>
#include <cstdint>

#include "rig/candump_log.h"
#include "tests/fuzz/memory_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const plumbline::fuzz::MemoryFile file(data, size);
  plumbline::rig::CandumpLog log(file.path().string());
  if (!log.open()) return 0;
  while (!log.ended()) {
    if (const auto frame = log.receive(std::chrono::milliseconds{0}); !frame) break;
  }
  return 0;
}
