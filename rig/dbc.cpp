#include "rig/dbc.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "rig/strict_toml.h"

extern const char kDefaultDbc[];

namespace plumbline::rig {

namespace {

constexpr std::uint32_t kExtendedFlag = 0x80000000u;
constexpr int kMaxFrameBytes = 64;  // CAN FD

/// Statements that end with ';' and say nothing about the layout.
constexpr std::array kSkipped = {"CM_",
                                 "BA_DEF_",
                                 "BA_DEF_DEF_",
                                 "BA_",
                                 "BA_DEF_REL_",
                                 "BA_REL_",
                                 "VAL_",
                                 "BA_DEF_DEF_REL_",
                                 "VAL_TABLE_",
                                 "SIG_VALTYPE_",
                                 "SIG_GROUP_",
                                 "SG_MUL_VAL_",
                                 "BO_TX_BU_",
                                 "EV_",
                                 "ENVVAR_DATA_",
                                 "EV_DATA_",
                                 "SGTYPE_",
                                 "SIG_TYPE_REF_",
                                 "SIGTYPE_VALTYPE_",
                                 "CAT_DEF_",
                                 "CAT_",
                                 "FILTER",
                                 "BA_DEF_SGTYPE_",
                                 "BA_SGTYPE_",
                                 "SGTYPE_VAL_"};

struct Token {
  enum class Kind { word, text, sign, end } kind = Kind::end;
  std::string_view text;
  int line = 0;
  bool first_on_line = false;
};

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

bool in_word(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
         c == '.';
}

/// Words (names and unsigned numbers), quoted texts and single signs.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {}

  Token next() {
    bool first = at_ == 0;
    while (at_ < text_.size() && is_space(text_[at_])) {
      if (text_[at_] == '\n') {
        ++line_;
        first = true;
      }
      ++at_;
    }
    Token token{Token::Kind::end, {}, line_, first};
    if (at_ == text_.size()) return token;
    const std::size_t begin = at_++;
    if (text_[begin] == '"') {
      token.kind = Token::Kind::text;
      while (at_ < text_.size() && text_[at_] != '"') {
        if (text_[at_] == '\n') ++line_;
        at_ += text_[at_] == '\\' && at_ + 1 < text_.size() ? 2 : 1;
      }
      at_ = std::min(at_, text_.size());
      token.text = text_.substr(begin + 1, at_ - begin - 1);
      if (at_ < text_.size()) ++at_;
      return token;
    }
    if (in_word(text_[begin])) {
      token.kind = Token::Kind::word;
      while (at_ < text_.size() && in_word(text_[at_])) ++at_;
      // 1.5E-05 is one number
      if (at_ + 1 < text_.size() && (text_[at_] == '-' || text_[at_] == '+') &&
          (text_[at_ - 1] == 'e' || text_[at_ - 1] == 'E') && text_[begin] >= '0' &&
          text_[begin] <= '9') {
        ++at_;
        while (at_ < text_.size() && in_word(text_[at_])) ++at_;
      }
    } else {
      token.kind = Token::Kind::sign;
    }
    token.text = text_.substr(begin, at_ - begin);
    return token;
  }

 private:
  std::string_view text_;
  std::size_t at_ = 0;
  int line_ = 1;
};

class Parser {
 public:
  Parser(std::string_view text, const std::string& name) : scanner_(text), name_(name) {
    advance();
  }

  Result<Dbc> parse() {
    while (token_.kind != Token::Kind::end && error_.empty()) statement();
    if (!error_.empty()) return fail(ErrorCode::input, error_);
    return std::move(dbc_);
  }

 private:
  void advance() { token_ = scanner_.next(); }

  void refuse(int line, const std::string& why) {
    if (error_.empty()) error_ = fmt::format("{}:{}: {}", name_, line, why);
  }
  void refuse_token(const char* wanted) {
    refuse(token_.line, token_.kind == Token::Kind::end
                            ? fmt::format("{} expected, but the file ends", wanted)
                            : fmt::format("{} expected, not \"{}\"", wanted, token_.text));
  }

