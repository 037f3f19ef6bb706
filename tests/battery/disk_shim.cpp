// A disk that kills or fails on request, and a clock that is set, under an unchanged program:
// LD_PRELOAD this library.
//
// Every write to, and sync of, a file whose name contains PLUMBLINE_DISK_FILES is one step; with
// PLUMBLINE_DISK_SYNCS=1 only the syncs are. The N-th step from the start of the program
//   PLUMBLINE_DISK_KILL=N    ends it with SIGKILL, before the step (N odd) or after it (N even)
//   PLUMBLINE_DISK_FULL=N    and all after it fail with ENOSPC
// PLUMBLINE_CLOCK_STEP=S sets the time of day S seconds on (or back) after it has been asked for
// PLUMBLINE_CLOCK_AFTER times.
// PLUMBLINE_DISK_COUNT=FILE receives the number of steps when the program ends by itself.
#include <dlfcn.h>
#include <signal.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

long number(const char* name) {
  const char* text = std::getenv(name);
  return text == nullptr ? 0 : std::atol(text);
}

struct Settings {
  const char* files = std::getenv("PLUMBLINE_DISK_FILES");
  const char* count_file = std::getenv("PLUMBLINE_DISK_COUNT");
  bool syncs_only = number("PLUMBLINE_DISK_SYNCS") != 0;
  long kill_at = number("PLUMBLINE_DISK_KILL");
  long full_at = number("PLUMBLINE_DISK_FULL");
  long clock_step_s = number("PLUMBLINE_CLOCK_STEP");
  long clock_after = number("PLUMBLINE_CLOCK_AFTER");
};

const Settings& settings() {
  static const Settings the_settings;
  return the_settings;
}

std::atomic<long> steps{0};
std::atomic<long> looks_at_clock{0};

bool watched(int fd) {
  if (settings().files == nullptr) return false;
  char link[64];
  char path[4096];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const ssize_t length = ::readlink(link, path, sizeof path - 1);
  if (length <= 0) return false;
  path[length] = '\0';
  return std::strstr(path, settings().files) != nullptr;
}

template <class Do>
ssize_t step(int fd, bool is_sync, Do&& act) {
  if ((settings().syncs_only && !is_sync) || !watched(fd)) return act();
  const long number_of_this = ++steps;
  if (settings().full_at > 0 && number_of_this >= settings().full_at) {
    errno = ENOSPC;
    return -1;
  }
  const bool last = number_of_this == settings().kill_at;
  if (last && number_of_this % 2 == 1) ::raise(SIGKILL);
  const ssize_t result = act();
  if (last) ::raise(SIGKILL);
  return result;
}

template <class Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

struct Counter {
  ~Counter() {
    if (settings().count_file == nullptr) return;
    if (std::FILE* file = std::fopen(settings().count_file, "w")) {
      std::fprintf(file, "%ld\n", steps.load());
      std::fclose(file);
    }
  }
} counter;

}  // namespace

extern "C" {

int fsync(int fd) {
  static const auto real = next<int (*)(int)>("fsync");
  return static_cast<int>(step(fd, true, [&] { return ssize_t{real(fd)}; }));
}

int fdatasync(int fd) {
  static const auto real = next<int (*)(int)>("fdatasync");
  return static_cast<int>(step(fd, true, [&] { return ssize_t{real(fd)}; }));
}

ssize_t pwrite64(int fd, const void* data, size_t size, off64_t at) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t, off64_t)>("pwrite64");
  return step(fd, false, [&] { return real(fd, data, size, at); });
}

ssize_t pwrite(int fd, const void* data, size_t size, off_t at) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t, off_t)>("pwrite");
  return step(fd, false, [&] { return real(fd, data, size, at); });
}

ssize_t write(int fd, const void* data, size_t size) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t)>("write");
  return step(fd, false, [&] { return real(fd, data, size); });
}

time_t time(time_t* result) {
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  const bool is_set = ++looks_at_clock > settings().clock_after;
  const time_t told = now.tv_sec + (is_set ? settings().clock_step_s : 0);
  if (result != nullptr) *result = told;
  return told;
}

}  // extern "C"
