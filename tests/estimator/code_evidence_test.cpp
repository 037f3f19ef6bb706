// What codes and samples show by themselves, before anything is fitted.
#include "estimator/effects/code_evidence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "estimator/effects/dwell_line.h"
#include "estimator/effects/visit_log.h"
#include "estimator/pose_means.h"

#include "tests/estimator/synthetic_run.h"

namespace plumbline {
namespace {

// Every code of a stretch, as a slowly swept input gives them.
std::vector<std::int64_t> sweep(double (*reading)(double u_V, double lsb_V)) {
  std::vector<double> u_V;
  const double lsb_V = kSixteenBits.lsb_V();
  for (int k = 0; k < 4000; ++k) u_V.push_back(reading(-2.6 + 2e-5 * k, lsb_V));
  return codes_seen(u_V, kSixteenBits);
}

double rounded(double u_V, double lsb_V) { return -5 + std::round((u_V + 5) / lsb_V) * lsb_V; }

TEST(CodeEvidence, ASoundConverterShowsNothing) {
  const auto codes = sweep(rounded);
  EXPECT_TRUE(stuck_bits(codes, kSixteenBits).empty());
  EXPECT_FALSE(coarser_lattice(codes, kSixteenBits));
}

TEST(CodeEvidence, ABitThatIsAlwaysSetIsNamed) {
  const auto codes = sweep([](double u, double lsb_V) {
    const auto code = std::llround((u + 5) / lsb_V) | (1 << 4);
    return -5 + lsb_V * static_cast<double>(code);
  });
  const auto stuck = stuck_bits(codes, kSixteenBits);
  ASSERT_EQ(stuck.size(), 1u);
  EXPECT_EQ(stuck[0].bit, 4);
  EXPECT_TRUE(stuck[0].value);
}

TEST(CodeEvidence, BitsThatTheRangeDoesNotReachAreNotNamed) {
  // 80 mV are 1049 codes: bit 10 and above cannot show.
  for (const StuckBit& stuck : stuck_bits(sweep(rounded), kSixteenBits)) EXPECT_LT(stuck.bit, 9);
  std::vector<std::int64_t> few = sweep(rounded);
  few.resize(8);
  EXPECT_TRUE(stuck_bits(few, kSixteenBits).empty());
}

TEST(CodeEvidence, AStepThatIsNoMultipleOfTheDeclaredOneIsMeasured) {
  const auto codes = sweep([](double u, double lsb_V) {
    return rounded(-2.5 + std::round((u + 2.5) / 1.684e-3) * 1.684e-3, lsb_V);
  });
  const auto lattice = coarser_lattice(codes, kSixteenBits);
  ASSERT_TRUE(lattice);
  EXPECT_NEAR(lattice->step_V, 1.684e-3, 2e-6);
  // −2.5 V is one of its points, to half a declared step.
  EXPECT_LT(std::abs(std::remainder(-2.5 - lattice->origin_V, lattice->step_V)), 1e-4);
}

TEST(CodeEvidence, AStepThatIsHardlyCoarserIsMeasured) {
  const Adc twelve_bits{12, -5.0, 0.0};
  for (const double step_V : {1.67e-3, 5.63e-3}) {  // 1.37 and 4.6 declared steps
    std::vector<double> u_V;
    for (int k = 0; k < 3000; ++k)
      u_V.push_back(rounded(-2.6 + std::round(2.2e-5 * k / step_V) * step_V, twelve_bits.lsb_V()));
    const auto lattice = coarser_lattice(codes_seen(u_V, twelve_bits), twelve_bits);
    ASSERT_TRUE(lattice) << step_V;
    EXPECT_NEAR(lattice->step_V, step_V, 0.01 * step_V);
    EXPECT_LT(std::abs(std::remainder(-2.6 - lattice->origin_V, lattice->step_V)), 4e-4);
  }
}

// Ten million codes are in reach of one axis, and readings of a few hundred dwells on some of them.
TEST(CodeEvidence, ACoarserStepIsMeasuredAmongTheCodesOfAFineConverter) {
  const Adc declared{24, -5.0, 0.0};
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> level_V(-4, -1);
  std::normal_distribution<double> noise_V(0, 5e-5);
  for (const double step_V : {1.1e-6, 6.2e-6, 2.9e-5}) {  // 3.7, 20.8 and 97 declared steps
    std::vector<double> u_V;
    for (int dwell = 0; dwell < 300; ++dwell) {
      const double at_V = level_V(random);
      for (int m = 0; m < 10; ++m)
        u_V.push_back(rounded(-2.6 + std::round((at_V + noise_V(random) + 2.6) / step_V) * step_V,
                              declared.lsb_V()));
    }
    const auto lattice = coarser_lattice(codes_seen(u_V, declared), declared);
    ASSERT_TRUE(lattice) << step_V;
    EXPECT_NEAR(lattice->step_V, step_V, 1e-6 * step_V);
  }
  std::vector<double> sound_V;
  for (int k = 0; k < 3000; ++k) sound_V.push_back(rounded(level_V(random), declared.lsb_V()));
  EXPECT_FALSE(coarser_lattice(codes_seen(sound_V, declared), declared));
}

// All lattices that give these codes are equally likely: the true one lies among them, as far off
// as is stated.
void expect_known_as_stated(double least_step_V, double most_step_V) {
  const Adc twelve_bits{12, -5.0, 0.0};
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> step_of(least_step_V, most_step_V);
  std::uniform_real_distribution<double> first_of(-2.602, -2.6);
  constexpr int kLattices = 200;
  double sum_first = 0, sum_second = 0, worst = 0;
  for (int k = 0; k < kLattices; ++k) {
    const double step_V = step_of(random), first_V = first_of(random);
    std::vector<double> u_V;
    for (int i = 0; i < 3000; ++i)
      u_V.push_back(
          rounded(first_V + std::round(2.2e-5 * i / step_V) * step_V, twelve_bits.lsb_V()));
    const auto lattice = coarser_lattice(codes_seen(u_V, twelve_bits), twelve_bits);
    ASSERT_TRUE(lattice) << step_V;
    const auto& [both, alone] = lattice->deviation;
    ASSERT_EQ(alone.origin_V, 0);
    const double first = std::remainder(first_V - lattice->origin_V, step_V) / both.origin_V;
    const double second = (step_V - lattice->step_V - first * both.step_V) / alone.step_V;
    sum_first += first * first;
    sum_second += second * second;
    worst = std::max({worst, std::abs(first), std::abs(second)});
  }
  EXPECT_NEAR(sum_first / kLattices, 1, 0.35);
  EXPECT_NEAR(sum_second / kLattices, 1, 0.35);
  EXPECT_LT(worst, 4);
}
TEST(CodeEvidence, StepAndOriginAreKnownAsWellAsIsStated) { expect_known_as_stated(2.6e-3, 6e-3); }
TEST(CodeEvidence, SoAreThoseOfALatticeThatLeavesFewCodesOut) {
  expect_known_as_stated(1.6e-3, 2.4e-3);
}

TEST(CodeEvidence, DwellsThatStepOverCodesProveALatticeOfFewPoints) {
  const Adc twelve_bits{12, -5.0, 0.0};
  const double step_V = 9.04e-3;  // 7.4 declared steps: five points in the range
  std::mt19937_64 random(6);
  std::normal_distribution<double> noise_V(0, 2.5e-4);
  const auto set_of = [&](double rounded_to_V) {
    MeasurementSet set;
    for (int k = 0; k < 300; ++k) {
      set.poses.push_back({k, 0, 0, set.samples.u_V[0].size(), 40});
      for (int m = 0; m < 40; ++m) {
        const double u_V = -2.5 + 1.2e-4 * k + noise_V(random);
        set.samples.u_V[0].push_back(rounded(
            -2.5 + std::round((u_V + 2.5) / rounded_to_V) * rounded_to_V, twelve_bits.lsb_V()));
      }
    }
    return set;
  };
  const MeasurementSet coarse = set_of(step_V), sound = set_of(1e-9);
  const auto codes = codes_seen(coarse.samples.u_V[0], twelve_bits);
  ASSERT_LE(codes.size(), 6U);
  EXPECT_FALSE(coarser_lattice(codes, twelve_bits));
  const auto lattice =
      coarser_lattice(codes, twelve_bits, dwells_over_codes(coarse, 0, twelve_bits));
  ASSERT_TRUE(lattice);
  EXPECT_NEAR(lattice->step_V, step_V, 0.03 * step_V);
  EXPECT_EQ(dwells_over_codes(sound, 0, twelve_bits), 0U);
}

TEST(CodeEvidence, NoiseOfSomeCodesStepsOverNone) {
  // In 50 readings the tails of the noise leave codes out, dwell after dwell.
  std::mt19937_64 random(8);
  std::normal_distribution<double> noise(0, 1.7);
  MeasurementSet set;
  for (int k = 0; k < 324; ++k) {
    set.poses.push_back({k, 0, 0, set.samples.u_V[0].size(), 50});
    for (int m = 0; m < 50; ++m)
      set.samples.u_V[0].push_back(rounded(
          -2.5 + kSixteenBits.lsb_V() * (4 * (k % 5) + noise(random)), kSixteenBits.lsb_V()));
  }
  EXPECT_LE(dwells_over_codes(set, 0, kSixteenBits), 3U);
  EXPECT_FALSE(code_faults(set, 0, kSixteenBits).coarser_lattice);
}

TEST(CodeEvidence, ReadingsMayStateAnyPlaceOfTheirCode) {
  for (const double place : {0.0, 0.37, 0.5}) {
    std::mt19937_64 random(9);
    std::uniform_int_distribution<int> code(30000, 32000);
    SampleTable readings;
    for (int k = 0; k < 3000; ++k)
      for (auto& u_V : readings.u_V)
        // Text of nine decimals.
        u_V.push_back(1e-9 *
                      std::round(1e9 * (-5 + kSixteenBits.lsb_V() * (code(random) + place))));
    const Adc aligned = aligned_with(readings, kSixteenBits);
    EXPECT_NEAR(aligned.min_V, -5 + place * kSixteenBits.lsb_V(), 1e-7);
    EXPECT_NEAR(aligned.lsb_V(), kSixteenBits.lsb_V(), 1e-12);
    EXPECT_EQ(aligned_with(readings, aligned).min_V, aligned.min_V);
    readings.u_V[1].back() = -2.5;  // one of them does not matter
    EXPECT_NEAR(aligned_with(readings, kSixteenBits).min_V, aligned.min_V, 1e-7);
  }
}

TEST(CodeEvidence, ReadingsOfAnotherConverterLeaveItAsDeclared) {
  SampleTable readings;
  for (int k = 0; k < 3000; ++k)
    for (auto& u_V : readings.u_V) u_V.push_back(-2.5 + 1.1e-4 * k);
  EXPECT_EQ(aligned_with(readings, kSixteenBits).min_V, kSixteenBits.min_V);
}

TEST(CodeEvidence, FewCodesOfASoundConverterAreNoLattice) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> u_V(-2.6, -2.53);
  for (int set = 0; set < 20; ++set) {
    std::vector<double> readings;
    for (int k = 0; k < 60; ++k) readings.push_back(rounded(u_V(random), kSixteenBits.lsb_V()));
    EXPECT_FALSE(coarser_lattice(codes_seen(readings, kSixteenBits), kSixteenBits)) << set;
  }
}

TEST(CodeEvidence, LowestBitsAllClearAreACoarserStep) {
  const auto codes = sweep([](double u, double lsb_V) {
    const auto code = std::llround((u + 5) / lsb_V) & ~7LL;
    return -5 + lsb_V * static_cast<double>(code);
  });
  EXPECT_TRUE(stuck_bits(codes, kSixteenBits).empty());
  const auto lattice = coarser_lattice(codes, kSixteenBits);
  ASSERT_TRUE(lattice);
  EXPECT_NEAR(lattice->step_V, 8 * kSixteenBits.lsb_V(), 1e-6);
}

// Poses all over 80 mV with little noise, each code as `fault` makes it.
MeasurementSet poses_with(std::int64_t (*fault)(std::int64_t code)) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise(0, 0.25);
  MeasurementSet set;
  for (int k = 0; k < 300; ++k) {
    set.poses.push_back({k, 0, 0, set.samples.u_V[0].size(), 40});
    const double steps = 1950 + 33 * std::sin(0.37 * k);
    for (int i = 0; i < 40; ++i)
      for (auto& u_V : set.samples.u_V)
        u_V.push_back(-5 + kTwelveBits.lsb_V() *
                               static_cast<double>(fault(std::llround(steps + noise(random)))));
  }
  return set;
}

