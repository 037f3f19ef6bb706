// Samples from a CAN carrier of any kind.
#pragma once

#include <chrono>
#include <memory>

#include "rig/carrier.h"
#include "rig/rig_config.h"
#include "rig/sample_assembler.h"
#include "rig/sample_source.h"

namespace plumbline::rig {

/// open() may be called again after a failure: the sample clock goes on, by the time that has
/// passed when the node has been switched off and on.
class CanSource : public SampleSource {
 public:
  CanSource(std::unique_ptr<Carrier> carrier, FrameLayout layout, double rate_hz,
            std::chrono::milliseconds silence_timeout);

  Result<void> open() override;
  /// Fails after silence_timeout without a sample; reading may go on after that.
  Result<SampleBatch> read(std::chrono::milliseconds timeout) override;
  SourceStatistics statistics() const override;
  std::string address() const override { return carrier_->address(); }
  bool recorded() const override { return carrier_->recorded(); }

 private:
  using Clock = std::chrono::steady_clock;

  void take(const CanFrame& frame, SampleBatch& batch);
  double expected_advance() const;
  Result<void> check_silence();

  std::unique_ptr<Carrier> carrier_;
  SampleAssembler assembler_;
  double rate_hz_;
  std::chrono::milliseconds silence_timeout_;
  SourceStatistics frames_;  ///< frames, error frames and what they said
  /// Time spent waiting since the last sample: unlike the time that has passed it does not grow
  /// while frames wait for us.
  Clock::duration waited_{};
  Clock::duration silent_{};  ///< the same, since the last sample or the last complaint
  Clock::time_point first_sample_at_;
  Clock::time_point last_sample_at_;
  std::int64_t first_counter_ = 0;
};

}  // namespace plumbline::rig
