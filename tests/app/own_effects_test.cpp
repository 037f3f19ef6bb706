// Effects that a user describes: what is refused, what an expression sees, and that the search
// finds one and a stored calibration keeps it.
#include "app/config/own_effects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "app/io/json.h"
#include "app/io/result_json.h"
#include "estimator/calibrate.h"
#include "tests/estimator/synthetic_run.h"

namespace plumbline::app {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

std::string effect(const std::string& expression, const std::string& acts_on = "bias") {
  return "[[effect]]\nname = \"mine\"\nacts_on = \"" + acts_on + "\"\nexpression = \"" +
         expression + "\"\n[effect.parameters]\nc = { start = 0.001, unit = \"g\" }\n";
}

std::string refusal(const std::string& text) {
  const auto effects = parse_own_effects(text, "my.toml", 20);
  if (effects.has_value()) return "accepted";
  EXPECT_EQ(effects.error().code, ErrorCode::input);
  EXPECT_EQ(effects.error().message.find('\n'), std::string::npos) << effects.error().message;
  return effects.error().message;
}

TEST(OwnEffects, AreRefusedWithPlaceAndReason) {
  EXPECT_THAT(refusal(effect("c * (")), StartsWith("my.toml:4:"));
  EXPECT_THAT(refusal(effect("c * wobble(a)")), StartsWith("my.toml:4:"));
  EXPECT_THAT(refusal(effect("c + 1")), HasSubstr("amplitudes are zero"));
  EXPECT_THAT(refusal(effect("c", "bais")), HasSubstr("bias"));
  EXPECT_THAT(refusal(effect("c * a") + effect("c * a")), HasSubstr("used twice"));
  EXPECT_THAT(refusal("[[effect]]\nname = \"mine\"\nacts_on = \"delta\"\naxes = [\"x\"]\n"
                      "expression = \"c\"\n[effect.parameters]\nc = { start = 1 }\n"),
              HasSubstr("seen by all axes"));
  EXPECT_THAT(refusal("[[effect]]\nname = \"mine\"\nacts_on = \"bias\"\nexpression = \"c*a\"\n"
                      "[effect.parameters]\nc = { start = 0 }\n"),
              HasSubstr("not zero"));
  EXPECT_THAT(refusal("[[effect]]\nname = \"my effect\"\nacts_on = \"bias\"\n"
                      "expression = \"c*a\"\n[effect.parameters]\nc = { start = 1 }\n"),
              HasSubstr("letters"));
  EXPECT_THAT(refusal(effect("c * 0 * a")), HasSubstr("does not depend on c"));
  EXPECT_THAT(refusal(effect("c * a", "h")), HasSubstr("the same for all"));
  EXPECT_EQ(refusal(effect("c * a * (temp_C - 20) * prev_a_x * sin(delta_deg * _pi / 180)")),
            "accepted");
}

TEST(OwnEffects, NeedTheirColumns) {
  const auto effects = parse_own_effects(effect("c * (rh_pct - 40)"), "my.toml", 20);
  ASSERT_TRUE(effects.has_value()) << effects.error().message;
  SampleTable samples;
  samples.covariates = {{"rh_pc", {}}};
  const auto missing = check_columns(*effects, samples);
  ASSERT_FALSE(missing.has_value());
  EXPECT_THAT(missing.error().message, HasSubstr("did you mean rh_pc?"));
  samples.covariates.front().name = "rh_pct";
  EXPECT_TRUE(check_columns(*effects, samples).has_value());
  const auto warm = parse_own_effects(effect("c * (temp_C - 20)"), "my.toml", 20);
  ASSERT_TRUE(warm.has_value()) << warm.error().message;
  const auto cold = check_columns(*warm, samples);
  ASSERT_FALSE(cold.has_value());
  EXPECT_THAT(cold.error().message, HasSubstr("needs temp_C"));
  samples.temp_C = {21};
  EXPECT_TRUE(check_columns(*warm, samples).has_value());
}

TEST(OwnEffects, SeeWhatFormatsSays) {
  MeasurementSet set;
  set.samples.covariates.push_back({"rh_pct", {}});
  for (int k = 0; k < 3; ++k) {
    set.poses.push_back({k, 40.0 * k, 30, set.samples.size(), 2});
    for (int i = 0; i < 2; ++i) {
      set.samples.t_s.push_back(10 * k + i);
      for (auto& u : set.samples.u_V) u.push_back(0.1 * k + 0.01 * i);
      set.samples.temp_C.push_back(25 + k);
      set.samples.covariates[0].value.push_back(50 + k);
    }
  }
  RunDescription description;
  description.reference_C = 22;
  const VisitLog log = make_visit_log(set, description);
  const std::vector<Eigen::Vector3d> a_g = {{0.1, 0.2, 0.3}, {0.4, 0.5, 0.6}, {0.7, 0.8, 0.9}};
  const auto value = [&](const std::string& expression, const std::string& acts_on = "bias") {
    const auto effects =
        parse_own_effects(effect("c * (" + expression + ")", acts_on), "my.toml", 22);
    EXPECT_TRUE(effects.has_value()) << effects.error().message;
    const double c = 2;
    return (*effects)[0]->term_g({log, 2, 1, a_g, 0, 0, 1}, &c);
  };
  EXPECT_NEAR(value("delta_deg"), 160, 1e-9);
  EXPECT_NEAR(value("h_deg"), 60, 1e-9);
  EXPECT_NEAR(value("a"), 1.6, 1e-12);
  EXPECT_NEAR(value("a_z"), 1.8, 1e-12);
  EXPECT_NEAR(value("prev_a_x"), 0.8, 1e-12);
  EXPECT_NEAR(value("prev_a"), 1.0, 1e-12);
  EXPECT_NEAR(value("prev_delta_deg"), 80, 1e-9);
  EXPECT_NEAR(value("t_s"), 2 * 20.5, 1e-9);
  EXPECT_NEAR(value("t_in_pose"), 2 * 0.5, 1e-9);
  EXPECT_NEAR(value("temp_C"), 54, 1e-9);
  EXPECT_NEAR(value("rh_pct"), 104, 1e-9);
  EXPECT_NEAR(value("pose"), 4, 1e-12);
  EXPECT_NEAR(value("1", "scale"), 2 * 0.8, 1e-12);
  const auto turned = parse_own_effects(effect("c", "h"), "my.toml", 22);
  ASSERT_TRUE(turned.has_value());
  HeadGeometry head;
  const double c = 90;
  (*turned)[0]->displace(log, 2, &c, head);
  EXPECT_NEAR(head.h_rad, std::acos(0), 1e-12);

  const auto moving = parse_own_effects(effect("c * t_in_pose", "h"), "my.toml", 22);
  ASSERT_TRUE(moving.has_value());
  EXPECT_TRUE((*moving)[0]->within_dwell());
  const AngleCourse course = (*moving)[0]->angle_course(log, 2, &c);
  EXPECT_EQ(course.angle, &HeadGeometry::h_rad);
  EXPECT_NEAR(course.course_rad(0), 0, 1e-12);
  EXPECT_NEAR(course.course_rad(1), std::acos(0), 1e-12);
  HeadGeometry half;
  (*moving)[0]->displace(log, 2, &c, half);
  EXPECT_NEAR(half.h_rad, 0.5 * std::acos(0), 1e-12);
}

TEST(OwnEffects, AreFoundAndKeptWithTheCalibration) {
  // Nothing on the list follows the sine of three times the angle on one axis.
  SyntheticRun data = synthetic_run(6, Adc{16, -5, 0}, {.delta_step_deg = 20});
  for (const Pose& pose : data.run.poses)
    for (std::size_t i = pose.first; i < pose.first + pose.count; ++i)
      data.run.samples.u_V[1][i] +=
          0.02 * 0.0314 * std::sin(5 * pose.delta_deg * 3.14159265358979 / 180);
  const auto own = parse_own_effects(effect("c * sin(5 * delta_deg * _pi / 180)"), "my.toml", 20);
  ASSERT_TRUE(own.has_value()) << own.error().message;
  const Calibration result =
      calibrate({data.run, &data.still, data.description}, {.own_effects = *own});
  ASSERT_EQ(result.diagnosis.effects.size(), 1u) << result.diagnosis.reason;
  const FoundEffect& found = result.diagnosis.effects.front();
  EXPECT_EQ(found.id, "user.mine");
  EXPECT_THAT(found.axes, testing::ElementsAre(1u));
  const EffectParameter& c = found.parameters.front();
  EXPECT_NEAR(c.value, 0.02, 4 * c.u);
  EXPECT_LT(result.after.heldout_pose_rms_mps2[1], 0.5 * result.before.heldout_pose_rms_mps2[1]);

  const std::string text = file_text(result_json(result, {}));
  const auto stored = parse_result_json(text, "result.json");
  ASSERT_TRUE(stored.has_value()) << stored.error().message;
  ASSERT_EQ(stored->model.own_effects.size(), 1u);
  EXPECT_EQ(stored->model.own_effects[0]->definition(), (*own)[0]->definition());
  const Evaluation evaluation = evaluate(stored->model, data.run, data.description);
  EXPECT_NEAR(evaluation.after.pose_rms_mps2[1], result.after.fit_pose_rms_mps2[1],
              0.01 * result.after.fit_pose_rms_mps2[1]);
}

}  // namespace
}  // namespace plumbline::app
