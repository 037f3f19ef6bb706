// Replies of a Modbus drive: the TCP header, the PDU, the status block.
#include <cstddef>
#include <cstdint>

#include "rig/modbus_frame.h"
#include "rig/register_map.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace plumbline::rig;
  const std::span bytes(data, size);
  static_cast<void>(parse_write_reply(bytes, 1, 0x10, 1));
  const RegisterMap map;
  const RegisterBlock block = status_block(map);
  for (const int count : {1, block.count}) {
    if (const auto words = parse_read_reply(bytes, 1, count); words && count == block.count) {
      static_cast<void>(decode_status(map, *words));
    }
  }
  if (size < 2) return 0;
  const auto transaction = static_cast<std::uint16_t>(data[0] << 8 | data[1]);
  if (const auto inner = unwrap_tcp(bytes, transaction)) {
    static_cast<void>(parse_read_reply(*inner, 1, block.count));
  }
  return 0;
}
