// Reproduces the paper's figures and table and writes one page.
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "app/io/files.h"
#include "tests/study/paper_study.h"

int main(int argc, char** argv) {
  using namespace plumbline;
  int units = 1000;
  std::uint64_t seed = 1;
  std::string out = "build/reproduce-paper.html";
  CLI::App program{"The paper's figures 2, 3 and 4 and its table from simulated units"};
  program.add_option("units", units, "simulated units")
      ->check(CLI::Range(2, 1000000))
      ->capture_default_str();
  program.add_option("--seed", seed, "of the first unit")->capture_default_str();
  program.add_option("--out", out, "the page")->capture_default_str();
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  }
  const study::PaperStudy result = study::study_paper(units, seed);
  if (auto done = app::write_file_atomically(out, study::paper_page(result)); !done) {
    fmt::print(stderr, "{}\n", done.error().message);
    return 2;
  }
  fmt::print("{} units; settled after (recursive least squares, filter, ratio):\n", units);
  for (const study::SettlingRow& row : result.settling)
    fmt::print("  {:>4.0f} {:>4.0f} {:>5.1f}   {} | {} | {}\n", row.recursive_positions,
               row.filter_positions, row.ratio(), row.recursive, row.filter, row.noise);
  fmt::print(
      "error of the parameters, mm/s²: least squares {:.2f}, filter {:.2f}, intervals {:.2f}; "
      "100 readings: {:.2f}, {:.2f}\n",
      1e3 * result.parameter_error_mps2[0], 1e3 * result.parameter_error_mps2[1],
      1e3 * result.parameter_error_mps2[2], 1e3 * result.parameter_error_mps2[3],
      1e3 * result.parameter_error_mps2[4]);
  fmt::print(
      "error of a measured component, one reading: {:.3f} m/s² RMS, {:.3f} (95 %), {:.3f} at "
      "most\n{}\n",
      result.one_reading.rms, result.one_reading.p95, result.one_reading.largest, out);
  return 0;
}
