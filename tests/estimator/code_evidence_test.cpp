// What the codes show by themselves.
#include "estimator/effects/code_evidence.h"

#include <gtest/gtest.h>

#include <cmath>

namespace plumbline {
namespace {

constexpr Adc kSixteenBits{16, -5, 0};

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

}  // namespace
}  // namespace plumbline
