#include "app/certificate/dcc/dcc_units.h"

#include <array>
#include <map>
#include <regex>
#include <set>

#include "estimator/measurement.h"

namespace plumbline::app {

std::optional<DsiUnit> dsi_unit(const std::string& unit) {
  constexpr double g = kStandardGravity_mps2;
  static const std::map<std::string, DsiUnit> kUnits = {
      {"", {"\\one", 1}},
      {"g", {dsi::kAcceleration, g}},
      {"g/g", {"\\one", 1}},
      {"g/g^2", {"\\metre\\tothe{-1}\\second\\tothe{2}", 1 / g}},
      {"g/g^3", {"\\metre\\tothe{-2}\\second\\tothe{4}", 1 / (g * g)}},
      {"g/K", {"\\metre\\second\\tothe{-2}\\kelvin\\tothe{-1}", g}},
      {"g/h", {"\\metre\\second\\tothe{-2}\\hour\\tothe{-1}", g}},
      {"g/s", {"\\metre\\second\\tothe{-3}", g}},
      {"1/K", {"\\kelvin\\tothe{-1}", 1}},
      {"1/h", {"\\hour\\tothe{-1}", 1}},
      {"1/s", {"\\second\\tothe{-1}", 1}},
      {"s", {"\\second", 1}},
      {"V", {dsi::kVolt, 1}},
      {"deg", {"\\degree", 1}},
      {"rad", {"\\radian", 1}},
      {"Hz", {"\\hertz", 1}},
      {"V/g", {dsi::kSensitivity, 1 / g}},
  };
  const auto it = kUnits.find(unit);
  if (it == kUnits.end()) return std::nullopt;
  return it->second;
}

ReadingUnits reading_units(const std::string& reading_unit) {
  if (reading_unit == "V") {
    return {dsi::kVolt, "\\metre\\second\\tothe{-2}\\volt\\tothe{-1}", 1};
  }
  if (reading_unit == "g") return {dsi::kAcceleration, "\\one", kStandardGravity_mps2};
  return {"\\one", dsi::kAcceleration, 1};
}

bool is_dsi_unit(const std::string& text) {
  // What the SI brochure (9th edition) and D-SI 2.2.1 name, as far as a calibration like this one
  // can need it.
  static const std::set<std::string> kKnown = {
      "metre",         "kilogram", "second",    "ampere", "kelvin",    "mole",
      "candela",       "one",      "volt",      "hertz",  "newton",    "pascal",
      "joule",         "watt",     "coulomb",   "farad",  "ohm",       "siemens",
      "degreecelsius", "radian",   "steradian", "tesla",  "weber",     "henry",
      "minute",        "hour",     "day",       "degree", "arcminute", "arcsecond",
      "gram",          "percent",  "ppm"};
  static const std::set<std::string> kPrefixes = {"micro", "milli", "kilo",  "mega",
                                                  "nano",  "pico",  "centi", "hecto"};
  static const std::regex kPart(R"(\\([a-z]+)(\{([^}]*)\})?)");
  static const std::regex kExponent(R"(-?\d+(\.\d+)?)");
  std::size_t used = 0;
  bool unit_before = false, prefix_before = false;
  for (std::sregex_iterator it(text.begin(), text.end(), kPart), end; it != end; ++it) {
    if (static_cast<std::size_t>(it->position()) != used) return false;
    used += static_cast<std::size_t>(it->length());
    const std::string name = (*it)[1];
    if (name == "tothe") {
      if (!unit_before || !std::regex_match((*it)[3].str(), kExponent)) return false;
      unit_before = false;
      continue;
    }
    if ((*it)[2].matched) return false;
    const bool prefix = kPrefixes.count(name) > 0;
    if ((!prefix && kKnown.count(name) == 0) || (prefix && prefix_before)) return false;
    prefix_before = prefix;
    unit_before = !prefix;
  }
  return used == text.size() && used > 0 && !prefix_before;
}

}  // namespace plumbline::app
