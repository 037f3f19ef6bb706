#include "rig/modbus_head.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

namespace plumbline::rig {

namespace {

constexpr std::array<const char*, 2> kAxisTitle = {"spindle (delta)", "tilt (h)"};

std::map<int, ProbeBlock> probe_blocks(const HeadConfig& config) {
  const RegisterBlock status = status_block(config.registers);
  std::map<int, ProbeBlock> blocks;
  for (std::size_t axis = 0; axis < config.unit_id.size(); ++axis) {
    blocks.try_emplace(config.unit_id[axis],
                       ProbeBlock{config.axis_base[axis] + status.offset, status.count});
  }
  return blocks;
}

/// Rounds to counts, or nothing when a 32-bit register cannot hold it.
template <class Int>
std::optional<Int> to_counts(double value) {
  const double rounded = std::round(value);
  if (!(rounded >= static_cast<double>(std::numeric_limits<Int>::min()) &&
        rounded <= static_cast<double>(std::numeric_limits<Int>::max()))) {
    return std::nullopt;
  }
  return static_cast<Int>(rounded);
}

}  // namespace

std::string alarm_text(std::uint16_t code) {
  const char* text = "unknown alarm";
  switch (code) {
    case 0x00:
      return "no alarm";
    case 0x10:
      text = "following error";
      break;
    case 0x20:
      text = "overvoltage";
      break;
    case 0x28:
      text = "encoder";
      break;
    case 0x30:
      text = "overload";
      break;
    case 0x60:
      text = "limit switch";
      break;
    case 0x66:
      text = "soft limit";
      break;
    case 0x84:
      text = "communication";
      break;
    default:
      break;
  }
  return fmt::format("{:02X}h {}", code, text);
}

ModbusHead::ModbusHead(const HeadConfig& config, ModbusEndpoint endpoint)
    : config_(config), link_(std::move(endpoint), config.response_timeout, probe_blocks(config)) {}

SteadyTime ModbusHead::call_deadline() const {
  return std::chrono::steady_clock::now() + kCallResponseTimes * config_.response_timeout;
}

Error ModbusHead::at_axis(std::size_t axis, const Error& error) const {
  return {error.code, fmt::format("{} axis: {}", kAxisTitle[axis], error.message)};
}

Result<AxisStatus> ModbusHead::read_axis(std::size_t axis, SteadyTime deadline) {
  const RegisterBlock block = status_block(config_.registers);
  const auto words = link_.read(config_.unit_id[axis], config_.axis_base[axis] + block.offset,
                                block.count, deadline);
  if (!words) return fail(at_axis(axis, words.error()));
  return decode_status(config_.registers, *words);
}

Result<void> ModbusHead::write(std::size_t axis, const RegisterWrite& write, SteadyTime deadline) {
  auto done = link_.write(config_.unit_id[axis], config_.axis_base[axis] + write.offset,
                          write.words, deadline);
  if (!done) return fail(at_axis(axis, done.error()));
  return {};
}

Result<void> ModbusHead::pulse(std::size_t axis, int bit, SteadyTime deadline) {
  const int offset = config_.registers.offset.command;
  const auto level = static_cast<std::uint16_t>(1u << bit);
  if (!command_clear_[axis]) {
    if (auto done = write(axis, {offset, {0}}, deadline); !done) return done;
  }
  command_clear_[axis] = false;
  if (auto done = write(axis, {offset, {level}}, deadline); !done) return done;
  if (auto done = write(axis, {offset, {0}}, deadline); !done) return done;
  command_clear_[axis] = true;
  return {};
}

Result<void> ModbusHead::connect() {
  const SteadyTime deadline = call_deadline();
  last_move_.reset();
  command_clear_.fill(false);
  for (std::size_t axis = 0; axis < kDriveAxes; ++axis) {
    const auto status = read_axis(axis, deadline);
    if (!status) return fail(status.error());
    // Counting on from what the drive echoes keeps an earlier program's command from passing for
    // ours.
    sequence_[axis] = status->sequence_echo;
  }
  return {};
}

Result<HeadStatus> ModbusHead::status() {
  const SteadyTime deadline = call_deadline();
  std::array<AxisStatus, kDriveAxes> axis_status;
  HeadStatus status;
  status.in_position = last_move_.has_value();
  status.ready = true;
  status.homed = true;
  for (std::size_t axis = 0; axis < kDriveAxes; ++axis) {
    const auto read = read_axis(axis, deadline);
    if (!read) return fail(read.error());
    axis_status[axis] = *read;
    status.in_position = status.in_position && read->in_position && !read->moving &&
                         read->confirms((*last_move_)[axis]);
    status.moving = status.moving || read->moving;
    status.ready = status.ready && read->enabled && read->ready && !read->alarmed;
    // A drive that is on its way home may still show the end of the homing before.
    status.homed = status.homed && read->homed && !read->moving;
    status.alarm[axis] = read->alarm;
    status.drive_temp_C[axis] = read->temperature_C;
  }
  status.actual.delta_deg = axis_status[0].position / config_.counts_per_deg[0];
  status.actual.h_deg = axis_status[1].position / config_.counts_per_deg[1];
  return status;
}

Result<double> ModbusHead::read_limit(std::size_t axis, int offset, SteadyTime deadline) {
  const auto words =
      link_.read(config_.unit_id[axis], config_.axis_base[axis] + offset, 2, deadline);
  if (!words) return fail(at_axis(axis, words.error()));
  const auto counts =
      static_cast<std::int32_t>(join_words(config_.registers.word_order, (*words)[0], (*words)[1]));
  return counts / config_.counts_per_deg[axis];
}

Result<SoftLimits> ModbusHead::soft_limits() {
  const SteadyTime deadline = call_deadline();
  std::array<double, 2 * kDriveAxes> limit{};
  for (std::size_t axis = 0; axis < kDriveAxes; ++axis) {
    const RegisterOffsets& at = config_.registers.offset;
    const auto lower = read_limit(axis, at.limit_lower, deadline);
    if (!lower) return fail(lower.error());
    const auto upper = read_limit(axis, at.limit_upper, deadline);
    if (!upper) return fail(upper.error());
    // A negative number of counts per degree turns the order round.
    limit[2 * axis] = std::min(*lower, *upper);
    limit[2 * axis + 1] = std::max(*lower, *upper);
  }
  return SoftLimits{{limit[0], limit[2]}, {limit[1], limit[3]}};
}

Result<std::string> ModbusHead::identity() {
  if (config_.identity_count == 0) return std::string();
  const auto words = link_.read(config_.unit_id[0], config_.identity_address,
                                config_.identity_count, call_deadline());
  if (!words) return fail(at_axis(0, words.error()));
  std::string text;
  for (const std::uint16_t word : *words) {
    text += fmt::format("{}{:04X}", text.empty() ? "" : "-", word);
  }
  return text;
}

Result<void> ModbusHead::start_homing() {
  const SteadyTime deadline = call_deadline();
  last_move_.reset();
  for (std::size_t axis = 0; axis < kDriveAxes; ++axis) {
    auto done = pulse(axis, config_.registers.command_bit.home, deadline);
    if (!done) return done;
  }
  return {};
}

Result<MoveCommand> ModbusHead::make_move(std::size_t axis, double target_deg) {
  const double counts_per_deg = config_.counts_per_deg[axis];
  const double rate = std::abs(counts_per_deg);
  const auto target = to_counts<std::int32_t>(target_deg * counts_per_deg);
  const auto speed = to_counts<std::uint32_t>(config_.speed_deg_s * rate);
  const auto acceleration = to_counts<std::uint32_t>(config_.acceleration_deg_s2 * rate);
  if (!target || !speed || !acceleration) {
    return fail(ErrorCode::rig,
                fmt::format("{} axis: a move to {} deg does not fit the drive's 32-bit registers; "
                            "check counts_per_deg",
                            kAxisTitle[axis], target_deg));
  }
  return MoveCommand{*target, *speed, *acceleration, *acceleration, ++sequence_[axis]};
}

Result<void> ModbusHead::send_move(std::size_t axis, const MoveCommand& move, SteadyTime deadline) {
  for (const RegisterWrite& block : encode_move(config_.registers, move)) {
    if (auto done = write(axis, block, deadline); !done) return done;
  }
  return pulse(axis, config_.registers.command_bit.start, deadline);
}

Result<void> ModbusHead::start_move(HeadAngles target) {
  const SteadyTime deadline = call_deadline();
  last_move_.reset();
  const std::array<double, kDriveAxes> target_deg = {target.delta_deg, target.h_deg};
  std::array<MoveCommand, kDriveAxes> moves;
  for (std::size_t axis = 0; axis < kDriveAxes; ++axis) {
    const auto move = make_move(axis, target_deg[axis]);
    if (!move) return fail(move.error());
    moves[axis] = *move;
  }
  for (std::size_t axis = 0; axis < kDriveAxes; ++axis) {
    auto done = send_move(axis, moves[axis], deadline);
    if (!done && !link_.in_step(config_.unit_id[axis])) {
      // The wire failed and nobody knows how far the command got: the drive is asked.
      const auto status = read_axis(axis, deadline);
      if (!status) return done;
      done =
          status->confirms(moves[axis]) ? Result<void>{} : send_move(axis, moves[axis], deadline);
    }
    if (!done) return done;
  }
  last_move_ = moves;
  return {};
}

Result<void> ModbusHead::stop() {
  last_move_.reset();
  Result<void> result;
  for (std::size_t axis = 0; axis < kDriveAxes; ++axis) {
    const SteadyTime deadline = call_deadline();
    const int bit = config_.registers.command_bit.stop;
    auto done = pulse(axis, bit, deadline);
    // Stopping twice does no harm; not stopping does.
    if (!done && !link_.in_step(config_.unit_id[axis])) done = pulse(axis, bit, deadline);
    if (!done && result) result = done;
  }
  return result;
}

Result<void> ModbusHead::reset_alarm() {
  const SteadyTime deadline = call_deadline();
  for (std::size_t axis = 0; axis < kDriveAxes; ++axis) {
    auto done = pulse(axis, config_.registers.command_bit.alarm_reset, deadline);
    if (!done) return done;
  }
  return {};
}

Result<void> ModbusHead::arm_watchdog(std::chrono::milliseconds timeout) {
  if (timeout.count() < 0 || timeout.count() > std::numeric_limits<std::uint16_t>::max()) {
    return fail(
        ErrorCode::input,
        fmt::format("a watchdog of {} ms does not fit its 16-bit register", timeout.count()));
  }
  const SteadyTime deadline = call_deadline();
  const RegisterWrite value{config_.registers.offset.watchdog,
                            {static_cast<std::uint16_t>(timeout.count())}};
  for (std::size_t axis = 0; axis < kDriveAxes; ++axis) {
    if (auto done = write(axis, value, deadline); !done) return done;
  }
  return {};
}

}  // namespace plumbline::rig
