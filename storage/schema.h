// The tables of a run database, their version, and the way from an older version to a newer one.
//
// The file carries kApplicationId (PRAGMA application_id), so that a foreign database is refused,
// and the version of its schema (PRAGMA user_version).
#pragma once

#include <span>
#include <string>

#include "storage/database.h"

namespace plumbline::storage {

/// "PLMB".
inline constexpr int kApplicationId = 0x504C4D42;

/// Leads from version `to - 1` to version `to`; version 0 is the empty file.
struct Migration {
  int to = 0;
  std::string script;
  Result<void> (*fill)(const Database&) = nullptr;  ///< runs after the script: what SQL cannot do
};

/// All migrations, ascending and without a gap; the last one's `to` is the current version.
std::span<const Migration> migrations();

/// Creates the schema in an empty file or brings an older one up to date, all in one transaction.
/// Errors: a foreign database and one of a newer program are ErrorCode::input.
Result<void> migrate(const Database& database, std::span<const Migration> steps = migrations());

/// For reading: the database must be ours and exactly of the current version.
Result<void> check_schema(const Database& database,
                          std::span<const Migration> steps = migrations());

}  // namespace plumbline::storage
