// Effects that a user describes in a TOML file, without compiling anything.
//
//   [[effect]]
//   name = "cable_drag"                       # reported as user.cable_drag
//   acts_on = "delta"                         # bias, scale, delta, h, roll or skew
//   axes = ["x", "z"]                         # bias and scale only; all three when left out
//   expression = "c * sin(delta_deg * _pi / 180) * (1 - exp(-t_s / tau))"
//   [effect.parameters]
//   c = { start = 0.02, unit = "deg" }        # amplitude: no effect where all amplitudes are zero
//   tau = { starts = [100, 1000], unit = "s", kind = "shape" }   # searched from each of these
//   n = { starts = [2, 3, 4], kind = "index" }                   # takes these values only
//
// The value of the expression (muparser's syntax) is a term in g (bias), a share of the axis's own
// specific force (scale), or an angle in degrees that is added to one of the head (delta, h, roll,
// skew). It may use delta_deg, h_deg, a_x, a_y, a_z (g, ideal head), t_s, t_in_pose, temp_C, pose
// (the number of the visit), every recorded column by its name, the position before with prev_ in
// front (prev_delta_deg, prev_h_deg, prev_a_x, prev_a_y, prev_a_z; at the first pose its own), and
// for bias and scale a and prev_a, the specific force along the axis itself. With t_in_pose it is
// looked for within the dwell, too.
#pragma once

#include <filesystem>
#include <memory>
#include <string_view>
#include <vector>

#include "estimator/effects/effect.h"

namespace plumbline::app {

using OwnEffects = std::vector<std::shared_ptr<const Effect>>;

/// Refused with file, line and column: what StrictTable refuses, an expression that cannot be
/// parsed, an unknown `acts_on`, a name used twice, an effect without an amplitude or one that is
/// not zero when its amplitudes are. `reference_C`: of the run, what temperatures count from.
Result<OwnEffects> read_own_effects(const std::filesystem::path& path, double reference_C);
Result<OwnEffects> parse_own_effects(std::string_view text, const std::string& name,
                                     double reference_C);

/// Refuses an effect that needs a column which the data do not have.
Result<void> check_columns(const OwnEffects& effects, const SampleTable& samples);

/// Both: the effects of a file for these data.
Result<OwnEffects> own_effects_for(const std::filesystem::path& path, double reference_C,
                                   const SampleTable& samples);

}  // namespace plumbline::app
