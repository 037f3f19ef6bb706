#include "rig/sim/faults.h"

#include <algorithm>
#include <array>

namespace plumbline::sim {
namespace {

/// One row for each kind: its name, where it acts, and the one value it takes (if any).
struct KindRow {
  FaultKind kind;
  FaultStage stage;
  const char* name;
  const char* value_key = nullptr;
  double value = 0;
  rig::Range range = {};
};

const std::array kKinds = {
    KindRow{
        FaultKind::modbus_exception, FaultStage::modbus, "modbus.exception", "code", 4, {1, 11}},
    KindRow{FaultKind::modbus_silence, FaultStage::modbus, "modbus.silence"},
    // By the host's clock: the host's own deadline is what it is to be held against.
    KindRow{FaultKind::modbus_late, FaultStage::modbus, "modbus.late", "late_s", 1.5, {0, 60}},
    KindRow{
        FaultKind::modbus_truncated, FaultStage::modbus, "modbus.truncated", "bytes", 3, {0, 260}},
    KindRow{FaultKind::modbus_bad_crc, FaultStage::modbus, "modbus.bad_crc"},
    KindRow{FaultKind::modbus_wrong_unit, FaultStage::modbus, "modbus.wrong_unit"},
    KindRow{FaultKind::modbus_wrong_transaction, FaultStage::modbus, "modbus.wrong_transaction"},
    KindRow{FaultKind::modbus_reset, FaultStage::modbus, "modbus.reset"},
    KindRow{FaultKind::modbus_half_open, FaultStage::modbus, "modbus.half_open"},
    KindRow{FaultKind::drive_stall, FaultStage::drive, "drive.stall"},
    KindRow{FaultKind::drive_slip, FaultStage::drive, "drive.slip", "slip_deg", 0.5, {-360, 360}},
    KindRow{FaultKind::drive_alarm, FaultStage::drive, "drive.alarm", "code", 0x30, {1, 0xFFFF}},
    KindRow{FaultKind::drive_limit, FaultStage::drive, "drive.limit"},
    KindRow{FaultKind::drive_lost_homing, FaultStage::drive, "drive.lost_homing"},
    KindRow{FaultKind::can_silence, FaultStage::sample, "can.silence"},
    KindRow{FaultKind::can_stuck_code, FaultStage::sample, "can.stuck_code"},
    KindRow{FaultKind::can_saturation, FaultStage::sample, "can.saturation"},
    // CAN_ERR_BUSOFF of linux/can/error.h.
    KindRow{FaultKind::can_error_frame,
            FaultStage::sample,
            "can.error_frame",
            "error_class",
            0x40,
            {1, 0x1FF}},
    KindRow{FaultKind::can_loss, FaultStage::frame, "can.loss"},
    KindRow{FaultKind::can_reorder, FaultStage::frame, "can.reorder"},
    KindRow{FaultKind::can_duplicate, FaultStage::frame, "can.duplicate"},
};

const KindRow& row_of(FaultKind kind) {
  return *std::find_if(kKinds.begin(), kKinds.end(),
                       [&](const KindRow& r) { return r.kind == kind; });
}

int read_axis(rig::StrictTable& table, FaultStage stage) {
  const std::vector<std::string> names = stage == FaultStage::drive
                                             ? std::vector<std::string>{"delta", "h"}
                                             : std::vector<std::string>{"x", "y", "z"};
  const std::string name = table.choice_or("axis", names.front(), names);
  return static_cast<int>(std::find(names.begin(), names.end(), name) - names.begin());
}

Fault read_fault(rig::StrictTable& table) {
  std::vector<std::string> names(kKinds.size());
  std::transform(kKinds.begin(), kKinds.end(), names.begin(),
                 [](const KindRow& row) { return row.name; });
  Fault fault;
  // No kind is a sensible default, so an absent one falls to text(), which refuses it.
  const std::string name =
      table.has("kind") ? table.choice_or("kind", names.front(), names) : table.text("kind");
  const auto row =
      std::find_if(kKinds.begin(), kKinds.end(), [&](const KindRow& r) { return name == r.name; });
  if (row == kKinds.end()) return fault;
  fault.kind = row->kind;

  if (table.has("at_s")) fault.at_s = table.number("at_s", {.min = 0});
  if (table.has("after")) fault.after = table.integer("after", {.min = 0});
  if (table.has("move")) fault.move = table.integer("move", {.min = 0});
  fault.delay_s = table.number_or("delay_s", 0, {.min = 0});
  fault.duration_s = table.number_or("duration_s", 0, {.min = 0});
  fault.probability = table.number_or("probability", 1, {.min = 0, .max = 1});
  // A rate or a span of time means "all of it" unless a count is given; a bare trigger means once.
  const bool once = fault.duration_s == 0 && fault.probability == 1;
  fault.count = table.integer_or("count", once ? 1 : 0, {.min = 0});
  if (fault.at_s.has_value() + fault.after.has_value() + fault.move.has_value() > 1) {
    table.refuse("kind", "more than one of at_s, after and move; keep the one that starts it");
  }
  if (fault.kind == FaultKind::drive_slip && fault.count != 1) {
    table.refuse("kind", "drive.slip happens once; write one entry for each slip");
  }
  if (row->stage == FaultStage::drive || row->kind == FaultKind::can_stuck_code ||
      row->kind == FaultKind::can_saturation) {
    fault.axis = read_axis(table, row->stage);
  }
  if (row->value_key != nullptr) {
    fault.value = table.number_or(row->value_key, row->value, row->range);
  }
  return fault;
}

}  // namespace

FaultStage stage_of(FaultKind kind) { return row_of(kind).stage; }

Faults read_faults(rig::StrictTable table) {
  Faults faults;
  for (rig::StrictTable& entry : table.tables("faults")) faults.all.push_back(read_fault(entry));
  return faults;
}

FaultInjector::FaultInjector(const Faults& faults, FaultStage stage, std::uint64_t seed)
    : random_(seed ^ (0x9E3779B97F4A7C15ULL * (1 + static_cast<std::uint64_t>(stage)))) {
  for (const Fault& fault : faults.all) {
    if (stage_of(fault.kind) != stage) continue;
    armed_.push_back({.fault = fault});
  }
}

std::vector<const Fault*> FaultInjector::event(double t_s, std::int64_t moves) {
  return acting(t_s, moves, true);
}

std::vector<const Fault*> FaultInjector::passing(double t_s, std::int64_t moves) {
  return acting(t_s, moves, false);
}

std::vector<const Fault*> FaultInjector::acting(double t_s, std::int64_t moves, bool is_event) {
  std::vector<const Fault*> result;
  for (Armed& armed : armed_) {
    const Fault& fault = armed.fault;
    // Drawn at every event, used or not: the same seed then hits the same events whatever the
    // other faults do.
    const bool certain = fault.probability == 1;
    const bool drawn = is_event && !certain && uniform_(random_) < fault.probability;

    const bool triggered = fault.at_s    ? t_s >= *fault.at_s
                           : fault.after ? is_event && events_ >= *fault.after
                           : fault.move  ? moves > *fault.move
                                         : true;
    if (triggered && !armed.active_from_s) {
      armed.active_from_s = fault.at_s.value_or(t_s) + fault.delay_s;
    }
    const bool active = armed.active_from_s && t_s >= *armed.active_from_s &&
                        (fault.duration_s == 0 || t_s < *armed.active_from_s + fault.duration_s) &&
                        (fault.count == 0 || armed.acted < fault.count);
    if (!active || !(certain || drawn)) continue;
    ++armed.acted;
    result.push_back(&fault);
  }
  if (is_event) ++events_;
  return result;
}

}  // namespace plumbline::sim
