// Effects of the dividing head that are on no list.
#include <cmath>

#include "rig/sim/effects/effect.h"
#include "rig/sim/effects/terms.h"
#include "rig/sim/random.h"

namespace plumbline::sim {

namespace {

/// The sensor's cable winds up round the spindle and pulls the arm.
std::unique_ptr<Effect> cable_pull(const EffectContext& p) {
  return head_term([c = p("c")](const Moment& now, HeadErrors& errors) {
    errors.h_index_deg += c * (now.delta_deg - 180) / 180;
  });
}

/// A worn tooth of the worm wheel: δ is wrong near one angle only.
std::unique_ptr<Effect> worn_tooth(const EffectContext& p) {
  return head_term(
      [c = p("c"), at = p("at"), width = p("width")](const Moment& now, HeadErrors& errors) {
        const double away = std::remainder(now.delta_deg - at, 360.0) / width;
        errors.delta_index_deg += c * std::exp(-away * away / 2);
      });
}

/// A wheel on a few arms sags between them: δ goes up and down in straight lines with each.
std::unique_ptr<Effect> wheel_arms(const EffectContext& p) {
  return head_term([c = p("c"), arms = p("arms")](const Moment& now, HeadErrors& errors) {
    const double from_arm = std::remainder(arms * now.delta_deg / 360, 1.0);
    errors.delta_index_deg += c * (4 * std::abs(from_arm) - 1);
  });
}

/// A frame that twists as the arm rises: the base rolls with h.
std::unique_ptr<Effect> frame_twist(const EffectContext& p) {
  return head_term([c = p("c")](const Moment& now, HeadErrors& errors) {
    errors.base_roll_deg += c * sin_deg(3 * now.h_deg);
  });
}

/// The brake of the tilt axis gives way after every stop and sinks to its end position.
std::unique_ptr<Effect> brake_sag(const EffectContext& p) {
  return head_term([c = p("c"), tau = p("tau")](const Moment& now, HeadErrors& errors) {
    errors.h_index_deg += c * cos_deg(now.h_deg) * std::expm1(-now.t_in_pose_s / tau);
  });
}

/// The cage of the spindle's bearing turns at 0.4 of the spindle's speed: the axis wobbles with the
/// sum of all turns so far, not with the angle.
class CageWobble final : public Effect {
 public:
  explicit CageWobble(const EffectContext& p) : c_(p("c")) {}
  void observe(const Moment& now) override {
    if (started_) cage_deg_ += 0.4 * (now.delta_deg - last_delta_deg_);
    started_ = true;
    last_delta_deg_ = now.delta_deg;
    lateral_ = sin_deg(cage_deg_);
  }
  void bend_head(const Moment&, HeadErrors& errors) override {
    errors.axis_skew_deg += c_ * lateral_;
    errors.h_index_deg += c_ * cos_deg(cage_deg_);
  }

 private:
  double c_;
  bool started_ = false;
  double last_delta_deg_ = 0;
  double cage_deg_ = 0;
  double lateral_ = 0;
};

/// The tilt axis is clamped anew whenever h has changed, and never twice in the same way.
class ClampScatter final : public Effect {
 public:
  explicit ClampScatter(const EffectContext& p)
      : sigma_deg_(p("sigma")), random_(p.seed, "own.clamp") {}
  void observe(const Moment& now) override {
    if (now.moving) return;
    if (!started_ || std::abs(now.h_deg - clamped_at_deg_) > 0.1) {
      error_deg_ = sigma_deg_ * random_.normal();
      clamped_at_deg_ = now.h_deg;
    }
    started_ = true;
  }
  void bend_head(const Moment&, HeadErrors& errors) override { errors.h_index_deg += error_deg_; }

 private:
  double sigma_deg_;
  Random random_;
  bool started_ = false;
  double clamped_at_deg_ = 0;
  double error_deg_ = 0;
};

/// Motors that hum while they hold: the vibration is rectified by the sensor's second-order term.
std::unique_ptr<Effect> vibration_rectification(const EffectContext& p) {
  return sensor_term(
      p, [b = p("b")](const Moment& now, std::size_t) { return b * now.motor_A * now.motor_A; });
}

/// The raised arm resonates: samples are noisier the further it is up.
class ArmVibration final : public Effect {
 public:
  explicit ArmVibration(const EffectContext& p) : mask_(axis_mask(p.setting)), k_(p("k")) {}
  double noise_factor(const Moment& now, std::size_t axis) override {
    return mask_[axis] ? 1 + k_ * sin_deg(now.h_deg) : 1.0;
  }

 private:
  std::array<bool, 3> mask_;
  double k_;
};

const EffectInfo kOwnHeadEffects[] = {
    {"own.cable_pull",
     "h += c*(delta-180)/180",
     "delta_deg",
     "geometry",
     false,
     {{"c", "deg"}},
     cable_pull},
    {"own.worn_tooth",
     "delta += c*exp(-(delta-at)^2/(2*width^2))",
     "delta_deg",
     "geometry",
     false,
     {{"c", "deg"}, {"at", "deg"}, {.name = "width", .unit = "deg", .min = 1e-3}},
     worn_tooth},
    {"own.wheel_arms",
     "delta += c*(4*distance to the nearest arm, in parts of their spacing, - 1)",
     "delta_deg",
     "geometry",
     false,
     {{"c", "deg"}, {.name = "arms", .unit = "1", .min = 1}},
     wheel_arms},
    {"own.frame_twist",
     "base roll += c*sin(3*h)",
     "h_deg",
     "geometry",
     false,
     {{"c", "deg"}},
     frame_twist},
    {"own.brake_sag",
     "h -= c*cos(h)*(1-exp(-(t-t_arrival)/tau))",
     "t_in_pose",
     "geometry",
     false,
     {{"c", "deg"}, {.name = "tau", .unit = "s", .min = 1e-6}},
     brake_sag},
    {"own.cage_wobble",
     "spindle leans by c in the direction of 0.4 times the sum of all turns",
     "previous_pose",
     "geometry",
     false,
     {{"c", "deg"}},
     make<CageWobble>},
    {"own.clamp_scatter",
     "h += a random angle, drawn anew whenever h has changed",
     "h_deg",
     "geometry",
     false,
     {{.name = "sigma", .unit = "deg", .min = 0}},
     make<ClampScatter>},
    {"own.vibration_rectification",
     "b*motor_A^2",
     "motor_A",
     "bias",
     true,
     {{"b", "g/A^2"}},
     vibration_rectification},
    {"own.arm_vibration",
     "noise times 1 + k*sin(h)",
     "h_deg",
     "sample",
     true,
     {{.name = "k", .unit = "1", .min = 0}},
     make<ArmVibration>},
};

}  // namespace

std::span<const EffectInfo> own_head_effects() { return kOwnHeadEffects; }

}  // namespace plumbline::sim
