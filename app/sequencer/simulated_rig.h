// The program plumbline-simrig as a child process, for dry runs.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>

#include "estimator/measurement.h"

namespace plumbline::app {

struct SimulatedRigOptions {
  std::string world_toml;  ///< text of the world file
  double speed = 1;
  std::uint64_t seed = 1;
  bool rtu = false;  ///< Modbus on a pseudo terminal instead of TCP
};

/// Started on free endpoints, reached only over its wires. The child is not in the terminal's
/// process group (Ctrl-C is ours: the motors are stopped over the wire), ends when this program
/// dies, and is ended and reaped by the destructor, which removes the temporary folder, too.
class SimulatedRig {
 public:
  /// Finds the program beside this one or on the PATH; waits until it serves. ErrorCode::input when
  /// the program is missing or refuses the world.
  static Result<SimulatedRig> start(const SimulatedRigOptions& options);
  SimulatedRig(SimulatedRig&& other) noexcept;
  SimulatedRig& operator=(SimulatedRig&&) = delete;
  ~SimulatedRig();

  const std::string& modbus() const { return modbus_; }  ///< "tcp:127.0.0.1:40123"
  const std::string& can() const { return can_; }        ///< "unix:…"
  pid_t process() const { return process_; }

 private:
  SimulatedRig() = default;
  Result<void> launch(const SimulatedRigOptions& options);
  Result<void> await_ready();
  Error refusal() const;

  std::filesystem::path folder_;
  pid_t process_ = -1;
  std::string modbus_;
  std::string can_;
};

}  // namespace plumbline::app
