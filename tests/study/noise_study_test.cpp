// The noise study on few short records; the whole one is scripts/study-noise.
#include "tests/study/noise_study.h"

#include <gtest/gtest.h>

namespace plumbline::study {
namespace {

TEST(NoiseStudy, AbsentTermsStayAbsentAndIntervalsHold) {
  constexpr int kRecords = 60;
  const NoiseCase white{.name = "white", .truth = {.N = 1e-3}, .samples = 8000};
  const NoiseStudy study = study_noise(white, kRecords, 500);
  EXPECT_GE(study.term[kTermN].covered, 0.85);
  EXPECT_GE(study.term[kTermN].present, 0.999);
  for (const std::size_t absent : {kTermQ, kTermB, kTermK, kTermR})
    EXPECT_LE(study.term[absent].present, 0.1) << kTermName[absent];
  EXPECT_LE(study.lines, 0.05);
  EXPECT_LE(study.markov, 0.05);
  EXPECT_GE(study.adequate, 0.95);

  const NoiseCase coloured{
      .name = "coloured", .truth = {.N = 2.5e-5, .B = 6e-5, .K = 2e-5}, .samples = 12000};
  const NoiseStudy other = study_noise(coloured, kRecords, 900);
  for (const std::size_t term : {kTermN, kTermB, kTermK})
    EXPECT_GE(other.term[term].covered, 0.85) << kTermName[term];
  EXPECT_NEAR(other.term[kTermB].mean, 6e-5, 1e-5);
}

}  // namespace
}  // namespace plumbline::study
