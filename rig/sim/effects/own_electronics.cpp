// Effects of the electronics that are on no list.
#include <cmath>

#include "rig/sim/effects/effect.h"
#include "rig/sim/effects/terms.h"
#include "rig/sim/random.h"

namespace plumbline::sim {

namespace {

/// Converter whose reference is derived from the supply: readings shrink as the supply rises.
std::unique_ptr<Effect> ratiometric(const EffectContext& p) {
  return sensor_term(
      p, [c = p("c"), nominal_V = p.world.room.supply_V](const Moment& now, std::size_t i) {
        return -c * (now.supply_V / nominal_V - 1) * now.a[i];
      });
}

/// Regulator that loses regulation: nothing happens until the supply falls below the knee.
std::unique_ptr<Effect> regulator_dropout(const EffectContext& p) {
  return sensor_term(p, [b = p("b"), knee_V = p("knee")](const Moment& now, std::size_t) {
    return b * std::max(0.0, knee_V - now.supply_V);
  });
}

/// Integral nonlinearity of the converter, repeating over the span.
std::unique_ptr<Effect> inl_ripple(const EffectContext& p) {
  return converter_term(p, [amplitude = p("amplitude"), period_V = p("period")](
                               const Moment&, std::size_t, double u_V) {
    return u_V + amplitude * std::sin(kTurn_rad * u_V / period_V);
  });
}

/// Amplifier with two ranges: above the threshold it switches to one whose gain differs.
std::unique_ptr<Effect> gain_ranging(const EffectContext& p) {
  return converter_term(p,
                        [error = p("error"), at = p("at")](const Moment&, std::size_t, double u_V) {
                          return u_V > at ? u_V + error * (u_V - at) : u_V;
                        });
}

/// A trap at the input transistor: the bias jumps between two levels at random times, and nothing
/// that is recorded says when.
class Popcorn final : public Effect {
 public:
  explicit Popcorn(const EffectContext& p)
      : mask_(axis_mask(p.setting)),
        b_(p("b")),
        mean_s_(p("mean")),
        random_(p.seed, "own.popcorn") {
    schedule();
  }
  void observe(const Moment& now) override {
    while (now.t_s >= next_s_) {
      up_ = !up_;
      schedule();
    }
  }
  double sensor_g(const Moment&, std::size_t axis) override {
    return mask_[axis] && up_ ? b_ : 0.0;
  }

 private:
  void schedule() { next_s_ -= mean_s_ * std::log1p(-random_.uniform()); }

  std::array<bool, 3> mask_;
  double b_;
  double mean_s_;
  Random random_;
  double next_s_ = 0;
  bool up_ = false;
};

/// Multiplexer whose hold capacitor keeps part of the last pose for the first samples: decays by a
/// power of time, unlike any exponential.
std::unique_ptr<Effect> dielectric_absorption(const EffectContext& p) {
  return sensor_term(p, [c = p("c"), tau = p("tau")](const Moment& now, std::size_t i) {
    return c * (now.a_previous[i] - now.a[i]) / (1 + now.t_in_pose_s / tau);
  });
}

const EffectInfo kOwnElectronicsEffects[] = {
    {"own.ratiometric",
     "-c*(supply/nominal - 1)*a_i",
     "supply_V",
     "scale",
     true,
     {{"c", "1"}},
     ratiometric},
    {"own.regulator_dropout",
     "b*max(0, knee - supply)",
     "supply_V",
     "bias",
     true,
     {{"b", "g/V"}, {"knee", "V"}},
     regulator_dropout},
    {"own.inl_ripple",
     "U += amplitude*sin(2*pi*U/period)",
     "code_i",
     "bias",
     true,
     {{"amplitude", "V"}, {.name = "period", .unit = "V", .min = 1e-9}},
     inl_ripple},
    {"own.gain_ranging",
     "U += error*(U-at) above at",
     "code_i",
     "scale",
     true,
     {{"error", "1"}, {"at", "V"}},
     gain_ranging},
    {"own.popcorn",
     "0 or b, changing at random, on average every `mean` seconds",
     "t_s",
     "bias",
     true,
     {{"b", "g"}, {.name = "mean", .unit = "s", .min = 0.1}},
     make<Popcorn>},
    {"own.dielectric_absorption",
     "c*(a_i at the previous pose - a_i)/(1+(t-t_arrival)/tau)",
     "t_in_pose",
     "sample",
     true,
     {{"c", "1"}, {.name = "tau", .unit = "s", .min = 1e-6}},
     dielectric_absorption},
};

}  // namespace

std::span<const EffectInfo> own_electronics_effects() { return kOwnElectronicsEffects; }

}  // namespace plumbline::sim
