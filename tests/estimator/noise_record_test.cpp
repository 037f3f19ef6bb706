// What a static record is said to hold: lines, Gauss-Markov terms, limits, misfit.
#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "estimator/noise/identify.h"
#include "estimator/noise/line_search.h"
#include "estimator/noise/record_terms.h"

namespace plumbline {
namespace {

constexpr double kRate_hz = 100;

std::vector<double> white(std::size_t n, double sigma, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> unit;
  std::vector<double> record(n);
  for (double& value : record) value = sigma * unit(engine);
  return record;
}

void add_sine(std::vector<double>& record, double f_hz, double amplitude, double phase) {
  for (std::size_t i = 0; i < record.size(); ++i)
    record[i] += amplitude *
                 std::sin(2 * std::numbers::pi * f_hz * static_cast<double>(i) / kRate_hz + phase);
}

/// First-order Gauss-Markov process, exact at the sample times.
void add_markov(std::vector<double>& record, double sigma, double tau_s, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> unit;
  const double kept = std::exp(-1 / (tau_s * kRate_hz));
  double x = sigma * unit(engine);
  for (double& value : record) {
    value += x;
    x = kept * x + sigma * std::sqrt(1 - kept * kept) * unit(engine);
  }
}

TEST(FindLines, MeasuresSinesBetweenTheOrdinates) {
  std::vector<double> record = white(30000, 1, 1);
  add_sine(record, 0.5611, 0.3, 0.4);
  add_sine(record, 3 * 0.5611, 0.12, 1);
  add_sine(record, 31.4, 0.2, 2);
  const LineSearch search = find_lines(record, kRate_hz);
  ASSERT_EQ(search.lines.size(), 3U);
  const SpectralLine& first = search.lines[0];
  EXPECT_NEAR(first.f_hz, 0.5611, 4 * first.u_f_hz);
  EXPECT_NEAR(first.amplitude, 0.3, 4 * first.u);
  // White noise: u = σ·√(2/n).
  EXPECT_NEAR(first.u, std::sqrt(2.0 / 30000), 0.2 * first.u);
  EXPECT_LT(first.u_f_hz, 1e-4);
  EXPECT_NEAR(search.lines[1].f_hz, 31.4, 4 * search.lines[1].u_f_hz);
  EXPECT_EQ(search.lines[1].harmonic, 1);
  EXPECT_EQ(search.lines[2].harmonic, 3);
  EXPECT_NEAR(search.lines[2].fundamental_hz, 0.5611, 1e-4);
  double square = 0;
  for (const double value : search.record) square += value * value;
  EXPECT_NEAR(square / 30000, 1, 0.03);
}

TEST(FindLines, NoiseHasNone) {
  int lines = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    std::vector<double> record = white(4000, 1, seed);
    if (seed % 2 == 0) add_markov(record, 5, 3, seed + 1000);
    lines += find_lines(record, kRate_hz).lines.empty() ? 0 : 1;
  }
  EXPECT_LE(lines, 1);
}

TEST(RecordTerms, LinesDoNotSpoilTheTerms) {
  const std::vector<double> clean = white(60000, 0.1, 2);
  std::vector<double> record = clean;
  add_sine(record, 0.56, 0.3, 0);
  add_sine(record, 1.68, 0.05, 1);
  const RecordTerms without = identify_noise(clean, kRate_hz).record;
  const RecordTerms with = identify_noise(record, kRate_hz).record;
  EXPECT_TRUE(with.adequate);
  EXPECT_FALSE(with.adequate_without_lines);
  EXPECT_TRUE(without.adequate_without_lines);
  ASSERT_EQ(with.lines.size(), 2U);
  EXPECT_NEAR(with.term[kTermN].value, without.term[kTermN].value, 0.5 * with.term[kTermN].u);
  EXPECT_FALSE(with.term[kTermB].present);
  EXPECT_FALSE(with.term[kTermK].present);
}

TEST(RecordTerms, FindsAGaussMarkovProcess) {
  std::vector<double> record = white(200000, 0.01, 3);
  add_markov(record, 0.02, 2, 4);
  const RecordTerms terms = identify_noise(record, kRate_hz).record;
  ASSERT_EQ(terms.markov.size(), 1U);
  EXPECT_NEAR(terms.markov[0].sigma, 0.02, 4 * terms.markov[0].u);
  EXPECT_NEAR(terms.markov[0].tau_s, 2, 4 * terms.markov[0].u_tau_s);
  EXPECT_NEAR(terms.term[kTermN].value, 0.001, 4 * terms.term[kTermN].u);
  EXPECT_TRUE(terms.adequate) << terms.remark;
  EXPECT_FALSE(terms.term[kTermB].present);
}

TEST(RecordTerms, BandwidthOfTheSensorIsNotANoiseTerm) {
  // White noise through two first-order low-passes at 8 Hz, and the converter's own on top.
  std::vector<double> record = white(100000, 1, 5);
  const double kept = std::exp(-2 * std::numbers::pi * 8 / kRate_hz);
  for (int stage = 0; stage < 2; ++stage) {
    double x = 0;
    for (double& value : record) value = x = kept * x + (1 - kept) * value;
  }
  const std::vector<double> converter = white(record.size(), 0.05, 6);
  for (std::size_t i = 0; i < record.size(); ++i) record[i] += converter[i];
  const RecordTerms terms = identify_noise(record, kRate_hz).record;
  EXPECT_LT(terms.band_hz, 12);
  EXPECT_NEAR(terms.term[kTermN].value, 0.1, 0.01);  // σ·√T of what goes in
  EXPECT_FALSE(terms.adequate);
  EXPECT_NE(terms.remark.find("falls above"), std::string::npos) << terms.remark;
}

TEST(RecordTerms, RoundingIsSeenAndItsShareOfNIsOpen) {
  std::vector<double> record = white(40000, 1, 7);
  for (double& value : record) value = std::round(value + 0.3);
  EXPECT_DOUBLE_EQ(value_step(record), 1);
  const RecordTerms terms = identify_noise(record, kRate_hz).record;
  EXPECT_EQ(terms.step, 1);
  // N of the record is √(1 + 1/12)·√T, that of the sensor √T.
  EXPECT_NEAR(terms.term[kTermN].value, 0.1 * std::sqrt(13.0 / 12), 0.002);
  EXPECT_NEAR(terms.term[kTermN].value, 0.1, 2 * terms.term[kTermN].u);
  EXPECT_EQ(value_step(white(1000, 1, 8)), 0);
  // Less noise than half a step: nothing here can be trusted.
  std::vector<double> coarse = white(40000, 0.3, 9);
  for (double& value : coarse) value = std::round(value + 0.3);
  const RecordTerms doubtful = identify_noise(coarse, kRate_hz).record;
  EXPECT_FALSE(doubtful.adequate);
  EXPECT_NE(doubtful.remark.find("half a step"), std::string::npos) << doubtful.remark;
  EXPECT_NEAR(doubtful.term[kTermN].value, 0.03, 2 * doubtful.term[kTermN].u);
}

TEST(RecordTerms, AllanDeviationOfTheTerms) {
  RecordTerms terms;
  terms.term[kTermN].value = 2;
  EXPECT_NEAR(allan_deviation_of(terms, 4), 1, 1e-12);
  terms.term[kTermN].value = 0;
  terms.term[kTermB].value = 3;
  const double flat = 3 * std::sqrt(2 * std::numbers::ln2 / std::numbers::pi);
  EXPECT_NEAR(allan_deviation_of(terms, 7), flat, 1e-12);
  // A band far wider than 1/τ is no limit.
  terms.flicker_low_hz = 1e-7;
  terms.flicker_high_hz = 1e6;
  EXPECT_NEAR(allan_deviation_of(terms, 1), flat, 2e-3 * flat);
  terms = {};
  terms.lines.push_back({.f_hz = 0.5, .amplitude = 1});
  EXPECT_NEAR(allan_deviation_of(terms, 1), 2 / std::numbers::pi, 1e-12);
}

TEST(RecordTerms, RecordedSensorHasALineNear056HzAndItsHarmonic) {
  const std::filesystem::path file = std::filesystem::path(PLUMBLINE_SHARED_DIR) / "data" /
                                     "static_long" / "adis16405_run1_acc_lsb.csv.gz";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "reference data not found: " << file;
  gzFile in = gzopen(file.c_str(), "rb");
  ASSERT_NE(in, nullptr);
  std::vector<double> record;
  char line[256];
  while (gzgets(in, line, sizeof line) != nullptr) {
    char* end = nullptr;
    const double value = std::strtod(line, &end);
    if (end != line) record.push_back(value);
  }
  gzclose(in);
  ASSERT_EQ(record.size(), 1000000U);
  const NoiseModel model = identify_noise(record, kRate_hz);
  const RecordTerms& terms = model.record;
  ASSERT_GE(terms.lines.size(), 2U);
  EXPECT_NEAR(terms.lines[0].f_hz, 0.564, 0.002);
  EXPECT_GT(terms.lines[0].amplitude, 0.15);
  bool harmonic = false;
  for (const SpectralLine& other : terms.lines)
    harmonic = harmonic || (other.harmonic == 3 && std::abs(other.f_hz - 1.6905) < 1e-3);
  EXPECT_TRUE(harmonic);
  EXPECT_FALSE(terms.adequate_without_lines);
  EXPECT_FALSE(model.adequate);
  // White noise between 2 and 6 Hz is 0.0178 … 0.0184 LSB²/Hz.
  EXPECT_NEAR(terms.term[kTermN].value, 0.1345, 0.006);
  EXPECT_EQ(terms.step, 1);
}

}  // namespace
}  // namespace plumbline
