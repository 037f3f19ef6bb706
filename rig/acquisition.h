// Reads a SampleSource on a thread of its own into a bounded queue that counts what it drops.
#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "rig/sample_source.h"

namespace plumbline::rig {

/// One reading thread; take() may be called from one other thread.
class Acquisition {
 public:
  /// `capacity` in samples.
  explicit Acquisition(std::unique_ptr<SampleSource> source, std::size_t capacity = 1u << 16);
  ~Acquisition();
  Acquisition(const Acquisition&) = delete;
  Acquisition& operator=(const Acquisition&) = delete;

  /// Opens the source and starts the thread. After a failure it may be called again: the source is
  /// opened anew and its sample clock goes on.
  Result<void> start();
  void stop();

  /// Everything that has arrived since the last take(); waits up to `timeout` for the first of it.
  /// Fails when the source has failed; what had arrived before is delivered first.
  Result<SampleBatch> take(std::chrono::milliseconds timeout);
  /// Throws away what has arrived so far.
  void discard();
  SourceStatistics statistics() const;

 private:
  void run();
  /// Takes what there is room for; the mutex is held.
  void store(SampleBatch& batch);

  std::unique_ptr<SampleSource> source_;
  std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable arrived_;
  std::condition_variable room_;  ///< for a log, which waits where a live source drops
  SampleBatch queue_;
  std::uint64_t queue_drops_ = 0;
  SourceStatistics statistics_;
  std::optional<Error> failure_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace plumbline::rig
