#include "app/certificate/rounding.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace plumbline::app {
namespace {

// A typographic minus keeps columns of signed numbers aligned.
std::string with_minus(std::string text) {
  if (!text.empty() && text.front() == '-') {
    const bool zero = text.find_first_not_of("-0.") == std::string::npos;
    text.replace(0, 1, zero ? "" : "−");
  }
  return text;
}

std::string superscript(int number) {
  static constexpr const char* kDigits[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string text = number < 0 ? "⁻" : "";
  for (const char digit : fmt::format("{}", std::abs(number))) text += kDigits[digit - '0'];
  return text;
}

}  // namespace

std::string difference_beside(double difference, double expanded) {
  if (!std::isfinite(difference) || !(expanded > 0) || !std::isfinite(expanded)) {
    return significant(difference, 2);
  }
  // Two places more than the uncertainty has: what is smaller does not matter.
  const int place = static_cast<int>(std::floor(std::log10(expanded))) - 3;
  return with_minus(fmt::format("{:.{}f}", difference, std::max(0, -place)));
}

std::string significant(double value, int digits) {
  if (!std::isfinite(value)) return "–";
  if (value == 0) return "0";
  const int exponent = static_cast<int>(std::floor(std::log10(std::abs(value))));
  if (exponent < -5 || exponent >= 7) {
    const std::string mantissa =
        with_minus(fmt::format("{:.{}f}", value / std::pow(10.0, exponent), digits - 1));
    return fmt::format("{}·10{}", mantissa, superscript(exponent));
  }
  return with_minus(fmt::format("{:.{}f}", value, std::max(0, digits - 1 - exponent)));
}

std::string chosen(double value, int digits) {
  const std::string text = significant(value, digits);
  const std::size_t factor = std::min(text.find("·"), text.size());
  std::string mantissa = text.substr(0, factor);
  if (mantissa.find('.') != std::string::npos) {
    mantissa.erase(mantissa.find_last_not_of('0') + 1);
    if (mantissa.back() == '.') mantissa.pop_back();
  }
  return mantissa + text.substr(factor);
}

RoundedResult round_result(double value, double expanded) {
  if (!(expanded > 0) || !std::isfinite(expanded) || !std::isfinite(value)) {
    return {significant(value, 6), "–"};
  }
  int place = static_cast<int>(std::floor(std::log10(expanded))) - 1;
  double unit = std::pow(10.0, place);
  double rounded = std::round(expanded / unit) * unit;
  if (rounded >= 99.5 * unit) {  // 0.0996 becomes 0.10, not 0.100
    ++place;
    unit *= 10;
    rounded = std::round(expanded / unit) * unit;
  }
  const int decimals = std::max(0, -place);
  return {with_minus(fmt::format("{:.{}f}", std::round(value / unit) * unit, decimals)),
          fmt::format("{:.{}f}", rounded, decimals)};
}

std::string result_with_unit(double value, double expanded, const std::string& unit) {
  const RoundedResult rounded = round_result(value, expanded);
  return fmt::format("({} ± {}) {}", rounded.value, rounded.uncertainty, unit);
}

}  // namespace plumbline::app