TEST(CodeFaults, AStuckBitIsNoCoarserStep) {
  for (const auto fault : {+[](std::int64_t code) { return code | 2; },
                           +[](std::int64_t code) { return code & ~std::int64_t{4}; }}) {
    const CodeFaults faults = code_faults(poses_with(fault), 0, kTwelveBits);
    EXPECT_EQ(faults.stuck_bits.size(), 1U);
    EXPECT_FALSE(faults.coarser_lattice);
  }
}

TEST(CodeFaults, ACoarserStepIsNoStuckBit) {
  // Steps of six: bit 0 never changes either.
  const CodeFaults faults =
      code_faults(poses_with([](std::int64_t code) { return (code + 3) / 6 * 6; }), 0, kTwelveBits);
  EXPECT_TRUE(faults.stuck_bits.empty());
  ASSERT_TRUE(faults.coarser_lattice);
  EXPECT_NEAR(faults.coarser_lattice->step_V, 6 * kTwelveBits.lsb_V(), 2e-5);
}

TEST(CodeFaults, TheLowestBitAloneIsAlsoAStepOfTwiceTheSize) {
  const CodeFaults faults =
      code_faults(poses_with([](std::int64_t code) { return code | 1; }), 0, kTwelveBits);
  ASSERT_EQ(faults.stuck_bits.size(), 1U);
  EXPECT_EQ(faults.stuck_bits.front().bit, 0);
  ASSERT_TRUE(faults.coarser_lattice);
  EXPECT_DOUBLE_EQ(faults.coarser_lattice->step_V, 2 * kTwelveBits.lsb_V());
}

