#include "app/io/result_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "app/io/evaluation_json.h"
#include "app/io/noise_json.h"
#include "tests/app/json_schema.h"

namespace plumbline::app {
namespace {

using testing::HasSubstr;

TriadEstimate some_triad() {
  TriadEstimate triad;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    triad[axis].value << 0.1, 0.2, 0.3, -2.5;
    triad[axis].value[static_cast<Eigen::Index>(axis)] = 0.032;
    triad[axis].covariance.diagonal() << 4e-12, 9e-12, 16e-12, 25e-12;
  }
  return triad;
}

/// Numbers without meaning, but of the right kind everywhere.
Calibration some_calibration() {
  Calibration calibration;
  calibration.observability = {.rank = 4, .condition = 1.5, .unobservable = ""};
  calibration.poses = 324;
  calibration.samples = 16200;
  for (NoiseModel& noise : calibration.noise) {
    noise.N = {.value = 1e-5, .u = 1e-7, .present = true, .upper_limit = 1.2e-5};
    noise.rate_hz = 100;
    noise.source = "static record";
    noise.adequate = true;
  }
  calibration.estimates = {.batch_ls = some_triad(), .rls = some_triad(), .ekf = some_triad()};
  calibration.final = {.batch_ls = some_triad(), .rls = std::nullopt, .ekf = some_triad()};
  calibration.diagnosis.verdict = Verdict::explained;
  calibration.diagnosis.reason = "because";
  FoundEffect effect;
  effect.id = "sensor.quadratic";
  effect.axes = {1};
  effect.parameters = {{.name = "k2", .axis = 1, .value = 0.0366, .u = 0.0004, .unit = "g/g^2"},
                       {.name = "epsilon", .axis = {}, .value = 0.1, .u = 0.01, .unit = "deg"}};
  effect.p_value = 1e-9;
  effect.heldout_gain = 0.9;
  effect.alternatives = {"sensor.asymmetry"};
  calibration.diagnosis.effects = {effect};
  UnlistedStructure structure;
  structure.driver = "rh_pct";
  structure.form = "bias";
  structure.axes = {0, 2};
  structure.shape = "rises";
  structure.parameters = {{"p1", 0, 0.001, 0.0001, "g"}};
  structure.p_value = 0.001;
  structure.heldout_gain = 0.5;
  structure.alternatives = {"sensor.drift"};
  calibration.diagnosis.unlisted = {structure};
  Visit visit;
  visit.t_mean_s = 2.5;
  visit.delta_rad = 0.5;
  visit.h_rad = 0.25;
  visit.temperature_K = 1.5;
  visit.covariate = {46, 5.01};
  calibration.diagnosis.history = {true, {"rh_pct", "supply_V"}, {visit, visit}};
  calibration.decision = {.status = DecisionStatus::conditional_pass,
                          .limit_mps2 = 0.2,
                          .max_abs_error_mps2 = 0.19,
                          .u_mps2 = 0.01,
                          .guard_band_mps2 = 0.02,
                          .rule = "guarded acceptance"};
  return calibration;
}

Provenance some_provenance() {
  return {.dut = {.serial = "A-0017", .model = "triad"},
          .input_sha256 = {{"samples.csv", std::string(64, 'a')}},
          .created_utc = "2026-01-31T12:34:56Z",
          .seed = 7};
}

std::string some_result() { return file_text(result_json(some_calibration(), some_provenance())); }

TEST(ResultJson, FollowsItsSchema) { EXPECT_EQ(schema_violations("result", some_result()), ""); }

TEST(ResultJson, SchemaNoticesWhatIsWrong) {
  const Json good = result_json(some_calibration(), some_provenance());
  Json extra = good;
  extra["diagnosis"]["mood"] = "fine";
  EXPECT_NE(schema_violations("result", file_text(extra)), "");
  Json missing = good;
  missing["final"].erase("ekf");
  EXPECT_NE(schema_violations("result", file_text(missing)), "");
  Json nan = good;
  nan["error"]["after"]["sample_rms"][1] = nullptr;
  EXPECT_NE(schema_violations("result", file_text(nan)), "");
  Json unit = good;
  unit["noise"]["x"]["Q"]["unit"] = "g";
  EXPECT_NE(schema_violations("result", file_text(unit)), "");
}

TEST(ResultJson, KeepsTheWrittenOrderAndShape) {
  const Json json = result_json(some_calibration(), some_provenance());
  std::vector<std::string> keys;
  for (const auto& item : json.items()) keys.push_back(item.key());
  EXPECT_THAT(keys, testing::ElementsAre("schema", "provenance", "data", "noise", "noise_fit",
                                         "quantization", "estimates", "uncertainty", "diagnosis",
                                         "final", "error", "decision"));
  const Json& x = json["estimates"]["batch_ls"]["x"];
  EXPECT_EQ(x["K_V_per_g"].dump(), "[0.032,0.2,0.3]");
  EXPECT_EQ(x["U0_V"].dump(), "-2.5");
  EXPECT_EQ(x["u_K_V_per_g"].dump(), "[2e-06,3e-06,4e-06]");
  EXPECT_EQ(x["u_U0_V"].dump(), "5e-06");
  EXPECT_EQ(json["diagnosis"]["effects"][0]["axes"].dump(), R"(["y"])");
  EXPECT_TRUE(json["diagnosis"]["effects"][0]["parameters"][1]["axis"].is_null());
}

TEST(ResultJson, ReadsBackWhatEvaluateNeeds) {
  const auto stored = parse_result_json(some_result(), "result.json");
  ASSERT_TRUE(stored) << stored.error().message;
  const Calibration original = some_calibration();
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    EXPECT_EQ(stored->model.twelve[axis].value, original.estimates.batch_ls[axis].value);
    EXPECT_EQ(stored->model.final[axis].covariance, original.final.batch_ls[axis].covariance);
  }
  ASSERT_EQ(stored->model.effects.size(), 1u);
  const FoundEffect& effect = stored->model.effects[0];
  EXPECT_EQ(effect.id, "sensor.quadratic");
  EXPECT_EQ(effect.parameters[0].axis, std::optional<std::size_t>(1));
  EXPECT_EQ(effect.parameters[1].axis, std::nullopt);
  EXPECT_EQ(effect.parameters[0].value, 0.0366);
  const RunHistory& history = stored->model.history;
  EXPECT_TRUE(history.has_temperature);
  EXPECT_THAT(history.covariate_names, testing::ElementsAre("rh_pct", "supply_V"));
  ASSERT_EQ(history.visits.size(), 2u);
  EXPECT_EQ(history.visits[1].t_mean_s, 2.5);
  EXPECT_NEAR(history.visits[1].delta_rad, 0.5, 1e-15);
  EXPECT_NEAR(history.visits[1].h_rad, 0.25, 1e-15);
  EXPECT_EQ(history.visits[1].temperature_K, 1.5);
  EXPECT_THAT(history.visits[1].covariate, testing::ElementsAre(46, 5.01));
  EXPECT_EQ(stored->dut.serial, "A-0017");
}