  bool is_sign(char sign) const {
    return token_.kind == Token::Kind::sign && token_.text[0] == sign;
  }
  void sign(char wanted) {
    if (!error_.empty()) return;
    if (!is_sign(wanted)) return refuse_token(fmt::format("'{}'", wanted).c_str());
    advance();
  }
  std::string word(const char* wanted) {
    if (!error_.empty()) return {};
    if (token_.kind != Token::Kind::word) {
      refuse_token(wanted);
      return {};
    }
    std::string text(token_.text);
    advance();
    return text;
  }
  std::int64_t whole(const char* wanted, std::int64_t min, std::int64_t max) {
    const int line = token_.line;
    const std::string text = word(wanted);
    if (!error_.empty()) return min;
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || value < min || value > max) {
      refuse(line, fmt::format("{} {} is not a whole number {} … {}", wanted, text, min, max));
      return min;
    }
    return value;
  }
  double real(const char* wanted) {
    const bool negative = is_sign('-');
    if (negative || is_sign('+')) advance();
    const int line = token_.line;
    const std::string text = word(wanted);
    if (!error_.empty()) return 0;
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
      refuse(line, fmt::format("{} {} is not a number", wanted, text));
      return 0;
    }
    return negative ? -value : value;
  }

  void skip_line() {
    do {
      advance();
    } while (token_.kind != Token::Kind::end && !token_.first_on_line);
  }
  void skip_statement() {
    while (token_.kind != Token::Kind::end && !is_sign(';')) advance();
    if (token_.kind == Token::Kind::end) return refuse_token("';'");
    advance();
  }
  /// The list of keywords under NS_ stands indented, each on a line of its own.
  void skip_new_symbols() {
    do {
      skip_line();
    } while (token_.kind == Token::Kind::word && token_.text != "BS_" && token_.text != "BU_" &&
             token_.text != "BO_");
  }

  void statement() {
    const Token at = token_;
    if (at.kind != Token::Kind::word || !at.first_on_line) return refuse_token("a statement");
    if (at.text == "BO_") return message();
    if (at.text == "SG_") return signal();
    if (at.text == "NS_") return skip_new_symbols();
    if (at.text == "VERSION" || at.text == "BS_" || at.text == "BU_") return skip_line();
    if (std::find(kSkipped.begin(), kSkipped.end(), at.text) != kSkipped.end()) {
      return skip_statement();
    }
    const std::string hint = nearest(at.text, {"BO_", "SG_", "VERSION", "NS_", "BS_", "BU_"});
    refuse(at.line, fmt::format("unknown statement {}{}", at.text,
                                hint.empty() ? "" : fmt::format("; did you mean {}?", hint)));
  }

  void message() {
    const int line = token_.line;
    advance();
    const auto id = static_cast<std::uint32_t>(whole("the message id", 0, 0xFFFFFFFF));
    DbcMessage message;
    message.extended = (id & kExtendedFlag) != 0;
    message.id = id & ~kExtendedFlag;
    message.name = word("the message name");
    sign(':');
    // Vector's pseudo-message for signals without a message has length 0.
    message.length = static_cast<int>(whole("the message length", 0, kMaxFrameBytes));
    if (error_.empty() && token_.kind == Token::Kind::word && !token_.first_on_line) advance();
    if (!error_.empty()) return;
    if (dbc_.find(message.name) != nullptr) {
      return refuse(line, fmt::format("message {} stands twice", message.name));
    }
    dbc_.messages.push_back(std::move(message));
  }

  void signal() {
    const int line = token_.line;
    if (dbc_.messages.empty()) return refuse(line, "SG_ before the first BO_");
    DbcMessage& message = dbc_.messages.back();
    advance();
    DbcSignal signal;
    signal.name = word("the signal name");
    if (error_.empty() && token_.kind == Token::Kind::word) {
      return refuse(line,
                    fmt::format("signal {} is multiplexed, which is not supported", signal.name));
    }
    sign(':');
    signal.start_bit = static_cast<int>(whole("the start bit", 0, 8 * kMaxFrameBytes - 1));
    sign('|');
    signal.length = static_cast<int>(whole("the length in bits", 1, 64));
    sign('@');
    signal.little_endian = whole("the byte order", 0, 1) == 1;
    signal.is_signed = is_sign('-');
    sign(signal.is_signed ? '-' : '+');
    sign('(');
    signal.factor = real("the factor");
    sign(',');
    signal.offset = real("the offset");
    sign(')');
    if (error_.empty() && is_sign('[')) {
      advance();
      real("the minimum");
      sign('|');
      real("the maximum");
      sign(']');
    }
    if (error_.empty() && token_.kind == Token::Kind::text) {
      signal.unit = std::string(token_.text);
      advance();
    }
    // Receivers, separated by commas, end the line.
    while (error_.empty() && token_.kind != Token::Kind::end && !token_.first_on_line) advance();
    if (!error_.empty()) return;
    if (message.find(signal.name) != nullptr) {
      return refuse(line, fmt::format("signal {}.{} stands twice", message.name, signal.name));
    }
    if (signal.last_byte() >= message.length) {
      return refuse(line,
                    fmt::format("signal {}.{} reaches byte {}, but the message has {} bytes",
                                message.name, signal.name, signal.last_byte(), message.length));
    }
    message.signals.push_back(std::move(signal));
  }

  Scanner scanner_;
  std::string name_;
  Token token_;
  Dbc dbc_;
  std::string error_;
};

}  // namespace

