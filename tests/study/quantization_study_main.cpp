// Table of what rounding costs: least squares, rounding undone to first order, and what calibrate()
// does. Exit code: 0 when the stated errors are reached, 1 when not, 2 wrong use.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <vector>

#include "tests/study/quantization_study.h"

namespace {

using namespace plumbline::study;

/// What is demanded, mm/s²; 0: only that it is no worse than least squares by 3 %.
struct Row {
  CodeCase c;
  double demanded = 0;
};

std::vector<Row> rows() {
  std::vector<Row> all = {{{0, 1}, 4.9 * 1.1},      {{0.03, 100}, 0.89 * 1.1},
                          {{0.1, 100}, 1.49 * 1.1}, {{0.3, 100}, 2.69 * 1.1},
                          {{0.1, 100, 60, 0}, 1.8}, {{0.1, 100, 0, 0.5}, 0},
                          {{0.03, 100, 0, 0.5}, 0}, {{0.3, 100, 0, 0.5}, 0}};
  for (const double sigma : {0.0, 0.03, 0.1, 0.2, 0.3, 0.5, 0.7, 0.8, 1.0, 3.0}) {
    for (const int readings : {1, 10, 100, 1000}) {
      if (sigma == 0 && readings > 1) continue;
      all.push_back({{sigma, readings}, 0});
    }
  }
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  int trials = 150;
  std::uint64_t seed = 1;
  CLI::App app{"Error of the parameters, RMS over the sphere, where converter steps are coarse"};
  app.add_option("trials", trials,
                 "simulated units of each kind; four times as many where an error is demanded")
      ->check(CLI::Range(2, 1000000))
      ->capture_default_str();
  app.add_option("--seed", seed, "of the first unit")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  bool holds = true;
  fmt::print("errors in mm/s²\n{:<42} {:>7} {:>13} {:>11} {:>10} {:>8} {:>8} {:>9}\n",
             "noise and readings a pose", "trials", "least squares", "first order", "calibrate",
             "σ found", "covered", "demanded");
  for (const Row& row : rows()) {
    // The RMS error of 150 trials scatters by 3 % itself.
    const int of_row = row.demanded > 0 ? 4 * trials : trials;
    const CodeErrors e = study_codes(row.c, of_row, seed);
    const double limit = row.demanded > 0 ? row.demanded : 1.03 * e.least_squares;
    const bool good = e.chosen <= limit;
    holds = holds && good;
    fmt::print("{:<42} {:>7} {:>13.3f} {:>11.3f} {:>10.3f} {:>8.3f} {:>6.1f} % {:>9.3f}{}\n",
               to_string(row.c), of_row, e.least_squares, e.first_order, e.chosen, e.sigma,
               100 * e.coverage, limit, good ? "" : "  MISSED");
    std::fflush(stdout);
  }
  return holds ? 0 : 1;
}
