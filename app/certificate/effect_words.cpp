#include "app/certificate/effect_words.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "app/certificate/rounding.h"

namespace plumbline::app {
namespace {

constexpr std::array<std::pair<const char*, const char*>, 30> kNames = {{
    {"sensor.quadratic", "second-order nonlinearity (K2)"},
    {"sensor.cubic", "third-order nonlinearity (K3)"},
    {"sensor.asymmetry", "scale factor asymmetry"},
    {"sensor.cross_product", "cross-coupling of two axes (Kip, Kio, Kpo)"},
    {"sensor.hysteresis", "hysteresis"},
    {"sensor.temperature_bias", "bias that follows the temperature"},
    {"sensor.temperature_scale", "scale factor that follows the temperature"},
    {"sensor.warmup", "warm-up of the bias"},
    {"sensor.drift", "drift of the bias with time"},
    {"sensor.scale_drift", "drift of the scale factor with time"},
    {"sensor.bias_step", "step of the bias"},
    {"sensor.settling", "slow settling after a change of position"},
    {"sensor.dead_zone", "dead zone around zero"},
    {"sensor.saturation", "saturation"},
    {"adc.quantization", "quantization by the converter"},
    {"adc.code_step", "step at one code boundary of the converter"},
    {"adc.stuck_bit", "stuck bit of the converter"},
    {"adc.mains_pickup", "mains pickup"},
    {"rig.base_roll", "tilt of the base about the spindle's direction"},
    {"rig.tilt_index", "index error of the tilt axis"},
    {"rig.axis_skew", "spindle not perpendicular to the tilt axis"},
    {"rig.delta_eccentricity", "eccentricity of the spindle's circle"},
    {"rig.delta_ellipticity", "ellipticity of the spindle's circle"},
    {"rig.delta_periodic", "periodic error of the spindle"},
    {"rig.h_scale", "scale error of the tilt axis"},
    {"rig.h_eccentricity", "eccentricity of the tilt circle"},
    {"rig.backlash", "backlash of the spindle"},
    {"rig.index_slip", "slip of the spindle's index"},
    {"rig.pose_outlier", "poses at a wrong angle"},
    {"env.base_field", "field fixed to the base (a magnetic one, say)"},
}};

std::string one_name(const std::string& id, const Translator& tr) {
  const auto* it = std::find_if(kNames.begin(), kNames.end(),
                                [&](const auto& entry) { return id == entry.first; });
  if (it != kNames.end()) return tr(it->second);
  constexpr std::string_view kCovariate = "covariate:";
  if (id.starts_with(kCovariate)) {
    return tr("influence of the recorded column {}", id.substr(kCovariate.size()));
  }
  return id;
}

}  // namespace

std::string effect_name(const std::string& id, const Translator& tr) {
  std::string text;
  for (std::size_t from = 0; from <= id.size();) {
    const std::size_t to = std::min(id.find('+', from), id.size());
    text += (text.empty() ? "" : " + ") + one_name(id.substr(from, to - from), tr);
    from = to + 1;
  }
  return text;
}

std::string axes_text(const std::vector<std::size_t>& axes) {
  std::string text;
  for (const std::size_t axis : axes) {
    text += (text.empty() ? "" : ", ") + std::string(kAxisName.at(axis));
  }
  return text;
}

std::string printed_unit(std::string unit) {
  constexpr std::pair<const char*, const char*> kPrinted[] = {
      {"^2", "²"}, {"^3", "³"}, {"deg", "°"}, {"sqrt(s)", "√s"}, {"*", "·"}};
  for (const auto& [from, to] : kPrinted) {
    for (std::size_t at = 0; (at = unit.find(from, at)) != std::string::npos;) {
      unit.replace(at, std::string_view(from).size(), to);
    }
  }
  return unit;
}

std::string parameter_text(const EffectParameter& parameter) {
  std::string text = parameter.name;
  if (parameter.axis) text += fmt::format(" ({})", kAxisName.at(*parameter.axis));
  const std::string unit = printed_unit(parameter.unit);
  text += " = ";
  if (parameter.u > 0) {
    text += result_with_unit(parameter.value, 2 * parameter.u, unit);
  } else if (parameter.value == std::round(parameter.value) && std::abs(parameter.value) < 1e6) {
    text += fmt::format("{:.0f}", parameter.value);  // a pose, a bit, an order
    if (!unit.empty()) text += " " + unit;
  } else {
    text += significant(parameter.value, 6) + (unit.empty() ? "" : " " + unit);
  }
  while (text.back() == ' ') text.pop_back();
  return text;
}

std::string unlisted_name(const UnlistedStructure& found, const Translator& tr) {
  const std::string form = found.form == "bias"       ? tr("the bias")
                           : found.form == "scale"    ? tr("the scale factor")
                           : found.form == "geometry" ? tr("the geometry of the head")
                                                      : tr("the readings within a dwell");
  return tr("not among the listed effects: {} follows {}", form, found.driver);
}

}  // namespace plumbline::app