TEST(CodeFaults, AHighBitThatFewReadingsCrossIsNamed) {
  // The readings reach seven codes below where bit 6 changes.
  for (const bool value : {false, true}) {
    const CodeFaults faults =
        value ? code_faults(poses_with([](std::int64_t code) { return (code + 60) | 64; }), 0,
                            kTwelveBits)
              : code_faults(
                    poses_with([](std::int64_t code) { return (code - 4) & ~std::int64_t{64}; }), 0,
                    kTwelveBits);
    ASSERT_EQ(faults.stuck_bits.size(), 1U);
    EXPECT_EQ(faults.stuck_bits.front().bit, 6);
    EXPECT_EQ(faults.stuck_bits.front().value, value);
  }
}

TEST(CodeFaults, SpikesOfTheSizeOfABitAreNoStuckBit) {
  MeasurementSet set = poses_with([](std::int64_t code) { return code; });
  for (const std::size_t k : {100U, 5000U, 9000U})
    set.samples.u_V[0][k] -= 70 * kTwelveBits.lsb_V();
  EXPECT_TRUE(code_faults(set, 0, kTwelveBits).stuck_bits.empty());
}

TEST(CodeFaults, ASoundConverterHasNone) {
  const CodeFaults faults =
      code_faults(poses_with([](std::int64_t code) { return code; }), 0, kTwelveBits);
  EXPECT_TRUE(faults.stuck_bits.empty());
  EXPECT_FALSE(faults.coarser_lattice);
}

