#include "rig/sim/drive.h"

#include <algorithm>
#include <cassert>

namespace plumbline::sim {
namespace {

std::size_t axis_of(int address) { return static_cast<std::size_t>(address / kAxisBase); }
int offset_of(int address) { return address % kAxisBase; }

constexpr std::uint16_t kDriveType = 2;  // two axes
constexpr std::uint16_t kFirmware = 0x0100;

}  // namespace

Drive::Drive(const DriveSettings& settings, const Faults& faults, std::uint64_t seed)
    : axes_{DriveAxis(settings, 0), DriveAxis(settings, 1)},
      nameplate_{static_cast<std::uint16_t>(settings.serial_number >> 16),
                 static_cast<std::uint16_t>(settings.serial_number & 0xFFFF), kDriveType,
                 kFirmware},
      faults_(faults, FaultStage::drive, seed) {}

void Drive::advance(double t_s) {
  for (DriveAxis& axis : axes_) axis.advance(t_s);
  apply(faults_.passing(t_s, moves()), t_s);
}

void Drive::check_watchdog(double t_s, HostTime now) {
  for (DriveAxis& axis : axes_) {
    const std::chrono::milliseconds limit(axis.watchdog_ms());
    if (limit.count() > 0 && now - last_request_ > limit) {
      axis.raise_alarm(alarm::kCommunication, t_s);
    }
  }
}

void Drive::note_request(HostTime now) {
  last_request_ = now;
  ++heartbeat_;
}

Refusal Drive::check_read(int address, int count) {
  const bool in_axis = address >= 0 && address < kAxisBase + reg::kCount &&
                       offset_of(address) + count <= reg::kCount;
  const bool in_nameplate = address >= kNameplate && address + count <= kRegisterEnd;
  return in_axis || in_nameplate ? Refusal::none : Refusal::illegal_address;
}

Refusal Drive::check_write(int address, std::span<const std::uint16_t> words) {
  if (address < 0 || address >= kAxisBase + reg::kCount ||
      !DriveAxis::writable(offset_of(address), static_cast<int>(words.size()))) {
    return Refusal::illegal_address;
  }
  return DriveAxis::acceptable(offset_of(address), words) ? Refusal::none : Refusal::illegal_value;
}

void Drive::write(int address, std::span<const std::uint16_t> words, double t_s) {
  assert(check_write(address, words) == Refusal::none);
  const std::size_t index = axis_of(address);
  if (!axes_.at(index).write(offset_of(address), words, t_s)) return;
  ++starts_.at(index);
  apply(faults_.event(t_s, moves()), t_s);
}

void Drive::image(double t_s, std::span<std::uint16_t> registers) const {
  assert(registers.size() >= kRegisterEnd);
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const auto image = axes_[i].image(t_s, heartbeat_);
    std::copy(image.begin(), image.end(), registers.begin() + static_cast<int>(i) * kAxisBase);
  }
  std::copy(nameplate_.begin(), nameplate_.end(), registers.begin() + kNameplate);
}

void Drive::apply(const std::vector<const Fault*>& faults, double t_s) {
  for (const Fault* fault : faults) {
    DriveAxis& axis = axes_.at(static_cast<std::size_t>(fault->axis));
    switch (fault->kind) {
      case FaultKind::drive_stall:
        axis.stall(t_s);
        break;
      case FaultKind::drive_slip:
        axis.slip(fault->value);
        break;
      case FaultKind::drive_alarm:
        axis.raise_alarm(static_cast<std::uint16_t>(fault->value), t_s);
        break;
      case FaultKind::drive_limit:
        axis.trip_limit_switch(t_s);
        break;
      case FaultKind::drive_lost_homing:
        axis.lose_homing();
        break;
      default:
        assert(false && "not a fault of the drive");
    }
  }
}

}  // namespace plumbline::sim
