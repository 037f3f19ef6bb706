// The parts of result.json that calibrations with and without angles have in common.
#pragma once

#include "app/io/json.h"
#include "estimator/calibrate.h"

namespace plumbline::app {

Json json_diagnosis(const Diagnosis& diagnosis);
Json json_errors(const ErrorFigures& error);
Json json_decision(const Decision& decision);

}  // namespace plumbline::app
