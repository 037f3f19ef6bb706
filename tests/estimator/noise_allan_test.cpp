// Deviations against published values: NIST SP 1065 and the tables printed by Stable32.
#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "estimator/noise/allan.h"
#include "estimator/noise/chi_squared.h"
#include "estimator/noise/edf.h"

namespace plumbline {
namespace {

const std::filesystem::path kReference =
    std::filesystem::path(PLUMBLINE_SHARED_DIR) / "data" / "allan_reference";

#define REQUIRE_REFERENCE()                 \
  if (!std::filesystem::exists(kReference)) \
  GTEST_SKIP() << "reference data not found: " << kReference

const std::map<std::string, Deviation> kKinds = {
    {"adev", Deviation::adev},     {"oadev", Deviation::oadev},    {"mdev", Deviation::mdev},
    {"tdev", Deviation::tdev},     {"hdev", Deviation::hdev},      {"ohdev", Deviation::ohdev},
    {"totdev", Deviation::totdev}, {"htotdev", Deviation::htotdev}};

/// Column `column` of a comma- or blank-separated file; comment and header lines are left out.
std::vector<double> read_column(const std::filesystem::path& path, std::size_t column) {
  std::ifstream in(path);
  std::vector<double> values;
  for (std::string line; std::getline(in, line);) {
    for (char& c : line)
      if (c == ',') c = ' ';
    std::istringstream words(line);
    double value = 0;
    std::size_t i = 0;
    for (; i <= column && words >> value; ++i) continue;
    if (i == column + 1) values.push_back(value);
  }
  return values;
}

/// The first word of every line of a compressed file that begins with a number.
std::vector<double> read_gzip_column(const std::filesystem::path& path) {
  std::vector<double> values;
  gzFile file = gzopen(path.c_str(), "rb");
  if (file == nullptr) return values;
  char line[256];
  while (gzgets(file, line, sizeof line) != nullptr) {
    char* end = nullptr;
    const double value = std::strtod(line, &end);
    if (end != line) values.push_back(value);
  }
  gzclose(file);
  return values;
}

/// `value` printed with `digits` decimals of the mantissa equals the published number, or lies
/// within half a unit of its last place.
void expect_digits(double value, double published, int digits, const std::string& what) {
  const double unit = std::pow(10, std::floor(std::log10(published)) - digits);
  EXPECT_NEAR(value, published, 0.5000001 * unit) << what;
}

TEST(Allan, Nbs14PublishedValues) {
  REQUIRE_REFERENCE();
  std::vector<double> rate = read_column(kReference / "nbs14_1000_frequency.csv", 1);
  ASSERT_EQ(rate.size(), 1000U);
  for (double& n : rate) n /= 2147483647.0;
  const std::vector<double> phase1000 = integrate_record(rate, 1);
  const std::vector<double> phase10 = read_column(kReference / "nbs14_10point.csv", 1);
  ASSERT_EQ(phase10.size(), 10U);
  std::ifstream in(kReference / "nbs14_deviations.csv");
  std::string line;
  int compared = 0;
  while (std::getline(in, line)) {
    std::istringstream cells(line);
    std::string set;
    std::string statistic;
    std::string m;
    std::string value;
    std::getline(cells, set, ',');
    std::getline(cells, statistic, ',');
    std::getline(cells, m, ',');
    std::getline(cells, value, ',');
    const auto kind = kKinds.find(statistic);
    if (kind == kKinds.end()) continue;  // mean, slope: not deviations
    const auto& phase = set == "10" ? phase10 : phase1000;
    // Two published values of one number: at m = 1 hdev and ohdev are the same statistic, yet
    // 70.80608 and 70.80607 are printed. Ours is the latter.
    if (set == "10" && statistic == "hdev" && m == "1") continue;
    double deviation = deviation_at(kind->second, phase, 1, std::stoul(m)).value;
    // The published Hadamard total values are corrected for their bias in white noise.
    if (statistic == "htotdev" && m != "1") deviation /= std::sqrt(1 - 0.005);
    // Some of the values are cut off after the seventh digit, not rounded.
    const double published = std::stod(value);
    const double unit = std::pow(10, std::floor(std::log10(published)) - 6);
    const double cut = std::floor(deviation / unit) * unit;
    if (std::abs(cut - published) > 1e-3 * unit) expect_digits(deviation, published, 6, line);
    ++compared;
  }
  EXPECT_EQ(compared, 37);
}

/// Values and number of every row; limits with the noise type that the row states.
void compare_table(const std::vector<double>& phase, const std::filesystem::path& path,
                   Deviation kind, bool limits, std::size_t exact_below) {
  std::ifstream in(path);
  ASSERT_TRUE(in) << path;
  int rows = 0;
  for (std::string line; std::getline(in, line);) {
    std::size_t m = 0;
    double tau = 0;
    long long n = 0;
    int alpha = 0;
    double low = 0;
    double value = 0;
    double high = 0;
    std::istringstream cells(line);
    if (!(cells >> m >> tau >> n >> alpha >> low >> value >> high)) continue;
    const std::string what = path.filename().string() + ": " + line;
    const DeviationPoint point = deviation_at(kind, phase, 1, m);
    if (m < exact_below)
      expect_digits(point.value, value, 4, what);
    else
      EXPECT_NEAR(point.value, value, 2e-4 * value) << what;
    // Degrees of freedom of the total deviation are published for white, flicker and walk only;
    // what Stable32 takes in phase noise is not.
    const bool published = kind != Deviation::totdev || alpha <= 0;
    if (limits && published && low > 0) {
      const double edf = equivalent_degrees_of_freedom(kind, alpha, m, phase.size());
      // "0.683" in the tables stands for one standard deviation where there are up to 100 degrees
      // of freedom; above, the limits printed are those of 0.68. Their quantiles of χ² are
      // approximations, visible in the fourth or fifth digit.
      const double tail = 0.5 * (1 - (edf > 100 ? 0.68 : std::erf(std::sqrt(0.5))));
      EXPECT_NEAR(point.value * std::sqrt(edf / chi_squared_quantile(1 - tail, edf)), low,
                  3e-4 * low)
          << "lower limit, " << what;
      EXPECT_NEAR(point.value * std::sqrt(edf / chi_squared_quantile(tail, edf)), high, 3e-4 * high)
          << "upper limit, " << what;
    }
    ++rows;
  }
  EXPECT_GT(rows, 5) << path;
}

TEST(Allan, Stable32PhaseDat) {
  REQUIRE_REFERENCE();
  const std::vector<double> phase = read_column(kReference / "phasedat" / "PHASE.DAT", 0);
  ASSERT_EQ(phase.size(), 1001U);
  for (const char* name : {"adev", "oadev", "mdev", "tdev", "hdev", "ohdev", "totdev"})
    compare_table(phase,
                  kReference / "phasedat" / ("stable32_" + std::string(name) + "_octave.txt"),
                  kKinds.at(name), true, 1000000);
}

TEST(Allan, Stable32PhaseDatEveryFactor) {
  REQUIRE_REFERENCE();
  const std::vector<double> phase = read_column(kReference / "phasedat" / "PHASE.DAT", 0);
  for (const char* name : {"adev", "oadev", "mdev", "hdev", "ohdev", "totdev"})
    compare_table(phase, kReference / "phasedat" / ("stable32_" + std::string(name) + "_all.txt"),
                  kKinds.at(name), false, 1000000);
}

TEST(Allan, Stable32PinkNoise) {
  REQUIRE_REFERENCE();
  const std::filesystem::path folder = kReference / "pink_frequency";
  const std::vector<double> rate = read_column(folder / "pink_frequency.txt", 0);
  ASSERT_EQ(rate.size(), 10000U);
  const std::vector<double> phase = integrate_record(rate, 1);
  compare_table(phase, folder / "stable32_oadev_octave.txt", Deviation::oadev, true, 1000000);
  for (const char* name : {"adev", "oadev", "mdev", "hdev", "ohdev"})
    compare_table(phase, folder / ("stable32_" + std::string(name) + "_all.txt"), kKinds.at(name),
                  false, 1000000);
}

TEST(Allan, Stable32GpsReceiver) {
  REQUIRE_REFERENCE();
  const std::filesystem::path folder = kReference / "gps";
  const std::vector<double> phase = read_gzip_column(folder / "gps_1pps_phase_data.txt.gz");
  ASSERT_EQ(phase.size(), 241218U);
  compare_table(phase, folder / "stable32_ADEV_decade.txt", Deviation::adev, true, 1000000);
  const std::pair<const char*, Deviation> tables[] = {
      {"OADEV", Deviation::oadev}, {"MDEV", Deviation::mdev},   {"TDEV", Deviation::tdev},
      {"HDEV", Deviation::hdev},   {"OHDEV", Deviation::ohdev}, {"TOTDEV", Deviation::totdev}};
  for (const auto& [name, kind] : tables)
    compare_table(phase, folder / ("stable32_" + std::string(name) + "_octave.txt"), kind, true,
                  1000000);
}

TEST(Allan, ManyFactorsInOnePassAreTheSameValues) {
  std::vector<double> record;
  for (int i = 0; i < 50001; ++i) record.push_back(std::sin(i * 0.37 * i) + 1e-4 * i);
  const std::vector<double> phase = integrate_record(record, 100);
  const std::vector<std::size_t> factors = {1, 2, 3, 5, 17, 4095, 8192, 12500, 25000, 25001};
  const auto all = deviations_at(Deviation::oadev, phase, 100, factors, true);
  const auto one = deviations_at(Deviation::oadev, phase, 100, factors, false);
  for (std::size_t j = 0; j < factors.size(); ++j) {
    const std::size_t m = factors[j];
    double sum = 0;
    for (std::size_t i = 0; i + 2 * m < phase.size(); ++i)
      sum += std::pow(phase[i + 2 * m] - 2 * phase[i + m] + phase[i], 2);
    const auto n = static_cast<double>(phase.size() > 2 * m ? phase.size() - 2 * m : 0);
    const double tau = static_cast<double>(m) / 100;
    EXPECT_EQ(all[j].n, static_cast<long long>(n));
    EXPECT_NEAR(all[j].value, n > 0 ? std::sqrt(0.5 * sum / n) / tau : 0, 1e-12);
    // The cores share the blocks, not the sums.
    EXPECT_EQ(all[j].value, one[j].value);
  }
}

TEST(Allan, Stable32MeasuredOscillator) {
  REQUIRE_REFERENCE();
  std::vector<double> rate = read_column(kReference / "ocxo" / "ocxo_frequency.txt", 0);
  ASSERT_EQ(rate.size(), 19982U);
  for (double& y : rate) y = y / 1e7 - 1;
  const std::vector<double> phase = integrate_record(rate, 1);
  // These tables were made from frequencies about 1, not about 0: the phase then runs to 2·10⁴ s,
  // and its rounding (4 ps) is seen next to 76 ps of noise. At m = 1, where adev and oadev are one
  // number, they print 7.6106e-11 and 7.6143e-11. So only the plain ones are compared, which
  // average frequencies, and from m = 512 on to 2·10⁻⁴.
  for (const char* name : {"adev", "hdev"})
    compare_table(phase, kReference / "ocxo" / ("stable32_" + std::string(name) + "_octave.txt"),
                  kKinds.at(name), false, 512);
}

TEST(Allan, HandWorked) {
  // y = 1 3 2 6 with T = 1: first differences 2 −1 4, so σ² = (4 + 1 + 16)/6; over pairs the means
  // are 2 and 4 (non-overlapping), 2 2.5 4 (overlapping: only 4 − 2).
  const std::vector<double> phase = integrate_record({1, 3, 2, 6}, 1);
  EXPECT_NEAR(deviation_at(Deviation::adev, phase, 1, 1).value, std::sqrt(21.0 / 6), 1e-14);
  EXPECT_NEAR(deviation_at(Deviation::oadev, phase, 1, 2).value, std::sqrt(2.0), 1e-14);
  EXPECT_EQ(deviation_at(Deviation::oadev, phase, 1, 2).n, 1);
  EXPECT_EQ(deviation_at(Deviation::oadev, phase, 1, 3).n, 0);
}

TEST(Allan, OffsetChangesNothingAndScaleScales) {
  std::vector<double> record;
  for (int i = 0; i < 500; ++i) record.push_back(std::sin(i * i * 0.37));
  std::vector<double> moved = record;
  for (double& y : moved) y = 3 * y + 1e4;
  const DeviationSet a = all_deviations(record, 10);
  const DeviationSet b = all_deviations(moved, 10);
  for (const auto curve : {&DeviationSet::adev, &DeviationSet::oadev, &DeviationSet::mdev,
                           &DeviationSet::hdev, &DeviationSet::totdev}) {
    ASSERT_GE((a.*curve).value.size(), 5U);
    ASSERT_EQ((a.*curve).value.size(), (b.*curve).value.size());
    for (std::size_t i = 0; i < (a.*curve).value.size(); ++i) {
      EXPECT_NEAR((b.*curve).value[i], 3 * (a.*curve).value[i], 1e-8);
      EXPECT_LT((a.*curve).lower[i], (a.*curve).value[i]);
      EXPECT_GT((a.*curve).upper[i], (a.*curve).value[i]);
    }
  }
}

TEST(ChiSquared, TabulatedQuantiles) {
  EXPECT_NEAR(chi_squared_quantile(0.95, 1), 3.841459, 1e-6);
  EXPECT_NEAR(chi_squared_quantile(0.025, 10), 3.246973, 1e-6);
  EXPECT_NEAR(chi_squared_quantile(0.5, 100), 99.334129, 1e-5);
  EXPECT_NEAR(chi_squared_tail(18.307038, 10), 0.05, 1e-8);
  EXPECT_NEAR(f_tail(4.102821, 2, 10), 0.05, 1e-7);
}

}  // namespace
}  // namespace plumbline
