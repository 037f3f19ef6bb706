// Shows a person how far a run has come.
#pragma once

#include <chrono>
#include <cstdio>
#include <string>

#include "app/sequencer/engine.h"

namespace plumbline::app {

/// Share of the plan before which the pace says nothing.
inline constexpr double kPaceKnown = 0.01;

/// On a terminal one line that is written over several times a second; elsewhere a plain line for
/// every tenth of the plan.
class ProgressDisplay {
 public:
  ProgressDisplay(std::FILE* stream, bool is_terminal);
  /// Leaves the terminal's line.
  ~ProgressDisplay();
  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  void show(const Progress& progress);

 private:
  using Clock = std::chrono::steady_clock;

  std::FILE* stream_;
  bool is_terminal_;
  bool line_open_ = false;
  int tenths_ = 0;  ///< of the plan, shown so far
  Clock::time_point start_ = Clock::now();
  Clock::time_point next_ = start_;
};

/// "pose 17/349  sampling  δ 160.00° h 10.00°  6000 samples/s  1:23 to go"
std::string progress_line(const Progress& progress, double elapsed_s);

}  // namespace plumbline::app
