// Listed effects of the sensor.
#include <cmath>

#include "rig/sim/effects/effect.h"
#include "rig/sim/effects/terms.h"

namespace plumbline::sim {

namespace {

constexpr double kSecondsPerHour = 3600;
/// A change of specific force smaller than this between two poses is none: settling of the head.
constexpr double kSameForce_g = 1e-4;

std::unique_ptr<Effect> quadratic(const EffectContext& p) {
  return sensor_term(
      p, [k2 = p("k2")](const Moment& now, std::size_t i) { return k2 * now.a[i] * now.a[i]; });
}

std::unique_ptr<Effect> cubic(const EffectContext& p) {
  return sensor_term(p, [k3 = p("k3")](const Moment& now, std::size_t i) {
    return k3 * now.a[i] * now.a[i] * now.a[i];
  });
}

std::unique_ptr<Effect> asymmetry(const EffectContext& p) {
  return sensor_term(
      p, [ka = p("ka")](const Moment& now, std::size_t i) { return ka * std::abs(now.a[i]); });
}

std::unique_ptr<Effect> cross_product(const EffectContext& p) {
  return sensor_term(
      p, [xy = p("k_xy"), xz = p("k_xz"), yz = p("k_yz")](const Moment& now, std::size_t) {
        return xy * now.a[0] * now.a[1] + xz * now.a[0] * now.a[2] + yz * now.a[1] * now.a[2];
      });
}

std::unique_ptr<Effect> hysteresis(const EffectContext& p) {
  return sensor_term(p, [w = p("w")](const Moment& now, std::size_t i) {
    const double rise = now.a[i] - now.a_previous[i];
    if (std::abs(rise) < kSameForce_g) return 0.0;
    return rise > 0 ? w / 2 : -w / 2;
  });
}

std::unique_ptr<Effect> temperature_bias(const EffectContext& p) {
  return sensor_term(p, [b1 = p("b1"), t0 = p.world.reference_C](const Moment& now, std::size_t) {
    return b1 * (now.temp_C - t0);
  });
}

std::unique_ptr<Effect> temperature_scale(const EffectContext& p) {
  return sensor_term(p, [s1 = p("s1"), t0 = p.world.reference_C](const Moment& now, std::size_t i) {
    return s1 * (now.temp_C - t0) * now.a[i];
  });
}

std::unique_ptr<Effect> warmup(const EffectContext& p) {
  return sensor_term(p, [b = p("b"), tau = p("tau")](const Moment& now, std::size_t) {
    return b * std::exp(-now.t_s / tau);
  });
}

std::unique_ptr<Effect> drift(const EffectContext& p) {
  return sensor_term(
      p, [d = p("d")](const Moment& now, std::size_t) { return d * now.t_s / kSecondsPerHour; });
}

std::unique_ptr<Effect> scale_drift(const EffectContext& p) {
  return sensor_term(p, [s = p("s")](const Moment& now, std::size_t i) {
    return s * now.t_s / kSecondsPerHour * now.a[i];
  });
}

std::unique_ptr<Effect> bias_step(const EffectContext& p) {
  return sensor_term(p, [b = p("b"), t0 = p("t0")](const Moment& now, std::size_t) {
    return now.t_s >= t0 ? b : 0.0;
  });
}

std::unique_ptr<Effect> settling(const EffectContext& p) {
  return sensor_term(p, [c = p("c"), tau = p("tau")](const Moment& now, std::size_t i) {
    return c * (now.a_previous[i] - now.a[i]) * std::exp(-now.t_in_pose_s / tau);
  });
}

/// Σ_j K_ij·a_j / K_ii: what the axis responds to, g.
double response_g(const Triad& triad, const Moment& now, std::size_t i) {
  const PerAxis<double>& k = triad.K_V_per_g[i];
  return (k[0] * now.a[0] + k[1] * now.a[1] + k[2] * now.a[2]) / k[i];
}

std::unique_ptr<Effect> dead_zone(const EffectContext& p) {
  return sensor_term(p, [w = p("w"), triad = p.triad](const Moment& now, std::size_t i) {
    return -std::clamp(response_g(triad, now, i), -w, w);
  });
}

std::unique_ptr<Effect> saturation(const EffectContext& p) {
  return sensor_term(p, [limit = p("L"), triad = p.triad](const Moment& now, std::size_t i) {
    const double response = response_g(triad, now, i);
    return std::clamp(response, -limit, limit) - response;
  });
}

const EffectInfo kSensorEffects[] = {
    {"sensor.quadratic", "k2*a_i^2", "a_i", "bias", true, {{"k2", "g/g^2"}}, quadratic},
    {"sensor.cubic", "k3*a_i^3", "a_i", "bias", true, {{"k3", "g/g^3"}}, cubic},
    {"sensor.asymmetry", "ka*abs(a_i)", "a_i", "bias", true, {{"ka", "g/g"}}, asymmetry},
    {"sensor.cross_product",
     "k_xy*a_x*a_y + k_xz*a_x*a_z + k_yz*a_y*a_z",
     "a_j*a_k",
     "bias",
     true,
     {{"k_xy", "g/g^2", false}, {"k_xz", "g/g^2", false}, {"k_yz", "g/g^2", false}},
     cross_product},
    {"sensor.hysteresis",
     "+w/2 after a_i rose on the way to this pose, -w/2 after it fell",
     "previous_pose",
     "bias",
     true,
     {{"w", "g"}},
     hysteresis},
    {"sensor.temperature_bias",
     "b1*(T-T0)",
     "temp_C",
     "bias",
     true,
     {{"b1", "g/K"}},
     temperature_bias},
    {"sensor.temperature_scale",
     "s1*(T-T0)*a_i",
     "temp_C",
     "scale",
     true,
     {{"s1", "1/K"}},
     temperature_scale},
    {"sensor.warmup", "b*exp(-t/tau)", "t_s", "bias", true, {{"b", "g"}, kTau}, warmup},
    {"sensor.drift", "d*t", "t_s", "bias", true, {{"d", "g/h"}}, drift},
    {"sensor.scale_drift", "s*t*a_i", "t_s", "scale", true, {{"s", "1/h"}}, scale_drift},
    {"sensor.bias_step",
     "b for t >= t0",
     "t_s",
     "bias",
     true,
     {{"b", "g"}, {"t0", "s"}},
     bias_step},
    {"sensor.settling",
     "c*(a_i at the previous pose - a_i)*exp(-(t-t_arrival)/tau)",
     "t_in_pose",
     "sample",
     true,
     {{"c", "1"}, kTau},
     settling},
    {"sensor.dead_zone",
     "response lowered by up to w towards zero: zero within +-w",
     "a_i",
     "bias",
     true,
     {{.name = "w", .unit = "g", .min = 0}},
     dead_zone},
    {"sensor.saturation",
     "response clipped at +-L",
     "a_i",
     "bias",
     true,
     {{.name = "L", .unit = "g", .min = 0}},
     saturation},
};

}  // namespace

std::span<const EffectInfo> sensor_effects() { return kSensorEffects; }

}  // namespace plumbline::sim
