// What has no name, of a synthetic run: that it is told as one, and by what.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "estimator/angle_units.h"
#include "estimator/calibrate.h"
#include "tests/estimator/synthetic_run.h"

namespace plumbline {

struct Structure {
  const char* driver;
  const char* form;
  const char* shape;
};

/// The only finding there is, which it expects to be this one and to leave next to noise.
inline UnlistedStructure expect_only_structure(const SyntheticRun& data,
                                               const Structure& expected) {
  const Calibration result = calibrated(data);
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_THAT(result.diagnosis.effects, testing::IsEmpty());
  EXPECT_EQ(result.diagnosis.unlisted.size(), 1U);
  if (result.diagnosis.unlisted.empty()) return {};
  const UnlistedStructure& found = result.diagnosis.unlisted.front();
  EXPECT_EQ(found.driver, expected.driver);
  EXPECT_EQ(found.form, expected.form);
  EXPECT_EQ(found.shape, expected.shape);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    EXPECT_GT(result.floor_pose_rms_mps2[i], 0);
    EXPECT_LT(result.after.heldout_pose_rms_mps2[i], 1.3 * result.floor_pose_rms_mps2[i]);
  }
  return found;
}
inline UnlistedStructure expect_only_structure(const SyntheticOptions& options,
                                               const Structure& expected) {
  return expect_only_structure(synthetic_run(7, kSixteenBits, options), expected);
}

/// Where the spindle stands, from 0° to 360°, by the specific force.
inline double delta_deg_of(const std::array<double, 3>& a_g) {
  const double delta_deg = std::atan2(-a_g[1], a_g[0]) / kRadPerDeg;
  return delta_deg < -1e-6 ? delta_deg + 360 : delta_deg;
}
/// How far the spindle is raised, by the specific force.
inline double h_deg_of(const std::array<double, 3>& a_g) {
  return std::atan2(a_g[2], std::hypot(a_g[0], a_g[1])) / kRadPerDeg;
}

inline const EffectParameter& parameter(const UnlistedStructure& found, const char* name) {
  const auto at = std::find_if(found.parameters.begin(), found.parameters.end(),
                               [&](const EffectParameter& p) { return p.name == name; });
  EXPECT_NE(at, found.parameters.end()) << name;
  return *at;
}

/// What a run of these options would be with a column that was recorded beside it, a function of
/// the time in s.
inline SyntheticRun with_column(const SyntheticOptions& options, const char* name,
                                const std::function<double(double)>& course) {
  SyntheticRun data = synthetic_run(7, kSixteenBits, options);
  Covariate column{name, {}};
  for (const double t_s : data.run.samples.t_s) column.value.push_back(course(t_s));
  data.run.samples.covariates = {std::move(column)};
  return data;
}

}  // namespace plumbline
