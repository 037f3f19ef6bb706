// SQLite with its resources owned by objects: connection, prepared statement, transaction.
//
// The three classes belong to one thread. Every failure is one line that names the file, what
// SQLite says and, for disk errors, what the operating system says.
#pragma once

#include <concepts>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "estimator/measurement.h"

struct sqlite3;
struct sqlite3_stmt;

namespace plumbline::storage {

enum class OpenMode {
  read_only,  ///< the file must exist; failures are ErrorCode::input
  create,     ///< read and write, created when absent; failures are ErrorCode::storage
};

using Bytes = std::span<const std::byte>;

/// One prepared statement. The first failed binding is kept and reported by step().
class Statement {
 public:
  /// Values go to the parameters ?1, ?2 … in order. A NaN is bound as NULL, which our columns
  /// refuse. Text and bytes are copied.
  template <class... Values>
  Statement& bind(const Values&... values) {
    int index = 0;
    (bind_at(++index, values), ...);
    return *this;
  }

  /// True when a row is there, false at the end. After an end or failure the statement is reset
  /// and may be bound again.
  Result<bool> step();

  long long integer(int column) const;
  double real(int column) const;
  std::string text(int column) const;
  /// Valid until the next step().
  Bytes bytes(int column) const;

 private:
  friend class Database;
  struct Finalizer {
    void operator()(sqlite3_stmt* statement) const;
  };
  Statement(const class Database& database, sqlite3_stmt* statement)
      : database_(&database), statement_(statement) {}

  template <std::integral Integer>
  void bind_at(int index, Integer value) {
    bind_integer(index, static_cast<long long>(value));
  }
  void bind_at(int index, double value);
  void bind_at(int index, std::string_view value);
  void bind_at(int index, Bytes value);
  void bind_integer(int index, long long value);
  void keep(int code);

  const Database* database_;
  std::unique_ptr<sqlite3_stmt, Finalizer> statement_;
  int bind_failure_ = 0;
};

/// One connection with foreign keys on and a busy timeout.
/// Does not move: statements and transactions point to it.
class Database {
 public:
  static Result<std::unique_ptr<Database>> open(const std::filesystem::path& file, OpenMode mode);
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;
  ~Database();

  /// From now on a commit that returned is on the disk: write-ahead log, every commit synced
  /// (synchronous=NORMAL loses acknowledged commits in a power cut, FULL does not).
  Result<void> make_durable() const;

  Result<Statement> prepare(std::string_view sql) const;
  /// Runs a whole script of statements without parameters.
  Result<void> execute(const std::string& script) const;
  /// Runs one statement to its end and ignores its rows.
  template <class... Values>
  Result<void> run(std::string_view sql, const Values&... values) const {
    return each(
        sql, [](const Statement&) {}, values...);
  }
  /// Calls `on_row` for every row of one statement.
  template <class... Values>
  Result<void> each(std::string_view sql, const std::function<void(const Statement&)>& on_row,
                    const Values&... values) const {
    auto statement = prepare(sql);
    if (!statement) return fail(statement.error());
    statement->bind(values...);
    for (;;) {
      const auto row = statement->step();
      if (!row) return fail(row.error());
      if (!*row) return {};
      on_row(*statement);
    }
  }
  /// The single integer that a statement yields, such as a PRAGMA or a count.
  Result<long long> integer(std::string_view sql) const;

  long long last_insert_id() const;
  /// A failure of this connection, with `text` behind the file's name.
  tl::unexpected<Error> failure(const std::string& text) const;
  const std::filesystem::path& file() const { return file_; }

 private:
  friend class Statement;
  friend class Transaction;
  Database(std::filesystem::path file, OpenMode mode) : file_(std::move(file)), mode_(mode) {}
  tl::unexpected<Error> failure_of(int code) const;

  std::filesystem::path file_;
  OpenMode mode_;
  sqlite3* connection_ = nullptr;
};

/// Rolls back unless committed.
class Transaction {
 public:
  enum class Kind { reading, writing };
  /// `writing` takes the write lock at once, so that a commit never meets another writer.
  static Result<Transaction> begin(const Database& database, Kind kind);
  Transaction(Transaction&& other) noexcept : database_(std::exchange(other.database_, nullptr)) {}
  Transaction& operator=(Transaction&&) = delete;
  ~Transaction();

  Result<void> commit();

 private:
  explicit Transaction(const Database& database) : database_(&database) {}
  const Database* database_;
};

}  // namespace plumbline::storage
