#include "app/summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace plumbline::app {
namespace {

using testing::EndsWith;
using testing::HasSubstr;

RunDescription some_description() {
  RunDescription description;
  description.dut.serial = "A-0017";
  return description;
}

Calibration some_calibration() {
  Calibration calibration;
  calibration.poses = 324;
  calibration.samples = 12960;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    calibration.final.batch_ls[axis].value << 0.001, 0.001, 0.001, -2.5;
    calibration.final.batch_ls[axis].value[static_cast<Eigen::Index>(axis)] = 0.032;
    calibration.final.batch_ls[axis].covariance.diagonal().setConstant(1e-12);
    calibration.noise[axis].source = "static record";
  }
  calibration.before.heldout_pose_rms_mps2 = {0.028, 0.088, 0.026};
  calibration.after = calibration.before;
  calibration.floor_pose_rms_mps2 = {0.028, 0.028, 0.026};
  calibration.diagnosis.verdict = Verdict::unexplained;
  calibration.diagnosis.reason = "the y residual is too large.";
  return calibration;
}

TEST(Summary, NamesTheAxisThatStandsOut) {
  EXPECT_EQ(conclusion(some_description(), some_calibration(), std::nullopt),
            "Unit A-0017 is calibrated, but the model lacks something (y axis: 0.088 m/s² rms "
            "where the noise alone would leave 0.028).");
}

TEST(Summary, SaysWhatTheFreshPosesAndTheLimitSay) {
  Calibration calibration = some_calibration();
  calibration.diagnosis.verdict = Verdict::clean;
  calibration.after.heldout_pose_rms_mps2[1] = 0.028;
  calibration.decision = {.status = DecisionStatus::conditional_fail,
                          .limit_mps2 = 0.2,
                          .max_abs_error_mps2 = 0.21,
                          .u_mps2 = 0.01,
                          .guard_band_mps2 = 0.02,
                          .rule = "guarded"};
  Evaluation verification;
  verification.poses = 24;
  verification.after.pose_max_abs_mps2 = {0.06, 0.08, 0.07};
  EXPECT_EQ(
      conclusion({}, calibration, verification),
      "The unit is calibrated and the model is complete within the noise (x axis: 0.028 m/s² "
      "rms where the noise alone would leave 0.028); 24 fresh poses confirm it to 0.080 m/s²; "
      "CONDITIONAL FAIL: largest error 0.21 m/s², limit 0.200 m/s².");
}

TEST(Summary, FreshPosesThatContradictDoNotConfirm) {
  Calibration calibration = some_calibration();
  calibration.diagnosis.verdict = Verdict::clean;
  Evaluation verification;
  verification.poses = 24;
  verification.after.pose_rms_mps2 = {0.03, 0.03, 0.05};
  verification.after.pose_max_abs_mps2 = {0.06, 0.08, 0.12};
  EXPECT_THAT(conclusion({}, calibration, verification),
              HasSubstr("but 24 fresh poses do not confirm it: z axis 0.050 m/s² rms where the "
                        "noise alone would leave 0.026, largest error 0.12 m/s²"));
  // By chance 24 of them may be half as much again.
  verification.after.pose_rms_mps2[2] = 1.4 * 0.026;
  EXPECT_EQ(contradicted_axis(calibration, verification), std::nullopt);
  // What the noise alone would leave is not known better than that.
  verification.after.pose_rms_mps2[2] = 0.05;
  calibration.u_floor_pose_rms_mps2[2] = 0.01;
  EXPECT_EQ(contradicted_axis(calibration, verification), std::nullopt);
}

TEST(Summary, EndsWithTheConclusion) {
  Calibration calibration = some_calibration();
  calibration.skipped_rows = 1;
  const std::string text = summary(some_description(), calibration, std::nullopt);
  EXPECT_THAT(text, EndsWith(conclusion(some_description(), calibration, std::nullopt) + "\n"));
  EXPECT_THAT(text, HasSubstr("Unit A-0017: 324 poses, 12960 samples, 1 bad row skipped; noise "
                              "from the static record\n"));
  EXPECT_THAT(text, HasSubstr("32.0000 ± 0.0020"));
}

}  // namespace
}  // namespace plumbline::app
