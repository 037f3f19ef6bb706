// What codes and samples show by themselves, before anything is fitted.
#include "estimator/effects/code_evidence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "estimator/effects/visit_log.h"

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

// What rounds behind the converter knows nothing of its codes.
TEST(CodeFaults, PointsOfACoarserStepAreWhatWasRead) {
  MeasurementSet set = poses_with([](std::int64_t code) { return code; });
  const double step_V = 6.3 * kTwelveBits.lsb_V();
  for (double& u_V : set.samples.u_V[0]) u_V = step_V * std::round(u_V / step_V);
  const auto lattice = code_faults(set, 0, kTwelveBits).coarser_lattice;
  ASSERT_TRUE(lattice);
  EXPECT_NEAR(lattice->step_V, step_V, 0.02 * kTwelveBits.lsb_V());
  std::size_t seen = 0;
  for (const double reading_V : lattice->reading_V) {
    if (std::isnan(reading_V)) continue;
    EXPECT_NEAR(reading_V, step_V * std::round(reading_V / step_V), 1e-9);
    ++seen;
  }
  EXPECT_GT(seen, 3U);
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

// Where z takes fifteen codes, most of its bits never change.
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

// Eight codes below where the bit would leave them, although noise takes the others over one only.
TEST(CodeFaults, SpikesBeyondTheNoiseOfTheirDwellsAreNoStuckBit) {
  MeasurementSet set = rings(2112.6, 20, 0.3, [](std::int64_t code) { return code; });
  for (const std::size_t row : {103U, 184U})
    set.samples.u_V[2][row] = kSixteenBits.min_V + kSixteenBits.lsb_V() * 2073;
  EXPECT_TRUE(make_visit_log(set, of_sixteen_bits()).codes[2].stuck_bits.empty());
}

}  // namespace
}  // namespace plumbline
