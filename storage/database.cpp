#include "storage/database.h"

#include <fmt/format.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace plumbline::storage {

namespace fs = std::filesystem;

namespace {

constexpr int kBusyTimeout_ms = 5000;

/// A WAL database in a folder that cannot be written (an archive, a read-only mount) has nowhere to
/// put its shared-memory file. Nobody can be writing there, so it may be read as immutable.
bool is_archived(const fs::path& file) {
  std::error_code error;
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  return ::access(folder.c_str(), W_OK) != 0 && !fs::exists(file.string() + "-wal", error);
}

std::string uri_of(const fs::path& file, bool immutable) {
  std::string uri = "file:";
  for (const char c : file.string()) {
    if (c == '%' || c == '?' || c == '#') {
      uri += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    } else {
      uri += c;
    }
  }
  return immutable ? uri + "?immutable=1" : uri;
}

}  // namespace

// --- statement -----------------------------------------------------------------------------------

void Statement::Finalizer::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

void Statement::keep(int code) {
  if (bind_failure_ == SQLITE_OK) bind_failure_ = code;
}

void Statement::bind_integer(int index, long long value) {
  keep(sqlite3_bind_int64(statement_.get(), index, value));
}

void Statement::bind_at(int index, double value) {
  keep(sqlite3_bind_double(statement_.get(), index, value));
}

void Statement::bind_at(int index, std::string_view value) {
  // An empty view may have no address, which SQLite would take for NULL.
  keep(sqlite3_bind_text64(statement_.get(), index, value.empty() ? "" : value.data(), value.size(),
                           SQLITE_TRANSIENT, SQLITE_UTF8));
}

void Statement::bind_at(int index, Bytes value) {
  keep(sqlite3_bind_blob64(statement_.get(), index, value.data(), value.size(), SQLITE_TRANSIENT));
}

Result<bool> Statement::step() {
  errno = 0;
  const int code =
      bind_failure_ == SQLITE_OK ? sqlite3_step(statement_.get()) : std::exchange(bind_failure_, 0);
  if (code == SQLITE_ROW) return true;
  // The message belongs to the connection and would be overwritten by the reset.
  Result<bool> end = false;
  if (code != SQLITE_DONE) end = database_->failure_of(code);
  sqlite3_reset(statement_.get());
  return end;
}

long long Statement::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

double Statement::real(int column) const { return sqlite3_column_double(statement_.get(), column); }

std::string Statement::text(int column) const {
  const auto* text = sqlite3_column_text(statement_.get(), column);
  if (text == nullptr) return {};
  return {reinterpret_cast<const char*>(text),
          static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

Bytes Statement::bytes(int column) const {
  const auto* data = static_cast<const std::byte*>(sqlite3_column_blob(statement_.get(), column));
  return {data, static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

// --- connection ----------------------------------------------------------------------------------

Result<std::unique_ptr<Database>> Database::open(const fs::path& file, OpenMode mode) {
  std::unique_ptr<Database> database(new Database(file, mode));
  const bool read_only = mode == OpenMode::read_only;
  const int flags = SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX |
                    (read_only ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  const std::string uri = uri_of(file, read_only && is_archived(file));
  const int code = sqlite3_open_v2(uri.c_str(), &database->connection_, flags, nullptr);
  if (code != SQLITE_OK) return database->failure_of(code);
  sqlite3_extended_result_codes(database->connection_, 1);
  sqlite3_busy_timeout(database->connection_, kBusyTimeout_ms);
  // Recursive triggers also fire for the rows that an INSERT OR REPLACE would remove.
  const auto done = database->execute("PRAGMA foreign_keys=ON; PRAGMA recursive_triggers=ON");
  if (!done) return fail(done.error());
  return database;
}

Result<void> Database::make_durable() const {
  return execute("PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL");
}

Database::~Database() { sqlite3_close(connection_); }

Result<Statement> Database::prepare(std::string_view sql) const {
  sqlite3_stmt* statement = nullptr;
  const int code = sqlite3_prepare_v2(connection_, sql.data(), static_cast<int>(sql.size()),
                                      &statement, nullptr);
  if (code != SQLITE_OK) return failure_of(code);
  return Statement(*this, statement);
}

Result<void> Database::execute(const std::string& script) const {
  errno = 0;
  const int code = sqlite3_exec(connection_, script.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) return failure_of(code);
  return {};
}

Result<long long> Database::integer(std::string_view sql) const {
  auto statement = prepare(sql);
  if (!statement) return fail(statement.error());
  const auto row = statement->step();
  if (!row) return fail(row.error());
  return *row ? statement->integer(0) : 0;
}

long long Database::last_insert_id() const { return sqlite3_last_insert_rowid(connection_); }

tl::unexpected<Error> Database::failure(const std::string& text) const {
  return fail(mode_ == OpenMode::read_only ? ErrorCode::input : ErrorCode::storage,
              file_.string() + ": " + text);
}

tl::unexpected<Error> Database::failure_of(int code) const {
  const int last_errno = errno;
  if ((code & 0xff) == SQLITE_NOTADB) return failure("is not an SQLite database");
  std::string text = connection_ == nullptr ? sqlite3_errstr(code) : sqlite3_errmsg(connection_);
  const int primary = code & 0xff;
  // SQLite keeps errno itself, except for what fails in a COMMIT; there errno is still as it was.
  int os_error = connection_ == nullptr ? 0 : sqlite3_system_errno(connection_);
  if (os_error == 0) os_error = last_errno;
  const bool of_the_disk =
      primary == SQLITE_IOERR || primary == SQLITE_FULL || primary == SQLITE_CANTOPEN;
  if (os_error != 0 && of_the_disk) {
    text += fmt::format(" ({})", std::generic_category().message(os_error));
  }
  const bool no_room = of_the_disk && (os_error == ENOSPC || os_error == EDQUOT);
  if (primary == SQLITE_FULL || no_room) text += "; free some space and resume";
  return failure(text);
}

// --- transaction ---------------------------------------------------------------------------------

Result<Transaction> Transaction::begin(const Database& database, Kind kind) {
  const auto done = database.execute(kind == Kind::writing ? "BEGIN IMMEDIATE" : "BEGIN");
  if (!done) return fail(done.error());
  return Transaction(database);
}

Transaction::~Transaction() {
  // Some failures (disk full among them) have rolled back already.
  if (database_ != nullptr && sqlite3_get_autocommit(database_->connection_) == 0) {
    sqlite3_exec(database_->connection_, "ROLLBACK", nullptr, nullptr, nullptr);
  }
}

Result<void> Transaction::commit() {
  auto done = database_->execute("COMMIT");
  if (done) database_ = nullptr;
  return done;
}

}  // namespace plumbline::storage
