// Tables of what identify_noise() finds in simulated records: spread against the bound, coverage of
// the 95 % intervals, and how often an absent term is called present.
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "tests/study/noise_study.h"

int main(int argc, char** argv) {
  using namespace plumbline;
  using namespace plumbline::study;
  int records = 300;
  std::uint64_t seed = 1;
  std::string only;
  CLI::App app{"What the noise identification says of simulated records with known terms"};
  app.add_option("records", records, "records of each kind")
      ->check(CLI::Range(2, 1000000))
      ->capture_default_str();
  app.add_option("--seed", seed, "of the first record")->capture_default_str();
  app.add_option("--only", only, "cases whose name contains this");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  for (const NoiseCase& noise_case : noise_cases()) {
    if (noise_case.name.find(only) == std::string::npos) continue;
    const NoiseStudy study = study_noise(noise_case, records, seed);
    fmt::print("\n{}, {} records\n", noise_case.name, records);
    fmt::print(
        "  term      truth       mean   sd/truth   of power/2    bound    mean u/sd  covered  "
        "present\n");
    for (std::size_t i = 0; i < kTermCount; ++i) {
      const NoiseFigures& term = study.term[i];
      const bool there = term.truth > 0;
      const double bound = i < 4 ? noise_case.bound[i] : 0;
      fmt::print(
          "  {:<4} {:>10.3g} {:>10.3g} {:>10} {:>12} {:>8} {:>12.2f} {:>7.1f}% {:>7.1f}%\n",
          kTermName[i], term.truth, term.mean,
          there ? fmt::format("{:.2f} %", 100 * term.sd / term.truth) : "–",
          there ? fmt::format("{:.2f} %", 50 * term.power_sd / (term.truth * term.truth)) : "–",
          bound > 0 ? fmt::format("{:.2f} %", 100 * bound) : "–",
          term.sd > 0 ? term.mean_u / term.sd : 0.0, 100 * term.covered, 100 * term.present);
    }
    fmt::print("  described {:.1f} %, with a line {:.1f} %, with a Gauss-Markov term {:.1f} %\n",
               100 * study.adequate, 100 * study.lines, 100 * study.markov);
    std::fflush(stdout);
  }
}