// 200 dwells of 40 samples of white noise.
MeasurementSet dwells_of_noise(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise_V(0, 3e-4);
  MeasurementSet set;
  for (int k = 0; k < 200; ++k) {
    set.poses.push_back({k, 0, 0, set.samples.u_V[0].size(), 40});
    for (int m = 0; m < 40; ++m)
      for (auto& u_V : set.samples.u_V) u_V.push_back(noise_V(random));
  }
  return set;
}

// Three rings, of which z reads the same all around.
MeasurementSet rings(double lowest_code, double rise_codes, double sd_codes,
                     std::int64_t (*fault)(std::int64_t code)) {
  MeasurementSet set;
  std::mt19937_64 random(10);
  std::normal_distribution<double> noise(0, sd_codes);
  for (int k = 0; k < 108; ++k) {
    const double h_deg = 40.0 * (k / 36);
    set.poses.push_back({k, 10.0 * (k % 36), h_deg, set.samples.t_s.size(), 20});
    for (int m = 0; m < 20; ++m) {
      set.samples.t_s.push_back(5.0 * k + 0.01 * m);
      for (auto& u_V : set.samples.u_V) {
        const double code =
            lowest_code + rise_codes * std::sin(h_deg * std::numbers::pi / 180) + noise(random);
        u_V.push_back(kSixteenBits.min_V +
                      kSixteenBits.lsb_V() * static_cast<double>(fault(std::llround(code))));
      }
    }
  }
  return set;
}
RunDescription of_sixteen_bits() {
  RunDescription description;
  description.adc = kSixteenBits;
  return description;
}

