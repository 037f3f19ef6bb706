// The example sets with known truth, whole through the engine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "estimator/calibrate.h"
#include "tests/estimator/example_loader.h"

namespace plumbline {
namespace {

/// Residual of the pose means, m/s², as truth.json states it.
struct Example {
  const char* name;
  std::vector<std::string> effects;     ///< ids that truth.json states
  PerAxis<double> before_mps2;          ///< `before_pose_rms`, any effect left in
  PerAxis<double> oracle_mps2;          ///< `oracle_pose_rms`, the effect taken out
  PerAxis<double> confirm_before_mps2;  ///< `confirm_before`
  PerAxis<double> confirm_oracle_mps2;  ///< `confirm_oracle`

  bool clean() const { return effects.empty(); }
};

std::ostream& operator<<(std::ostream& out, const Example& e) { return out << e.name; }

class ExampleSet : public testing::TestWithParam<Example> {};

TEST_P(ExampleSet, ResidualAndVerdict) {
  const Example& example = GetParam();
  const auto folder = std::filesystem::path(PLUMBLINE_SHARED_DIR) / "data/examples" / example.name;
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not here";
  const MeasurementSet run = read_set(folder / "samples.csv");
  const MeasurementSet still = read_set(folder / "static.csv");
  const RunDescription description = example_description();
  ASSERT_EQ(run.poses.size(), 324u);

  const Calibration result = calibrate({run, &still.samples, description}, {});

  ASSERT_EQ(result.observability.rank, 4);
  SCOPED_TRACE(result.diagnosis.reason);
  EXPECT_EQ(result.diagnosis.verdict, example.clean() ? Verdict::clean : Verdict::explained);
  std::vector<std::string> found;
  for (const FoundEffect& effect : result.diagnosis.effects) found.push_back(effect.id);
  EXPECT_THAT(found, testing::UnorderedElementsAreArray(example.effects));
  EXPECT_THAT(result.diagnosis.unlisted, testing::IsEmpty());
  const Evaluation confirmed =
      evaluate(certified_model(result), read_set(folder / "confirm.csv"), description);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    SCOPED_TRACE(kAxisName[axis]);
    const double tolerance = example.clean() ? 0.03 : 0.10;
    EXPECT_NEAR(result.before.fit_pose_rms_mps2[axis], example.before_mps2[axis],
                tolerance * example.before_mps2[axis]);
    EXPECT_GE(result.before.heldout_pose_rms_mps2[axis], result.before.fit_pose_rms_mps2[axis]);
    // The fit of the truth file weighs all poses alike: where an effect is left in, ours may do
    // better or a little worse.
    EXPECT_LT(confirmed.before.pose_rms_mps2[axis], 1.15 * example.confirm_before_mps2[axis]);
    // With the effects in the model the error is that of one who knows them.
    EXPECT_NEAR(result.after.fit_pose_rms_mps2[axis], example.oracle_mps2[axis],
                0.10 * example.oracle_mps2[axis]);
    EXPECT_LT(confirmed.after.pose_rms_mps2[axis], 1.1 * example.confirm_oracle_mps2[axis]);
    EXPECT_LE(result.final.agreement_en[axis], 1.0);
    EXPECT_LT(result.floor_pose_rms_mps2[axis], 1.2 * example.oracle_mps2[axis]);
    EXPECT_GT(result.floor_pose_rms_mps2[axis], 0.8 * example.oracle_mps2[axis]);
    EXPECT_LE(result.estimates.agreement_en[axis], 1.0);
    EXPECT_LT((result.estimates.rls->at(axis).value - result.estimates.batch_ls[axis].value).norm(),
              1e-10);
  }
}

INSTANTIATE_TEST_SUITE_P(All, ExampleSet,
                         testing::Values(Example{"clean",
                                                 {},
                                                 {0.0279654, 0.0277775, 0.0259205},
                                                 {0.0279654, 0.0277775, 0.0259205},
                                                 {0.0287560, 0.0276176, 0.0406881},
                                                 {0.0287559, 0.0276176, 0.0406880}},
                                         Example{"quadratic",
                                                 {"sensor.quadratic"},
                                                 {0.1404820, 0.0299989, 0.0235391},
                                                 {0.0243605, 0.0299989, 0.0235391},
                                                 {0.1261580, 0.0239705, 0.0257255},
                                                 {0.0329450, 0.0239705, 0.0257255}},
                                         Example{"base-roll",
                                                 {"rig.base_roll"},
                                                 {0.1034594, 0.1008033, 0.0277373},
                                                 {0.0290822, 0.0291715, 0.0272753},
                                                 {0.1041377, 0.1169480, 0.0400807},
                                                 {0.0266861, 0.0319706, 0.0386206}},
                                         Example{"temperature-and-backlash",
                                                 {"rig.backlash", "sensor.temperature_bias"},
                                                 {0.1078229, 0.1081693, 0.1232544},
                                                 {0.0247632, 0.0254345, 0.0285232},
                                                 {0.1185593, 0.1107623, 0.1063779},
                                                 {0.0272996, 0.0339226, 0.0245480}}),
                         [](const auto& parameter) {
                           std::string name = parameter.param.name;
                           std::erase(name, '-');
                           return name;
                         });

}  // namespace
}  // namespace plumbline
