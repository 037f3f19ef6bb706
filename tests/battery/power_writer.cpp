// Runs inside the virtual machine whose power is cut: checks what earlier boots have committed,
// then commits poses for ever and acknowledges each one on its output.
//   power_writer DATABASE LAST_ACKNOWLEDGED
#include <cstdio>
#include <cstdlib>

#include "storage/run_store.h"

namespace {

plumbline::storage::PoseRecord pose_of(long long ordinal) {
  plumbline::storage::PoseRecord pose;
  pose.ordinal = ordinal;
  pose.delta_deg = static_cast<double>(ordinal);
  for (int i = 0; i < 40; ++i) {
    plumbline::RawSample sample;
    sample.counter = ordinal * 1000 + i;
    sample.t_s = static_cast<double>(ordinal) * 10 + i * 0.01;
    sample.code = {i, -i, static_cast<std::int32_t>(ordinal)};
    pose.samples.push_back(sample);
  }
  return pose;
}

int fail(const char* what) {
  std::printf("\nPOWER-FAULT %s\n", what);
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const long long acknowledged = std::atoll(argv[2]);
  auto store = plumbline::storage::RunStore::open(argv[1]);
  if (!store) return fail(store.error().message.c_str());
  const auto runs = store->runs();
  if (!runs) return fail(runs.error().message.c_str());
  plumbline::storage::RunId run = 0;
  long long next = 0;
  if (runs->empty()) {
    if (acknowledged >= 0) return fail("the run is gone");
    const auto created = store->create_run({.serial = "P",
                                            .program_version = "",
                                            .config_toml = "",
                                            .plan_csv = "",
                                            .started_utc = "",
                                            .rate_hz = 100,
                                            .adc = {}});
    if (!created) return fail(created.error().message.c_str());
    run = *created;
  } else {
    run = runs->front().id;
    const auto poses = store->poses(run);
    if (!poses) return fail(poses.error().message.c_str());
    for (const auto& pose : *poses) {
      if (pose.ordinal != next) return fail("a pose is missing or doubled");
      const auto expected = pose_of(next);
      if (pose.samples.size() != expected.samples.size() ||
          pose.samples.back().counter != expected.samples.back().counter) {
        return fail("a pose has changed");
      }
      ++next;
    }
    const auto chain = store->check_chain(run);
    if (!chain || !chain->faults.empty()) return fail("the hash chain is broken");
  }
  if (next <= acknowledged) return fail("an acknowledged pose is lost");
  std::printf("\nPOWER-CHECKED %lld\n", next);
  std::fflush(stdout);
  for (;; ++next) {
    if (const auto done = store->commit_pose(run, pose_of(next)); !done) {
      return fail(done.error().message.c_str());
    }
    std::printf("POWER-ACK %lld\n", next);
    std::fflush(stdout);
  }
}
