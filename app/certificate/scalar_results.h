// What a certificate of a calibration without angles is made from.
#pragma once

#include <string>

#include "estimator/scalar/calibrate_scalar.h"

namespace plumbline::app {

/// How the rests were found, and in which unit the readings are.
struct ScalarSource {
  std::string rests;         ///< one sentence
  std::string reading_unit;  ///< "V", "g", "LSB" or "unit", from the column's name
  PerAxis<std::string> columns;
};

struct ScalarResults {
  const ScalarCalibration& calibration;
  const ScalarSource& source;
};

/// What the chapters that all certificates have in common need of it (CertificateInput's
/// `calibration`): diagnosis, decision, errors, counts.
Calibration shared_chapters(const ScalarCalibration& scalar);

}  // namespace plumbline::app
