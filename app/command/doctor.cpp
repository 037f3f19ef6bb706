// `plumbline doctor`: is everything there that a run needs, and what is to be done if not?
#include <fmt/format.h>
#include <net/if.h>
#include <sys/timex.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "app/command/command.h"
#include "app/config/rig_description.h"
#include "app/sequencer/control_socket.h"
#include "rig/acquisition.h"
#include "rig/modbus_link.h"

namespace plumbline::app {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t kWantedBuffer_bytes = 4 << 20;
constexpr double kWantedRoom_bytes = 200e6;
constexpr std::chrono::seconds kListening{2};

struct DoctorArguments {
  std::string config;
  std::string database;
};

/// Prints one line for each thing looked at.
class Report {
 public:
  void good(const std::string& what) { fmt::print("ok    {}\n", what); }
  void doubtful(const std::string& what, const std::string& advice) {
    fmt::print("warn  {}\n      {}\n", what, advice);
  }
  void bad(const std::string& what, const std::string& advice) {
    fmt::print("FAIL  {}\n      {}\n", what, advice);
    ++failures_;
  }
  int failures() const { return failures_; }

 private:
  int failures_ = 0;
};

std::string first_line(const fs::path& file) {
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  return line;
}

void check_plan_limits(const RigDescription& rig, Report& report) {
  const Plan plan = make_plan(rig.run.grid, rig.plan, rig.sensor.rate_hz);
  if (!rig.soft_limits) {
    report.doubtful("[head] soft_limits are not given",
                    "with them, `plan` can check a plan without the drive");
  } else if (const auto allowed = check_plan(plan, *rig.soft_limits); !allowed) {
    report.bad(allowed.error().message, "change [grid], [plan] or the limits");
  } else {
    report.good(fmt::format("the plan of {} steps keeps the soft limits", plan.steps.size()));
  }
}

void check_clock(Report& report) {
  timex state{};
  if (::adjtimex(&state) == TIME_ERROR || (state.status & STA_UNSYNC) != 0) {
    report.doubtful("the clock of this machine is not synchronised",
                    "events and certificates carry its time; enable systemd-timesyncd or chrony "
                    "(measurements go by the sensor's clock)");
  } else {
    report.good("the clock is synchronised");
  }
}

void check_disk(const std::string& database, Report& report) {
  if (database.empty()) return;
  const fs::path file(database);
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  std::error_code error;
  const auto space = fs::space(folder, error);
  if (error) {
    report.bad(fmt::format("{}: {}", folder.string(), error.message()), "create the folder first");
    return;
  }
  const std::string room =
      fmt::format("{} MB are free for {}", space.available / 1'000'000, database);
  if (static_cast<double>(space.available) < kWantedRoom_bytes) {
    report.bad(room, "make room, a night takes up to 200 MB");
  } else {
    report.good(room);
  }
  if (::access(folder.c_str(), W_OK) != 0) {
    report.bad(folder.string() + " cannot be written", "choose another folder, or chown it");
  }
  if (!fs::exists(file)) return;
  const auto store = storage::RunStore::open_read_only(file);
  if (!store) {
    report.bad(store.error().message, "choose another file with --db");
    return;
  }
  const auto runs = store->runs();
  if (!runs) return report.bad(runs.error().message, "choose another file with --db");
  report.good(fmt::format("{} holds {} runs", database, runs->size()));
  if (ControlClient::connect(control_path(file))) {
    report.bad("a session is running on this database", "`plumbline ctl status` shows it");
  }
}

void check_drive(const RigDescription& rig, Report& report) {
  const auto endpoint = rig::parse_modbus_endpoint(rig.head.modbus);
  if (!endpoint) return report.bad(endpoint.error().message, "give [head] modbus in rig.toml");
  if (!endpoint->is_tcp && fs::exists(endpoint->device) &&
      ::access(endpoint->device.c_str(), R_OK | W_OK) != 0) {
    return report.bad(endpoint->device + " may not be opened by this user",
                      "usermod -aG dialout USER, then log in again");
  }
  auto head = rig::make_dividing_head(rig.head);
  if (!head) return report.bad(head.error().message, "correct [head] in rig.toml");
  if (const auto connected = (*head)->connect(); !connected) {
    return report.bad(connected.error().message,
                      "check power, cable, address, and unit_id in rig.toml");
  }
  const auto status = (*head)->status();
  if (!status) return report.bad(status.error().message, "check [head.registers] in rig.toml");
  const auto identity = (*head)->identity();
  report.good(fmt::format(
      "the drive answers at {}{}: δ {:.4f}°, h {:.4f}°, {}, {:.0f} °C and {:.0f} °C",
      rig.head.modbus, identity && !identity->empty() ? ", identity " + *identity : "",
      status->actual.delta_deg, status->actual.h_deg, status->homed ? "homed" : "not homed",
      status->drive_temp_C[0], status->drive_temp_C[1]));
  if (!identity) {
    report.doubtful(identity.error().message, "correct identity_address and identity_count");
  } else if (identity->empty()) {
    report.doubtful("the drive does not say which one it is",
                    "give identity_address and identity_count, so that a run is never resumed on "
                    "another drive");
  }
  for (const std::uint16_t alarm : status->alarm) {
    if (alarm != 0) {
      report.doubtful("the drive shows alarm " + rig::alarm_text(alarm),
                      "`run` resets it; find the cause first");
    }
  }
  const auto limits = (*head)->soft_limits();
  if (!limits) return report.bad(limits.error().message, "check [head.registers] in rig.toml");
  const Plan plan = make_plan(rig.run.grid, rig.plan, rig.sensor.rate_hz);
  if (limits->lower.delta_deg < limits->upper.delta_deg) {
    if (const auto allowed = check_plan(plan, *limits); !allowed) {
      report.bad("beyond the drive's own limits: " + allowed.error().message,
                 "change [grid], [plan] or the limits in the drive");
    }
  }
  if (rig.head.watchdog.count() == 0) {
    report.doubtful("the drive's watchdog is off (watchdog_ms = 0)",
                    "without it the motors go on when this program dies");
  }
}

void check_interface(const std::string& address, Report& report) {
  if (!address.starts_with("can:")) return;
  const std::string name = address.substr(4);
  const fs::path entry = fs::path("/sys/class/net") / name;
  if (!fs::exists(entry)) {
    return report.bad(
        fmt::format("there is no interface {}", name),
        "plug the adapter in; modprobe its driver; ip -brief link shows what there is");
  }
  constexpr int kArphrdCan = 280;
  if (std::atoi(first_line(entry / "type").c_str()) != kArphrdCan) {
    report.bad(name + " is no CAN interface", "give the right one in [sensor] can");
  }
  const auto flags = std::strtoul(first_line(entry / "flags").c_str(), nullptr, 16);
  if ((flags & IFF_UP) == 0) {
    report.bad(name + " is down",
               fmt::format("ip link set {} up type can bitrate 500000 restart-ms 100", name));
  } else {
    report.good(name + " is up");
  }
}

void check_buffer(std::uint64_t granted_bytes, Report& report) {
  // The kernel reports twice what was asked for, for its own bookkeeping.
  if (granted_bytes == 0 || granted_bytes >= kWantedBuffer_bytes) return;
  report.doubtful(
      fmt::format("the receive buffer of the sensor's socket has {} kB only", granted_bytes / 1024),
      fmt::format("sysctl -w net.core.rmem_max={}, so that a busy machine loses nothing",
                  kWantedBuffer_bytes));
}

void check_node(const RigDescription& rig, Report& report) {
  check_interface(rig.sensor.can, report);
  auto source = rig::make_sample_source(rig.sensor);
  if (!source) return report.bad(source.error().message, "correct [sensor] in rig.toml");
  rig::Acquisition acquisition(*std::move(source));
  if (const auto started = acquisition.start(); !started) {
    return report.bad(started.error().message, "check power, cable, and [sensor] can in rig.toml");
  }
  const auto begin = std::chrono::steady_clock::now();
  std::vector<RawSample> samples;
  std::string identity;
  while (std::chrono::steady_clock::now() - begin < kListening) {
    const auto batch = acquisition.take(std::chrono::milliseconds{100});
    if (!batch) return report.bad(batch.error().message, "check power, cable, bitrate, DBC file");
    samples.insert(samples.end(), batch->samples.begin(), batch->samples.end());
    for (const rig::CovariateReading& reading : batch->covariates) {
      if (reading.name == rig::kIdentityColumn) identity = fmt::format("{:.0f}", reading.value);
    }
  }
  const double seconds = std::chrono::duration<double>(kListening).count();
  const rig::SourceStatistics bus = acquisition.statistics();
  if (samples.empty()) {
    return report.bad(fmt::format("{}: {} frames, but no sample", rig.sensor.can, bus.frames),
                      "check bitrate, termination, and the DBC file");
  }
  const double rate_hz = static_cast<double>(samples.size()) / seconds;
  report.good(fmt::format("the node is heard at {}{}: {:.0f} samples/s, {:.2f} °C", rig.sensor.can,
                          identity.empty() ? "" : ", serial number " + identity, rate_hz,
                          samples.back().temp_C));
  if (std::abs(rate_hz / rig.sensor.rate_hz - 1) > 0.1) {
    report.doubtful(fmt::format("{:.0f} samples/s instead of {:g}", rate_hz, rig.sensor.rate_hz),
                    "correct rate_hz (a simulated rig may be faster than real time)");
  }
  if (bus.lost_samples + bus.crc_errors + bus.kernel_drops + bus.error_frames > 0) {
    report.doubtful(fmt::format("{} samples lost, {} wrong checksums, {} dropped by the kernel, {} "
                                "error frames {}",
                                bus.lost_samples, bus.crc_errors, bus.kernel_drops,
                                bus.error_frames, bus.last_error_frame),
                    "check cable, termination and load of the bus");
  }
  const auto lowest = -(std::int32_t{1} << (rig.sensor.adc.bits - 1));
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    if (samples.back().code[axis] <= lowest || samples.back().code[axis] >= -lowest - 1) {
      report.bad(fmt::format("output {} is at the end of the converter's span", kAxisName[axis]),
                 "check the wiring of the unit, and bits, min_V, max_V in rig.toml");
    }
  }
  check_buffer(bus.receive_buffer_bytes, report);
}

Result<ExitCode> examine(const DoctorArguments& arguments) {
  const auto rig = read_rig_description(arguments.config);
  if (!rig) return fail(rig.error());
  Report report;
  report.good(arguments.config + " is in order");
  check_plan_limits(*rig, report);
  check_clock(report);
  check_disk(arguments.database, report);
  check_drive(*rig, report);
  check_node(*rig, report);
  if (report.failures() == 0) {
    fmt::print("Everything that a run needs is there.\n");
    return ExitCode::done;
  }
  fmt::print("{} of these must be put right before a run.\n", report.failures());
  return ExitCode::rig_fault;
}

}  // namespace

void add_doctor(CLI::App& program, Invocation& invocation) {
  CLI::App* sub = program.add_subcommand(
      "doctor", "look at everything that a run needs, and say what to do; nothing moves");
  auto arguments = std::make_shared<DoctorArguments>();
  sub->add_option("--config", arguments->config, "rig.toml")->required();
  sub->add_option("--db", arguments->database, "run database that is going to be used");
  sub->callback([arguments, &invocation] {
    invocation.action = [arguments] { return examine(*arguments); };
  });
}

}  // namespace plumbline::app