int DbcSignal::last_byte() const {
  if (little_endian) return (start_bit + length - 1) / 8;
  // Big endian: bits run from the MSB downwards in each byte, then on to the next byte.
  return start_bit / 8 + (7 - start_bit % 8 + length - 1) / 8;
}

std::optional<std::int64_t> DbcSignal::raw(std::span<const std::uint8_t> data) const {
  if (last_byte() >= static_cast<int>(data.size())) return std::nullopt;
  std::uint64_t value = 0;
  for (int i = 0; i < length; ++i) {
    // Position counted from the first bit on the wire order of this byte order; MSB of the value
    // first.
    int byte = 0;
    int bit = 0;
    if (little_endian) {
      const int position = start_bit + length - 1 - i;
      byte = position / 8;
      bit = position % 8;
    } else {
      const int position = 7 - start_bit % 8 + i;
      byte = start_bit / 8 + position / 8;
      bit = 7 - position % 8;
    }
    value = (value << 1) | ((data[static_cast<std::size_t>(byte)] >> bit) & 1u);
  }
  if (is_signed && length < 64 && ((value >> (length - 1)) & 1u) != 0) {
    value |= ~std::uint64_t{0} << length;
  }
  return static_cast<std::int64_t>(value);
}

std::optional<double> DbcSignal::physical(std::span<const std::uint8_t> data) const {
  const auto value = raw(data);
  if (!value) return std::nullopt;
  const double number = is_signed ? static_cast<double>(*value)
                                  : static_cast<double>(static_cast<std::uint64_t>(*value));
  return factor * number + offset;
}

const DbcSignal* DbcMessage::find(std::string_view signal) const {
  const auto it = std::find_if(signals.begin(), signals.end(),
                               [&](const DbcSignal& s) { return s.name == signal; });
  return it == signals.end() ? nullptr : &*it;
}

const DbcMessage* Dbc::find(std::string_view message) const {
  const auto it = std::find_if(messages.begin(), messages.end(),
                               [&](const DbcMessage& m) { return m.name == message; });
  return it == messages.end() ? nullptr : &*it;
}

Result<Dbc> parse_dbc(std::string_view text, const std::string& name) {
  return Parser(text, name).parse();
}

std::string_view default_dbc_text() { return kDefaultDbc; }

}  // namespace plumbline::rig
