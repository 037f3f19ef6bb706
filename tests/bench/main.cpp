// Runs the benchmarks and ends with a table: each against the limit of its group, "Group/limit".
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "estimator/linear_algebra.h"

namespace {

class TableReporter : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.error_occurred || run.run_type != Run::RT_Iteration) continue;
      std::string name = run.run_name.function_name;
      if (!run.run_name.args.empty()) name += " " + run.run_name.args;
      times_.emplace_back(name, run.GetAdjustedRealTime());
      unit_[name] = benchmark::GetTimeUnitString(run.time_unit);
    }
  }

  void Finalize() override {
    ConsoleReporter::Finalize();
    std::map<std::string, double> limits;
    for (const auto& [name, time] : times_) {
      const auto slash = name.rfind('/');
      if (slash != std::string::npos && name.substr(slash + 1) == "limit")
        limits[name.substr(0, slash)] = time;
    }
    fmt::print("\n{:<62} {:>12} {:>8}\n", "what", "time", "ratio");
    for (const auto& [name, time] : times_) {
      const auto slash = name.rfind('/');
      const auto limit =
          limits.find(slash == std::string::npos ? std::string() : name.substr(0, slash));
      const std::string ratio = limit == limits.end() || name.substr(slash + 1) == "limit"
                                    ? "–"
                                    : fmt::format("{:.2f}", time / limit->second);
      fmt::print("{:<62} {:>9.2f} {:<2} {:>8}\n", name, time, unit_[name], ratio);
    }
    fmt::print("ratio: to the limit of the group, measured in the same run\n");
  }

 private:
  std::vector<std::pair<std::string, double>> times_;
  std::map<std::string, std::string> unit_;
};

}  // namespace

int main(int argc, char** argv) {
  plumbline::start_with_kernels_for_processor(argv);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  TableReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  benchmark::Shutdown();
  return 0;
}
