// The dividing head behind a Modbus drive, TCP or RTU.
#pragma once

#include <array>
#include <optional>

#include "rig/dividing_head.h"
#include "rig/modbus_link.h"
#include "rig/rig_config.h"

namespace plumbline::rig {

/// Every call ends within kCallResponseTimes response timeouts (stop() within twice that: each axis
/// has its own). Reads are repeated once after a fault of the wire. A START is repeated only when
/// the echo of its sequence number says that it has not been accepted.
class ModbusHead : public DividingHead {
 public:
  static constexpr int kCallResponseTimes = 4;

  ModbusHead(const HeadConfig& config, ModbusEndpoint endpoint);

  Result<void> connect() override;
  Result<HeadStatus> status() override;
  Result<SoftLimits> soft_limits() override;
  Result<std::string> identity() override;
  Result<void> start_homing() override;
  Result<void> start_move(HeadAngles target) override;
  Result<void> stop() override;
  Result<void> reset_alarm() override;
  Result<void> arm_watchdog(std::chrono::milliseconds timeout) override;

 private:
  static constexpr std::size_t kDriveAxes = 2;  // δ, h

  SteadyTime call_deadline() const;
  Result<AxisStatus> read_axis(std::size_t axis, SteadyTime deadline);
  Result<void> write(std::size_t axis, const RegisterWrite& write, SteadyTime deadline);
  /// A rising edge of one command bit; the register is left at 0 for the next one.
  Result<void> pulse(std::size_t axis, int bit, SteadyTime deadline);
  Result<void> send_move(std::size_t axis, const MoveCommand& move, SteadyTime deadline);
  Result<MoveCommand> make_move(std::size_t axis, double target_deg);
  Result<double> read_limit(std::size_t axis, int offset, SteadyTime deadline);
  Error at_axis(std::size_t axis, const Error& error) const;

  HeadConfig config_;
  ModbusLink link_;
  std::array<std::uint16_t, kDriveAxes> sequence_{};
  std::array<bool, kDriveAxes> command_clear_{};  ///< the command register is known to be 0
  std::optional<std::array<MoveCommand, kDriveAxes>> last_move_;
};

}  // namespace plumbline::rig
