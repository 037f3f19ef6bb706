#include "estimator/decision.h"

#include <gtest/gtest.h>

namespace plumbline {
namespace {

TEST(Decision, FourOutcomesAroundTheLimit) {
  // Limit 0.2, u 0.01: guard band 0.02 on either side.
  EXPECT_EQ(decide(0.2, 0.17, 0.01).status, DecisionStatus::pass);
  EXPECT_EQ(decide(0.2, 0.19, 0.01).status, DecisionStatus::conditional_pass);
  EXPECT_EQ(decide(0.2, 0.21, 0.01).status, DecisionStatus::conditional_fail);
  EXPECT_EQ(decide(0.2, 0.23, 0.01).status, DecisionStatus::fail);
}

TEST(Decision, ReportsWhatItJudged) {
  const Decision decision = decide(0.2, 0.17, 0.01);
  EXPECT_EQ(decision.limit_mps2, 0.2);
  EXPECT_EQ(decision.max_abs_error_mps2, 0.17);
  EXPECT_EQ(decision.guard_band_mps2, 0.02);
  EXPECT_NE(decision.rule.find("guard band"), std::string::npos);
}

TEST(Decision, WithoutUncertaintyOnlyTheLimitCounts) {
  EXPECT_EQ(decide(0.2, 0.2, 0).status, DecisionStatus::pass);
  EXPECT_EQ(decide(0.2, 0.2000001, 0).status, DecisionStatus::fail);
}

TEST(Decision, NamesAreThoseOfTheResultFile) {
  EXPECT_STREQ(to_string(DecisionStatus::conditional_pass), "conditional_pass");
  EXPECT_STREQ(to_string(DecisionStatus::none), "none");
}

}  // namespace
}  // namespace plumbline
