// result.json (schema "plumbline.result/1", app/io/schema/result.schema.json): a calibration as
// other programs read it, and the way back for `evaluate`.
#pragma once

#include <filesystem>

#include "app/io/json.h"
#include "app/provenance.h"
#include "estimator/calibrate.h"

namespace plumbline::app {

/// Depends on the data and the seed alone, `provenance` apart. Precondition: all directions are
/// observable.
Json result_json(const Calibration& calibration, const Provenance& provenance);

/// What `evaluate` needs of a result.json.
struct StoredCalibration {
  CertifiedModel model;
  DeviceUnderTest dut;
};

/// Refused with the place in the file: another schema, a missing or wrong value. `reference_C`: of
/// the data that it will be applied to.
Result<StoredCalibration> parse_result_json(std::string_view text, const std::string& name,
                                            double reference_C = 20);
Result<StoredCalibration> read_result_json(const std::filesystem::path& path,
                                           double reference_C = 20);

}  // namespace plumbline::app
