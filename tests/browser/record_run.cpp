// Puts a run of three poses into FOLDER/runs.db for the tests in the browser, and a result beside
// it: with twelve effects and names as long as a form allows.
//
//   record_run FOLDER SERIAL running|finished|stopped|failed [RESULT K_xx DECISION]
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "storage/run_store.h"
#include "tests/app/certificate_example.h"
#include "tests/app/result_example.h"
#include "tests/storage/store_fixture.h"

namespace plumbline::app {
namespace {

void write_result(const std::filesystem::path& folder, const std::string& chain_head,
                  const std::string& K_xx, const std::string& decision) {
  CertificateExample crowded;
  crowded.add_effects(12);
  crowded.add_not_found();
  crowded.make_names_long();
  std::vector<std::string> effects;
  for (const FoundEffect& effect : crowded.calibration.diagnosis.effects) {
    effects.push_back(effect.id);
  }
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "result.json")
      << example_result(chain_head, std::stod(K_xx), decision, effects).dump();
  std::ofstream(folder / "certificate.html") << crowded.html();
}

void must(const Result<void>& done) {
  if (!done) throw std::runtime_error(done.error().message);
}

int record(const std::vector<std::string>& words) {
  using storage::RunState;
  const std::filesystem::path folder = words.at(0);
  auto store = storage::RunStore::open(folder / "runs.db").value();
  storage::RunHeader header = storage::example_header();
  header.serial = words.at(1);
  const auto run = store.create_run(header).value();
  for (long long pose = 0; pose < 3; ++pose) {
    must(store.commit_pose(run, storage::example_pose(pose)));
  }
  must(store.add_event(run, {0.5, "2026-01-02T03:04:06Z", "operator", std::string(60, 'W')}));
  for (const RunState state : {RunState::finished, RunState::stopped, RunState::failed}) {
    if (words.at(2) != to_string(state)) continue;
    must(store.finish_run(run, state, "2026-01-02T04:00:00Z"));
  }
  if (words.size() == 6) {
    write_result(folder / words[3], store.runs().value().back().chain_head, words[4], words[5]);
  }
  return 0;
}

}  // namespace
}  // namespace plumbline::app

int main(int count, char** words) {
  try {
    return plumbline::app::record({words + 1, words + count});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "record_run: %s\n", error.what());
    return 1;
  }
}
