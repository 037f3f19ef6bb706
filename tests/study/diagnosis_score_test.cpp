// What the study itself does: the sets it makes, how it scores them, and its rows and limits.
#include "tests/study/diagnosis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace plumbline::study {
namespace {

// The covariance that the oracle uses is the one that the simulated noise has.
TEST(DiagnosisStudyItself, TrueCovariancePredictsTheResidualOfPlainSets) {
  for (const NoiseKind kind : {NoiseKind::white, NoiseKind::examples, NoiseKind::coloured}) {
    for (const int bits : {12, 16}) {
      double ratio = 0;
      constexpr int kSets = 8;
      for (int k = 0; k < kSets; ++k) {
        const StudySet set = make_set({.seed = static_cast<std::uint64_t>(100 + k),
                                       .noise = kind,
                                       .bits = bits,
                                       .static_s = 1});
        for (std::size_t i = 0; i < kAxisCount; ++i) {
          ratio += std::pow(set.plain.truth.poses.oracle[i] / set.noise_mps2[i], 2) /
                   (kSets * kAxisCount);
        }
      }
      EXPECT_NEAR(ratio, 1, kind == NoiseKind::coloured ? 0.3 : 0.15)
          << to_string(kind) << " " << bits;
    }
  }
}

TEST(DiagnosisStudyItself, EveryEffectReachesItsSize) {
  for (const StudyEffect& effect : study_effects()) {
    const SetDesign design{.seed = 5,
                           .effects = {effect.name},
                           .size = 3,
                           .order = sim::RecordOrder::random,
                           .samples_per_pose = 10,
                           .static_s = 1};
    const StudySet set = make_set(design);
    ASSERT_EQ(set.size.size(), 1U);
    if (std::string(effect.name) == "adc.stuck_bit") continue;  // bits come in powers of two
    EXPECT_TRUE(set.feasible) << effect.name << " " << set.size.front();
    EXPECT_NEAR(set.size.front(), 3, 0.3) << effect.name;
    EXPECT_GT(set.sigma.front(), 0) << effect.name;
  }
}

TEST(DiagnosisStudyItself, SameSeedSameSet) {
  const SetDesign design{.seed = 3, .effects = {"rig.backlash"}, .size = 3, .static_s = 1};
  const StudySet first = make_set(design);
  const StudySet second = make_set(design);
  EXPECT_EQ(first.set.run.samples.u_V, second.set.run.samples.u_V);
  EXPECT_EQ(first.static_record.u_V, second.static_record.u_V);
  EXPECT_NE(first.set.run.samples.u_V, first.plain.run.samples.u_V);
}

/// A set of which only the truth matters.
StudySet with_truth(const SetDesign& design, std::vector<sim::EffectSetting> effects) {
  StudySet set = make_set({.seed = design.seed, .static_s = 1});
  set.effects = std::move(effects);
  return set;
}

FoundEffect finding(std::string id, std::vector<std::size_t> axes,
                    std::vector<std::string> alternatives = {}) {
  FoundEffect found;
  found.id = std::move(id);
  found.axes = std::move(axes);
  found.alternatives = std::move(alternatives);
  return found;
}

TEST(DiagnosisStudyItself, ScoresFindingsByHand) {
  const SetDesign design{.seed = 1, .effects = {"sensor.quadratic", "rig.base_roll"}};
  const StudySet set =
      with_truth(design, {{"sensor.quadratic", {1}, {{"k2", 0.02}}, {}, "bias"},
                          {"rig.base_roll", {0, 1, 2}, {{"epsilon", 1.0}}, {}, "bias"}});
  Calibration calibration;  // one that got the 12 parameters right
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto& K = set.world.triad.K_V_per_g[i];
    AxisEstimate& estimate = calibration.final.batch_ls[i];
    estimate.value << K[0], K[1], K[2], set.world.triad.U0_V[i];
    estimate.covariance.setIdentity();
  }
  calibration.estimates = calibration.final;
  Diagnosis& diagnosis = calibration.diagnosis;

  const SetOutcome nothing = score(design, set, calibration);
  EXPECT_EQ(nothing.K_within, 9);
  EXPECT_EQ(nothing.U0_within, 3);
  EXPECT_EQ(nothing.effects, 2);
  EXPECT_EQ(nothing.named_or_stated, 0);
  EXPECT_EQ(nothing.missed(), 2);
  EXPECT_EQ(nothing.wrong, 0);

  diagnosis.effects = {finding("sensor.quadratic", {1}),
                       finding("rig.axis_skew", {0, 1, 2}, {"rig.base_roll"})};
  diagnosis.effects[0].parameters = {{"k2", 1, 0.025, 0.002, "g/g^2"}};
  SetOutcome outcome = score(design, set, calibration);
  EXPECT_EQ(outcome.named, 1);
  EXPECT_EQ(outcome.named_or_stated, 2);
  EXPECT_EQ(outcome.wrong, 0);
  EXPECT_EQ(outcome.parameters, 1);
  EXPECT_EQ(outcome.parameters_within, 0);  // 2.5 u away

  // Another axis, another name, and a third finding: one of them is beyond the two true ones.
  diagnosis.effects = {finding("sensor.quadratic", {0}), finding("rig.tilt_index", {0, 1, 2}),
                       finding("sensor.drift", {1})};
  outcome = score(design, set, calibration);
  EXPECT_EQ(outcome.named_or_stated, 0);
  EXPECT_EQ(outcome.wrong, 3);
  EXPECT_EQ(outcome.additional(), 1);

