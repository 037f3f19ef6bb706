// Every effect: nothing at zero amplitude, and its response against numbers worked out by hand.
#include "rig/sim/effects/effect.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <set>

#include "rig/sim/record.h"
#include "tests/sim/sim_rig.h"

namespace plumbline::sim {
namespace {

constexpr std::array<double, 3> kNominal = {0.4330127019, -0.75, 0.5};  // δ = 60°, h = 30°

std::array<double, 3> operator+(std::array<double, 3> a, const std::array<double, 3>& b) {
  for (std::size_t i = 0; i < 3; ++i) a[i] += b[i];
  return a;
}

std::string effect(const std::string& keys) { return "[[effects]]\n" + keys + "\n"; }

/// First reading at δ = 60°, h = 30° with one effect, arrived at t = 0 as the first pose.
std::array<double, 3> reading_with(const std::string& keys) {
  PlainUnit unit(effect(keys));
  unit.go(0, 60, 30);
  return unit.reading_g();
}

// --- the whole catalogue -------------------------------------------------------------------------

/// Values under which an effect does nothing (where that is not: first parameter 0) and something.
const std::map<std::string, double> kOtherParameters = {
    {"tau", 10},   {"t0", 5},         {"n", 5},        {"pose", 1},   {"f", 7},
    {"period", 9}, {"at", -2.495},    {"width", 15},   {"knee", 5.1}, {"mean", 3},
    {"duty", 0.5}, {"threshold", 45}, {"duration", 2}, {"bit", 3},    {"value", 0}};

EffectSetting setting(const EffectInfo& info, double amplitude) {
  EffectSetting result;
  result.id = info.id;
  result.axes = {0, 1, 2};
  result.poses = {1};
  for (const ParameterInfo& p : info.parameters) {
    const auto other = kOtherParameters.find(p.name);
    result.parameters[p.name] = other == kOtherParameters.end() ? amplitude : other->second;
  }
  if (result.id == "sensor.saturation") result.parameters["L"] = amplitude == 0 ? 10 : 0.3;
  if (result.id == "own.inl_ripple") result.parameters["period"] = 0.01;
  return result;
}

RecordedSet recorded(const EffectSetting& effect) {
  World world = world_of(R"(
[noise]
N = 1e-6
[room]
wander_C = 1
self_heating_C = 2
rh_wander_pct = 1
supply_wander_V = 0.05
)");
  world.effects = {effect};
  RecordOptions options;
  options.grid = {{0, 300, 60}, {0, 80, 40}};
  options.soak_s = 1;
  options.samples_per_pose = 5;
  options.verification_poses = 0;
  return record_set(world, options);
}

TEST(EffectCatalogue, ZeroAmplitudeChangesNoCodeAndOtherAmplitudesDo) {
  const World plain_world = world_of("");
  for (const EffectInfo* info : effect_catalogue()) {
    if (std::string(info->id) == "adc.stuck_bit") continue;  // has no neutral value
    EffectSetting off = setting(*info, 0);
    if (off.id == "rig.pose_outlier") off.parameters["delta"] = 0;
    const RecordedSet without = recorded(off);
    EXPECT_EQ(without.truth.poses.before, without.truth.poses.oracle) << info->id;
    const RecordedSet with = recorded(setting(*info, 0.01));
    EXPECT_NE(with.run.samples.u_V, without.run.samples.u_V) << info->id;
    EXPECT_EQ(with.truth.poses.oracle, without.truth.poses.oracle)
        << info->id << ": the same noise stands beside the effect";
  }
}

TEST(EffectCatalogue, HasEveryListedEffectAndManyOfItsOwn) {
  std::set<std::string> ids;
  std::size_t own = 0;
  for (const EffectInfo* info : effect_catalogue()) {
    EXPECT_TRUE(ids.insert(info->id).second) << info->id << " twice";
    own += std::string(info->id).starts_with("own.") ? 1 : 0;
    EXPECT_FALSE(info->parameters.empty()) << info->id;
    for (const ParameterInfo& p : info->parameters) EXPECT_STRNE(p.unit, "") << info->id;
  }
  for (const char* id : {"sensor.quadratic",
                         "sensor.cubic",
                         "sensor.asymmetry",
                         "sensor.cross_product",
                         "sensor.hysteresis",
                         "sensor.temperature_bias",
                         "sensor.temperature_scale",
                         "sensor.warmup",
                         "sensor.drift",
                         "sensor.scale_drift",
                         "sensor.bias_step",
                         "sensor.settling",
                         "sensor.dead_zone",
                         "sensor.saturation",
                         "adc.quantization",
                         "adc.code_step",
                         "adc.stuck_bit",
                         "adc.mains_pickup",
                         "rig.base_roll",
                         "rig.tilt_index",
                         "rig.axis_skew",
                         "rig.delta_eccentricity",
                         "rig.delta_ellipticity",
                         "rig.delta_periodic",
                         "rig.h_scale",
                         "rig.h_eccentricity",
                         "rig.backlash",
                         "rig.index_slip",
                         "rig.pose_outlier",
                         "env.base_field",
                         "covariate:rh_pct",
                         "covariate:supply_V",
                         "covariate:motor_A",
                         "covariate:temp_C"}) {
    EXPECT_TRUE(ids.contains(id)) << id;
  }
  EXPECT_GE(own, 16U);
}

TEST(EffectCatalogue, IsDocumentedWithEveryParameter) {
  std::ifstream file(PLUMBLINE_SOURCE_DIR "/rig/sim/worlds/README.md");
  std::map<std::string, std::string> row_of;  // by the id that starts the row
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("| `")) row_of[line.substr(3, line.find('`', 3) - 3)] = line;
  }
  for (const EffectInfo* info : effect_catalogue()) {
    ASSERT_TRUE(row_of.contains(info->id)) << info->id;
    for (const ParameterInfo& p : info->parameters) {
      EXPECT_THAT(row_of[info->id], ::testing::HasSubstr(std::string("`") + p.name + "`"));
    }
  }
}

