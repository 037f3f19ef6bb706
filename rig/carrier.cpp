#include "rig/carrier.h"

#include <fmt/format.h>
#include <linux/can/error.h>

#include <vector>

#include "rig/candump_log.h"
#include "rig/socketcan_carrier.h"
#include "rig/unix_carrier.h"

namespace plumbline::rig {

Result<std::unique_ptr<Carrier>> make_carrier(const std::string& address) {
  const std::size_t colon = address.find(':');
  const std::string kind = address.substr(0, colon);
  const std::string rest = colon == std::string::npos ? "" : address.substr(colon + 1);
  if (!rest.empty()) {
    if (kind == "can") return std::unique_ptr<Carrier>(std::make_unique<SocketCanCarrier>(rest));
    if (kind == "unix") return std::unique_ptr<Carrier>(std::make_unique<UnixCarrier>(rest));
    if (kind == "log") return std::unique_ptr<Carrier>(std::make_unique<CandumpLog>(rest));
  }
  return fail(ErrorCode::input,
              fmt::format("can = \"{}\": give can:INTERFACE, unix:PATH or log:FILE", address));
}

std::string error_frame_text(const CanFrame& frame) {
  struct Meaning {
    std::uint32_t mask;
    const char* text;
  };
  static constexpr std::array kClass = {
      Meaning{CAN_ERR_BUSOFF, "bus-off"},
      Meaning{CAN_ERR_RESTARTED, "controller restarted"},
      Meaning{CAN_ERR_ACK, "no acknowledgement"},
      Meaning{CAN_ERR_TX_TIMEOUT, "transmit timeout"},
      Meaning{CAN_ERR_LOSTARB, "arbitration lost"},
      Meaning{CAN_ERR_PROT, "protocol violation"},
      Meaning{CAN_ERR_TRX, "transceiver"},
      Meaning{CAN_ERR_BUSERROR, "bus error"},
  };
  static constexpr std::array kController = {
      Meaning{CAN_ERR_CRTL_RX_OVERFLOW, "receive overflow"},
      Meaning{CAN_ERR_CRTL_TX_OVERFLOW, "transmit overflow"},
      Meaning{CAN_ERR_CRTL_RX_WARNING, "receive error warning"},
      Meaning{CAN_ERR_CRTL_TX_WARNING, "transmit error warning"},
      Meaning{CAN_ERR_CRTL_RX_PASSIVE, "receive error passive"},
      Meaning{CAN_ERR_CRTL_TX_PASSIVE, "transmit error passive"},
  };
  if (frame.id == 0) return "interface down";
  std::vector<std::string> texts;
  for (const Meaning& meaning : kClass) {
    if ((frame.id & meaning.mask) != 0) texts.emplace_back(meaning.text);
  }
  if ((frame.id & CAN_ERR_CRTL) != 0) {
    for (const Meaning& meaning : kController) {
      if ((frame.data[1] & meaning.mask) != 0) texts.emplace_back(meaning.text);
    }
  }
  return texts.empty() ? fmt::format("error class {:X}h", frame.id)
                       : fmt::format("{}", fmt::join(texts, ", "));
}

}  // namespace plumbline::rig
