#include "rig/sim/node_frames.h"

#include <linux/can/error.h>

#include <algorithm>
#include <cmath>

namespace plumbline::sim {
namespace {

constexpr double kEnvironmentRate_hz = 10;

can_frame error_frame(std::uint32_t error_class) {
  can_frame frame{};
  frame.can_id = CAN_ERR_FLAG | error_class;
  frame.can_dlc = CAN_ERR_DLC;
  return frame;
}

}  // namespace

NodeFrames::NodeFrames(double rate_hz, int bits, const Faults& faults, std::uint64_t seed,
                       std::uint32_t serial_number)
    : samples_per_environment_(std::max(1L, std::lround(rate_hz / kEnvironmentRate_hz))),
      samples_per_identity_(std::max(1L, std::lround(rate_hz))),
      serial_number_(serial_number),
      largest_code_((std::int32_t{1} << (bits - 1)) - 1),
      sample_faults_(faults, FaultStage::sample, seed),
      frame_faults_(faults, FaultStage::frame, seed) {}

std::vector<can_frame> NodeFrames::at(NodeSample sample, std::int64_t moves) {
  std::vector<can_frame> out;
  bool silent = false;
  std::array<bool, 3> stuck{};
  for (const Fault* fault : sample_faults_.event(sample.t_s, moves)) {
    const auto axis = static_cast<std::size_t>(fault->axis);
    switch (fault->kind) {
      case FaultKind::can_silence:
        silent = true;
        break;
      case FaultKind::can_stuck_code:
        stuck.at(axis) = true;
        if (!stuck_code_.at(axis)) stuck_code_.at(axis) = sample.code.at(axis);
        sample.code.at(axis) = *stuck_code_.at(axis);
        break;
      case FaultKind::can_saturation:
        sample.code.at(axis) = largest_code_;
        sample.clipped = true;
        break;
      default:  // can_error_frame, the last of this stage
        out.push_back(error_frame(static_cast<std::uint32_t>(fault->value)));
    }
  }
  for (std::size_t axis = 0; axis < stuck.size(); ++axis) {
    if (!stuck.at(axis)) stuck_code_.at(axis).reset();
  }
  if (silent) return out;

  for (const can_frame& frame : encode_sample(sample)) put(out, frame, sample.t_s, moves);
  if (sample.counter % samples_per_environment_ == 0) {
    put(out, encode_environment(sample), sample.t_s, moves);
  }
  if (serial_number_ != 0 && sample.counter % samples_per_identity_ == 0) {
    put(out, encode_identity(serial_number_), sample.t_s, moves);
  }
  return out;
}

void NodeFrames::put(std::vector<can_frame>& out, const can_frame& frame, double t_s,
                     std::int64_t moves) {
  bool lost = false;
  bool twice = false;
  bool overtaken = false;
  for (const Fault* fault : frame_faults_.event(t_s, moves)) {
    lost |= fault->kind == FaultKind::can_loss;
    twice |= fault->kind == FaultKind::can_duplicate;
    overtaken |= fault->kind == FaultKind::can_reorder;
  }
  if (lost) return;
  if (overtaken && !held_) {
    held_ = frame;
    return;
  }
  out.insert(out.end(), twice ? 2 : 1, frame);
  if (held_) out.push_back(*held_);
  held_.reset();
}

}  // namespace plumbline::sim
