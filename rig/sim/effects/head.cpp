// Listed effects of the dividing head.
#include <algorithm>

#include "rig/sim/effects/effect.h"
#include "rig/sim/effects/terms.h"

namespace plumbline::sim {

namespace {

/// A constant error: `amount` is added to one member of HeadErrors.
std::unique_ptr<Effect> constant_error(double HeadErrors::*member, double amount) {
  return head_term(
      [member, amount](const Moment&, HeadErrors& errors) { errors.*member += amount; });
}

std::unique_ptr<Effect> harmonic_error(double HeadErrors::*cosine, double HeadErrors::*sine,
                                       const EffectContext& p) {
  return head_term([cosine, sine, c = p("c"), s = p("s")](const Moment&, HeadErrors& errors) {
    errors.*cosine += c;
    errors.*sine += s;
  });
}

std::unique_ptr<Effect> base_roll(const EffectContext& p) {
  return constant_error(&HeadErrors::base_roll_deg, p("epsilon"));
}
std::unique_ptr<Effect> tilt_index(const EffectContext& p) {
  return constant_error(&HeadErrors::h_index_deg, p("epsilon"));
}
std::unique_ptr<Effect> axis_skew(const EffectContext& p) {
  return constant_error(&HeadErrors::axis_skew_deg, p("eta"));
}
std::unique_ptr<Effect> h_scale(const EffectContext& p) {
  return constant_error(&HeadErrors::h_scale, p("k"));
}
std::unique_ptr<Effect> backlash(const EffectContext& p) {
  return constant_error(&HeadErrors::backlash_deg, p("w"));
}
std::unique_ptr<Effect> delta_eccentricity(const EffectContext& p) {
  return harmonic_error(&HeadErrors::delta_eccentricity_c_deg,
                        &HeadErrors::delta_eccentricity_s_deg, p);
}
std::unique_ptr<Effect> delta_ellipticity(const EffectContext& p) {
  return harmonic_error(&HeadErrors::delta_ellipticity_c_deg, &HeadErrors::delta_ellipticity_s_deg,
                        p);
}
std::unique_ptr<Effect> h_eccentricity(const EffectContext& p) {
  return harmonic_error(&HeadErrors::h_eccentricity_c_deg, &HeadErrors::h_eccentricity_s_deg, p);
}

std::unique_ptr<Effect> delta_periodic(const EffectContext& p) {
  return head_term([n = p("n"), c = p("c"), s = p("s")](const Moment& now, HeadErrors& errors) {
    errors.delta_index_deg += c * cos_deg(n * now.delta_deg) + s * sin_deg(n * now.delta_deg);
  });
}

std::unique_ptr<Effect> index_slip(const EffectContext& p) {
  return head_term(
      [epsilon = p("epsilon"), pose = p("pose")](const Moment& now, HeadErrors& errors) {
        if (static_cast<double>(now.pose) >= pose) errors.delta_index_deg += epsilon;
      });
}

std::unique_ptr<Effect> pose_outlier(const EffectContext& p) {
  return head_term([poses = p.setting.poses, delta = p("delta"), h = p("h")](const Moment& now,
                                                                             HeadErrors& errors) {
    if (std::find(poses.begin(), poses.end(), now.pose) == poses.end()) return;
    errors.delta_index_deg += delta;
    errors.h_index_deg += h;
  });
}

const EffectInfo kHeadEffects[] = {
    {"rig.base_roll",
     "base turned about x_b by epsilon",
     "delta_deg",
     "geometry",
     false,
     {{"epsilon", "deg"}},
     base_roll},
    {"rig.tilt_index",
     "h += epsilon",
     "h_deg",
     "geometry",
     false,
     {{"epsilon", "deg"}},
     tilt_index},
    {"rig.axis_skew",
     "spindle out of the perpendicular to the tilt axis by eta",
     "h_deg",
     "geometry",
     false,
     {{"eta", "deg"}},
     axis_skew},
    {"rig.delta_eccentricity",
     "delta += c*cos(delta) + s*sin(delta)",
     "delta_deg",
     "geometry",
     false,
     {{"c", "deg", false}, {"s", "deg", false}},
     delta_eccentricity},
    {"rig.delta_ellipticity",
     "delta += c*cos(2*delta) + s*sin(2*delta)",
     "delta_deg",
     "geometry",
     false,
     {{"c", "deg", false}, {"s", "deg", false}},
     delta_ellipticity},
    {"rig.delta_periodic",
     "delta += c*cos(n*delta) + s*sin(n*delta)",
     "delta_deg",
     "geometry",
     false,
     {{"c", "deg", false}, {"s", "deg", false}, {"n", "1"}},
     delta_periodic},
    {"rig.h_scale", "h = h*(1+k)", "h_deg", "geometry", false, {{"k", "1"}}, h_scale},
    {"rig.h_eccentricity",
     "h += c*cos(h) + s*sin(h)",
     "h_deg",
     "geometry",
     false,
     {{"c", "deg", false}, {"s", "deg", false}},
     h_eccentricity},
    {"rig.backlash",
     "delta += +-w/2 by the direction in which delta was approached",
     "previous_pose",
     "geometry",
     false,
     {{"w", "deg"}},
     backlash},
    {"rig.index_slip",
     "delta += epsilon from one pose on",
     "t_s",
     "geometry",
     false,
     {{"epsilon", "deg"}, {"pose", "1"}},
     index_slip},
    {"rig.pose_outlier",
     "delta and h wrong at the listed poses",
     "t_s",
     "geometry",
     false,
     {{"delta", "deg", false, 5.0}, {"h", "deg", false}},
     pose_outlier},
};

}  // namespace

std::span<const EffectInfo> head_effects() { return kHeadEffects; }

}  // namespace plumbline::sim