  diagnosis.effects = {finding("sensor.cubic", {1}, {"sensor.quadratic+rig.base_roll"})};
  outcome = score(design, set, calibration);
  EXPECT_EQ(outcome.named, 0);
  EXPECT_EQ(outcome.named_or_stated, 2);

  diagnosis.effects = {finding("sensor.quadratic", {0, 1})};
  outcome = score(design, set, calibration);
  EXPECT_EQ(outcome.named, 0);
  EXPECT_EQ(outcome.named_or_stated, 1);
  EXPECT_EQ(outcome.wrong, 1);
}

TEST(DiagnosisStudyItself, EffectOutsideTheListIsScoredByItsDriver) {
  const SetDesign design{.seed = 1, .effects = {"own.condensation"}};
  const StudySet set = with_truth(design, {{"own.condensation", {1}, {{"b", 0.01}}, {}, "bias"}});
  Diagnosis diagnosis;
  UnlistedStructure structure;
  structure.driver = "rh_pct";
  structure.axes = {1};
  diagnosis.unlisted = {structure};
  Claims claims = check_claims(design, set, diagnosis);
  EXPECT_EQ(claims.driver_right, 1);
  EXPECT_EQ(claims.wrong + claims.near_name + claims.listed_instead + claims.missed(), 0);

  // Another axis, another driver; a listed name beside the right driver is one too many.
  diagnosis.unlisted[0].axes = {0};
  EXPECT_EQ(check_claims(design, set, diagnosis).driver_right, 0);
  diagnosis.unlisted[0] = structure;
  diagnosis.unlisted[0].driver = "t_s";
  EXPECT_EQ(check_claims(design, set, diagnosis).driver_right, 0);
  diagnosis.unlisted[0] = structure;
  diagnosis.effects = {finding("sensor.drift", {1})};
  claims = check_claims(design, set, diagnosis);
  EXPECT_EQ(claims.driver_right, 1);
  EXPECT_EQ(claims.listed_instead, 1);
  EXPECT_EQ(claims.wrong, 1);

  // The straight part of the curve has the driver in its name; its other form has not.
  diagnosis.unlisted.clear();
  diagnosis.effects = {finding("covariate:rh_pct", {1})};
  diagnosis.effects[0].parameters = {{"c", 1, 0.01, 0, "g/rh_pct"}};
  claims = check_claims(design, set, diagnosis);
  EXPECT_EQ(claims.driver_right, 1);
  EXPECT_EQ(claims.near_name, 1);
  EXPECT_EQ(claims.wrong + claims.listed_instead, 0);
  diagnosis.effects[0].parameters[0].unit = "1/rh_pct";
  claims = check_claims(design, set, diagnosis);
  EXPECT_EQ(claims.driver_right, 0);
  EXPECT_EQ(claims.listed_instead, 1);
}

TEST(DiagnosisStudyItself, NaiveSearchNamesAnEffectAndSeesMoreThanThereIs) {
  const StudySet set =
      make_set({.seed = 11, .effects = {"sensor.quadratic"}, .size = 10, .static_s = 1});
  const NaiveResult naive = search_naively(set);
  const Claims claims = check_claims({.effects = {"sensor.quadratic"}}, set, naive.diagnosis);
  EXPECT_EQ(claims.named_or_stated, 1) << claims.found;
  EXPECT_GT(claims.wrong, 0) << claims.found;
  EXPECT_GT(naive.fresh_mps2, 0);
  EXPECT_LT(naive.fresh_mps2, 0.5);
}

TEST(DiagnosisStudyItself, RowsAreReadBackAsTheyWereWritten) {
  SetOutcome outcome;
  outcome.design = {.seed = 7,
                    .effects = {"rig.backlash", "sensor.drift"},
                    .size = 3,
                    .order = sim::RecordOrder::random,
                    .noise = NoiseKind::coloured,
                    .bits = 12};
  outcome.size = {3.01, 2.99};
  outcome.sigma = {40, 41.5};
  outcome.verdict = Verdict::partly_explained;
  outcome.found = "sensor.drift(x) d=1, 2; rig.backlash(xyz)";
  outcome.effects = 2;
  outcome.named = 1;
  outcome.after.fresh = 0.0215;
  outcome.truth_ahead = -3.5;
  outcome.naive.wrong = 3;
  const std::string text = csv_header() + csv_row(outcome);
  const auto rows = read_csv(text + "8,rig.back", "rows");  // the last one was cut short
  ASSERT_TRUE(rows) << rows.error().message;
  ASSERT_EQ(rows->size(), 1U);
  EXPECT_EQ(csv_row(rows->front()), csv_row(outcome));
  EXPECT_EQ(rows->front().found, outcome.found);
  EXPECT_EQ(reproduce(rows->front().design), reproduce(outcome.design));
  EXPECT_FALSE(read_csv("seed,effects\n1,none\n", "rows"));
}

TEST(DiagnosisStudyItself, ClopperPearsonLimitsByHand) {
  const Share none{0, 500};
  EXPECT_EQ(none.lower(), 0);
  EXPECT_NEAR(none.upper(), 1 - std::pow(0.025, 1.0 / 500), 1e-9);
  const Share all{20, 20};
  EXPECT_NEAR(all.lower(), std::pow(0.025, 1.0 / 20), 1e-9);
  EXPECT_EQ(all.upper(), 1);
  const Share half{50, 100};
  EXPECT_NEAR(half.lower(), 0.39832, 1e-5);
  EXPECT_NEAR(half.upper(), 0.60168, 1e-5);
}

}  // namespace
}  // namespace plumbline::study
