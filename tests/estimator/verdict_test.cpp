#include "estimator/diagnosis/verdict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace plumbline {
namespace {

using testing::HasSubstr;

VerdictInput ordinary_input() {
  VerdictInput input;
  input.poses = 324;
  input.axis.fill({true, true, 0.4, 0.028, 0.0281, 0.0009});
  return input;
}

TEST(Verdict, CleanWhenNoAxisStandsOut) {
  Diagnosis diagnosis;
  decide_verdict(ordinary_input(), diagnosis);
  EXPECT_EQ(diagnosis.verdict, Verdict::clean);
  EXPECT_DOUBLE_EQ(diagnosis.p_value, 1.0);  // 3 · 0.4, at most 1
}

TEST(Verdict, NamesTheAxisInExcess) {
  VerdictInput input = ordinary_input();
  input.axis[1] = {true, true, 1e-9, 0.088, 0.028, 0.002};
  Diagnosis diagnosis;
  decide_verdict(input, diagnosis);
  EXPECT_EQ(diagnosis.verdict, Verdict::unexplained);
  EXPECT_EQ(diagnosis.reason, "y axis: residual 0.088 m/s² where 0.028 ± 0.002 is expected");
  EXPECT_DOUBLE_EQ(diagnosis.p_value, 3e-9);
}

TEST(Verdict, ThreeAxesShareTheFalseAlarms) {
  VerdictInput input = ordinary_input();
  input.axis[0].p_value = 0.005;  // below 1 %, above a third of it
  EXPECT_FALSE(is_unexplained(input, 0));
  input.axis[0].p_value = 0.003;
  EXPECT_TRUE(is_unexplained(input, 0));
}

TEST(Verdict, CannotTellFromTooFewPoses) {
  VerdictInput input = ordinary_input();
  input.poses = 29;
  input.axis[1].p_value = 0;
  Diagnosis diagnosis;
  decide_verdict(input, diagnosis);
  EXPECT_EQ(diagnosis.verdict, Verdict::undetermined);
  EXPECT_THAT(diagnosis.reason, HasSubstr("29 poses"));
}

TEST(Verdict, CannotTellWithADeadAxis) {
  VerdictInput input = ordinary_input();
  input.axis[2].responds = false;
  Diagnosis diagnosis;
  decide_verdict(input, diagnosis);
  EXPECT_EQ(diagnosis.verdict, Verdict::undetermined);
  EXPECT_THAT(diagnosis.reason, HasSubstr("z axis"));
}

}  // namespace
}  // namespace plumbline