TEST(EffectCatalogue, ActsOnTheNamedAxesOnly) {
  expect_g(reading_with("id = 'sensor.quadratic'\naxes = ['y']\nk2 = 0.1"),
           kNominal + std::array{0.0, 0.05625, 0.0});
}

TEST(EffectCatalogue, TermsAreInputReferredWhateverTheSignOfTheAxis) {
  World world = world_of(effect("id = 'sensor.drift'\nd = 3600"));  // 1 g/s
  world.triad.K_V_per_g[2][2] = -0.03;
  Unit unit(world, 1);
  unit.jump_to_pose({1, 60, 30, 0, 0});
  unit.next(resting(60, 30));
  EXPECT_NEAR(unit.truth().noiseless_V[2], -2.5 - 0.03 * (0.5 + 1), 1e-9);
}

// --- sensor --------------------------------------------------------------------------------------

TEST(SensorEffects, FunctionsOfTheForce) {
  expect_g(reading_with("id = 'sensor.quadratic'\nk2 = 0.1"),
           kNominal + std::array{0.01875, 0.05625, 0.025});
  expect_g(reading_with("id = 'sensor.cubic'\nk3 = 0.1"),
           kNominal + std::array{0.00811898816, -0.0421875, 0.0125});
  expect_g(reading_with("id = 'sensor.asymmetry'\nka = 0.1"),
           kNominal + std::array{0.04330127019, 0.075, 0.05});
  // a_x·a_y = −0.3247595264, a_x·a_z = 0.2165063509, a_y·a_z = −0.375
  expect_g(reading_with("id = 'sensor.cross_product'\naxes = ['x']\nk_xy = 0.1"),
           kNominal + std::array{-0.03247595264, 0.0, 0.0});
  expect_g(reading_with("id = 'sensor.cross_product'\naxes = ['z']\nk_xz = 0.1\nk_yz = 0.2"),
           kNominal + std::array{0.0, 0.0, 0.02165063509 - 0.075});
  expect_g(reading_with("id = 'sensor.dead_zone'\nw = 0.45"), {0, -0.3, 0.05});
  expect_g(reading_with("id = 'sensor.saturation'\nL = 0.6"), {0.4330127019, -0.6, 0.5});
}

