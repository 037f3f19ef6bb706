#include "rig/modbus_frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>

namespace plumbline::rig {

namespace {

constexpr std::uint8_t kReadHolding = 0x03;
constexpr std::uint8_t kWriteMultiple = 0x10;
constexpr std::uint8_t kExceptionFlag = 0x80;
constexpr std::size_t kTcpPrefix = 6;  // of the MBAP header, the unit id left out

std::uint8_t high(int value) { return static_cast<std::uint8_t>((value >> 8) & 0xFF); }
std::uint8_t low(int value) { return static_cast<std::uint8_t>(value & 0xFF); }
int word_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  return (bytes[at] << 8) | bytes[at + 1];
}

tl::unexpected<ReplyFault> fault(std::string text) {
  return tl::unexpected(ReplyFault{0, std::move(text)});
}

/// Unit, function and exceptions, which all replies have in common.
tl::expected<void, ReplyFault> check_head(std::span<const std::uint8_t> reply, int unit,
                                          std::uint8_t function) {
  if (reply.size() < 3) return fault("truncated reply");
  if (reply[0] != unit) return fault(fmt::format("reply from foreign unit {}", reply[0]));
  if (reply[1] == (function | kExceptionFlag)) {
    return tl::unexpected(ReplyFault{reply[2], fmt::format("the drive refused: exception {} ({})",
                                                           reply[2], exception_text(reply[2]))});
  }
  if (reply[1] != function) {
    return fault(fmt::format("reply to another function ({:02X}h)", reply[1]));
  }
  return {};
}

}  // namespace

std::vector<std::uint8_t> read_request(int unit, int address, int count) {
  assert(count >= 1 && count <= 125);
  return {low(unit), kReadHolding, high(address), low(address), high(count), low(count)};
}

std::vector<std::uint8_t> write_request(int unit, int address,
                                        std::span<const std::uint16_t> words) {
  assert(!words.empty() && words.size() <= 123);
  const int count = static_cast<int>(words.size());
  std::vector<std::uint8_t> bytes = {low(unit),   kWriteMultiple, high(address), low(address),
                                     high(count), low(count),     low(2 * count)};
  for (const std::uint16_t word : words) {
    bytes.push_back(high(word));
    bytes.push_back(low(word));
  }
  return bytes;
}

tl::expected<std::vector<std::uint16_t>, ReplyFault> parse_read_reply(
    std::span<const std::uint8_t> reply, int unit, int count) {
  if (auto head = check_head(reply, unit, kReadHolding); !head) {
    return tl::unexpected(head.error());
  }
  const auto expected = 2 * static_cast<std::size_t>(count);
  if (reply[2] != expected || reply.size() != 3 + expected) {
    return fault(fmt::format("reply of {} registers where {} were asked for", reply[2] / 2, count));
  }
  std::vector<std::uint16_t> words;
  words.reserve(static_cast<std::size_t>(count));
  for (std::size_t at = 3; at < reply.size(); at += 2) {
    words.push_back(static_cast<std::uint16_t>(word_at(reply, at)));
  }
  return words;
}

tl::expected<void, ReplyFault> parse_write_reply(std::span<const std::uint8_t> reply, int unit,
                                                 int address, int count) {
  if (auto head = check_head(reply, unit, kWriteMultiple); !head) return head;
  if (reply.size() != 6) return fault("truncated reply");
  if (word_at(reply, 2) != address || word_at(reply, 4) != count) {
    return fault("acknowledgement of another write");
  }
  return {};
}

std::vector<std::uint8_t> wrap_tcp(std::uint16_t transaction, std::span<const std::uint8_t> body) {
  const int length = static_cast<int>(body.size());
  const std::array<std::uint8_t, kTcpPrefix> prefix = {high(transaction), low(transaction), 0, 0,
                                                       high(length),      low(length)};
  std::vector<std::uint8_t> frame(prefix.size() + body.size());
  std::copy(body.begin(), body.end(), std::copy(prefix.begin(), prefix.end(), frame.begin()));
  return frame;
}

tl::expected<std::span<const std::uint8_t>, ReplyFault> unwrap_tcp(
    std::span<const std::uint8_t> frame, std::uint16_t transaction) {
  if (frame.size() <= kTcpPrefix) return fault("truncated reply");
  if (word_at(frame, 0) != transaction) return fault("reply to another transaction");
  if (word_at(frame, 2) != 0) return fault("reply in another protocol");
  if (static_cast<std::size_t>(word_at(frame, 4)) != frame.size() - kTcpPrefix) {
    return fault("reply whose length field is wrong");
  }
  return frame.subspan(kTcpPrefix);
}

const char* exception_text(int code) {
  switch (code) {
    case 1:
      return "illegal function";
    case 2:
      return "illegal data address";
    case 3:
      return "illegal data value";
    case 4:
      return "device failure";
    case 5:
      return "acknowledged, still working";
    case 6:
      return "device busy";
    case 8:
      return "memory parity error";
    case 10:
      return "gateway path unavailable";
    case 11:
      return "no answer behind the gateway: is the unit id right?";
    default:
      return "unknown exception";
  }
}

}  // namespace plumbline::rig
