// The turn of every waiting loop: samples, the drive's status, orders from outside.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <thread>
#include <utility>

#include "app/provenance.h"
#include "app/sequencer/engine.h"
#include "rig/sample_source.h"

namespace plumbline::app {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

Engine::Outcome<void> Engine::tick() {
  std::this_thread::sleep_until(next_poll_);
  next_poll_ = Clock::now() + options_.poll_interval;
  if (control_.stop_requested()) return stop_asked_for();
  if (store_failure_) return give_up(*store_failure_);
  if (auto received = receive(); !received) return received;
  auto status = asked(head_.status());
  if (!status) return tl::unexpected(status.error());
  status_ = *status;
  progress_.head = status_;
  report();
  if (status_.alarm[0] != 0 || status_.alarm[1] != 0) {
    return repeat(fmt::format("alarm of the drive (δ {}, h {})", rig::alarm_text(status_.alarm[0]),
                              rig::alarm_text(status_.alarm[1])));
  }
  if (homed_ && options_.home_end_latched && !status_.homed && !status_.moving) {
    return repeat("the drive has lost its homing");
  }
  if (holding_) return {};
  if (auto reason = reason_to_hold()) {
    return tl::unexpected(Interruption{Trouble::hold, {ErrorCode::rig, *std::move(reason)}});
  }
  return {};
}

Engine::Outcome<void> Engine::receive() {
  auto batch = acquisition_.take(milliseconds{0});
  if (!batch) {
    sensor_failure_ = batch.error();
    return repeat(batch.error().message);
  }
  const bool ended = batch->samples.empty() && batch->ended;
  use(*batch);
  if (ended) return give_up({ErrorCode::rig, "the recorded log of the sensor ended"});
  return {};
}

void Engine::use(rig::SampleBatch& batch) {
  // A log is read on demand: nothing of it is ever older than it should be.
  read_up_to_ = std::max(read_up_to_, batch.ended ? Clock::now() : batch.empty_at);
  if (!batch.samples.empty() && !any_sample_) {
    any_sample_ = true;
    clock_offset_s_ = start_s_ - batch.samples.back().t_s;
    // What came before the first look is older than the run's clock.
    batch.samples.erase(batch.samples.begin(), std::prev(batch.samples.end()));
  }
  for (RawSample& sample : batch.samples) {
    sample.t_s += clock_offset_s_;
    fresh_.push_back(sample);
    suspend_.add("temp_C", sample.t_s, sample.temp_C);
    if (suspend_.watches(kVibrationColumn)) watch_vibration(sample);
  }
  for (const rig::CovariateReading& reading : batch.covariates) {
    if (reading.name == rig::kIdentityColumn) {
      node_identity_ = fmt::format("{:.0f}", reading.value);
      continue;
    }
    const double t_s = reading.t_s + clock_offset_s_;
    suspend_.add(reading.name, t_s, reading.value);
    if (any_sample_) covariates_.push_back({reading.name, t_s, reading.value});
  }
  progress_.samples_received += batch.samples.size();
  if (batch.samples.empty()) return;
  newest_ = batch.samples.back();
  progress_.t_s = newest_.t_s;
  progress_.newest = newest_;
}

void Engine::watch_vibration(const RawSample& sample) {
  const bool at_rest =
      progress_.state == EngineState::sampling || progress_.state == EngineState::paused;
  if (!at_rest || !floor_ || status_.moving ||
      (!rest_window_.empty() && sample.counter != rest_window_.back().counter + 1)) {
    rest_window_.clear();
  }
  if (!at_rest || !floor_ || status_.moving) return;
  rest_window_.push_back(sample);
  const auto window = static_cast<std::size_t>(options_.settling.window);
  if (rest_window_.size() < window) return;
  double worst = 0;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    double mean = 0;
    double square = 0;
    for (const RawSample& one : rest_window_) {
      mean += static_cast<double>(one.code[axis]) / static_cast<double>(window);
    }
    for (const RawSample& one : rest_window_) {
      const double deviation = static_cast<double>(one.code[axis]) - mean;
      square += deviation * deviation / static_cast<double>(window - 1);
    }
    worst = std::max(worst, std::sqrt(square) * options_.adc.lsb_V() / floor_->sd_V[axis]);
  }
  suspend_.add(kVibrationColumn, sample.t_s, worst);
  rest_window_.clear();
}

void Engine::enter(EngineState state, const std::string& text) {
  progress_.state = state;
  progress_.reason = text;
  note("state", fmt::format("{}: {}", to_string(state), text));
}

void Engine::note(const std::string& kind, const std::string& text) {
  progress_.last_event = {newest_.t_s, utc_now(), kind, text};
  ++progress_.events;
  auto stored = store_.add_event(run_, progress_.last_event);
  if (!stored && !store_failure_) store_failure_ = stored.error();
  report();
}

void Engine::report() {
  if (observer_) observer_(progress_);
}

}  // namespace plumbline::app