TEST(SensorEffects, HysteresisFollowsTheChangeOfEachComponent) {
  PlainUnit unit(effect("id = 'sensor.hysteresis'\nw = 0.02"));
  unit.go(0, 60, 30);
  expect_g(unit.reading_g(), kNominal);  // nothing came before
  unit.go(5, 60, 60);  // a_x 0.433 → 0.25, a_y −0.75 → −0.433, a_z 0.5 → 0.866
  expect_g(unit.reading_g(), {0.25 - 0.01, -0.4330127019 + 0.01, 0.8660254038 + 0.01});
  unit.go(10, 300, 60);  // a_x and a_z as before, a_y changes sign
  expect_g(unit.reading_g(), {0.25, 0.4330127019 + 0.01, 0.8660254038});
}

TEST(SensorEffects, Temperature) {  // T − T₀ = 2 K
  expect_g(reading_with("id = 'sensor.temperature_bias'\nb1 = 0.01"),
           kNominal + std::array{0.02, 0.02, 0.02});
  expect_g(reading_with("id = 'sensor.temperature_scale'\ns1 = 0.01"),
           {0.4330127019 * 1.02, -0.75 * 1.02, 0.5 * 1.02});
}

TEST(SensorEffects, Time) {
  const auto after_half_an_hour = [](const std::string& keys) {
    PlainUnit unit(effect(keys));
    unit.go(1800, 60, 30);
    return unit.reading_g();
  };
  expect_g(after_half_an_hour("id = 'sensor.drift'\nd = 0.02"),
           kNominal + std::array{0.01, 0.01, 0.01});
  expect_g(after_half_an_hour("id = 'sensor.scale_drift'\ns = 0.02"),
           {0.4330127019 * 1.01, -0.75 * 1.01, 0.5 * 1.01});
  expect_g(after_half_an_hour("id = 'sensor.warmup'\nb = 0.1\ntau = 1800"),
           kNominal + std::array{0.03678794412, 0.03678794412, 0.03678794412});
  expect_g(after_half_an_hour("id = 'sensor.bias_step'\nb = 0.1\nt0 = 1801"), kNominal);
  expect_g(after_half_an_hour("id = 'sensor.bias_step'\nb = 0.1\nt0 = 1800"),
           kNominal + std::array{0.1, 0.1, 0.1});
}

TEST(SensorEffects, SettlingDecaysFromThePreviousPose) {
  PlainUnit unit(effect("id = 'sensor.settling'\nc = 0.1\ntau = 0.5"));
  unit.go(0, 0, 0);  // a = (1, 0, 0)
  unit.reading_g();
  unit.go(5, 60, 30);
  expect_g(unit.reading_g(), kNominal + std::array{0.05669872981, 0.075, -0.05});
  expect_g(unit.reading_g(5.5), kNominal + std::array{0.05669872981 * 0.3678794412,
                                                      0.075 * 0.3678794412, -0.05 * 0.3678794412});
}

// A sensor feels where the head really stood, whatever it was told.
TEST(SensorEffects, MemoryIsOfTheTrueAttitude) {
  PlainUnit unit(effect("id = 'sensor.settling'\nc = 0.1\ntau = 0.5") +
                 effect("id = 'rig.delta_eccentricity'\nc = 30"));  // δ += 30°·cos δ
  unit.go(0, 0, 0);  // in truth δ = 30°: a = (0.8660254, −0.5, 0)
  unit.reading_g();
  unit.go(5, 60, 30);  // in truth δ = 75°: a = (0.2241439, −0.8365163, 0.5)
  expect_g(unit.reading_g(), {0.2241438680 + 0.06418815357, -0.8365163037 + 0.03365163037, 0.45});
}

// --- electronics ---------------------------------------------------------------------------------

