// Effects: what a real unit, its electronics, the head and the room do beyond the 12 parameters.
//
// An effect overrides those stages of the signal path that it disturbs. The path of one sample:
//
//   head errors ─► gravity in the sensor frame ─► response K·a + U0 ─► + K_ii·[input-referred
//   terms]
//     bend_head()                                                        sensor()
//   ─► + noise · factor ─► converter input ─► code
//        noise_factor()    convert()          encode()
//
// Effects see the same instant independently of one another: their terms add.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "rig/sim/head_errors.h"
#include "rig/sim/world.h"

namespace plumbline::sim {

/// What an effect may look at, at the instant of one sample (or between samples, while time
/// passes).
struct Moment {
  double t_s = 0;
  double dt_s = 0;  ///< since the previous instant

  double delta_deg = 0;  ///< angles that the drives have turned to, errors of the head not included
  double h_deg = 0;
  double delta_speed_deg_s = 0;
  double h_speed_deg_s = 0;
  bool moving = false;
  int approach = 0;           ///< direction of the last δ motion: −1, +1, 0 before the first
  long long pose = 0;         ///< counts the arrivals at rest; 0 is where the head stands first
  double t_in_pose_s = 0;     ///< since the arrival
  PerAxis<double> a_nominal;  ///< nominal specific force at the angles above, g

  Attitude attitude;           ///< with all head errors; filled in after bend_head()
  PerAxis<double> a;           ///< true specific force in the sensor frame, g; likewise
  PerAxis<double> a_previous;  ///< the same when the head left the previous pose; first pose: a

  double air_C = 0;   ///< of the room
  double temp_C = 0;  ///< of the sensor
  double rh_pct = 0;
  double supply_V = 0;
  double motor_A = 0;
};

/// One effect at work. Stages left alone do nothing.
class Effect {
 public:
  virtual ~Effect() = default;
  /// Lets the effect's memory follow the world; called once for each instant, before all others.
  virtual void observe(const Moment& /*now*/) {}
  virtual void bend_head(const Moment& /*now*/, HeadErrors& /*errors*/) {}
  /// Input-referred term of one axis, g.
  virtual double sensor_g(const Moment& /*now*/, std::size_t /*axis*/) { return 0; }
  /// Multiplies the noise of one axis.
  virtual double noise_factor(const Moment& /*now*/, std::size_t /*axis*/) { return 1; }
  /// Voltage at the converter, noise included, before it is rounded.
  virtual double convert_V(const Moment& /*now*/, std::size_t /*axis*/, double u_V) { return u_V; }
  virtual std::int32_t encode(const Moment& /*now*/, std::size_t /*axis*/, std::int32_t code) {
    return code;
  }
};

/// One parameter of an effect, as the world file names it.
struct ParameterInfo {
  const char* name;
  const char* unit;
  bool required = true;
  double fallback = 0;  ///< when not required
  double min = -1e9;
  double max = 1e9;
};

/// What an effect is made from.
struct EffectContext {
  const EffectSetting& setting;
  const World& world;
  const Triad& triad;
  std::uint64_t seed = 0;

  double operator()(const char* parameter) const { return setting.parameters.at(parameter); }
};

/// An entry of the catalogue. The first parameter is the amplitude: zero switches the effect off.
struct EffectInfo {
  const char* id;
  const char* term;    ///< formula, in the words of the file formats
  const char* driver;  ///< what it follows: a column, `<column>.rate`, `t_s`, `delta_deg` …
  const char* form;    ///< what it changes: bias, scale, geometry, sample
  bool per_axis;       ///< takes `axes`
  std::vector<ParameterInfo> parameters;
  std::unique_ptr<Effect> (*make)(const EffectContext&);
};

/// The families, each in a file of its own.
std::span<const EffectInfo> sensor_effects();       ///< sensor.*
std::span<const EffectInfo> electronics_effects();  ///< adc.*
std::span<const EffectInfo> head_effects();         ///< rig.*
std::span<const EffectInfo> room_effects();         ///< env.*, covariate:<column>
std::span<const EffectInfo> own_sensor_effects();   ///< own.*, not on the list of known effects
std::span<const EffectInfo> own_electronics_effects();
std::span<const EffectInfo> own_head_effects();
std::span<const EffectInfo> own_room_effects();

/// All of them, in the order above.
const std::vector<const EffectInfo*>& effect_catalogue();
/// nullptr when there is none of that id.
const EffectInfo* find_effect(std::string_view id);
/// All [[effects]] of a world, in the order of the file.
std::vector<std::unique_ptr<Effect>> make_effects(const World& world, const Triad& triad,
                                                  std::uint64_t seed);

}  // namespace plumbline::sim
