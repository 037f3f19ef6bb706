#include "rig/can_source.h"

#include <fmt/format.h>

#include <algorithm>

namespace plumbline::rig {

namespace {

/// Bounds one batch, so that a fast stream or a log reaches the reader in pieces.
constexpr int kMaxFramesPerRead = 4096;
/// Before that the counter's pace on this host is not known, and the nominal rate stands for it.
constexpr double kPaceKnown_s = 1.0;

double seconds(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

CanSource::CanSource(std::unique_ptr<Carrier> carrier, FrameLayout layout, double rate_hz,
                     std::chrono::milliseconds silence_timeout)
    : carrier_(std::move(carrier)),
      assembler_(std::move(layout), rate_hz),
      rate_hz_(rate_hz),
      silence_timeout_(silence_timeout) {}

Result<void> CanSource::open() {
  if (auto opened = carrier_->open(); !opened) return opened;
  silent_ = {};
  if (assembler_.last()) waited_ = Clock::now() - last_sample_at_;
  // Whoever opens us again after that complaint accepts the node as it is now.
  if (assembler_.counter_went_back()) assembler_.start_anew(expected_advance());
  return {};
}

double CanSource::expected_advance() const {
  if (carrier_->recorded() || !assembler_.last()) return 0;
  const double span_s = seconds(last_sample_at_ - first_sample_at_);
  // A simulated rig may run faster than the clock on the wall.
  const double pace_hz =
      span_s < kPaceKnown_s
          ? rate_hz_
          : static_cast<double>(assembler_.last()->counter - first_counter_) / span_s;
  return pace_hz * seconds(waited_);
}

void CanSource::take(const CanFrame& frame, SampleBatch& batch) {
  ++frames_.frames;
  if (frame.error) {
    ++frames_.error_frames;
    frames_.last_error_frame = error_frame_text(frame);
    return;
  }
  if (const auto sample = assembler_.push(frame, expected_advance())) {
    last_sample_at_ = Clock::now();
    if (assembler_.statistics().samples == 1) {
      first_sample_at_ = last_sample_at_;
      first_counter_ = sample->counter;
    }
    waited_ = {};
    silent_ = {};
    batch.samples.push_back(*sample);
  }
  for (const auto& [column, value] : assembler_.layout().covariates(frame)) {
    const double t_s = assembler_.last() ? assembler_.last()->t_s : 0.0;
    batch.covariates.push_back({*column, t_s, value});
  }
}

Result<void> CanSource::check_silence() {
  if (carrier_->recorded() || silent_ < silence_timeout_) return {};
  silent_ = {};
  const std::string bus =
      frames_.last_error_frame.empty() ? "" : "; the bus said: " + frames_.last_error_frame;
  return fail(ErrorCode::rig,
              fmt::format("{}: no sample for {:.1f} s ({} frames so far{}): is the node powered, "
                          "is the bus connected, does the DBC file fit?",
                          address(), seconds(silence_timeout_), frames_.frames, bus));
}

Result<SampleBatch> CanSource::read(std::chrono::milliseconds timeout) {
  SampleBatch batch;
  for (int taken = 0; taken < kMaxFramesPerRead; ++taken) {
    const Clock::time_point before = Clock::now();
    const auto frame = carrier_->receive(taken == 0 ? timeout : std::chrono::milliseconds{0});
    const Clock::duration waited = Clock::now() - before;
    waited_ += waited;
    silent_ += waited;
    if (!frame) {
      if (!batch.samples.empty()) return batch;  // the next call meets the failure again
      return fail(frame.error());
    }
    if (!*frame) {
      batch.empty_at = before;
      break;
    }
    take(**frame, batch);
  }
  batch.ended = carrier_->ended();
  if (assembler_.counter_went_back()) {
    return fail(ErrorCode::rig,
                fmt::format("{}: the node's sample counter went back from {}: has the node been "
                            "switched off and on?",
                            address(), assembler_.last()->counter & 0xFFFF));
  }
  if (batch.samples.empty()) {
    if (auto heard = check_silence(); !heard) return fail(heard.error());
  }
  return batch;
}

SourceStatistics CanSource::statistics() const {
  SourceStatistics all = assembler_.statistics();
  all.frames = frames_.frames;
  all.error_frames = frames_.error_frames;
  all.last_error_frame = frames_.last_error_frame;
  all.kernel_drops = carrier_->kernel_drops();
  all.receive_buffer_bytes = carrier_->receive_buffer_bytes();
  return all;
}

}  // namespace plumbline::rig