std::array<std::int32_t, 3> codes_with(const std::string& keys, int bits, double u_x_V) {
  World world = world_of(keys.empty() ? "" : effect(keys));
  world.adc.bits = bits;
  world.triad.K_V_per_g[0] = {0.03, 0, 0};
  world.triad.U0_V = {u_x_V - 0.03, -2.5, -2.5};
  Unit unit(world, 1);
  unit.jump_to_pose({0, 0, 0, 0, 0});
  return unit.next(resting(0, 0)).code;
}

TEST(ElectronicsEffects, Codes) {
  // 12 bits over 5 V: 1 code = 1.220703125 mV, −2.49 V is code 8.19 from the middle.
  EXPECT_EQ(codes_with("", 12, -2.49)[0], 8);
  EXPECT_EQ(codes_with("id = 'adc.stuck_bit'\nbit = 0\nvalue = 1", 12, -2.49)[0], 9);
  EXPECT_EQ(codes_with("id = 'adc.stuck_bit'\nbit = 3\nvalue = 0", 12, -2.49)[0], 0);
  // −2.51 V is code −8 = …11111000: bit 3 is set, bit 0 is not.
  EXPECT_EQ(codes_with("id = 'adc.stuck_bit'\nbit = 0\nvalue = 1", 12, -2.51)[0], -7);
  EXPECT_EQ(codes_with("id = 'adc.stuck_bit'\nbit = 3\nvalue = 0", 12, -2.51)[0], -16);
  // The sign bit held at 1 makes 8 − 2048 of 8.
  EXPECT_EQ(codes_with("id = 'adc.stuck_bit'\nbit = 11\nvalue = 1", 12, -2.49)[0], -2040);
  // Rounded to steps of 4 mV first: −2.49 V → 8 or 12 mV from the middle → 8 mV = 6.55 codes.
  EXPECT_EQ(codes_with("id = 'adc.quantization'\nlsb = 0.004", 12, -2.491)[0], 7);
  // ±3 mV on either side of −2.5 V: 10 + 3 mV = 10.65, −10 − 3 mV = −10.65 codes.
  EXPECT_EQ(codes_with("id = 'adc.code_step'\nc = 0.003\nat = -2.5", 12, -2.49)[0], 11);
  EXPECT_EQ(codes_with("id = 'adc.code_step'\nc = 0.003\nat = -2.5", 12, -2.51)[0], -11);
}

TEST(ElectronicsEffects, MainsPickupIsInEverySample) {
  PlainUnit unit(effect("id = 'adc.mains_pickup'\namplitude = 0.01\nf = 5\nphase = 30"));
  unit.go(0, 60, 30);
  expect_g(unit.reading_g(0), kNominal + std::array{0.005, 0.005, 0.005});
  // 2π·5·0.05 + 30° = 120°
  expect_g(unit.reading_g(0.05),
           kNominal + std::array{0.00866025404, 0.00866025404, 0.00866025404});
}

// --- head and room -------------------------------------------------------------------------------

TEST(HeadEffects, Angles) {
  expect_g(reading_with("id = 'rig.base_roll'\nepsilon = 1"),
           {0.4178325246, -0.7586119746, 0.4999238476});
  expect_g(reading_with("id = 'rig.tilt_index'\nepsilon = 1"),
           {0.4285836504, -0.7423286577, 0.5150380749});
  expect_g(reading_with("id = 'rig.axis_skew'\neta = 1"),
           {0.4405698156, -0.7456368984, 0.4999238476});
  expect_g(reading_with("id = 'rig.delta_eccentricity'\nc = 1\ns = 0.5"),
           {0.4207427235, -0.7569514916, 0.5});
  expect_g(reading_with("id = 'rig.delta_ellipticity'\nc = 1\ns = 0.5"),
           {0.4338892674, -0.7494932312, 0.5});
  expect_g(reading_with("id = 'rig.delta_periodic'\nc = 1\ns = 0.5\nn = 5"),
           {0.4321355445, -0.7505057436, 0.5});
  expect_g(reading_with("id = 'rig.h_scale'\nk = 0.02"),
           {0.4303710135, -0.7454244615, 0.5090414158});
  expect_g(reading_with("id = 'rig.h_eccentricity'\nc = 1\ns = 0.5"),
           {0.4280612894, -0.7414239020, 0.5167728032});
}

