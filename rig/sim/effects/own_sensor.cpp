// Effects of the sensor that are on no list: a calibration has to find them by their shape.
#include <cmath>
#include <optional>

#include "rig/sim/effects/effect.h"
#include "rig/sim/effects/terms.h"

namespace plumbline::sim {

namespace {

/// b times what a memory, that sees every instant, makes of it.
template <class F>
std::unique_ptr<Effect> remembering_term(const EffectContext& context, F f) {
  class Term final : public Effect {
   public:
    Term(const EffectContext& p, F function)
        : mask_(axis_mask(p.setting)), b_(p("b")), function_(std::move(function)) {}
    void observe(const Moment& now) override { value_ = function_(now); }
    double sensor_g(const Moment&, std::size_t axis) override {
      return mask_[axis] ? b_ * value_ : 0.0;
    }

   private:
    std::array<bool, 3> mask_;
    double b_;
    F function_;
    double value_ = 0;
  };
  return std::make_unique<Term>(context, std::move(f));
}

/// Glue of the proof mass's frame: expands with temperature through a play, so that the bias on the
/// way up differs from the bias on the way down.
std::unique_ptr<Effect> thermal_hysteresis(const EffectContext& p) {
  return remembering_term(p, [play = Play(p("width") / 2)](const Moment& now) mutable {
    return play.next(now.temp_C) - now.temp_C;
  });
}

/// The same frame where the glue is all that holds it: the bias is where the play has drawn it.
std::unique_ptr<Effect> thermal_drag(const EffectContext& p) {
  return remembering_term(p, [play = Play(p("width") / 2), t0 = p.world.reference_C](
                                 const Moment& now) mutable { return play.next(now.temp_C) - t0; });
}

/// A housing that heats up from outside: while its temperature changes, a gradient bends it.
std::unique_ptr<Effect> thermal_gradient(const EffectContext& p) {
  return remembering_term(p, [core = Lag(p("tau"))](const Moment& now) mutable {
    return now.temp_C - core.next(now.temp_C, now.dt_s);
  });
}

/// Suspension that remembers the load of the last minutes: every earlier pose counts, the longer
/// ago the less.
class Creep final : public Effect {
 public:
  explicit Creep(const EffectContext& p)
      : mask_(axis_mask(p.setting)),
        c_(p("c")),
        memory_{Lag(p("tau")), Lag(p("tau")), Lag(p("tau"))} {}
  void observe(const Moment& now) override {
    // Between two poses the head has spent about the time of the step at the earlier one.
    if (!now.moving || !load_) load_ = now.a_nominal;
    for (std::size_t i = 0; i < kAxisCount; ++i) memory_[i].next((*load_)[i], now.dt_s);
  }
  double sensor_g(const Moment& now, std::size_t axis) override {
    return mask_[axis] ? c_ * (memory_[axis].value() - now.a_nominal[axis]) : 0.0;
  }

 private:
  std::array<bool, 3> mask_;
  double c_;
  std::array<Lag, 3> memory_;
  std::optional<PerAxis<double>> load_;  ///< at the last rest, g
};

/// A proof mass that sticks: it follows the force only when the change exceeds its friction.
class Stiction final : public Effect {
 public:
  explicit Stiction(const EffectContext& p)
      : mask_(axis_mask(p.setting)),
        position_{Play(p("friction")), Play(p("friction")), Play(p("friction"))} {}
  void observe(const Moment& now) override {
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      remainder_[i] = position_[i].next(now.a_nominal[i]) - now.a_nominal[i];
    }
  }
  double sensor_g(const Moment&, std::size_t axis) override {
    return mask_[axis] ? remainder_[axis] : 0.0;
  }

 private:
  std::array<bool, 3> mask_;
  std::array<Play, 3> position_;
  PerAxis<double> remainder_{};
};

/// A fixture that is not stiff: every move leaves it ringing, the more the further the load turned.
std::unique_ptr<Effect> ringing(const EffectContext& p) {
  return sensor_term(p, [c = p("c"), tau = p("tau"), f = p("f")](const Moment& now, std::size_t i) {
    return c * (now.a_previous[i] - now.a[i]) * std::exp(-now.t_in_pose_s / tau) *
           std::cos(kTurn_rad * f * now.t_in_pose_s);
  });
}

/// Axes whose directions move with temperature: the output takes up the next axis, x ← y ← z ← x.
std::unique_ptr<Effect> thermal_twist(const EffectContext& p) {
  return sensor_term(p, [c = p("c"), t0 = p.world.reference_C](const Moment& now, std::size_t i) {
    return c * (now.temp_C - t0) * now.a[(i + 1) % kAxisCount];
  });
}

/// Warm gas inside the case rises: how it cools the sensor depends on which way is up.
std::unique_ptr<Effect> chimney(const EffectContext& p) {
  return sensor_term(p, [b = p("b")](const Moment& now, std::size_t) {
    return b * (now.temp_C - now.air_C) * now.a[0] * now.a[2];
  });
}

const EffectInfo kOwnSensorEffects[] = {
    {"own.thermal_hysteresis",
     "b*(play(T) - T), play of the given width",
     "temp_C",
     "bias",
     true,
     {{"b", "g/K"}, {.name = "width", .unit = "K", .min = 0}},
     thermal_hysteresis},
    {"own.thermal_drag",
     "b*(play(T) - T0), play of the given width",
     "temp_C",
     "bias",
     true,
     {{"b", "g/K"}, {.name = "width", .unit = "K", .min = 0}},
     thermal_drag},
    {"own.thermal_gradient",
     "b*(T - T lagged by tau)",
     "temp_C.rate",
     "bias",
     true,
     {{"b", "g/K"}, kTau},
     thermal_gradient},
    {"own.creep",
     "c*(a_i lagged by tau - a_i)",
     "previous_pose",
     "bias",
     true,
     {{"c", "1"}, kTau},
     make<Creep>},
    {"own.stiction",
     "play(a_i) - a_i, half width friction",
     "previous_pose",
     "bias",
     true,
     {{.name = "friction", .unit = "g", .min = 0}},
     make<Stiction>},
    {"own.ringing",
     "c*(a_i at the previous pose - a_i)*exp(-(t-t_arrival)/tau)*cos(2*pi*f*(t-t_arrival))",
     "t_in_pose",
     "sample",
     true,
     {{"c", "1"}, kTau, {.name = "f", .unit = "Hz", .min = 0}},
     ringing},
    {"own.thermal_twist",
     "c*(T-T0)*a_(i+1), axes counted cyclically",
     "temp_C",
     "scale",
     true,
     {{"c", "1/K"}},
     thermal_twist},
    {"own.chimney",
     "b*(T - T of the air)*a_x*a_z",
     "temp_C",
     "scale",
     true,
     {{"b", "g/K"}},
     chimney},
};

}  // namespace

std::span<const EffectInfo> own_sensor_effects() { return kOwnSensorEffects; }

}  // namespace plumbline::sim
