// The study of the diagnosis on few sets; the whole one is scripts/study-diagnosis.
#include "tests/study/diagnosis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace plumbline::study {
namespace {

TEST(DiagnosisStudy, NamesAnEffectAndSaysNothingOnACleanSet) {
  SetDesign design{.seed = 11, .effects = {"sensor.quadratic"}, .size = 3};
  const SetOutcome with = run_set(design);
  ASSERT_TRUE(with.feasible);
  EXPECT_EQ(with.verdict, Verdict::explained);
  EXPECT_EQ(with.named_or_stated, 1) << with.truth << " / " << with.found;
  EXPECT_EQ(with.wrong, 0) << with.found;
  EXPECT_LT(with.after.fresh, 0.8 * with.before.fresh);
  EXPECT_LT(with.after.heldout, 1.15 * with.oracle.heldout);
  EXPECT_NEAR(with.size.front(), 3, 0.06);

  design.effects.clear();
  const SetOutcome without = run_set(design);
  EXPECT_EQ(without.verdict, Verdict::clean) << without.found;
  EXPECT_EQ(without.wrong, 0) << without.found;
  EXPECT_LT(without.after.heldout, 1.15 * without.oracle.heldout);
}

// Leaving out needs the covariance under the noise alone. With what the uncertainties add to it,
// the error on left-out poses came out four times as large as it is.
TEST(DiagnosisStudy, ErrorOnLeftOutPosesIsNotThatOfTheUncertainties) {
  const SetOutcome outcome = run_set({.seed = 182001,
                                      .effects = {"rig.delta_ellipticity"},
                                      .size = 1,
                                      .order = sim::RecordOrder::raster,
                                      .noise = NoiseKind::examples,
                                      .bits = 16,
                                      .samples_per_pose = 50,
                                      .static_s = 300});
  ASSERT_TRUE(outcome.feasible);
  EXPECT_EQ(outcome.named, 1) << outcome.found;
  EXPECT_LT(outcome.after.heldout, 1.1 * outcome.oracle.heldout);
}

void expect_its_driver_and_no_listed_name(const SetOutcome& outcome) {
  ASSERT_TRUE(outcome.feasible) << outcome.truth;
  EXPECT_EQ(outcome.driver_right, 1) << outcome.truth << " / " << outcome.found;
  EXPECT_EQ(outcome.listed_instead, 0) << outcome.truth << " / " << outcome.found;
}

// The bias follows the temperature less its average of the past: seen over the whole run, that
// looks like slow noise.
TEST(DiagnosisStudy, TellsALagBehindTheTemperatureFromSlowNoise) {
  const SetOutcome outcome = run_set({.seed = 17,
                                      .effects = {"own.thermal_gradient"},
                                      .order = sim::RecordOrder::raster,
                                      .static_s = 1800});
  expect_its_driver_and_no_listed_name(outcome);
  EXPECT_LT(outcome.after.heldout, 1.3 * outcome.oracle.heldout);
}

// Shapes that a low polynomial or harmonic series does not have: what is left of them must not go
// by listed names.
TEST(DiagnosisStudy, EffectsWithSharpShapesHaveTheirDriverAndNoListedName) {
  for (const char* effect : {"own.gain_ranging", "own.worn_tooth", "own.cable_pull",
                             "own.compressor", "own.stiction", "own.brake_sag"}) {
    const SetOutcome outcome = run_set({.seed = 120002,
                                        .effects = {effect},
                                        .size = 3,
                                        .order = sim::RecordOrder::raster,
                                        .noise = NoiseKind::examples,
                                        .bits = 16,
                                        .static_s = 1800});
    expect_its_driver_and_no_listed_name(outcome);
    EXPECT_LT(outcome.after.heldout, 1.2 * outcome.oracle.heldout) << outcome.truth;
  }
}

// Two of its edges were found first, as steps.
TEST(DiagnosisStudy, WhatSwitchesOnAndOffIsATrainOfPulses) {
  const SetOutcome outcome = run_set({.seed = 530001,
                                      .effects = {"own.compressor"},
                                      .size = 3,
                                      .order = sim::RecordOrder::random,
                                      .noise = NoiseKind::coloured,
                                      .bits = 12,
                                      .static_s = 300});
  expect_its_driver_and_no_listed_name(outcome);
  EXPECT_LT(outcome.after.heldout, 1.1 * outcome.oracle.heldout);
}

// What a product of components is on average has a listed name; together with what varies it is one
// finding without one.
TEST(DiagnosisStudy, WhatVariesIsOneFindingWithItsMean) {
  const SetOutcome outcome = run_set({.seed = 530003,
                                      .effects = {"own.chimney"},
                                      .size = 3,
                                      .order = sim::RecordOrder::raster,
                                      .static_s = 1800});
  expect_its_driver_and_no_listed_name(outcome);
  EXPECT_LT(outcome.after.heldout, 1.1 * outcome.oracle.heldout);
}

void expect_only_finding(const SetOutcome& outcome) {
  ASSERT_TRUE(outcome.feasible);
  EXPECT_EQ(outcome.named, 1) << outcome.truth << " / " << outcome.found;
  EXPECT_EQ(outcome.wrong, 0) << outcome.found;
}

// Rounded twice, first to a third of the declared step: every code occurs, only the edges between
// them are elsewhere, and from code to code that looks like a wave.
TEST(DiagnosisStudy, AStepFinerThanTheDeclaredOneIsNoWave) {
  const SetOutcome outcome = run_set({.seed = 900008,
                                      .effects = {"adc.quantization"},
                                      .size = 1,
                                      .order = sim::RecordOrder::raster,
                                      .bits = 12,
                                      .static_s = 300});
  expect_only_finding(outcome);
  EXPECT_EQ(outcome.parameters_within, outcome.parameters) << outcome.found;
}

// Whole rings of poses go over an edge of the step and back: that passed for a train of pulses.
TEST(DiagnosisStudy, SlowNoiseAtTheEdgesOfACoarseStepIsNoStructure) {
  const SetOutcome outcome = run_set({.seed = 900003,
                                      .effects = {"adc.quantization"},
                                      .size = 10,
                                      .order = sim::RecordOrder::raster,
                                      .static_s = 1800});
  expect_only_finding(outcome);
}

SetOutcome in_serpentine_order(const char* effect) {
  return run_set({.seed = 760002,
                  .effects = {effect},
                  .size = 3,
                  .order = sim::RecordOrder::snake,
                  .noise = NoiseKind::examples,
                  .bits = 16,
                  .samples_per_pose = 50,
                  .static_s = 600});
}

// A train that explains steps one by one may take the place of another train.
TEST(DiagnosisStudy, WhatSwitchesRegularlyIsOneTrainNotSteps) {
  expect_its_driver_and_no_listed_name(in_serpentine_order("own.compressor"));
}

// In serpentine order the shorter way round is the only one; between fresh poses it is not, and the
// simulated head goes the other.
TEST(DiagnosisStudy, FreshPosesTellWhichWayRoundTheHeadGoes) {
  const SetOutcome outcome = run_set({.seed = 5, .effects = {"rig.backlash"}, .size = 10});
  ASSERT_TRUE(outcome.feasible);
  ASSERT_EQ(outcome.named, 1) << outcome.found;
  EXPECT_GT(outcome.after.fresh, 2 * outcome.oracle.fresh) << "the run alone tells";
  EXPECT_LT(outcome.evaluated_fresh, 1.15 * outcome.oracle.fresh);
}

// The humidity goes on falling after the run, and the average of its past is where the run left it.
TEST(DiagnosisStudy, FreshPosesGoOnWhereTheRunEnded) {
  const SetOutcome outcome = run_set({.seed = 410001,
                                      .effects = {"own.swelling"},
                                      .size = 3,
                                      .order = sim::RecordOrder::snake,
                                      .noise = NoiseKind::white,
                                      .bits = 12,
                                      .samples_per_pose = 50,
                                      .static_s = 300});
  ASSERT_TRUE(outcome.feasible);
  EXPECT_EQ(outcome.driver_right, 1) << outcome.truth << " / " << outcome.found;
  EXPECT_LT(outcome.after.fresh, 1.2 * outcome.oracle.fresh);
  EXPECT_LT(outcome.evaluated_fresh, 1.2 * outcome.oracle.fresh);
}

// Noise of a fifth of a step: in the middle of a step all readings of a pose are alike, which says
// little, not much.
TEST(DiagnosisStudy, OfAPoseInTheMiddleOfAStepLittleIsKnown) {
  int within = 0;
  for (std::uint64_t seed = 820005; seed <= 820010; ++seed) {
    const SetOutcome outcome = run_set({.seed = seed,
                                        .effects = {"sensor.quadratic"},
                                        .size = 3,
                                        .order = sim::RecordOrder::raster,
                                        .noise = NoiseKind::white,
                                        .bits = 12,
                                        .static_s = 300});
    within += outcome.K_within + outcome.U0_within + outcome.parameters_within;
  }
  EXPECT_GE(within, 68) << "of 78 parameters";  // 74 are 95 %
}

SetDesign coarse_in_slow_noise(std::uint64_t seed, const char* effect, sim::RecordOrder order) {
  return {.seed = seed,
          .effects = {effect},
          .size = 10,
          .order = order,
          .noise = NoiseKind::coloured,
          .bits = 12};
}

// The gain has several peaks over the place of a step that few poses see.
TEST(DiagnosisStudy, ACodeStepIsPlacedWhereItGainsMost) {
  const SetOutcome outcome = run_set({.seed = 620013,
                                      .effects = {"adc.code_step"},
                                      .size = 3,
                                      .order = sim::RecordOrder::raster,
                                      .noise = NoiseKind::white,
                                      .bits = 16,
                                      .static_s = 300});
  expect_only_finding(outcome);
  EXPECT_EQ(outcome.parameters_within, outcome.parameters);
}

// Near the boundary slow noise decides on which side of the step a pose is: no pose is wrong there.
TEST(DiagnosisStudy, ACodeStepInSlowNoiseIsNamedAndNoPoseIsBlamed) {
  expect_only_finding(
      run_set(coarse_in_slow_noise(73002, "adc.code_step", sim::RecordOrder::snake)));
}

// A third of the poses read the same code: what is known of the noise of that axis is next to
// nothing, and its sensitivity was said to be, too.
TEST(DiagnosisStudy, AClippedAxisOfACoarseConverterIsStillAnAxis) {
  expect_only_finding(run_set({.seed = 350002,
                               .effects = {"sensor.saturation"},
                               .size = 10,
                               .order = sim::RecordOrder::snake,
                               .noise = NoiseKind::white,
                               .bits = 12,
                               .samples_per_pose = 40,
                               .static_s = 600}));
}

TEST(DiagnosisStudy, AStuckBitOfACoarseConverterIsTheOnlyFinding) {
  const SetOutcome outcome =
      run_set(coarse_in_slow_noise(74003, "adc.stuck_bit", sim::RecordOrder::random));
  expect_only_finding(outcome);
  EXPECT_LT(outcome.after.fresh, 1.5 * outcome.oracle.fresh);
}

SetOutcome in_strong_slow_noise(const char* effect) {
  return run_set({.seed = 760005,
                  .effects = {effect},
                  .size = 3,
                  .order = sim::RecordOrder::random,
                  .noise = NoiseKind::coloured,
                  .bits = 12,
                  .samples_per_pose = 40,
                  .static_s = 300});
}

void expect_driver_and_error_of_the_oracle(const SetOutcome& outcome) {
  EXPECT_EQ(outcome.driver_right, 1) << outcome.found;
  EXPECT_EQ(outcome.wrong, 0) << outcome.found;
  EXPECT_LT(outcome.after.fresh, 1.1 * outcome.oracle.fresh);
}

// Not one of the edges can be told from the slow noise; all of them can.
TEST(DiagnosisStudy, APumpInStrongSlowNoiseIsFoundByItsRegularity) {
  expect_driver_and_error_of_the_oracle(in_strong_slow_noise("own.compressor"));
}

// On the other axes all that is slow gains more, as long as nothing is noise; with noise of its own
// only the truth does.
TEST(DiagnosisStudy, APlayInStrongSlowNoiseIsFoundBesideAxesWithMoreNoise) {
  expect_driver_and_error_of_the_oracle(in_strong_slow_noise("own.thermal_hysteresis"));
}

// 93 % of the response creep: a sensitivity of what is left at once would make little errors large.
TEST(DiagnosisStudy, BesideCreepTheSensitivityIsThatOfRest) {
  expect_driver_and_error_of_the_oracle(in_strong_slow_noise("own.creep"));
}

// Between a step and a bend, which went on beyond the range that was seen.
TEST(DiagnosisStudy, AWideStepIsNoBend) {
  const SetOutcome outcome = run_set({.seed = 760004,
                                      .effects = {"own.condensation"},
                                      .size = 3,
                                      .order = sim::RecordOrder::snake,
                                      .noise = NoiseKind::examples,
                                      .bits = 12,
                                      .samples_per_pose = 50,
                                      .static_s = 1800});
  expect_driver_and_error_of_the_oracle(outcome);
}

// From neighbouring poses settling is told less well than poses anywhere need it, whoever tells.
TEST(DiagnosisStudy, WhoIsToldTheEffectErrsAsMuch) {
  const SetOutcome outcome = run_set({.seed = 740001,
                                      .effects = {"sensor.settling"},
                                      .size = 3,
                                      .order = sim::RecordOrder::raster,
                                      .noise = NoiseKind::examples,
                                      .bits = 16,
                                      .samples_per_pose = 50,
                                      .static_s = 600});
  expect_only_finding(outcome);
  EXPECT_GT(outcome.told_fresh, 1.5 * outcome.oracle.fresh);
  EXPECT_LT(outcome.after.fresh, 1.05 * outcome.told_fresh);
}

// A drift looks better as long as the noise is the one that had to take up the creep.
TEST(DiagnosisStudy, CreepInSlowNoiseIsNotTakenForADrift) {
  const SetOutcome outcome = in_serpentine_order("own.creep");
  expect_driver_and_error_of_the_oracle(outcome);
  EXPECT_EQ(outcome.listed_instead, 0) << outcome.found;
}

// The covariance that the oracle uses is the one that the simulated noise has.
TEST(DiagnosisStudy, TrueCovariancePredictsTheResidualOfPlainSets) {
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

TEST(DiagnosisStudy, EveryEffectReachesItsSize) {
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

TEST(DiagnosisStudy, SameSeedSameSet) {
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

TEST(DiagnosisStudy, ScoresFindingsByHand) {
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

TEST(DiagnosisStudy, EffectOutsideTheListIsScoredByItsDriver) {
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

TEST(DiagnosisStudy, NaiveSearchNamesAnEffectAndSeesMoreThanThereIs) {
  const StudySet set =
      make_set({.seed = 11, .effects = {"sensor.quadratic"}, .size = 10, .static_s = 1});
  const NaiveResult naive = search_naively(set);
  const Claims claims = check_claims({.effects = {"sensor.quadratic"}}, set, naive.diagnosis);
  EXPECT_EQ(claims.named_or_stated, 1) << claims.found;
  EXPECT_GT(claims.wrong, 0) << claims.found;
  EXPECT_GT(naive.fresh_mps2, 0);
  EXPECT_LT(naive.fresh_mps2, 0.5);
}

TEST(DiagnosisStudy, RowsAreReadBackAsTheyWereWritten) {
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

TEST(DiagnosisStudy, ClopperPearsonLimitsByHand) {
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