TEST(CodeFaults, ABitThatNothingMissesIsNotStuck) {
  // Three readings, here with one bit alike.
  const MeasurementSet set = rings(29800, 4500, 2, [](std::int64_t code) { return code; });
  EXPECT_FALSE(code_faults(set, 2, kSixteenBits).stuck_bits.empty());
  EXPECT_TRUE(make_visit_log(set, of_sixteen_bits()).codes[2].stuck_bits.empty());
}

// A few readings of one ring lie below the edge of a bit that all others have at its value: the
// means hardly show it, the readings do.
TEST(CodeFaults, ABitThatFewReadingsJumpOverIsStuckAlthoughTheMeansFit) {
  const MeasurementSet set =
      rings(2112.2, 20, 0.3, [](std::int64_t code) { return code & ~std::int64_t{32}; });
  const std::vector<StuckBit> stuck = make_visit_log(set, of_sixteen_bits()).codes[2].stuck_bits;
  ASSERT_EQ(stuck.size(), 1U);
  EXPECT_EQ(stuck.front().bit, 5);
  EXPECT_FALSE(stuck.front().value);
}

// Where z takes thirty codes, four of its bits in twelve never change.
TEST(CodeFaults, TwoSpikesAreSeldomTakenForABit) {
  constexpr int kSets = 100, kMost = 1;
  const MeasurementSet sound = rings(2112.6, 20, 0.3, [](std::int64_t code) { return code; });
  std::mt19937_64 random(14);
  std::uniform_int_distribution<std::size_t> row(0, sound.samples.size() - 1);
  std::uniform_int_distribution<int> off(5, 200);
  int taken = 0;
  for (int k = 0; k < kSets; ++k) {
    MeasurementSet set = sound;
    for (int spike = 0; spike < 2; ++spike)
      set.samples.u_V[2][row(random)] +=
          kSixteenBits.lsb_V() * off(random) * (row(random) % 2 ? 1 : -1);
    taken += make_visit_log(set, of_sixteen_bits()).codes[2].stuck_bits.empty() ? 0 : 1;
  }
  EXPECT_LE(taken, kMost);
}

