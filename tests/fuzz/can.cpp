// A stream of kernel CAN structures into samples: 16 bytes a frame, and now and then a new start of
// the node.
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "rig/dbc.h"
#include "rig/frame_layout.h"
#include "rig/sample_assembler.h"
#include "rig/socket_receive.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace plumbline::rig;
  static const FrameLayout layout =
      FrameLayout::bind(parse_dbc(default_dbc_text(), "plumbline.dbc").value(), {},
                        {{"rh_pct", "ENV.Humidity"}})
          .value();
  SampleAssembler assembler(layout, 100);
  std::int64_t last = -1;
  for (; size >= 16; data += 16, size -= 16) {
    const auto frame = from_kernel_frame({data, 16});
    if (!frame) continue;
    if (assembler.counter_went_back()) assembler.start_anew(data[0]);
    static_cast<void>(layout.covariates(*frame));
    const auto sample = assembler.push(*frame, data[3]);
    if (!sample) continue;
    if (last >= 0 && sample->counter <= last) std::abort();  // the promise of the assembler
    last = sample->counter;
  }
  static_cast<void>(from_kernel_frame({data, size}));
  return 0;
}
