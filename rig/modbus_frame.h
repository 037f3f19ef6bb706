// Modbus requests and replies as bytes: unit id and PDU, without the transport's header or checksum
// (Modbus application protocol V1.1b3, 6.3 and 6.12). Pure.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <tl/expected.hpp>
#include <vector>

namespace plumbline::rig {

/// Why a reply was not accepted.
struct ReplyFault {
  int exception = 0;  ///< the server's exception code; 0 = the reply does not fit the request
  std::string text;
};

/// FC03; 1 ≤ count ≤ 125.
std::vector<std::uint8_t> read_request(int unit, int address, int count);
/// FC16; 1 to 123 words.
std::vector<std::uint8_t> write_request(int unit, int address,
                                        std::span<const std::uint16_t> words);

/// The words of a reply to read_request(unit, …, count); anything else is a fault.
tl::expected<std::vector<std::uint16_t>, ReplyFault> parse_read_reply(
    std::span<const std::uint8_t> reply, int unit, int count);
/// Accepts only the echo of write_request(unit, address, `count` words).
tl::expected<void, ReplyFault> parse_write_reply(std::span<const std::uint8_t> reply, int unit,
                                                 int address, int count);

/// MBAP header (Modbus messaging on TCP/IP V1.0b, 3.1.3) in front of unit id and PDU.
std::vector<std::uint8_t> wrap_tcp(std::uint16_t transaction, std::span<const std::uint8_t> body);
/// Unit id and PDU of a TCP reply; refuses a foreign transaction, protocol or length.
tl::expected<std::span<const std::uint8_t>, ReplyFault> unwrap_tcp(
    std::span<const std::uint8_t> frame, std::uint16_t transaction);

/// "illegal data address" and so on.
const char* exception_text(int code);

}  // namespace plumbline::rig
