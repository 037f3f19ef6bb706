// Listed effects of the electronics.
#include <cmath>

#include "rig/sim/effects/effect.h"
#include "rig/sim/effects/terms.h"

namespace plumbline::sim {

namespace {

std::unique_ptr<Effect> quantization(const EffectContext& p) {
  const double mid_V = 0.5 * (p.world.adc.min_V + p.world.adc.max_V);
  return converter_term(p, [lsb = p("lsb"), mid_V](const Moment&, std::size_t, double u_V) {
    return lsb > 0 ? mid_V + lsb * std::nearbyint((u_V - mid_V) / lsb) : u_V;
  });
}

std::unique_ptr<Effect> code_step(const EffectContext& p) {
  return converter_term(p, [c = p("c"), at = p("at")](const Moment&, std::size_t, double u_V) {
    return u_V >= at ? u_V + c : u_V - c;
  });
}

/// One bit of the two's-complement code never changes.
class StuckBit final : public Effect {
 public:
  explicit StuckBit(const EffectContext& p)
      : mask_(axis_mask(p.setting)),
        bits_(p.world.adc.bits),
        bit_(static_cast<unsigned>(p("bit"))),
        value_(p("value") != 0) {}
  std::int32_t encode(const Moment&, std::size_t axis, std::int32_t code) override {
    if (!mask_[axis] || static_cast<int>(bit_) >= bits_) return code;
    auto word = static_cast<std::uint32_t>(code);
    word = value_ ? word | (1U << bit_) : word & ~(1U << bit_);
    const unsigned unused = 32U - static_cast<unsigned>(bits_);
    return static_cast<std::int32_t>(word << unused) >> unused;  // sign-extends the code
  }

 private:
  std::array<bool, 3> mask_;
  int bits_;
  unsigned bit_;
  bool value_;
};

std::unique_ptr<Effect> mains_pickup(const EffectContext& p) {
  return sensor_term(p, [amplitude = p("amplitude"), f = p("f"), phase = p("phase")](
                            const Moment& now, std::size_t) {
    return amplitude * std::sin(kTurn_rad * (f * now.t_s + phase / 360));
  });
}

const EffectInfo kElectronicsEffects[] = {
    {"adc.quantization",
     "rounding to multiples of lsb from mid-span",
     "code_i",
     "bias",
     true,
     {{.name = "lsb", .unit = "V", .min = 0}},
     quantization},
    {"adc.code_step", "c*sign(U-at)", "code_i", "bias", true, {{"c", "V"}, {"at", "V"}}, code_step},
    {"adc.stuck_bit",
     "one bit of the code held at 0 or 1",
     "code_i",
     "bias",
     true,
     {{.name = "bit", .unit = "1", .min = 0, .max = 23},
      {.name = "value", .unit = "1", .min = 0, .max = 1}},
     make<StuckBit>},
    {"adc.mains_pickup",
     "amplitude*sin(2*pi*f*t + phase)",
     "t_s",
     "sample",
     true,
     {{"amplitude", "g"}, {"f", "Hz"}, {"phase", "deg", false}},
     mains_pickup},
};

}  // namespace

std::span<const EffectInfo> electronics_effects() { return kElectronicsEffects; }

}  // namespace plumbline::sim
