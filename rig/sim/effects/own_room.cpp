// Effects of the room that are on no list.
#include <cmath>

#include "rig/sim/effects/effect.h"
#include "rig/sim/effects/terms.h"
#include "rig/sim/random.h"

namespace plumbline::sim {

namespace {

/// The building leans with the sun: the base rolls slowly back and forth.
std::unique_ptr<Effect> floor_tilt(const EffectContext& p) {
  return head_term([c = p("c"), period = p("period"), phase = p("phase")](const Moment& now,
                                                                          HeadErrors& errors) {
    errors.base_roll_deg += c * std::sin(kTurn_rad * (now.t_s / period + phase / 360));
  });
}

/// A compressor next door, on for part of every cycle; nobody records it.
std::unique_ptr<Effect> compressor(const EffectContext& p) {
  return sensor_term(
      p, [b = p("b"), period = p("period"), duty = p("duty")](const Moment& now, std::size_t) {
        return std::fmod(now.t_s, period) < duty * period ? b : 0.0;
      });
}

/// The glue under the sensor takes up water slowly and swells: the scale follows the humidity of
/// the last minutes.
class Swelling final : public Effect {
 public:
  explicit Swelling(const EffectContext& p)
      : mask_(axis_mask(p.setting)), c_(p("c")), mean_(p.world.room.rh_pct), water_(p("tau")) {}
  void observe(const Moment& now) override { water_.next(now.rh_pct, now.dt_s); }
  double sensor_g(const Moment& now, std::size_t axis) override {
    return mask_[axis] ? c_ * (water_.value() - mean_) * now.a[axis] : 0.0;
  }

 private:
  std::array<bool, 3> mask_;
  double c_;
  double mean_;
  Lag water_;
};

/// Condensation: leakage current once the humidity passes a threshold.
std::unique_ptr<Effect> condensation(const EffectContext& p) {
  return sensor_term(p, [b = p("b"), threshold = p("threshold")](const Moment& now, std::size_t) {
    return b / (1 + std::exp(-(now.rh_pct - threshold)));
  });
}

/// Heavy vehicles pass: for some seconds all samples are several times as noisy.
class Traffic final : public Effect {
 public:
  explicit Traffic(const EffectContext& p)
      : k_(p("k")), mean_s_(p("mean")), duration_s_(p("duration")), random_(p.seed, "own.traffic") {
    schedule();
  }
  void observe(const Moment& now) override {
    while (now.t_s >= start_s_ + duration_s_) schedule();
    passing_ = now.t_s >= start_s_;
  }
  double noise_factor(const Moment&, std::size_t) override { return passing_ ? 1 + k_ : 1.0; }

 private:
  void schedule() { start_s_ += duration_s_ - mean_s_ * std::log1p(-random_.uniform()); }

  double k_;
  double mean_s_;
  double duration_s_;
  Random random_;
  double start_s_ = 0;
  bool passing_ = false;
};

/// A fan on the bench: a vibration whose frequency follows the supply and so never stays the same.
class Fan final : public Effect {
 public:
  explicit Fan(const EffectContext& p)
      : mask_(axis_mask(p.setting)),
        amplitude_(p("amplitude")),
        f_hz_(p("f")),
        nominal_V_(p.world.room.supply_V) {}
  void observe(const Moment& now) override {
    phase_ = std::fmod(phase_ + f_hz_ * now.supply_V / nominal_V_ * now.dt_s, 1.0);
  }
  double sensor_g(const Moment&, std::size_t axis) override {
    return mask_[axis] ? amplitude_ * std::sin(kTurn_rad * phase_) : 0.0;
  }

 private:
  std::array<bool, 3> mask_;
  double amplitude_;
  double f_hz_;
  double nominal_V_;
  double phase_ = 0;
};

const ParameterInfo kPeriod{.name = "period", .unit = "s", .min = 1e-3};

const EffectInfo kOwnRoomEffects[] = {
    {"own.floor_tilt",
     "base roll += c*sin(2*pi*t/period + phase)",
     "t_s",
     "geometry",
     false,
     {{"c", "deg"}, kPeriod, {"phase", "deg", false}},
     floor_tilt},
    {"own.compressor",
     "b during the first part `duty` of every period",
     "t_s",
     "bias",
     true,
     {{"b", "g"}, kPeriod, {.name = "duty", .unit = "1", .min = 0, .max = 1}},
     compressor},
    {"own.swelling",
     "c*(rh lagged by tau - mean rh)*a_i",
     "rh_pct",
     "scale",
     true,
     {{"c", "1/%"}, {.name = "tau", .unit = "s", .min = 1e-6}},
     make<Swelling>},
    {"own.condensation",
     "b/(1+exp(-(rh-threshold)/1%))",
     "rh_pct",
     "bias",
     true,
     {{"b", "g"}, {"threshold", "%"}},
     condensation},
    {"own.traffic",
     "noise times 1+k for `duration`, at random, on average every `mean` seconds",
     "t_s",
     "sample",
     false,
     {{.name = "k", .unit = "1", .min = 0},
      {.name = "mean", .unit = "s", .min = 1},
      {.name = "duration", .unit = "s", .min = 0.1}},
     make<Traffic>},
    {"own.fan",
     "amplitude*sin(phase), frequency f*supply/nominal",
     "t_s",
     "sample",
     true,
     {{"amplitude", "g"}, {"f", "Hz"}},
     make<Fan>},
};

}  // namespace

std::span<const EffectInfo> own_room_effects() { return kOwnRoomEffects; }

}  // namespace plumbline::sim
