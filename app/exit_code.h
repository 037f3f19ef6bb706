// Exit codes of the program; other programs rely on them.
#pragma once

#include "estimator/measurement.h"

namespace plumbline::app {

enum class ExitCode {
  done = 0,             ///< and within limits, if limits were given
  limits_exceeded = 1,  ///< done, and the decision is fail or conditional fail
  wrong_use = 2,        ///< arguments, configuration, input file or output folder
  rig_fault = 3,        ///< rig, bus or run database failed; stopped safely and resumable
  internal_error = 4,   ///< a defect of this program
};

ExitCode exit_code_of(ErrorCode code);

}  // namespace plumbline::app
