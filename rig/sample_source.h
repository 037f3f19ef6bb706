// Samples of the accelerometer node, whatever carries its frames.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::rig {

/// A slowly sampled quantity that came over the bus beside the samples (supply voltage, humidity
/// …).
struct CovariateReading {
  std::string name;  ///< covariate column name from the configuration, e.g. "rh_pct"
  double t_s = 0;    ///< on the node sample clock: of the latest complete sample
  double value = 0;
};

/// Name under which the node's own number arrives among the covariates, when it sends one.
inline constexpr const char* kIdentityColumn = "node identity";

/// Losses and errors since open(); every counter only grows.
struct SourceStatistics {
  std::uint64_t frames = 0;
  std::uint64_t samples = 0;
  std::uint64_t lost_samples = 0;  ///< gaps of the node's counter
  std::uint64_t crc_errors = 0;    ///< wrong checksum or length
  std::uint64_t out_of_order = 0;  ///< duplicates and reordered samples, refused
  std::uint64_t unpaired = 0;      ///< A without B or B without A
  std::uint64_t kernel_drops = 0;  ///< SO_RXQ_OVFL
  std::uint64_t queue_drops = 0;   ///< our own bounded queue was full
  std::uint64_t error_frames = 0;  ///< CAN error frames (bus-off and so on)
  std::string last_error_frame;    ///< what the last of them said; empty when there was none
  std::uint64_t receive_buffer_bytes = 0;  ///< SO_RCVBUF as read back, 0 where there is none
};

/// What one call delivered. Everything that had been on its way at `empty_at` is in this or an
/// earlier batch: nothing was waiting to be read at that time, or a moment later. `ended` is true
/// when a recorded log has been read to its end.
struct SampleBatch {
  std::vector<RawSample> samples;
  std::vector<CovariateReading> covariates;
  std::chrono::steady_clock::time_point empty_at{};
  bool ended = false;
};

/// A stream of samples. read() is called from one thread.
class SampleSource {
 public:
  virtual ~SampleSource() = default;

  virtual Result<void> open() = 0;
  /// Waits until something arrives or `timeout` passes (an empty batch is not an error).
  virtual Result<SampleBatch> read(std::chrono::milliseconds timeout) = 0;
  virtual SourceStatistics statistics() const = 0;
  /// True for a recording: it waits for its reader and has an end.
  virtual bool recorded() const { return false; }
  /// "can:can0" and so on, for messages.
  virtual std::string address() const = 0;
};

}  // namespace plumbline::rig
