#include "rig/sim/drive_axis.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace plumbline::sim {
namespace {

// As delivered, the soft limits end this far before the limit switches, so that the overshoot of a
// move up to them does not trip a switch.
constexpr double kSoftLimitMargin_deg = 1.0;

// The power stage: 8 K above its surroundings under continuous motion, five minutes time constant.
constexpr double kAmbient_C = 28.0;
constexpr double kWarmingAtFullLoad_K = 8.0;
constexpr double kWarmingTau_s = 300.0;

constexpr std::uint16_t kAbsolute = 1;
constexpr std::uint16_t kRelative = 2;

}  // namespace

DriveAxis::DriveAxis(const DriveSettings& settings, std::size_t index)
    : axis_(settings.axis.at(index)),
      counts_per_deg_(settings.counts_per_deg.at(index)),
      high_word_first_(settings.high_word_first),
      following_error_deg_(settings.following_error_deg) {
  const AxisDynamics& dynamics = axis_.dynamics();
  put32(registers_, reg::kSpeed, counts(dynamics.speed_deg_s));
  put32(registers_, reg::kAcceleration, counts(dynamics.acceleration_deg_s2));
  put32(registers_, reg::kDeceleration, counts(dynamics.acceleration_deg_s2));
  put32(registers_, reg::kLowerLimit, counts(dynamics.lower_limit_deg + kSoftLimitMargin_deg));
  put32(registers_, reg::kUpperLimit, counts(dynamics.upper_limit_deg - kSoftLimitMargin_deg));
  registers_[reg::kMode] = kAbsolute;
}

std::int32_t DriveAxis::value32(int offset) const {
  const auto at = static_cast<std::size_t>(offset);
  const std::uint32_t first = registers_.at(at);
  const std::uint32_t second = registers_.at(at + 1);
  return static_cast<std::int32_t>(high_word_first_ ? first << 16 | second : second << 16 | first);
}

void DriveAxis::put32(std::span<std::uint16_t> words, int offset, std::int64_t value) const {
  const auto at = static_cast<std::size_t>(offset);
  const auto bits = static_cast<std::uint32_t>(value);
  const auto high = static_cast<std::uint16_t>(bits >> 16);
  const auto low = static_cast<std::uint16_t>(bits & 0xFFFF);
  words[at] = high_word_first_ ? high : low;
  words[at + 1] = high_word_first_ ? low : high;
}

std::int64_t DriveAxis::counts(double deg) const { return std::llround(deg * counts_per_deg_); }

bool DriveAxis::writable(int offset, int count) {
  const int end = offset + count;
  const bool command_block = offset >= reg::kCommand && end <= reg::kSequence + 1;
  const bool settings_block = offset >= reg::kWatchdog && end <= reg::kUpperLimit + 2;
  return count > 0 && (command_block || settings_block);
}

bool DriveAxis::acceptable(int offset, std::span<const std::uint16_t> words) {
  const int at = reg::kMode - offset;
  if (at < 0 || at >= static_cast<int>(words.size())) return true;
  const std::uint16_t mode = words[static_cast<std::size_t>(at)];
  return mode == kAbsolute || mode == kRelative;
}

bool DriveAxis::write(int offset, std::span<const std::uint16_t> words, double t_s) {
  assert(writable(offset, static_cast<int>(words.size())));
  const std::uint16_t before = registers_[reg::kCommand];
  std::copy(words.begin(), words.end(), registers_.begin() + offset);
  const std::uint16_t after = registers_[reg::kCommand];
  const auto up = static_cast<std::uint16_t>(after & ~before);
  const auto down = static_cast<std::uint16_t>(before & ~after);

  if (up & command::kAlarmReset) reset_alarm();
  if (up & command::kFree) {
    stop(t_s);
    enabled_ = false;
  }
  if (up & command::kStop) stop(t_s);
  jog(up, down, t_s);
  if (up & command::kHome) home(t_s);
  return (up & command::kStart) && start(t_s);
}

bool DriveAxis::start(double t_s) {
  info_ = !usable() || homing_ != Homing::none;
  if (info_) return false;
  const std::int32_t target = value32(reg::kTarget);
  double target_deg = target / counts_per_deg_;
  if (registers_[reg::kMode] == kRelative) target_deg += state(t_s).commanded_deg;
  if (target_deg < register_deg(reg::kLowerLimit) || target_deg > register_deg(reg::kUpperLimit)) {
    raise_alarm(alarm::kSoftLimit, t_s);
    return false;
  }
  target_echo_ = target;
  sequence_echo_ = registers_[reg::kSequence];
  stalled_ = false;
  axis_.start_move(t_s, target_deg, register_deg(reg::kSpeed), register_deg(reg::kAcceleration),
                   register_deg(reg::kDeceleration));
  return true;
}

void DriveAxis::home(double t_s) {
  info_ = !usable();
  if (info_) return;
  homed_ = false;
  stalled_ = false;
  homing_ = Homing::searching;
  axis_.start_move(t_s, axis_.home_switch_encoder_deg(), axis_.dynamics().homing_speed_deg_s, 0, 0);
}

