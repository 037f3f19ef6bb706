// samples.csv and static.csv; the first byte chooses the options.
#include <cstddef>
#include <cstdint>

#include "app/io/csv.h"
#include "tests/fuzz/memory_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const plumbline::fuzz::MemoryFile file(data + 1, size - 1);
  plumbline::app::CsvOptions options;
  options.skip_bad_rows = (data[0] & 1) != 0;
  options.angle_free = (data[0] & 2) != 0;
  options.rate_hz = (data[0] & 4) != 0 ? 100 : 0;
  static_cast<void>(plumbline::app::read_samples(file.path(), options));
  static_cast<void>(plumbline::app::read_static(file.path(), options));
  return 0;
}
