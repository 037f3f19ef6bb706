// Coverage of the 12 parameters on many simulated units: a table for each converter.
// Exit code: 0 when every overall share lies within 93 … 97 %, 1 when one does not, 2 wrong use.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <thread>

#include "tests/study/coverage.h"

namespace {

using namespace plumbline::study;

constexpr double kLowestShare = 0.93;
constexpr double kHighestShare = 0.97;

/// Prints the table of one converter; true when the overall share is as demanded.
bool report(const Converter& converter, const Coverage& coverage) {
  fmt::print("\n{}, {} units\n", to_string(converter), coverage.units);
  fmt::print("  parameter   within 1.96u   within 2u   mean error/u   sd error/u\n");
  for (Eigen::Index i = 0; i < kParameters; ++i) {
    fmt::print("  {:<9} {:>12.1f} % {:>9.1f} % {:>14.3f} {:>12.3f}\n", parameter_name(i),
               100 * coverage.share(i), 100 * coverage.share_k2(i), coverage.mean(i),
               coverage.sd(i));
  }
  const int values = coverage.units * static_cast<int>(kParameters);
  const Interval one = binomial_interval(coverage.units, 0.95);
  const Interval all = binomial_interval(values, 0.95);
  fmt::print("  {:<9} {:>12.2f} % {:>9.2f} %\n", "all", 100 * coverage.overall_share,
             100 * coverage.overall_share_k2);
  fmt::print(
      "  expected by chance (95 %): {:.1f} … {:.1f} % per parameter, {:.2f} … {:.2f} % of all "
      "{} values\n",
      100 * one.lower, 100 * one.upper, 100 * all.lower, 100 * all.upper, values);
  fmt::print(
      "  standard uncertainty of the overall share, from its scatter between units: {:.2f} %\n",
      100 * coverage.u_overall_share);

  const Interval nees = nees_interval(coverage.units, 0.95);
  fmt::print("  mean NEES {:.3f}, expected {:.3f} … {:.3f} (95 %, {} degrees of freedom a unit)\n",
             coverage.mean_nees, nees.lower, nees.upper, kParameters);
  fmt::print("  filter: {:.2f} % of its values within 1.96u\n", 100 * coverage.filter_share);
  fmt::print("  filter against batch: E_n ≤ 1 for {:.2f} % of the axes, largest {:.3f}\n",
             100 * coverage.en_within_share, coverage.largest_en);
  fmt::print("  verdict: {:.1f} % of the units falsely \"unexplained\", {:.1f} % undecided\n",
             100 * coverage.unexplained_share, 100 * coverage.undecided_share);

  const bool holds =
      coverage.overall_share >= kLowestShare && coverage.overall_share <= kHighestShare;
  fmt::print("  {}: overall share {:.2f} %, demanded {:.0f} … {:.0f} %\n",
             holds ? "holds" : "FAILS", 100 * coverage.overall_share, 100 * kLowestShare,
             100 * kHighestShare);
  std::fflush(stdout);
  return holds;
}

}  // namespace

int main(int argc, char** argv) {
  UnitSeries series;
  series.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  CLI::App app{"Share of the 12 parameters within their 95 % interval, on simulated units"};
  app.add_option("units", series.units, "number of simulated units per converter")
      ->check(CLI::Range(2, 1000000))
      ->capture_default_str();
  app.add_option("--threads", series.threads, "changes the time, not the result")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  app.add_option("--seed", series.first_seed, "of the first unit; the others count up from it")
      ->capture_default_str();
  bool only_coloured = false;
  app.add_flag("--coloured", only_coloured, "only the units with coloured noise");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  bool holds = true;
  for (const Converter& converter : converters()) {
    if (only_coloured && !converter.coloured) continue;
    const auto outcomes = calibrate_units(converter, series);
    holds = report(converter, summarise(outcomes)) && holds;
    series.first_seed +=
        static_cast<std::uint64_t>(series.units);  // other units for the next converter
  }
  return holds ? 0 : 1;
}
