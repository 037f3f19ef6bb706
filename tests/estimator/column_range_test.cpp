// Which columns of another set were elsewhere than during the calibration.
#include "estimator/column_range.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "estimator/diagnosis/restored_model.h"

namespace plumbline {
namespace {

SampleTable table(std::vector<double> temp_C, std::vector<double> supply_V) {
  SampleTable samples;
  samples.t_s.resize(3);
  samples.temp_C = std::move(temp_C);
  if (!supply_V.empty()) samples.covariates.push_back({"supply_V", std::move(supply_V)});
  return samples;
}

TEST(ColumnRange, IsOfEveryRecordedColumn) {
  const auto ranges = column_ranges(table({20, std::nan(""), 30}, {5, 4, 6}));
  ASSERT_EQ(ranges.size(), 2u);
  EXPECT_EQ(ranges[0].column, "temp_C");
  EXPECT_EQ(ranges[0].low, 20);
  EXPECT_EQ(ranges[0].high, 30);
  EXPECT_EQ(ranges[1].column, "supply_V");
  EXPECT_EQ(ranges[1].low, 4);
  EXPECT_TRUE(column_ranges(table({}, {})).empty());
}

TEST(ColumnRange, ATenthOfItsWidthBeyondIsNotYetElsewhere) {
  const auto calibrated = column_ranges(table({20, 25, 30}, {}));
  EXPECT_TRUE(beyond(calibrated, table({19.5, 25, 30.5}, {})).empty());
  EXPECT_TRUE(beyond(calibrated, table({}, {9, 9, 9})).empty());
  const auto elsewhere = beyond(calibrated, table({18, 25, 85}, {}));
  ASSERT_EQ(elsewhere.size(), 1u);
  EXPECT_EQ(elsewhere[0].readings, 2u);
  EXPECT_EQ(elsewhere[0].seen.low, 18);
  EXPECT_EQ(elsewhere[0].seen.high, 85);
  EXPECT_EQ(elsewhere[0].calibrated.high, 30);
}

// With the temperature taken for zero it would be left out without a word.
TEST(RestoredModel, LeavesOutWhatNeedsAColumnThatIsNotThere) {
  CertifiedModel model;
  FoundEffect warm;
  warm.id = "sensor.temperature_bias";
  warm.axes = {0};
  warm.parameters = {{"b1", std::size_t{0}, 0.001, 1e-5, "g/K"}};
  model.effects = {warm};
  VisitLog log;
  log.visits.resize(2);
  const RestoredModel without = restore_model(model, log);
  EXPECT_THAT(without.left_out, testing::ElementsAre("sensor.temperature_bias"));
  EXPECT_THAT(without.lacking, testing::ElementsAre("temp_C"));
  EXPECT_TRUE(without.parameters.effects.empty());
  log.has_temperature = true;
  const RestoredModel with = restore_model(model, log);
  EXPECT_TRUE(with.left_out.empty());
  EXPECT_EQ(with.parameters.effects.size(), 1u);
}

// Effects that exist only for the columns of a set are not there to be asked what they need.
TEST(RestoredModel, NamesTheColumnsOfACalibrationThatASetLacks) {
  CertifiedModel model;
  model.history.covariate_names = {"rh_pct", "supply_V"};
  FoundEffect supply;
  supply.id = "covariate:supply_V";
  supply.axes = {1};
  supply.parameters = {{"c", std::size_t{1}, 0.001, 1e-5, "g/unit"},
                       {"mean", std::size_t{1}, 5, 0, "unit"}};
  model.effects = {supply};
  UnlistedStructure humid, time;
  humid.driver = "rh_pct.rate";
  time.driver = "t_s";
  model.unlisted = {humid, time};
  VisitLog log;
  log.visits.resize(2);
  const RestoredModel without = restore_model(model, log);
  EXPECT_THAT(without.left_out,
              testing::ElementsAre("covariate:supply_V", "unlisted: rh_pct.rate", "unlisted: t_s"));
  EXPECT_THAT(without.lacking, testing::ElementsAre("supply_V", "rh_pct"));
}

}  // namespace
}  // namespace plumbline
