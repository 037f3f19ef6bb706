#include "app/certificate/effect_words.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "app/certificate/rounding.h"
#include "estimator/angle_units.h"
#include "estimator/effects/covariate.h"

namespace plumbline::app {
namespace {

struct EffectWords {
  const char* id;
  const char* name;
  const char* term;  ///< as in the model; `a` in g
};

constexpr std::array<EffectWords, 30> kEffects = {{
    {"sensor.quadratic", "second-order nonlinearity (K2)", "k2·a_i²"},
    {"sensor.cubic", "third-order nonlinearity (K3)", "k3·a_i³"},
    {"sensor.asymmetry", "scale factor asymmetry", "ka·|a_i|"},
    {"sensor.cross_product", "cross-coupling of two axes (Kip, Kio, Kpo)",
     "k_xy·a_x·a_y + k_xz·a_x·a_z + k_yz·a_y·a_z"},
    {"sensor.hysteresis", "hysteresis",
     "+w/2 where a_i rose on the way to the position, −w/2 where it fell; start: how the first "
     "position was reached"},
    {"sensor.temperature_bias", "bias that follows the temperature", "b1·(T − T₀)"},
    {"sensor.temperature_scale", "scale factor that follows the temperature", "s1·(T − T₀)·a_i"},
    {"sensor.warmup", "warm-up of the bias", "b·exp(−t/tau)"},
    {"sensor.drift", "drift of the bias with time", "d·t"},
    {"sensor.scale_drift", "drift of the scale factor with time", "s·t·a_i"},
    {"sensor.bias_step", "step of the bias", "b from t = t0 on"},
    {"sensor.settling", "slow settling after a change of position",
     "c·(a_i of the position before − a_i)·exp(−t/tau), t since the arrival"},
    {"sensor.dead_zone", "dead zone around zero",
     "no response while the specific force along the axis is within ±w"},
    {"sensor.saturation", "saturation", "clipped at ±L"},
    {"adc.quantization", "quantization by the converter", "rounding to steps of lsb"},
    {"adc.code_step", "step at one code boundary of the converter", "c·sign(U_i − at)"},
    {"adc.stuck_bit", "stuck bit of the converter", "the bit of the code always has the value"},
    {"adc.mains_pickup", "mains pickup", "amplitude·sin(2π·f·t + phase) in every reading"},
    {"rig.base_roll", "tilt of the base about the spindle's direction",
     "base tilted about the direction of the spindle by epsilon"},
    {"rig.tilt_index", "index error of the tilt axis", "h + epsilon"},
    {"rig.axis_skew", "spindle not perpendicular to the tilt axis",
     "spindle off the perpendicular to the tilt axis by eta"},
    {"rig.delta_eccentricity", "eccentricity of the spindle's circle", "δ + c·cos δ + s·sin δ"},
    {"rig.delta_ellipticity", "ellipticity of the spindle's circle", "δ + c·cos 2δ + s·sin 2δ"},
    {"rig.delta_periodic", "periodic error of the spindle", "δ + c·cos nδ + s·sin nδ"},
    {"rig.h_scale", "scale error of the tilt axis", "h·(1 + k)"},
    {"rig.h_eccentricity", "eccentricity of the tilt circle", "h + c·cos h + s·sin h"},
    {"rig.backlash", "backlash of the spindle",
     "δ ± w/2 by the direction in which δ was approached; way 0: the shorter way round, 1: never "
     "past 360°; start: how the first angle was reached"},
    {"rig.index_slip", "slip of the spindle's index",
     "δ + epsilon from the position numbered pose on"},
    {"rig.pose_outlier", "poses at a wrong angle", "δ + delta and h + h at single positions"},
    {"env.base_field", "field fixed to the base (a magnetic one, say)",
     "m1 and m2 times the horizontal axes of the base as the triad sees them"},
}};

const EffectWords* words_of(const std::string& id) {
  const auto* it = std::find_if(kEffects.begin(), kEffects.end(),
                                [&](const EffectWords& words) { return id == words.id; });
  return it == kEffects.end() ? nullptr : it;
}

std::string what_changes(std::string_view form, const Translator& tr) {
  return form == "bias"       ? tr("the bias")
         : form == "scale"    ? tr("the scale factor")
         : form == "geometry" ? tr("the geometry of the head")
                              : tr("the readings within a dwell");
}

std::string one_name(const std::string& id, const Translator& tr) {
  if (const EffectWords* words = words_of(id)) return tr(words->name);
  constexpr std::string_view kStructure = "unlisted:";  // unlisted:DRIVER:FORM
  if (const std::size_t form = id.rfind(':');
      id.starts_with(kStructure) && form > kStructure.size())
    return tr("{} follows {}", what_changes(std::string_view(id).substr(form + 1), tr),
              id.substr(kStructure.size(), form - kStructure.size()));
  if (const auto column = covariate_column(id))
    return tr("influence of the recorded column {}", *column);
  return id;
}

std::string one_term(const std::string& id, const Translator& tr) {
  if (const EffectWords* words = words_of(id)) return tr(words->term);
  const auto column = covariate_column(id);
  if (!column) return {};
  return tr(
      "c·(v − mean) with c in g per unit, c·(v − mean)·a_i with c per unit; v is the column {}",
      *column);
}

/// Of the members of a sum of effects.
std::string member_by_member(const std::string& id, const Translator& tr,
                             std::string (*words)(const std::string&, const Translator&),
                             const char* between) {
  std::string text;
  for (const std::string& member : members_of(id))
    text += (text.empty() ? "" : between) + words(member, tr);
  return text;
}

}  // namespace

std::vector<std::string> members_of(const std::string& id) {
  std::vector<std::string> members;
  for (std::size_t from = 0; from <= id.size();) {
    const std::size_t to = std::min(id.find('+', from), id.size());
    members.push_back(id.substr(from, to - from));
    from = to + 1;
  }
  return members;
}

std::string effect_name(const std::string& id, const Translator& tr) {
  return member_by_member(id, tr, one_name, " + ");
}

std::string effect_term(const std::string& id, const Translator& tr) {
  return member_by_member(id, tr, one_term, "; ");
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

std::string before_unit(const std::string& unit) { return unit.empty() || unit == "°" ? "" : " "; }

std::string parameter_text(const EffectParameter& parameter) {
  std::string text = parameter.name;
  if (parameter.axis) text += fmt::format(" ({})", kAxisName.at(*parameter.axis));
  // Angles of the head are stated in degrees throughout.
  const bool in_rad = parameter.unit == "rad";
  const std::string unit = in_rad ? "°" : printed_unit(parameter.unit);
  const double factor = in_rad ? kDegPerRad : 1;
  const double value = factor * parameter.value;
  text += " = ";
  if (parameter.u > 0) {
    const RoundedResult rounded = round_result(value, 2 * factor * parameter.u);
    text +=
        fmt::format("({} ± {}){}{}", rounded.value, rounded.uncertainty, before_unit(unit), unit);
  } else if (value == std::round(value) && std::abs(value) < 1e6) {
    text += fmt::format("{:.0f}", value);  // a pose, a bit, an order
    text += before_unit(unit) + unit;
  } else {
    text += chosen(value, 6) + before_unit(unit) + unit;
  }
  return text;
}

std::string shortened(const std::string& text, std::size_t most) {
  std::size_t count = 0;
  for (std::size_t at = 0; at < text.size(); ++at) {
    if ((text[at] & 0xC0) == 0x80) continue;
    if (++count == most) return text.substr(0, at) + "…";
  }
  return text;
}

std::string unlisted_name(const UnlistedStructure& found, const Translator& tr) {
  if (found.is_wandering())
    return tr("not among the listed effects: the bias wanders beyond the static record");
  if (found.is_of_noise())
    return tr("not among the listed effects: the noise follows {}", found.driver);
  return tr("not among the listed effects: {} follows {}", what_changes(found.form, tr),
            found.driver);
}

}  // namespace plumbline::app
