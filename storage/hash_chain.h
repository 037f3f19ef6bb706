// A hash chain over what a run has measured: whoever changes, removes or inserts a pose breaks it.
//
// Link 0 is the SHA-256 (FIPS 180-4) of the run's description; each committed pose adds one link,
// the SHA-256 of the link before and the canonical bytes of the pose. The last link, the head,
// stands in the run's row, in result.json and on the certificate: whoever keeps a certificate can
// prove that the database still holds what was certified.
//
// Canonical bytes, little-endian, no padding: integers as int64, reals as IEEE 754 binary64 (zero
// without sign), texts and the sample BLOB (sample_blob.h) as int64 length and bytes.
//   run:  "plumbline.chain/1", id, serial, program version, start (UTC), rate, converter bits, min,
//         max, configuration, plan
//   pose: ordinal, kind, commanded δ and h, encoder δ and h, settling time, capped, approach,
//         number of samples, samples; number of covariates, then name, time and value of each
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "storage/database.h"
#include "storage/run_store.h"

namespace plumbline::storage {

using Hash = std::array<std::byte, 32>;

Hash first_link(RunId run, const RunHeader& header);
Hash next_link(const Hash& before, const PoseRecord& pose);
/// 64 lower-case hexadecimal digits.
std::string to_hex(Bytes hash);

/// Checks one run as of one instant.
Result<ChainReport> check_chain(const Database& database, RunId run);

/// Numbers that were given to runs which are not there any more: runs are numbered without a gap.
Result<std::vector<RunId>> removed_runs(const Database& database);

/// For runs recorded before there was a chain: computes their links from what they hold now.
Result<void> link_older_runs(const Database& database);

}  // namespace plumbline::storage
