// The parts of result.json that calibrations with and without angles have in common.
#pragma once

#include "app/io/json.h"
#include "estimator/calibrate.h"

namespace plumbline::app {

Json json_diagnosis(const Diagnosis& diagnosis);
Json json_error_figures(const ErrorFigures& error);
/// Before, after, and what the noise alone would leave. Result: Calibration or ScalarCalibration.
template <class Result>
Json json_error(const Result& result) {
  return {{"before", json_error_figures(result.before)},
          {"after", json_error_figures(result.after)},
          {"floor",
           {{"pose_rms", json_array(result.floor_pose_rms_mps2)},
            {"u_pose_rms", json_array(result.u_floor_pose_rms_mps2)}}}};
}
Json json_decision(const Decision& decision);

}  // namespace plumbline::app
