// From stored rows to what the engine reads: codes become volts, visits become numbered poses.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "storage/database.h"
#include "storage/run_store.h"

namespace plumbline::storage {

/// The kind that to_string() made this text of.
PoseKind pose_kind_from(const std::string& text);

/// All runs, oldest first, with the counts of their poses and samples.
Result<std::vector<RunSummary>> list_runs(const Database& database);

/// A pose as it stands in the database, with the link that was stored for it.
struct StoredPose {
  long long id = 0;
  PoseRecord record;
  std::string link;  ///< hexadecimal; empty: none
  bool suspect = false;
  bool consistent = true;  ///< the columns that repeat what the samples say agree with them
};

/// Every pose of a run in the order of the visits.
Result<void> each_pose(const Database& database, RunId run,
                       const std::function<void(const StoredPose&)>& use);

/// What was noted during a run, oldest first.
Result<std::vector<EventRecord>> list_events(const Database& database, RunId run);

/// One run as of one instant, even while another process is writing it (see RunStore::load).
Result<StoredRun> load_run(const Database& database, RunId run);

}  // namespace plumbline::storage
