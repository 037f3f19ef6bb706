// Faults that the simulated rig makes on purpose: [[faults]] of world.toml.
#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "rig/strict_toml.h"

namespace plumbline::sim {

enum class FaultKind {
  // One event = one Modbus request.
  modbus_exception,
  modbus_silence,
  modbus_late,
  modbus_truncated,
  modbus_bad_crc,
  modbus_wrong_unit,
  modbus_wrong_transaction,
  modbus_reset,
  modbus_half_open,
  // One event = one START command.
  drive_stall,
  drive_slip,
  drive_alarm,
  drive_limit,
  drive_lost_homing,
  // One event = one sample of the node.
  can_silence,
  can_stuck_code,
  can_saturation,
  can_error_frame,
  // One event = one CAN frame.
  can_loss,
  can_reorder,
  can_duplicate,
};

/// Where in the rig a fault acts; each part asks only for its own.
enum class FaultStage { modbus, drive, sample, frame };

FaultStage stage_of(FaultKind kind);

/// One entry of [[faults]]. At most one of at_s, after and move says from when on it is active
/// (none: from the start); delay_s later it acts on every event, thinned by `probability`, until
/// duration_s has passed or it has acted `count` times.
struct Fault {
  FaultKind kind = FaultKind::modbus_silence;
  std::optional<double> at_s = std::nullopt;  ///< world time
  std::optional<std::int64_t> after =
      std::nullopt;  ///< number of events (see FaultKind) that still go well
  std::optional<std::int64_t> move =
      std::nullopt;        ///< start of the k-th motion of the head, counted from 0
  double delay_s = 0;      ///< world time
  double duration_s = 0;   ///< world time; 0 = without end
  std::int64_t count = 1;  ///< 0 = without bound
  double probability = 1;
  int axis = 0;      ///< drive faults: 0 δ, 1 h; node faults: 0 x, 1 y, 2 z
  double value = 0;  ///< exception or alarm code, delay, angle … by kind
};

struct Faults {
  std::vector<Fault> all;
};

/// Reads the [[faults]] of `table` (the root of world.toml); what is wrong is refused there.
Faults read_faults(rig::StrictTable table);

/// Decides at each event which faults act. One per stage, used by one thread at a time.
class FaultInjector {
 public:
  FaultInjector(const Faults& faults, FaultStage stage, std::uint64_t seed);

  /// An event of this stage happens at world time t_s, after `moves` motions have been started.
  /// Counts the event and returns the faults that act on it; they live as long as the injector.
  std::vector<const Fault*> event(double t_s, std::int64_t moves);
  /// World time is t_s and nothing happens: returns the faults that need no event to act on.
  std::vector<const Fault*> passing(double t_s, std::int64_t moves);

 private:
  struct Armed {
    Fault fault;
    std::optional<double> active_from_s = std::nullopt;
    std::int64_t acted = 0;
  };
  std::vector<const Fault*> acting(double t_s, std::int64_t moves, bool is_event);

  std::vector<Armed> armed_;
  std::int64_t events_ = 0;
  std::mt19937_64 random_;
  std::uniform_real_distribution<double> uniform_;
};

}  // namespace plumbline::sim
