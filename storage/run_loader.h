// From stored rows to what the engine reads: codes become volts, visits become numbered poses.
#pragma once

#include <vector>

#include "storage/database.h"
#include "storage/run_store.h"

namespace plumbline::storage {

/// All runs, oldest first, with the counts of their poses and samples.
Result<std::vector<RunSummary>> list_runs(const Database& database);

/// One run as of one instant, even while another process is writing it (see RunStore::load).
Result<StoredRun> load_run(const Database& database, RunId run);

}  // namespace plumbline::storage
