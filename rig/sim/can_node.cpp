#include "rig/sim/can_node.h"

#include <algorithm>
#include <chrono>

namespace plumbline::sim {
namespace {

// Between two bursts: short against the samples of a rig at 1×, long against a context switch.
constexpr std::chrono::milliseconds kShortestSleep{1};
constexpr std::chrono::milliseconds kLongestSleep{10};

}  // namespace

CanNode::CanNode(Machine& machine, std::unique_ptr<FrameOutput> output, NodeFrames frames)
    : machine_(machine),
      output_(std::move(output)),
      frames_(std::move(frames)),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

CanNode::~CanNode() {
  machine_.attach_node(false);
  thread_.request_stop();
  thread_.join();
}

std::optional<Error> CanNode::failure() const {
  const std::lock_guard lock(mutex_);
  return failure_;
}

void CanNode::run(const std::stop_token& stop) {
  machine_.attach_node(true);
  while (!stop.stop_requested()) {
    output_->service();
    if (auto sent = send_due(); !sent) {
      machine_.attach_node(false);
      const std::lock_guard lock(mutex_);
      failure_ = sent.error();
      return;
    }
    const std::chrono::duration<double> until_next((machine_.next_sample_s() - machine_.now_s()) /
                                                   machine_.speed());
    machine_.wait_for_demand(std::clamp(std::chrono::ceil<std::chrono::microseconds>(until_next),
                                        std::chrono::microseconds(kShortestSleep),
                                        std::chrono::microseconds(kLongestSleep)));
  }
}

Result<void> CanNode::send_due() {
  for (const TimedSample& timed : machine_.take_samples()) {
    for (const can_frame& frame : frames_.at(timed.sample, timed.moves)) {
      if (auto sent = output_->send(frame); !sent) return sent;
    }
  }
  machine_.sent();
  return {};
}

}  // namespace plumbline::sim