TEST(HeadEffects, DependOnHowAndWhenThePoseWasReached) {
  PlainUnit backlash(effect("id = 'rig.backlash'\nw = 2"));
  backlash.go(0, 60, 30, +1);
  expect_g(backlash.reading_g(), {0.4198574471, -0.7574428850, 0.5});
  backlash.go(5, 60, 30, 0);  // only h was moved meanwhile: the play stays where it is
  expect_g(backlash.reading_g(), {0.4198574471, -0.7574428850, 0.5});
  backlash.go(10, 60, 30, -1);
  expect_g(backlash.reading_g(), {0.4460360568, -0.7423286577, 0.5});

  PlainUnit slip(effect("id = 'rig.index_slip'\nepsilon = 1\npose = 1"));
  slip.go(0, 60, 30);
  expect_g(slip.reading_g(), kNominal);
  slip.go(5, 60, 30);
  expect_g(slip.reading_g(), {0.4198574471, -0.7574428850, 0.5});
  slip.go(10, 60, 30);
  expect_g(slip.reading_g(), {0.4198574471, -0.7574428850, 0.5});

  PlainUnit outlier(effect("id = 'rig.pose_outlier'\ndelta = 1\nposes = [1]"));
  outlier.go(0, 60, 30);
  expect_g(outlier.reading_g(), kNominal);
  outlier.go(5, 60, 30);
  expect_g(outlier.reading_g(), {0.4198574471, -0.7574428850, 0.5});
  outlier.go(10, 60, 30);
  expect_g(outlier.reading_g(), kNominal);
}

TEST(RoomEffects, FieldAndColumns) {
  // x_b = (−0.25, 0.433, 0.866), y_b = (−0.866, −0.5, 0) in the sensor frame
  expect_g(reading_with("id = 'env.base_field'\nm1 = 0.1\nm2 = 0.01"),
           kNominal + std::array{-0.025 - 0.008660254038, 0.04330127019 - 0.005, 0.08660254038});
  // motor: 0.2 + 0.15·cos 30° at rest, mean 0.275 A
  const double excess_A = 0.2 + 0.15 * 0.8660254038 - 0.275;
  expect_g(reading_with("id = 'covariate:motor_A'\nc = 0.1"),
           kNominal + std::array{0.1 * excess_A, 0.1 * excess_A, 0.1 * excess_A});
  expect_g(reading_with("id = 'covariate:motor_A'\nc = 0.1\nform = 'scale'"),
           {0.4330127019 * (1 + 0.1 * excess_A), -0.75 * (1 + 0.1 * excess_A),
            0.5 * (1 + 0.1 * excess_A)});
}

// --- effects of our own --------------------------------------------------------------------------

TEST(OwnEffects, Geometry) {
  expect_g(reading_with("id = 'own.cable_pull'\nc = 1"),  // h − 2/3°
           {0.4358922068, -0.7549874489, 0.4898897182});
  expect_g(reading_with("id = 'own.worn_tooth'\nc = 1\nat = 50\nwidth = 10"),  // δ + e^−½
           {0.4250491204, -0.7545417452, 0.5});
  expect_g(reading_with("id = 'own.wheel_arms'\nc = 1\narms = 3"),  // half way: δ + 1°
           {0.4198574471, -0.7574428850, 0.5});
  expect_g(reading_with("id = 'own.frame_twist'\nc = 1"),  // sin 90°
           reading_with("id = 'rig.base_roll'\nepsilon = 1"));
  PlainUnit sag(effect("id = 'own.brake_sag'\nc = 1\ntau = 2"));
  sag.go(0, 60, 30);
  expect_g(sag.reading_g(0), kNominal);
  expect_g(sag.reading_g(1), {0.4344918570, -0.7525619718, 0.4948406862});
}

