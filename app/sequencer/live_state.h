// The newest state of a running engine, for threads that look at it from outside.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <mutex>
#include <string>
#include <vector>

#include "app/sequencer/engine_report.h"

namespace plumbline::app {

/// What does not change during a run.
struct LiveRun {
  std::string serial;
  std::string database;
  std::string out;
  std::string started_utc;
  double rate_hz = 0;
  Adc adc;
};

struct LiveSnapshot {
  LiveRun run;
  Progress progress;
  double elapsed_s = 0;            ///< host clock, since the session began
  double state_since_s = 0;        ///< how long the engine has been in this state, host clock
  double remaining_s = -1;         ///< host clock, by the pace so far; −1: not known yet
  std::size_t poses = 0;           ///< how many pose means can be asked for
  std::vector<RawSample> samples;  ///< the newest ones, at most kRecentSamples, thinned to ≤ 50/s
  std::vector<storage::EventRecord> events;  ///< the newest ones, at most kRecentEvents
};

/// Thread safe. update() is called by the engine's thread and never waits for a reader for longer
/// than copying a snapshot takes.
class LiveState {
 public:
  static constexpr std::size_t kRecentSamples = 100;
  static constexpr std::size_t kRecentEvents = 20;

  explicit LiveState(LiveRun run);

  void update(const Progress& progress);
  LiveSnapshot snapshot() const;
  /// Means of the poses committed in this session from index `first` on, at most `most`.
  std::vector<PoseMean> poses(std::size_t first, std::size_t most) const;
  /// Counts changes of state, events and committed poses; what else changes is not worth waking
  /// for.
  std::uint64_t version() const;

 private:
  using Clock = std::chrono::steady_clock;

  mutable std::mutex mutex_;
  LiveRun run_;
  Progress progress_;
  Clock::time_point start_ = Clock::now();
  Clock::time_point state_since_ = start_;
  Clock::time_point next_sample_ = start_;
  double planned_before_s_ = 0;  ///< what earlier sessions had done
  bool pace_started_ = false;
  Clock::time_point pace_start_ = start_;
  std::deque<RawSample> samples_;
  std::deque<storage::EventRecord> events_;
  std::vector<PoseMean> poses_;
  std::uint64_t version_ = 0;
};

}  // namespace plumbline::app
