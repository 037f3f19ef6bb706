// Numbers as a certificate prints them (ILAC P14: the uncertainty to two significant digits, the
// value rounded to the same place).
#pragma once

#include <string>

namespace plumbline::app {

struct RoundedResult {
  std::string value;
  std::string uncertainty;
};

/// `expanded` > 0. A value without usable uncertainty (0, NaN, infinite) is printed with six
/// significant digits and the uncertainty as "–".
RoundedResult round_result(double value, double expanded);

/// "(32.0021 ± 0.0012) mV/g"
std::string result_with_unit(double value, double expanded, const std::string& unit);

/// A difference of two estimates, to two places more than the uncertainty that it is compared with
/// is printed to.
std::string difference_beside(double difference, double expanded);

/// `value` with so many significant digits, without exponent where it reads well.
std::string significant(double value, int digits);
/// The same without zeros at the end: of what was chosen, not measured.
std::string chosen(double value, int digits);

}  // namespace plumbline::app
