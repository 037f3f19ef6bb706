#include "app/exit_code.h"

namespace plumbline::app {

ExitCode exit_code_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::input:
    case ErrorCode::output:
      return ExitCode::wrong_use;
    case ErrorCode::rig:
    case ErrorCode::storage:
      return ExitCode::rig_fault;
    case ErrorCode::internal:
      break;
  }
  return ExitCode::internal_error;
}

}  // namespace plumbline::app
