// Listed effects of the room and of recorded columns.
#include <cmath>
#include <limits>

#include "rig/sim/effects/effect.h"
#include "rig/sim/effects/terms.h"

namespace plumbline::sim {

namespace {

std::unique_ptr<Effect> base_field(const EffectContext& p) {
  return sensor_term(p, [m1 = p("m1"), m2 = p("m2")](const Moment& now, std::size_t i) {
    return m1 * now.attitude.base_x[i] + m2 * now.attitude.base_y[i];
  });
}

constexpr double kOfTheRoom = std::numeric_limits<double>::quiet_NaN();  ///< as it is set

/// Follows one quantity of the room about its mean, which a run has about where the room is set.
std::unique_ptr<Effect> follow(const EffectContext& p, double Moment::*quantity, double set) {
  const double mean = std::isnan(p("mean")) ? set : p("mean");
  return sensor_term(p, [quantity, mean, c = p("c"), scale = p.setting.form == "scale"](
                            const Moment& now, std::size_t i) {
    return c * (now.*quantity - mean) * (scale ? now.a[i] : 1.0);
  });
}

std::unique_ptr<Effect> follow_temperature(const EffectContext& p) {
  return follow(p, &Moment::temp_C, p.world.room.temperature_C + p.world.room.self_heating_C);
}
std::unique_ptr<Effect> follow_humidity(const EffectContext& p) {
  return follow(p, &Moment::rh_pct, p.world.room.rh_pct);
}
std::unique_ptr<Effect> follow_supply(const EffectContext& p) {
  return follow(p, &Moment::supply_V, p.world.room.supply_V);
}
std::unique_ptr<Effect> follow_motor(const EffectContext& p) {
  return follow(p, &Moment::motor_A, p.world.room.hold_A + p.world.room.lift_A / 2);
}

const EffectInfo kRoomEffects[] = {
    {"env.base_field",
     "m1*e1_i + m2*e2_i, e1 = x_b and e2 = y_b seen by the sensor",
     "delta_deg",
     "bias",
     true,
     {{"m1", "g", false}, {"m2", "g", false}},
     base_field},
    {"covariate:temp_C",
     "c*(v - mean v), times a_i for form = \"scale\"",
     "temp_C",
     "bias or scale",
     true,
     {{"c", "g/K or 1/K"}, {"mean", "C", false, kOfTheRoom}},
     follow_temperature},
    {"covariate:rh_pct",
     "c*(v - mean v), times a_i for form = \"scale\"",
     "rh_pct",
     "bias or scale",
     true,
     {{"c", "g/% or 1/%"}, {"mean", "%", false, kOfTheRoom}},
     follow_humidity},
    {"covariate:supply_V",
     "c*(v - mean v), times a_i for form = \"scale\"",
     "supply_V",
     "bias or scale",
     true,
     {{"c", "g/V or 1/V"}, {"mean", "V", false, kOfTheRoom}},
     follow_supply},
    {"covariate:motor_A",
     "c*(v - mean v), times a_i for form = \"scale\"",
     "motor_A",
     "bias or scale",
     true,
     {{"c", "g/A or 1/A"}, {"mean", "A", false, kOfTheRoom}},
     follow_motor},
};

}  // namespace

std::span<const EffectInfo> room_effects() { return kRoomEffects; }

}  // namespace plumbline::sim
