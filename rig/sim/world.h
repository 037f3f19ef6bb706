// What is simulated: the unit, its electronics, the head, the room. Read from a world file (TOML).
//
// Every key has a default, so an empty file is a valid world: the unit of the paper, ideal in
// everything else. rig/sim/worlds/default.toml shows all keys with explanations.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/measurement.h"
#include "rig/sim/drive_settings.h"
#include "rig/sim/faults.h"
#include "rig/sim/head_errors.h"

namespace plumbline::sim {

/// The 12 parameters: U_i = U0_i + Σ_j K_ij·a_j, axes in the order x, y, z.
struct Triad {
  PerAxis<PerAxis<double>> K_V_per_g = {{{0.032002, -0.0017435, 7.4811e-5},
                                         {0.0022174, 0.031399, 0.00016485},
                                         {-0.00033471, -0.0017407, -0.032812}}};
  PerAxis<double> U0_V = {-2.5865, -2.4363, -2.3423};
};

/// [unit] random = true: another unit of the same make for every seed, normally distributed about
/// the triad given.
struct UnitScatter {
  bool random = false;
  double scale_rel = 0.02;        ///< of the diagonal of K, relative
  double cross_V_per_g = 0.0003;  ///< of the other elements of K
  double bias_V = 0.03;           ///< of U0
};

/// Coefficients of the five noise terms of one output (IEEE Std 952), at the level of samples.
/// All in volts of output; a world file may give them in g, see read_world().
struct NoiseTerms {
  double Q = 0;  ///< quantization noise, V·s
  double N = 0;  ///< velocity random walk, V·√s: standard deviation N·√rate per sample
  double B =
      0;  ///< bias instability, V: PSD (B²/2π)/f between kFlickerLowest_hz (noise.h) and rate/4
  double K = 0;  ///< acceleration random walk, V/√s
  double R = 0;  ///< ramp, V/s: a straight line of slope ±R, sign drawn from the seed
  /// Relaxations (first-order Gauss-Markov processes), one for each time constant, each with this
  /// standard deviation in V: flicker noise of a limited band, as real devices have it.
  double relaxation = 0;
  std::vector<double> relaxation_tau_s = {};
};

/// The room and what it does to the sensor's temperature; the columns recorded beside the outputs.
struct Room {
  double temperature_C = 22;      ///< of the air at t = 0, cycle and wander aside
  double drift_C_per_h = 0;       ///< steady warming of the room
  double cycle_C = 0;             ///< amplitude of a sinusoidal cycle (heating, day and night)
  double cycle_period_s = 86400;  ///< of that cycle
  double cycle_phase_deg = 0;     ///< at t = 0
  double wander_C = 0;            ///< standard deviation of a random wander
  double wander_tau_s = 600;      ///< its correlation time
  double sensor_lag_s = 120;      ///< first-order lag of the sensor behind the air
  double self_heating_C = 0;      ///< final excess of the sensor over the air after power-up
  double self_heating_tau_s = 600;
  double thermometer_noise_C = 0.002;  ///< standard deviation of one reading
  double thermometer_offset_C = 0;

  double rh_pct = 45;  ///< mean relative humidity
  double rh_cycle_pct = 0;
  double rh_cycle_period_s = 7200;
  double rh_wander_pct = 0;
  double rh_wander_tau_s = 900;
  double rh_noise_pct = 0.02;  ///< of one reading

  double supply_V = 5;
  double supply_wander_V = 0;
  double supply_wander_tau_s = 300;
  double supply_cycle_V = 0;  ///< amplitude of a sinusoidal cycle
  double supply_cycle_period_s = 800;
  double supply_drop_V_per_A = 0;  ///< drop under the motors' current
  double supply_noise_V = 0.0001;  ///< of one reading

  double hold_A = 0.2;        ///< motor current at rest
  double lift_A = 0.15;       ///< added at rest by the torque of the raised arm, times cos h
  double move_A = 0.5;        ///< added while an axis moves
  double motor_wander_A = 0;  ///< load that changes with time
  double motor_wander_tau_s = 60;
  double motor_noise_A = 0.04;  ///< of one reading
};

/// Standard deviation of one positioning, drawn anew at every arrival. Encoders do not see it.
struct PositioningScatter {
  double delta_arcsec = 0;
  double h_arcsec = 0;
};

/// One entry of [[effects]]. Which ids exist and what their parameters mean: effects/effect.h.
struct EffectSetting {
  std::string id;                 ///< `sensor.quadratic`, `own.creep`, `covariate:rh_pct` …
  std::vector<std::size_t> axes;  ///< sensor axes it acts on; all three by default
  std::map<std::string, double> parameters;  ///< complete: defaults are filled in when read
  std::vector<long long> poses;              ///< of rig.pose_outlier
  std::string form = "bias";                 ///< of covariate:<column>: "bias" or "scale"
};

struct World {
  std::string name;    ///< of the file, for messages
  std::string source;  ///< its text, for storing with a run; empty for a world made in memory

  std::string serial = "SIM-0001";
  std::string model = "simulated triad";
  Triad triad;
  UnitScatter scatter;

  Adc adc;                                  ///< 12 to 24 bits
  double rate_hz = 100;                     ///< of the node's sample clock
  std::uint32_t node_serial_number = 2718;  ///< 0: the node does not send it
  Gravity gravity{9.81012,
                  0.00002};  ///< local_mps2 is the truth, u_mps2 what the laboratory states
  double reference_C = 20;   ///< T₀ of the temperature effects

  PerAxis<NoiseTerms> noise_V;
  Room room;

  DriveSettings drive;
  HeadErrors head;  ///< geometric errors that every run has, effects or not
  PositioningScatter positioning;

  std::vector<EffectSetting> effects;
  Faults faults;
};

/// Reads a world file. Noise tables [noise] (all axes) and [noise.x], [noise.y], [noise.z] take
/// `unit = "V"` (default) or "g"; the latter is multiplied by |K_ii|. Errors are
/// ErrorCode::input with file, line and column; unknown keys, effects and effect parameters are
/// refused by name.
Result<World> read_world(const std::filesystem::path& path);
/// The same from a text; `name` stands for the file in messages.
Result<World> parse_world(std::string_view text, const std::string& name);

/// The triad that a Unit with this seed has: world.triad, or one drawn about it.
Triad draw_triad(const World& world, std::uint64_t seed);

}  // namespace plumbline::sim
