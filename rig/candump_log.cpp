#include "rig/candump_log.h"

#include <fmt/format.h>

#include <charconv>

namespace plumbline::rig {

namespace {

constexpr std::uint32_t kErrorFlag = 0x20000000;
constexpr std::uint32_t kExtendedMask = 0x1FFFFFFF;
constexpr std::uint32_t kStandardMask = 0x7FF;

template <class Int>
bool parse_hex(std::string_view text, Int& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, 16);
  return error == std::errc() && end == text.data() + text.size();
}

/// Cuts the first word off.
std::string_view take_word(std::string_view& rest) {
  rest.remove_prefix(std::min(rest.find_first_not_of(" \t"), rest.size()));
  const std::string_view word = rest.substr(0, rest.find_first_of(" \t\r"));
  rest.remove_prefix(word.size());
  return word;
}

}  // namespace

tl::expected<CanFrame, std::string> parse_candump_line(std::string_view line) {
  const auto refuse = [](const char* why) { return tl::unexpected(std::string(why)); };
  const std::string_view stamp = take_word(line);
  if (stamp.size() < 3 || stamp.front() != '(' || stamp.back() != ')') {
    return refuse("no time stamp in parentheses");
  }
  if (take_word(line).empty()) return refuse("no interface");
  const std::string_view text = take_word(line);
  const std::size_t hash = text.find('#');
  if (hash == std::string_view::npos) return refuse("no # between identifier and data");
  if (hash != 3 && hash != 8) return refuse("the identifier has neither 3 nor 8 digits");

  CanFrame frame;
  if (!parse_hex(text.substr(0, hash), frame.id))
    return refuse("the identifier is not hexadecimal");
  if (hash == 8) {
    frame.error = (frame.id & kErrorFlag) != 0;
    frame.extended = !frame.error;
    frame.id &= kExtendedMask;
  } else if (frame.id > kStandardMask) {
    return refuse("the identifier exceeds 7FF");
  }

  std::string_view data = text.substr(hash + 1);
  std::size_t room = 8;
  if (data.starts_with('#')) {  // CAN FD: ##, one digit of flags
    if (data.size() < 2) return refuse("no flags after ##");
    data.remove_prefix(2);
    room = frame.data.size();
  } else if (data.starts_with('R')) {
    frame.remote = true;
    return frame;
  }
  // "_9" and the like after the data: raw DLC above 8, which carries no further byte.
  data = data.substr(0, data.find('_'));
  if (data.size() % 2 != 0) return refuse("half a data byte");
  if (data.size() / 2 > room) return refuse("too many data bytes");
  for (std::size_t i = 0; i < data.size() / 2; ++i) {
    if (!parse_hex(data.substr(2 * i, 2), frame.data[i])) {
      return refuse("the data is not hexadecimal");
    }
  }
  frame.length = static_cast<std::uint8_t>(data.size() / 2);
  return frame;
}

CandumpLog::CandumpLog(std::string file) : file_(std::move(file)), address_("log:" + file_) {}

Result<void> CandumpLog::open() {
  stream_ = std::ifstream(file_);
  line_ = 0;
  ended_ = false;
  if (!stream_) return fail(ErrorCode::rig, fmt::format("{}: cannot read the file", address_));
  return {};
}

Result<std::optional<CanFrame>> CandumpLog::receive(std::chrono::milliseconds) {
  std::string line;
  while (std::getline(stream_, line)) {
    ++line_;
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    const auto frame = parse_candump_line(line);
    if (!frame) {
      return fail(ErrorCode::rig, fmt::format("{}:{}: {}", address_, line_, frame.error()));
    }
    return std::optional(*frame);
  }
  ended_ = true;
  return std::optional<CanFrame>{};
}

}  // namespace plumbline::rig