TEST(OwnEffects, Temperature) {  // T − T₀ = 2 K
  expect_g(reading_with("id = 'own.thermal_twist'\nc = 0.01"),
           kNominal + std::array{-0.015, 0.01, 0.008660254038});
  expect_g(reading_with("id = 'own.thermal_drag'\nb = 0.01\nwidth = 1"),
           kNominal + std::array{0.02, 0.02, 0.02});
  // Self-heating by 1 − e^−1 of 10 K after 100 s, air at 22 °C; a_x·a_z = 0.2165
  PlainUnit chimney("[room]\nself_heating_C = 10\nself_heating_tau_s = 100\n" +
                    effect("id = 'own.chimney'\naxes = ['x']\nb = 0.01"));
  chimney.go(100, 60, 30);
  expect_g(chimney.reading_g(), kNominal + std::array{0.01 * 6.321205588 * 0.2165063509, 0.0, 0.0});
}

TEST(OwnEffects, WhatAMoveSetsOff) {
  PlainUnit ringing(effect("id = 'own.ringing'\naxes = ['x']\nc = 0.1\ntau = 0.5\nf = 1"));
  ringing.go(0, 0, 0);
  expect_g(ringing.reading_g(), {1, 0, 0});
  ringing.go(10, 90, 0);  // a_x from 1 to 0
  expect_g(ringing.reading_g(10), {0.1, -1, 0});
  expect_g(ringing.reading_g(10.5), {-0.03678794412, -1, 0});  // half a turn and a time constant
}

TEST(OwnEffects, MemoryOfEarlierPoses) {
  PlainUnit stiction(effect("id = 'own.stiction'\naxes = ['z']\nfriction = 0.01"));
  stiction.go(0, 0, 0);
  expect_g(stiction.reading_g(), {1, 0, 0});
  stiction.go(5, 0, 30);  // a_z rises to 0.5, follows 0.01 behind
  expect_g(stiction.reading_g(), {0.8660254038, 0, 0.49});
  stiction.go(10, 0, 29.5);  // a_z = 0.4924235601: within the play
  expect_g(stiction.reading_g(), {0.8703556959, 0, 0.49});

  PlainUnit creep(effect("id = 'own.creep'\naxes = ['x']\nc = 0.1\ntau = 10"));
  creep.go(0, 0, 0);
  expect_g(creep.reading_g(), {1, 0, 0});
  creep.go(100, 90, 0);  // the memory still is 1
  expect_g(creep.reading_g(), {0.1, -1, 0});
  // 10 s later e^−1 of it is left.
  expect_g(creep.reading_g(110), {0.03678794412, -1, 0});
}

TEST(OwnEffects, SupplyAndHumidity) {
  // Supply 5 V − 1 V/A · 0.3299 A
  const double supply_V = 5 - (0.2 + 0.15 * 0.8660254038);
  const double factor = 1 - 0.5 * (supply_V / 5 - 1);
  expect_g(reading_with("id = 'own.ratiometric'\nc = 0.5\n[room]\nsupply_drop_V_per_A = 1"),
           {0.4330127019 * factor, -0.75 * factor, 0.5 * factor});
  const double below_V = 4.8 - supply_V;
  expect_g(
      reading_with(
          "id = 'own.regulator_dropout'\nb = 0.1\nknee = 4.8\n[room]\nsupply_drop_V_per_A = 1"),
      kNominal + std::array{0.1 * below_V, 0.1 * below_V, 0.1 * below_V});
  expect_g(reading_with("id = 'own.condensation'\nb = 0.1\nthreshold = 45"),
           kNominal + std::array{0.05, 0.05, 0.05});
}

TEST(OwnEffects, Time) {
  PlainUnit compressor(effect("id = 'own.compressor'\nb = 0.1\nperiod = 10\nduty = 0.3"));
  compressor.go(0, 60, 30);
  expect_g(compressor.reading_g(2.9), kNominal + std::array{0.1, 0.1, 0.1});
  expect_g(compressor.reading_g(3.1), kNominal);
  expect_g(compressor.reading_g(12), kNominal + std::array{0.1, 0.1, 0.1});

  PlainUnit floor(effect("id = 'own.floor_tilt'\nc = 1\nperiod = 40"));
  floor.go(0, 60, 30);
  expect_g(floor.reading_g(10), {0.4178325246, -0.7586119746, 0.4999238476});
}

}  // namespace
}  // namespace plumbline::sim
