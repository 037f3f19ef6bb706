// Orders to a running engine, from a signal handler or another thread.
#pragma once

#include <atomic>

namespace plumbline::app {

/// What the engine has been asked for and has not done yet. All calls are safe in signal handlers;
/// the engine looks at every turn of its waiting loops.
class EngineControl {
 public:
  enum class Pause {
    none,
    at_pose,  ///< once the pose being measured is committed
    now,      ///< at once: motors stopped, the pose is measured anew later
  };

  /// Motors stopped, run closed and resumable. The engine insists on a confirmed safe state: a
  /// drive that is silent is called again first.
  void request_stop() noexcept { raise_end(kStop); }
  /// The same without insisting: one stop command, then the end.
  void request_abort() noexcept { raise_end(kAbort); }
  /// Ends a pause; and takes back one that has not begun yet.
  void request_resume() noexcept { pause_.store(Pause::none, std::memory_order_relaxed); }
  void request_pause(Pause when) noexcept { pause_.store(when, std::memory_order_relaxed); }

  bool stop_requested() const noexcept { return end_.load(std::memory_order_relaxed) >= kStop; }
  bool abort_requested() const noexcept { return end_.load(std::memory_order_relaxed) >= kAbort; }
  Pause pause_requested() const noexcept { return pause_.load(std::memory_order_relaxed); }

 private:
  static constexpr int kStop = 1;
  static constexpr int kAbort = 2;
  void raise_end(int how) noexcept {
    int before = end_.load(std::memory_order_relaxed);
    while (before < how && !end_.compare_exchange_weak(before, how, std::memory_order_relaxed)) {
    }
  }

  static_assert(std::atomic<int>::is_always_lock_free, "set from a signal handler");
  static_assert(std::atomic<Pause>::is_always_lock_free, "set from a signal handler");
  std::atomic<int> end_{0};
  std::atomic<Pause> pause_{Pause::none};
};

}  // namespace plumbline::app