TEST(PoseMeans, BurstsOfNoiseMakeAMeanLessCertain) {
  MeasurementSet set = dwells_of_noise(11);
  const Pose& loud = set.poses[17];
  for (std::size_t k = loud.first; k < loud.first + loud.count; ++k) set.samples.u_V[0][k] *= 4;
  // A single jump and a course within the dwell are no burst.
  set.samples.u_V[0][set.poses[30].first + 5] += 0.1;
  for (std::size_t k = 0; k < 40; ++k)
    set.samples.u_V[0][set.poses[40].first + k] += 1e-4 * static_cast<double>(k);
  const Eigen::VectorXd variance_V2 = burst_variance_V2(set, 0, 0);
  EXPECT_EQ((variance_V2.array() > 0).count(), 1);
  EXPECT_NEAR(variance_V2(17), 15 * 9e-8 / 40, 0.5 * 15 * 9e-8 / 40);
  EXPECT_TRUE(burst_variance_V2(set, 1, 0).isZero());
  EXPECT_TRUE(burst_variance_V2(set, 0, 1e-3).isZero());  // noise between two codes
}

// 200 dwells of 40 samples at 100 Hz with white noise, every 6.4 s as a raster has them, or a
// little more or less.
MeasurementSet dwells(std::uint64_t seed, double amplitude_V, double f_hz, double phase_rad,
                      double uneven_s = 0) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise_V(0, 3e-4);
  std::uniform_real_distribution<double> more_s(0, uneven_s);
  MeasurementSet set;
  for (int k = 0; k < 200; ++k) {
    set.poses.push_back({k, 0, 0, set.samples.u_V[0].size(), 40});
    const double arrival_s = 6.4 * k + (uneven_s > 0 ? more_s(random) : 0);
    for (int m = 0; m < 40; ++m) {
      const double t_s = arrival_s + 0.01 * m;
      set.samples.t_s.push_back(t_s);
      for (auto& u_V : set.samples.u_V)
        u_V.push_back(0.02 * std::sin(0.3 * k) + noise_V(random) +
                      amplitude_V * std::sin(2 * std::numbers::pi * f_hz * t_s + phase_rad));
    }
  }
  return set;
}

TEST(DwellLine, IsFoundAtItsFrequencyAmongTheAliasesOfTheRaster) {
  const auto line = line_through_dwells(dwells(1, 6e-4, 23.371, 1.2), 0);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->f_hz, 23.371, 1e-4);  // the next alias of the raster is 0.156 Hz away
  EXPECT_NEAR(line->amplitude_V, 6e-4, 2e-5);
  EXPECT_NEAR(std::remainder(line->phase_rad - 1.2, 2 * std::numbers::pi), 0, 0.1);
}

TEST(DwellLine, AboveHalfTheSamplingRateIsSeenAtItsAlias) {
  const auto line = line_through_dwells(dwells(2, 2e-4, 59.9, 0.4), 1);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->f_hz, 40.1, 1e-4);
}

TEST(DwellLine, AboveHalfTheSamplingRateIsKnownFromUnevenArrivals) {
  for (const double f_hz : {59.9, 133.7, 249.6, 550.2}) {
    const auto line = line_through_dwells(dwells(3, 2e-4, f_hz, 0.4, 0.5), 1);
    ASSERT_TRUE(line) << f_hz;
    EXPECT_NEAR(line->f_hz, f_hz, 1e-4);
    EXPECT_NEAR(line->amplitude_V, 2e-4, 2e-5);
    EXPECT_NEAR(std::remainder(line->phase_rad - 0.4, 2 * std::numbers::pi), 0, 0.2);
  }
}

