// The calibration engine with its diagnosis, without files, on a run of 324 poses × 40 samples and
// a static record of 300 s: noise of the record, fits, the search over all candidates with the
// simulated chance of its best, alternatives and detection limits. The limit is what one look at
// all candidates cannot do without: their responses, computed and whitened once.
#include <Eigen/Core>
#include <optional>
#include <string>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/candidate_responses.h"
#include "rig/sim/record.h"
#include "rig/sim/world.h"
#include "tests/bench/limit.h"

namespace plumbline::bench {
namespace {

std::optional<sim::RecordedSet> set_of(const std::string& world, benchmark::State& state) {
  const auto read =
      sim::read_world(std::string(PLUMBLINE_SOURCE_DIR "/rig/sim/worlds/") + world + ".toml");
  if (read) return sim::record_set(*read, {});
  state.SkipWithError(read.error().message.c_str());
  return {};
}

void responses_limit(benchmark::State& state) {
  const auto set = set_of("default", state);
  if (!set) return;
  const VisitLog log = make_visit_log(set->run, set->description);
  const CandidateList list = all_candidates(log);
  EnlargedParameters model;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    model.twelve[axis] = Eigen::Vector4d::Unit(static_cast<Eigen::Index>(axis));
  const auto n = std::ssize(log.visits);
  PoseWhitening whitening;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    whitening.set(axis, Eigen::MatrixXd::Identity(n, n) + Eigen::MatrixXd::Ones(n, n));
    whitening.dwell_sd_V[axis] = Eigen::VectorXd::Ones(log.dwell_contrasts());
  }
  for (auto _ : state)
    benchmark::DoNotOptimize(candidate_responses(log, list, whitening, model).place.data());
  state.counters["candidates"] = static_cast<double>(list.candidates.size());
}
BENCHMARK(responses_limit)
    ->Name("Diagnosis 324 x 40/limit")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void diagnosis(benchmark::State& state, const char* world) {
  const auto set = set_of(world, state);
  if (!set) return;
  for (auto _ : state) {
    const Calibration result = calibrate({set->run, &set->soak, set->description}, {});
    state.counters["effects"] = static_cast<double>(result.diagnosis.effects.size());
  }
}
BENCHMARK_CAPTURE(diagnosis, nothing, "default")
    ->Name("Diagnosis 324 x 40/nothing to find")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(diagnosis, base_roll, "base-roll")
    ->Name("Diagnosis 324 x 40/base roll")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(diagnosis, two, "temperature-and-backlash")
    ->Name("Diagnosis 324 x 40/temperature and backlash")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace plumbline::bench
