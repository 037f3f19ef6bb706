#include "estimator/effects/listed_drivers.h"

#include <string_view>

#include "estimator/effects/covariate.h"

namespace plumbline {

namespace {

/// What the listed effects are functions of. Those that are constants of the head or of the
/// converter are functions of nothing that a structure could follow as well.
struct Listed {
  std::string_view id;
  TermForm form;
  std::vector<std::string_view> drivers;  ///< "a", "code": those of the own axis
};

const std::vector<Listed>& listed_drivers() {
  static const std::vector<Listed> all = {
      {"adc.code_step", TermForm::bias, {"a", "code"}},
      {"rig.backlash", TermForm::geometry, {"previous_pose"}},
      {"rig.delta_eccentricity", TermForm::geometry, {"delta_deg"}},
      {"rig.delta_ellipticity", TermForm::geometry, {"delta_deg"}},
      {"rig.delta_periodic", TermForm::geometry, {"delta_deg"}},
      {"rig.h_eccentricity", TermForm::geometry, {"h_deg"}},
      {"rig.h_scale", TermForm::geometry, {"h_deg"}},
      {"rig.index_slip", TermForm::geometry, {"t_s"}},
      {"rig.tilt_index", TermForm::geometry, {"h_deg"}},
      {"sensor.asymmetry", TermForm::bias, {"a", "code"}},
      {"sensor.bias_step", TermForm::bias, {"t_s"}},
      {"sensor.cubic", TermForm::bias, {"a", "code"}},
      {"sensor.dead_zone", TermForm::bias, {"a", "code"}},
      {"sensor.drift", TermForm::bias, {"t_s"}},
      {"sensor.hysteresis", TermForm::bias, {"previous_pose", "a"}},
      {"sensor.quadratic", TermForm::bias, {"a", "code"}},
      {"sensor.saturation", TermForm::bias, {"a", "code"}},
      {"sensor.scale_drift", TermForm::scale, {"t_s"}},
      {"sensor.settling", TermForm::sample, {"t_in_pose"}},
      {"sensor.temperature_bias", TermForm::bias, {kTemperatureColumn}},
      {"sensor.temperature_scale", TermForm::scale, {kTemperatureColumn}},
      {"sensor.warmup", TermForm::bias, {"t_s"}},
  };
  return all;
}

}  // namespace

std::optional<ListedDrivers> drivers_of(const Effect& effect, std::size_t axis) {
  if (const auto column = covariate_column(effect.id())) {
    const bool bias = effect.parameters().front().unit.starts_with("g");
    return ListedDrivers{bias ? TermForm::bias : TermForm::scale, {*column}};
  }
  for (const Listed& listed : listed_drivers()) {
    if (listed.id != effect.id()) continue;
    ListedDrivers found{listed.form, {}};
    for (const std::string_view driver : listed.drivers) {
      const bool of_axis = driver == "a" || driver == "code";
      found.drivers.push_back(std::string(driver) +
                              (of_axis ? std::string("_") + kAxisName[axis] : ""));
    }
    return found;
  }
  return {};
}

}  // namespace plumbline
