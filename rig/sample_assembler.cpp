#include "rig/sample_assembler.h"

#include <algorithm>
#include <cmath>

namespace plumbline::rig {

namespace {

/// A half waits for its other half as long as the counter runs this much further. Far below 128, so
/// that the eight bits which pair them never meet those of an earlier round.
constexpr int kPairWindow = 4;

/// Signed distance from `from` to `to` on the 8-bit circle.
int distance(std::uint8_t from, std::uint8_t to) {
  return static_cast<std::int8_t>(static_cast<std::uint8_t>(to - from));
}

}  // namespace

std::optional<std::int64_t> CounterUnwrapper::accept(std::uint16_t counter, double expected) {
  if (!last_ || advance_) {
    last_ = last_ ? *last_ + *advance_ : counter;
    advance_.reset();
    last_raw_ = counter;
    return last_;
  }
  constexpr double kRound = 65536.0;
  const auto step = static_cast<std::uint16_t>(counter - last_raw_);
  const auto rounds = static_cast<std::int64_t>(std::lround((expected - step) / kRound));
  const std::int64_t advance = step + rounds * 65536;
  if (advance <= 0) return std::nullopt;
  last_ = *last_ + advance;
  last_raw_ = counter;
  return last_;
}

void CounterUnwrapper::start_anew(std::int64_t advance) {
  if (last_) advance_ = std::max<std::int64_t>(advance, 1);
}

SampleAssembler::SampleAssembler(FrameLayout layout, double rate_hz)
    : layout_(std::move(layout)), rate_hz_(rate_hz) {}

std::uint8_t SampleAssembler::counter_of(const CanFrame& frame, bool is_second) const {
  return is_second ? layout_.counter_of_second(frame.bytes())
                   : layout_.counter_of_first(frame.bytes());
}

std::optional<RawSample> SampleAssembler::push(const CanFrame& frame, double expected_advance) {
  switch (layout_.classify(frame)) {
    case FrameLayout::Kind::foreign:
      return std::nullopt;
    case FrameLayout::Kind::first:
      return pair(frame, false, expected_advance);
    case FrameLayout::Kind::second:
      return pair(frame, true, expected_advance);
    case FrameLayout::Kind::both:
      return complete(layout_.cut(frame), expected_advance);
    case FrameLayout::Kind::damaged:
      ++statistics_.crc_errors;
      return std::nullopt;
  }
  return std::nullopt;
}

std::optional<RawSample> SampleAssembler::pair(const CanFrame& frame, bool is_second,
                                               double expected_advance) {
  const std::uint8_t counter = counter_of(frame, is_second);
  for (const bool second : {false, true}) {
    statistics_.unpaired += std::erase_if(waiting_[second], [&](const CanFrame& other) {
      return std::abs(distance(counter_of(other, second), counter)) > kPairWindow;
    });
  }
  if (last_low_) {
    const int behind = distance(counter, *last_low_);
    if (behind >= 0 && behind < kPairWindow) {  // half of a sample that is there or overtaken
      ++statistics_.out_of_order;
      ++refused_in_a_row_;
      return std::nullopt;
    }
  }
  const auto with_same_counter = [&](bool second) {
    return std::find_if(waiting_[second].begin(), waiting_[second].end(),
                        [&](const CanFrame& f) { return counter_of(f, second) == counter; });
  };
  if (with_same_counter(is_second) != waiting_[is_second].end()) {
    ++statistics_.out_of_order;
    return std::nullopt;
  }
  const auto other = with_same_counter(!is_second);
  if (other == waiting_[!is_second].end()) {
    waiting_[is_second].push_back(frame);
    return std::nullopt;
  }
  const CanFrame partner = *other;
  waiting_[!is_second].erase(other);
  const auto& first = is_second ? partner : frame;
  const auto& second = is_second ? frame : partner;
  return complete({first.bytes(), second.bytes()}, expected_advance);
}

std::optional<RawSample> SampleAssembler::complete(const SampleBytes& bytes,
                                                   double expected_advance) {
  const auto decoded = layout_.decode(bytes);
  if (!decoded) {
    ++statistics_.crc_errors;
    return std::nullopt;
  }
  const auto counter = unwrapper_.accept(decoded->counter, expected_advance);
  if (!counter) {
    ++statistics_.out_of_order;
    ++refused_in_a_row_;
    return std::nullopt;
  }
  refused_in_a_row_ = 0;
  if (!first_counter_) first_counter_ = *counter;
  if (last_) {
    statistics_.lost_samples += static_cast<std::uint64_t>(*counter - last_->counter - 1);
  }
  ++statistics_.samples;
  RawSample sample = decoded->sample;
  sample.counter = *counter;
  sample.t_s = static_cast<double>(*counter - *first_counter_) / rate_hz_;
  last_ = sample;
  last_low_ = static_cast<std::uint8_t>(decoded->counter);
  return sample;
}

void SampleAssembler::start_anew(double advance) {
  unwrapper_.start_anew(std::llround(advance));
  for (Waiting& waiting : waiting_) {
    statistics_.unpaired += waiting.size();
    waiting.clear();
  }
  last_low_.reset();
  refused_in_a_row_ = 0;
}

}  // namespace plumbline::rig
