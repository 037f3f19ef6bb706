// What the tests of the study demand of a set.
#pragma once

#include <gtest/gtest.h>

#include "tests/study/diagnosis.h"

namespace plumbline::study {

inline void expect_its_driver_and_no_listed_name(const SetOutcome& outcome) {
  ASSERT_TRUE(outcome.feasible) << outcome.truth;
  EXPECT_EQ(outcome.driver_right, 1) << outcome.truth << " / " << outcome.found;
  EXPECT_EQ(outcome.listed_instead, 0) << outcome.truth << " / " << outcome.found;
}

inline void expect_only_finding(const SetOutcome& outcome) {
  ASSERT_TRUE(outcome.feasible);
  EXPECT_EQ(outcome.named, 1) << outcome.truth << " / " << outcome.found;
  EXPECT_EQ(outcome.wrong, 0) << outcome.found;
}

}  // namespace plumbline::study