// What the means of those dwells leave when the attitudes are taken out.
Eigen::VectorXd left_by_attitudes(const MeasurementSet& set) {
  Eigen::VectorXd left_V(std::ssize(set.poses));
  for (Eigen::Index k = 0; k < left_V.size(); ++k)
    left_V(k) = Eigen::Map<const Eigen::VectorXd>(set.samples.u_V[0].data() + 40 * k, 40).mean() -
                0.02 * std::sin(0.3 * static_cast<double>(k));
  return left_V;
}

TEST(DwellLine, ThatHardlyChangesWithinADwellShowsInTheMeans) {
  const MeasurementSet set = dwells(4, 2e-4, 100.6, 0.9, 0.5);
  EXPECT_FALSE(line_through_dwells(set, 0));
  const auto line = line_between_dwells(set, left_by_attitudes(set));
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->f_hz, 100.6, 1e-4);
  EXPECT_NEAR(line->amplitude_V, 2e-4, 4e-5);
  EXPECT_NEAR(std::remainder(line->phase_rad - 0.9, 2 * std::numbers::pi), 0, 0.3);
}

// Whatever the courses of the dwells show besides: what is removed from them as slow may leave of
// it what looks like a weaker one.
TEST(DwellLine, AStrongOneThatHardlyChangesWithinADwellComesFirst) {
  MeasurementSet set = dwells(4, 1e-2, 100.1, 0.9, 0.5);
  for (std::size_t k = 0; k < set.poses.size(); ++k)
    set.poses[k].delta_deg = 0.3 * static_cast<double>(k) * 180 / std::numbers::pi - 90;
  for (std::size_t i = 0; i < set.samples.size(); ++i)
    set.samples.u_V[0][i] += 3e-4 * std::sin(2 * std::numbers::pi * 23.4 * set.samples.t_s[i]);
  ASSERT_TRUE(line_through_dwells(set, 0));
  const auto line = make_visit_log(set, {}).line[0];
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->f_hz, 100.1, 1e-4);
  EXPECT_FALSE(make_visit_log(set, {}, {{0.12, 0.01}}).line[0]) << "part of the noise";
}

TEST(DwellLine, WhatDiesAwayInEveryDwellIsNotSteady) {
  MeasurementSet set = dwells(6, 2e-4, 23.371, 1.2);
  EXPECT_TRUE(line_through_dwells(set, 0)->steady);
  for (const Pose& pose : set.poses)
    for (std::size_t m = 0; m < pose.count; ++m) {
      const double t_s = 0.01 * static_cast<double>(m);
      set.samples.u_V[1][pose.first + m] +=
          2e-3 * std::exp(-t_s / 0.1) * std::sin(2 * std::numbers::pi * 18 * t_s);
    }
  const auto line = line_through_dwells(set, 1);
  ASSERT_TRUE(line);
  EXPECT_FALSE(line->steady);
}

TEST(DwellLine, ACourseOfTheRunIsNoLine) {
  // Slow waves and drifts are lines at every multiple of the sampling rate, too, where the arrivals
  // do not tell.
  for (const double uneven_s : {0.0, 0.5}) {
    const MeasurementSet set = dwells(5, 0, 0, 0, uneven_s);
    Eigen::VectorXd left_V = left_by_attitudes(set);
    for (Eigen::Index k = 0; k < left_V.size(); ++k)
      left_V(k) += 2e-4 * std::sin(0.05 * static_cast<double>(k)) + 1e-6 * static_cast<double>(k);
    EXPECT_FALSE(line_between_dwells(set, left_V)) << uneven_s;
  }
}

TEST(DwellLine, NoiseHasNone) {
  for (std::uint64_t seed = 10; seed < 20; ++seed)
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      EXPECT_FALSE(line_through_dwells(dwells(seed, 0, 0, 0), axis)) << seed;
  EXPECT_FALSE(line_through_dwells({}, 0));
}

}  // namespace
}  // namespace plumbline
