// Which effects the study adds, with which parameters.
#include <cmath>
#include <numbers>

#include "tests/study/diagnosis.h"

namespace plumbline::study {
namespace {

using Parameters = std::map<std::string, double>;

/// The amplitude alone.
DrawParameters only(const char* name) {
  return [name](const DrawContext&) -> Parameters { return {{name, 1.0}}; };
}
/// Two components in a random direction.
DrawParameters direction(const char* first, const char* second) {
  return [first, second](const DrawContext& at) -> Parameters {
    const double angle = at.random.uniform(0, 2 * std::numbers::pi);
    return {{first, std::cos(angle)}, {second, std::sin(angle)}};
  };
}

Parameters cross_product(const DrawContext& at) {
  Parameters p;  // one product, two or all three
  const auto products = 1 + at.random.index(7);
  for (const auto& [bit, name] : {std::pair(1U, "k_xy"), {2U, "k_xz"}, {4U, "k_yz"}})
    if ((products & bit) != 0) p[name] = at.random.sign() * at.random.uniform(0.3, 1);
  return p;
}
Parameters warmup(const DrawContext& at) {
  return {{"b", at.random.sign()}, {"tau", at.run_s * at.random.uniform(0.05, 0.3)}};
}
Parameters bias_step(const DrawContext& at) {
  return {{"b", at.random.sign()}, {"t0", at.run_s * at.random.uniform(0.15, 0.85)}};
}
Parameters settling(const DrawContext& at) {
  return {{"c", at.random.sign()}, {"tau", at.dwell_s * at.random.uniform(0.3, 2)}};
}
Parameters code_step(const DrawContext& at) {
  const double reach = at.axis == 2 ? at.random.uniform(0.2, 0.8) : at.random.uniform(-0.7, 0.7);
  return {
      {"c", at.random.sign()},
      {"at", at.world.triad.U0_V[at.axis] + reach * at.world.triad.K_V_per_g[at.axis][at.axis]}};
}
Parameters stuck_bit(const DrawContext& at) {
  return {{"bit", 1}, {"value", static_cast<double>(at.random.index(2))}};
}
Parameters mains_pickup(const DrawContext& at) {
  return {{"amplitude", 1},
          {"f", at.world.rate_hz * at.random.uniform(0.05, 0.45)},
          {"phase", at.random.uniform(0, 360)}};
}
Parameters delta_periodic(const DrawContext& at) {
  Parameters p = direction("c", "s")(at);
  p["n"] = static_cast<double>(3 + at.random.index(15));
  return p;
}
Parameters index_slip(const DrawContext& at) {
  return {{"epsilon", at.random.sign()}, {"pose", static_cast<double>(50 + at.random.index(225))}};
}
Parameters pose_outlier(const DrawContext& at) {
  const double angle = at.random.uniform(0, 2 * std::numbers::pi);
  return {{"delta", std::cos(angle)}, {"h", std::sin(angle)}};
}

std::vector<StudyEffect> listed_study_effects() {
  return {
      {"sensor.quadratic", "xyz", 0.5, {}, {}, either_sign("k2"), {"k2"}},
      {"sensor.cubic", "xyz", 0.5, {}, {}, either_sign("k3"), {"k3"}},
      // On z, which sees no negative a, asymmetry is a scale factor and a dead zone one ring.
      {"sensor.asymmetry", "xy", 0.5, {}, {}, either_sign("ka"), {"ka"}},
      {"sensor.cross_product", "xyz", 0.5, {}, {}, cross_product, {"k_xy", "k_xz", "k_yz"}},
      {"sensor.hysteresis", "xyz", 0.5, {}, {}, either_sign("w"), {"w"}},
      {"sensor.temperature_bias", "xyz", 0.5, {}, {}, either_sign("b1"), {"b1"}},
      {"sensor.temperature_scale", "xyz", 0.5, {}, {}, either_sign("s1"), {"s1"}},
      {"sensor.warmup", "xyz", 2, {}, {}, warmup, {"b"}},
      {"sensor.drift", "xyz", 2, {}, {}, either_sign("d"), {"d"}},
      {"sensor.scale_drift", "xyz", 2, {}, {}, either_sign("s"), {"s"}},
      {"sensor.bias_step", "xyz", 0.5, {}, {}, bias_step, {"b"}},
      {"sensor.settling", "xyz", 2, {}, {}, settling, {"c"}},
      {"sensor.dead_zone", "xy", 0.5, {}, {}, only("w"), {"w"}},
      {"sensor.saturation", "xyz", 0.7, {}, {}, only("L"), {"L"}},
      {"adc.quantization", "xyz", 0.05, {}, {}, only("lsb"), {"lsb"}},
      {"adc.code_step", "xyz", 0.05, {}, {}, code_step, {"c"}},
      {"adc.stuck_bit", "xyz", 1, {}, {}, stuck_bit, {"bit"}},
      {"adc.mains_pickup", "xyz", 0.5, {}, {}, mains_pickup, {"amplitude"}},
      {"rig.base_roll", "", 10, {}, {}, either_sign("epsilon"), {"epsilon"}},
      {"rig.tilt_index", "", 10, {}, {}, either_sign("epsilon"), {"epsilon"}},
      {"rig.axis_skew", "", 10, {}, {}, either_sign("eta"), {"eta"}},
      {"rig.delta_eccentricity", "", 10, {}, {}, direction("c", "s"), {"c", "s"}},
      {"rig.delta_ellipticity", "", 10, {}, {}, direction("c", "s"), {"c", "s"}},
      {"rig.delta_periodic", "", 10, {}, {}, delta_periodic, {"c", "s"}},
      {"rig.h_scale", "", 0.5, {}, {}, either_sign("k"), {"k"}},
      {"rig.h_eccentricity", "", 10, {}, {}, direction("c", "s"), {"c", "s"}},
      {"rig.backlash", "", 20, {}, {}, either_sign("w"), {"w"}},
      {"rig.index_slip", "", 10, {}, {}, index_slip, {"epsilon"}},
      {"rig.pose_outlier", "", 60, {}, {}, pose_outlier, {"delta", "h"}},
      {"env.base_field", "xyz", 0.5, {}, {}, direction("m1", "m2"), {"m1", "m2"}},
      {"covariate:rh_pct:bias", "xyz", 0.5, {}, {}, either_sign("c"), {"c"}},
      {"covariate:rh_pct:scale", "xyz", 0.5, {}, {}, either_sign("c"), {"c"}},
      {"covariate:supply_V:bias", "xyz", 50, {}, {}, either_sign("c"), {"c"}},
      {"covariate:supply_V:scale", "xyz", 50, {}, {}, either_sign("c"), {"c"}},
      {"covariate:motor_A:bias", "xyz", 5, {}, {}, either_sign("c"), {"c"}},
      {"covariate:motor_A:scale", "xyz", 5, {}, {}, either_sign("c"), {"c"}},
  };
}

}  // namespace

DrawParameters either_sign(const char* name) {
  return [name](const DrawContext& at) -> Parameters { return {{name, at.random.sign()}}; };
}

const std::vector<StudyEffect>& study_effects() {
  static const std::vector<StudyEffect> all = [] {
    std::vector<StudyEffect> effects = listed_study_effects();
    for (StudyEffect& own : own_study_effects()) effects.push_back(std::move(own));
    return effects;
  }();
  return all;
}

const StudyEffect* find_study_effect(const std::string& name) {
  for (const StudyEffect& effect : study_effects())
    if (effect.name == name) return &effect;
  return nullptr;
}

std::vector<std::string> effect_names(bool listed) {
  std::vector<std::string> names;
  for (const StudyEffect& effect : study_effects())
    if (effect.drivers.empty() == listed) names.emplace_back(effect.name);
  return names;
}

}  // namespace plumbline::study
