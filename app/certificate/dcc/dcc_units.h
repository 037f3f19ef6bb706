// Units of this program in the notation of the D-SI (digital SI), and what values have to be
// multiplied by.
#pragma once

#include <optional>
#include <string>

namespace plumbline::app {

struct DsiUnit {
  std::string unit;   ///< SI, "\metre\second\tothe{-2}"
  double factor = 1;  ///< value in `unit` = factor × value in the program's unit
};

/// Of "g/g^2", "g/K", "deg" …; empty for units that are no SI units times a number (those of a
/// recorded column).
std::optional<DsiUnit> dsi_unit(const std::string& unit);

/// Of the readings of a calibration without angles (ScalarSource::reading_unit): volts, g, or a
/// number where the unit has no name in the SI.
struct ReadingUnits {
  std::string bias;   ///< of a reading
  std::string scale;  ///< of specific force by reading
  double factor = 1;  ///< bias in `bias` = factor × bias, scale in `scale` = scale / factor
};
ReadingUnits reading_units(const std::string& reading_unit);

/// True when the text is a product of known D-SI prefixes and units with numeric exponents.
bool is_dsi_unit(const std::string& text);

namespace dsi {
inline constexpr const char* kAcceleration = "\\metre\\second\\tothe{-2}";
inline constexpr const char* kSensitivity = "\\volt\\metre\\tothe{-1}\\second\\tothe{2}";
inline constexpr const char* kVolt = "\\volt";
/// Beside the SI value in a si:hybrid only: g_n is no unit of the SI.
inline constexpr const char* kVoltPerG = "\\volt\\gn\\tothe{-1}";
}  // namespace dsi

}  // namespace plumbline::app
