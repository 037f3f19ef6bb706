// A disk that fails on request: SQLite's file layer with the N-th write or sync, and all after it,
// refused.
#pragma once

#include <sqlite3.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace plumbline::storage {

/// Becomes SQLite's default file system as long as it lives. One at a time.
class FailingVfs {
 public:
  FailingVfs() {
    state().real = sqlite3_vfs_find(nullptr);
    vfs_ = *state().real;
    vfs_.zName = "failing";
    vfs_.szOsFile = static_cast<int>(sizeof(File)) + state().real->szOsFile;
    vfs_.xOpen = &open;
    sqlite3_vfs_register(&vfs_, 1);
  }
  ~FailingVfs() {
    sqlite3_vfs_unregister(&vfs_);
    sqlite3_vfs_register(state().real, 1);
  }
  FailingVfs(const FailingVfs&) = delete;
  FailingVfs& operator=(const FailingVfs&) = delete;

  /// The `n`-th write or sync from now (1 is the next) fails with `code`, and so do all after it.
  void fail_at(int n, int code) {
    state().left = n;
    state().code = code;
  }
  void work_again() { state().code = SQLITE_OK; }

 private:
  struct State {
    sqlite3_vfs* real = nullptr;
    int left = 0;
    int code = SQLITE_OK;
  };
  static State& state() {
    static State the_state;
    return the_state;
  }
  /// The real file lies directly behind in the memory that SQLite gives (aligned to 8 bytes).
  struct File {
    sqlite3_file base;
    sqlite3_io_methods methods;
  };
  static sqlite3_file* real(sqlite3_file* file) {
    return reinterpret_cast<sqlite3_file*>(reinterpret_cast<File*>(file) + 1);
  }
  static int verdict() {
    if (state().code == SQLITE_OK) return SQLITE_OK;
    if (state().left > 1) {
      --state().left;
      return SQLITE_OK;
    }
    return state().code;
  }

  static int open(sqlite3_vfs*, sqlite3_filename name, sqlite3_file* file, int flags, int* out) {
    auto* self = reinterpret_cast<File*>(file);
    self->base.pMethods = nullptr;
    const int code = state().real->xOpen(state().real, name, real(file), flags, out);
    if (real(file)->pMethods == nullptr) return code;
    self->methods = {
        .iVersion = real(file)->pMethods->iVersion < 2 ? real(file)->pMethods->iVersion : 2,
        .xClose = [](sqlite3_file* f) { return real(f)->pMethods->xClose(real(f)); },
        .xRead = [](sqlite3_file* f, void* data, int n,
                    sqlite3_int64 at) { return real(f)->pMethods->xRead(real(f), data, n, at); },
        .xWrite =
            [](sqlite3_file* f, const void* data, int n, sqlite3_int64 at) {
              const int refused = verdict();
              return refused != SQLITE_OK ? refused
                                          : real(f)->pMethods->xWrite(real(f), data, n, at);
            },
        .xTruncate = [](sqlite3_file* f,
                        sqlite3_int64 size) { return real(f)->pMethods->xTruncate(real(f), size); },
        .xSync =
            [](sqlite3_file* f, int how) {
              const int refused = verdict();
              return refused != SQLITE_OK ? SQLITE_IOERR_FSYNC
                                          : real(f)->pMethods->xSync(real(f), how);
            },
        .xFileSize =
            [](sqlite3_file* f, sqlite3_int64* size) {
              return real(f)->pMethods->xFileSize(real(f), size);
            },
        .xLock = [](sqlite3_file* f,
                    int level) { return real(f)->pMethods->xLock(real(f), level); },
        .xUnlock = [](sqlite3_file* f,
                      int level) { return real(f)->pMethods->xUnlock(real(f), level); },
        .xCheckReservedLock =
            [](sqlite3_file* f, int* reserved) {
              return real(f)->pMethods->xCheckReservedLock(real(f), reserved);
            },
        .xFileControl =
            [](sqlite3_file* f, int op, void* argument) {
              return real(f)->pMethods->xFileControl(real(f), op, argument);
            },
        .xSectorSize = [](sqlite3_file* f) { return real(f)->pMethods->xSectorSize(real(f)); },
        .xDeviceCharacteristics =
            [](sqlite3_file* f) { return real(f)->pMethods->xDeviceCharacteristics(real(f)); },
        .xShmMap =
            [](sqlite3_file* f, int page, int size, int extend, void volatile** memory) {
              return real(f)->pMethods->xShmMap(real(f), page, size, extend, memory);
            },
        .xShmLock = [](sqlite3_file* f, int offset, int n,
                       int how) { return real(f)->pMethods->xShmLock(real(f), offset, n, how); },
        .xShmBarrier = [](sqlite3_file* f) { real(f)->pMethods->xShmBarrier(real(f)); },
        .xShmUnmap = [](sqlite3_file* f,
                        int remove) { return real(f)->pMethods->xShmUnmap(real(f), remove); },
        .xFetch = nullptr,
        .xUnfetch = nullptr,
    };
    self->base.pMethods = &self->methods;
    return code;
  }

  sqlite3_vfs vfs_{};
};

}  // namespace plumbline::storage