TEST(ResultJson, RefusesOtherFiles) {
  const auto message = [](const std::string& text) {
    const auto stored = parse_result_json(text, "result.json");
    return stored ? "" : stored.error().message;
  };
  EXPECT_THAT(message(""), HasSubstr("result.json: not a usable result.json: "));
  EXPECT_THAT(message("{}"), HasSubstr("key 'schema' not found"));
  EXPECT_THAT(message(R"({"schema": "plumbline.result/2"})"),
              HasSubstr("its schema is \"plumbline.result/2\" instead of \"plumbline.result/1\""));
  Json json = result_json(some_calibration(), some_provenance());
  json["final"]["batch_ls"]["y"]["K_V_per_g"][1] = 0;
  EXPECT_THAT(message(file_text(json)), HasSubstr("the scale factor of axis y is 0"));
  json["final"]["batch_ls"]["y"]["K_V_per_g"][1] = nullptr;
  EXPECT_THAT(message(file_text(json)), HasSubstr("type must be number, but is null"));
}

TEST(EvaluationJson, FollowsItsSchemaAndJudgesTheWorstAxis) {
  Evaluation evaluation;
  evaluation.poses = 24;
  evaluation.samples = 960;
  evaluation.after.pose_max_abs_mps2 = {0.1, 0.3, 0.2};
  evaluation.left_out = {"rig.pose_outlier"};
  const Json none = evaluation_json(evaluation, 0, std::nullopt, some_provenance());
  EXPECT_EQ(schema_violations("evaluation", file_text(none)), "");
  EXPECT_EQ(none["decision"]["status"], "none");
  const Json fail = evaluation_json(evaluation, 3, Limits{0.25}, some_provenance());
  EXPECT_EQ(schema_violations("evaluation", file_text(fail)), "");
  EXPECT_EQ(fail["data"]["skipped_rows"], 3);
  EXPECT_EQ(fail["decision"]["status"], "fail");
  EXPECT_EQ(fail["decision"]["max_abs_error_mps2"], 0.3);
  EXPECT_EQ(within_limits(evaluation, Limits{0.3}), std::optional(true));
}

TEST(NoiseJson, FollowsItsSchemaAndWritesAnInfiniteLimitAsNull) {
  NoiseReport report{.rate_hz = 100, .samples = 1000, .channels = {}};
  NoiseChannel channel{
      .axis = "y", .column = "ay_lsb", .unit = "LSB", .noise = {}, .deviations = {}};
  channel.deviations.oadev = {.tau_s = {0.01, 0.02},
                              .n = {998, 996},
                              .value = {1, 0.7},
                              .lower = {0.9, 0.6},
                              .upper = {1.1, std::numeric_limits<double>::infinity()}};
  channel.noise.fitted = {1, 0.7};
  channel.noise.source = "static record";
  report.channels.push_back(channel);
  const Json json = noise_json(report, some_provenance());
  EXPECT_EQ(schema_violations("noise", file_text(json)), "");
  EXPECT_EQ(json["axes"]["y"]["terms"]["N"]["unit"], "LSB*sqrt(s)");
  EXPECT_EQ(json["axes"]["y"]["deviations"]["oadev"]["upper"].dump(), "[1.1,null]");
}

}  // namespace
}  // namespace plumbline::app
