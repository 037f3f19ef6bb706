// Puts samples together from frames: pairs the two messages, unwraps the counter, counts losses.
// Pure: no bus, no clock.
#pragma once

#include <deque>
#include <optional>

#include "rig/frame_layout.h"
#include "rig/sample_source.h"

namespace plumbline::rig {

/// Extends the node's 16-bit counter to 64 bits.
class CounterUnwrapper {
 public:
  /// The unwrapped counter, or nothing when it does not come after the last one accepted.
  /// `expected` is how far the counter should have run since then, to within ±32767: it tells how
  /// often the counter has wrapped in a long silence. 0 is right for anything shorter.
  std::optional<std::int64_t> accept(std::uint16_t counter, double expected);
  /// The node's counter has started anew, wherever: the next one accepted comes `advance` (at least
  /// 1) after the last, so that what is unwrapped only ever grows.
  void start_anew(std::int64_t advance);

 private:
  std::optional<std::int64_t> last_;
  std::optional<std::int64_t> advance_;  ///< of the first one after a new start
  std::uint16_t last_raw_ = 0;
};

/// One stream of frames of one node.
class SampleAssembler {
 public:
  SampleAssembler(FrameLayout layout, double rate_hz);

  /// A sample, when `frame` completes one. `expected_advance` as for CounterUnwrapper.
  std::optional<RawSample> push(const CanFrame& frame, double expected_advance);
  const FrameLayout& layout() const { return layout_; }
  /// Counts samples, losses, CRC errors, order and pairing.
  const SourceStatistics& statistics() const { return statistics_; }
  /// The last sample, if there was one.
  const std::optional<RawSample>& last() const { return last_; }
  /// True after so many samples in a row from the past that they cannot be latecomers: the node's
  /// counter has started anew.
  bool counter_went_back() const { return refused_in_a_row_ >= kMaxLatecomers; }
  /// Takes the node's counter as it comes from now on; samples and times go on `advance` samples
  /// after the last one.
  void start_anew(double advance);

 private:
  static constexpr int kMaxLatecomers = 50;
  using Waiting = std::deque<CanFrame>;

  std::optional<RawSample> pair(const CanFrame& frame, bool is_second, double expected_advance);
  std::optional<RawSample> complete(const SampleBytes& bytes, double expected_advance);
  std::uint8_t counter_of(const CanFrame& frame, bool is_second) const;

  FrameLayout layout_;
  double rate_hz_;
  std::array<Waiting, 2> waiting_;  ///< first messages, second messages
  CounterUnwrapper unwrapper_;
  std::optional<std::int64_t> first_counter_;
  std::optional<RawSample> last_;
  std::optional<std::uint8_t> last_low_;  ///< low byte of the last sample's counter, as sent
  int refused_in_a_row_ = 0;
  SourceStatistics statistics_;
};

}  // namespace plumbline::rig
