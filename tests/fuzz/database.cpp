// A run database that somebody sent: opened, listed, checked, loaded.
#include <cstddef>
#include <cstdint>

#include "storage/run_store.h"
#include "tests/fuzz/memory_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const plumbline::fuzz::MemoryFile file(data, size);
  const auto store = plumbline::storage::RunStore::open_read_only(file.path());
  if (!store) return 0;
  const auto runs = store->runs();
  if (!runs) return 0;
  int looked_at = 0;
  for (const auto& run : *runs) {
    if (++looked_at > 5) break;
    static_cast<void>(store->load(run.id));
    static_cast<void>(store->check_chain(run.id));
    static_cast<void>(store->committed_poses(run.id));
    static_cast<void>(store->identity(run.id));
  }
  return 0;
}