void DriveAxis::stop(double t_s) {
  homing_ = Homing::none;
  axis_.stop(t_s);
}

void DriveAxis::jog(std::uint16_t edges_up, std::uint16_t edges_down, double t_s) {
  constexpr std::uint16_t kJog = command::kJogPlus | command::kJogMinus;
  if (edges_up & kJog) {
    info_ = !usable() || homing_ != Homing::none;
    if (info_) return;
    const int limit = (edges_up & command::kJogPlus) ? reg::kUpperLimit : reg::kLowerLimit;
    axis_.start_move(t_s, register_deg(limit), register_deg(reg::kSpeed),
                     register_deg(reg::kAcceleration), register_deg(reg::kDeceleration));
  } else if (edges_down & kJog) {
    axis_.stop(t_s);
  }
}

void DriveAxis::reset_alarm() {
  alarm_ = 0;
  info_ = false;
  stalled_ = false;
  limit_switch_ = LimitSwitch::none;
  enabled_ = true;
}

void DriveAxis::raise_alarm(std::uint16_t code, double t_s) {
  if (alarm_ != 0) return;
  alarm_ = code;
  homing_ = Homing::none;
  if (code == alarm::kFollowingError) {
    axis_.freeze(t_s);  // the shaft is held by what blocks it; there is nothing to decelerate
  } else {
    axis_.stop(t_s);
  }
}

void DriveAxis::trip_limit_switch(double t_s) {
  limit_switch_ = state(t_s).speed_deg_s < 0 ? LimitSwitch::minus : LimitSwitch::plus;
  raise_alarm(alarm::kLimitSwitch, t_s);
}

void DriveAxis::advance(double t_s) {
  if (homing_ == Homing::searching && t_s >= axis_.end_s()) {
    const double met_s = axis_.end_s();
    axis_.reference(met_s);
    axis_.start_move(met_s, 0, axis_.dynamics().homing_speed_deg_s, 0, 0);
    homing_ = Homing::returning;
  }
  const AxisState now = state(t_s);
  if (homing_ == Homing::returning && now.in_position) {
    homing_ = Homing::none;
    homed_ = true;
  }
  if (std::abs(now.commanded_deg - now.encoder_deg) > following_error_deg_) {
    raise_alarm(alarm::kFollowingError, t_s);
  }
  // Only on the way out, so that an axis can be driven back off its switch after a reset.
  const AxisDynamics& dynamics = axis_.dynamics();
  if ((now.angle_deg > dynamics.upper_limit_deg && now.speed_deg_s > 0) ||
      (now.angle_deg < dynamics.lower_limit_deg && now.speed_deg_s < 0)) {
    trip_limit_switch(t_s);
  }
  const double load = now.moving ? 1 : 0;
  warming_K_ += (load * kWarmingAtFullLoad_K - warming_K_) *
                -std::expm1(-(t_s - advanced_s_) / kWarmingTau_s);
  advanced_s_ = t_s;
}

std::array<std::uint16_t, reg::kCount> DriveAxis::image(double t_s, std::uint16_t heartbeat) const {
  const AxisState now = state(t_s);
  const bool busy = now.moving || homing_ != Homing::none;
  unsigned bits = 0;
  const auto set = [&bits](std::uint16_t bit, bool on) { bits |= on ? bit : 0u; };
  set(status::kEnabled, enabled_);
  set(status::kLimitPlus, limit_switch_ == LimitSwitch::plus);
  set(status::kLimitMinus, limit_switch_ == LimitSwitch::minus);
  set(status::kFollowingError, alarm_ == alarm::kFollowingError);
  set(status::kHomeEnd, homed_);
  set(status::kReady, usable() && !busy);
  set(status::kInfo, info_);
  set(status::kAlarm, alarm_ != 0);
  set(status::kBusy, busy);
  set(status::kMove, now.moving);
  set(status::kInPosition, now.in_position && usable() && homing_ == Homing::none);
  set(status::kTorqueLimit, stalled_);

  std::array<std::uint16_t, reg::kCount> image{};
  std::copy(registers_.begin(), registers_.end(), image.begin());
  image[reg::kStatus] = static_cast<std::uint16_t>(bits);
  image[reg::kAlarm] = alarm_;
  put32(image, reg::kPosition, counts(now.encoder_deg));
  put32(image, reg::kCommandedPosition, counts(now.commanded_deg));
  put32(image, reg::kTargetEcho, target_echo_);
  put32(image, reg::kActualSpeed, counts(now.speed_deg_s));
  image[reg::kSequenceEcho] = sequence_echo_;
  image[reg::kHeartbeat] = heartbeat;
  image[reg::kTemperature] =
      static_cast<std::uint16_t>(std::lround(10 * (kAmbient_C + warming_K_)));
  return image;
}

}  // namespace plumbline::sim
