// Sets on which the diagnosis once went wrong over what a converter does. They take minutes:
// scripts/test-nightly.
#include <gtest/gtest.h>

#include "tests/study/diagnosis.h"
#include "tests/study/diagnosis_expectations.h"

namespace plumbline::study {
namespace {

// Rounded twice, first to a third of the declared step: every code occurs, only the edges between
// them are elsewhere, and from code to code that looks like a wave.
TEST(DiagnosisSets, AStepFinerThanTheDeclaredOneIsNoWave) {
  const SetOutcome outcome = run_set({.seed = 900008,
                                      .effects = {"adc.quantization"},
                                      .size = 1,
                                      .order = sim::RecordOrder::raster,
                                      .bits = 12,
                                      .static_s = 300});
  expect_only_finding(outcome);
  EXPECT_EQ(outcome.parameters_within, outcome.parameters) << outcome.found;
}

// Several finer steps, and some that are little coarser, make a wave of the same period. To first
// order, with an amplitude that they do not have, a wrong one often seems the likelier.
TEST(DiagnosisSets, OfTheStepsThatMakeTheSameWaveTheTrueOneIsNamed) {
  SetDesign design{.seed = 1190003,
                   .effects = {"adc.quantization"},
                   .order = sim::RecordOrder::raster,
                   .noise = NoiseKind::white,
                   .bits = 12,
                   .samples_per_pose = 40,
                   .static_s = 600};
  for (const double size : {1, 3}) {
    design.size = size;
    expect_only_finding(run_set(design));
  }
}

// Whole rings of poses go over an edge of the step and back: that passed for a train of pulses.
TEST(DiagnosisSets, SlowNoiseAtTheEdgesOfACoarseStepIsNoStructure) {
  const SetOutcome outcome = run_set({.seed = 900003,
                                      .effects = {"adc.quantization"},
                                      .size = 10,
                                      .order = sim::RecordOrder::raster,
                                      .static_s = 1800});
  expect_only_finding(outcome);
}

// With noise of a twentieth of the declared step a ring of poses has one rounding error in common:
// taken for independent, that passed for functions of the angles.
TEST(DiagnosisSets, RoundingToStepsWithEdgesIsNoEffect) {
  SetDesign design{.seed = 943007,
                   .effects = {},
                   .order = sim::RecordOrder::random,
                   .bits = 10,
                   .samples_per_pose = 40,
                   .static_s = 600};
  const SetOutcome clean = run_set(design);
  EXPECT_EQ(clean.wrong + clean.unlisted, 0) << clean.found;
  EXPECT_EQ(clean.verdict, Verdict::clean);
  design.effects = {"sensor.quadratic"};
  design.size = 1;
  const SetOutcome quadratic = run_set(design);
  expect_only_finding(quadratic);
  EXPECT_EQ(quadratic.unlisted, 0) << quadratic.found;
  EXPECT_EQ(quadratic.parameters_within, quadratic.parameters) << quadratic.found;
  EXPECT_LT(quadratic.worst_K, 4);
}

// Noise of a fifth of a step: in the middle of a step all readings of a pose are alike, which says
// little, not much.
TEST(DiagnosisSets, OfAPoseInTheMiddleOfAStepLittleIsKnown) {
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

// Near the boundary slow noise decides on which side of the step a pose is: no pose is wrong there.
TEST(DiagnosisSets, ACodeStepInSlowNoiseIsNamedAndNoPoseIsBlamed) {
  expect_only_finding(
      run_set(coarse_in_slow_noise(73002, "adc.code_step", sim::RecordOrder::snake)));
}

TEST(DiagnosisSets, AStuckBitOfACoarseConverterIsTheOnlyFinding) {
  const SetOutcome outcome =
      run_set(coarse_in_slow_noise(74003, "adc.stuck_bit", sim::RecordOrder::random));
  expect_only_finding(outcome);
  EXPECT_LT(outcome.after.fresh, 1.5 * outcome.oracle.fresh);
}

// As part of the model, the bit turned every error of the model into one of its own weight.
TEST(DiagnosisSets, AStuckBitHidesNothingElseOnItsAxis) {
  const SetDesign drift{.seed = 890062,
                        .effects = {"sensor.scale_drift", "adc.stuck_bit"},
                        .size = 3,
                        .order = sim::RecordOrder::raster,
                        .noise = NoiseKind::examples,
                        .bits = 16,
                        .samples_per_pose = 40,
                        .static_s = 600};
  SetDesign asymmetry = drift;
  asymmetry.seed = 890043;
  asymmetry.effects = {"sensor.asymmetry", "adc.stuck_bit"};
  asymmetry.size = 10;
  asymmetry.order = sim::RecordOrder::random;
  asymmetry.static_s = 1800;
  for (const SetDesign& design : {drift, asymmetry}) {
    const SetOutcome outcome = run_set(design);
    EXPECT_EQ(outcome.named, 2) << outcome.truth << " / " << outcome.found;
    EXPECT_EQ(outcome.wrong, 0) << outcome.found;
    EXPECT_GE(outcome.K_within, 8);
    EXPECT_LT(outcome.after.fresh, 1.1 * outcome.told_fresh);
  }
}

// Until the warm-up is known, poses near an edge of the bit are expected on its wrong side: steps
// of the bit's weight had stood for them, and kept the readings there.
TEST(DiagnosisSets, JumpsByTheWeightOfAStuckBitAreNoStepsOfTheBias) {
  const SetOutcome outcome = run_set({.seed = 1820002,
                                      .effects = {"sensor.warmup", "adc.stuck_bit"},
                                      .size = 10,
                                      .order = sim::RecordOrder::random,
                                      .noise = NoiseKind::coloured,
                                      .bits = 16,
                                      .samples_per_pose = 40,
                                      .static_s = 300});
  EXPECT_EQ(outcome.named, 2) << outcome.truth << " / " << outcome.found;
  EXPECT_EQ(outcome.wrong, 0) << outcome.found;
}

// Noise of a tenth of a step smooths the steps of the bit so little that seven steps of the codes
// had stood for what was left of them, with K off by 74 of its uncertainties.
TEST(DiagnosisSets, StepsOfTheCodesThatStoodForTheEdgesOfAStuckBitGo) {
  const SetOutcome outcome = run_set({.seed = 1760517,
                                      .effects = {"adc.stuck_bit"},
                                      .size = 3,
                                      .order = sim::RecordOrder::random,
                                      .noise = NoiseKind::white,
                                      .bits = 12,
                                      .samples_per_pose = 40,
                                      .static_s = 600});
  expect_only_finding(outcome);
  EXPECT_EQ(outcome.K_within, 9);
  EXPECT_LT(outcome.after.fresh, 1.1 * outcome.told_fresh);
}

// Once the bit was given back to the readings, nothing proved it any more, and what was left of its
// edges had gone by a bit of the codes without a name.
TEST(DiagnosisSets, WhatIsLeftOfAStuckBitIsNoFurtherBit) {
  const SetOutcome outcome = run_set({.seed = 2050003,
                                      .effects = {"adc.stuck_bit"},
                                      .size = 3,
                                      .order = sim::RecordOrder::raster,
                                      .noise = NoiseKind::white,
                                      .bits = 16,
                                      .samples_per_pose = 50,
                                      .static_s = 600});
  expect_only_finding(outcome);
  EXPECT_LT(outcome.truth_ahead, 10);
  EXPECT_LT(outcome.after.fresh, 1.1 * outcome.told_fresh);
}

// A step of 1.49 declared ones leaves every third code out, as one of 1.5 does.
TEST(DiagnosisSets, AStepOfOneAndAHalfIsOnlySoWellKnown) {
  const SetOutcome outcome = run_set({.seed = 1360006,
                                      .effects = {"adc.quantization"},
                                      .size = 3,
                                      .order = sim::RecordOrder::random,
                                      .noise = NoiseKind::examples,
                                      .bits = 12,
                                      .samples_per_pose = 50,
                                      .static_s = 600});
  EXPECT_EQ(outcome.named, 1) << outcome.truth << " / " << outcome.found;
  EXPECT_EQ(outcome.parameters_within, outcome.parameters) << outcome.found;
  EXPECT_LT(outcome.after.fresh, 1.2 * outcome.oracle.fresh);
}

// Nine readings at the end of the run, of the lowest ring, show the edge of the bit: steps of the
// bias and of the scale that cancelled there were wrong by a g elsewhere.
TEST(DiagnosisSets, ABitOfWhichNineReadingsTellIsNamed) {
  const SetOutcome outcome = run_set({.seed = 1400001,
                                      .effects = {"adc.stuck_bit"},
                                      .size = 1,
                                      .order = sim::RecordOrder::snake,
                                      .noise = NoiseKind::examples,
                                      .bits = 12,
                                      .samples_per_pose = 50,
                                      .static_s = 300});
  EXPECT_EQ(outcome.named, 1) << outcome.truth << " / " << outcome.found;
  EXPECT_EQ(outcome.wrong, 0) << outcome.found;
  EXPECT_LT(outcome.after.fresh, 1.1 * outcome.oracle.fresh);
}

// A sine of one step and a half of the converter is neither noise of the means nor, where next to
// nothing of it is left in them, a line that wanders.
TEST(DiagnosisSets, APickupOfMoreThanAStepIsNamed) {
  const SetDesign by_scatter{.seed = 1450001,
                             .effects = {"adc.mains_pickup"},
                             .size = 10,
                             .order = sim::RecordOrder::random,
                             .noise = NoiseKind::white,
                             .bits = 12,
                             .samples_per_pose = 40,
                             .static_s = 300};
  SetDesign by_phase = by_scatter;
  by_phase.seed = 1450002;
  by_phase.order = sim::RecordOrder::raster;
  by_phase.noise = NoiseKind::examples;
  by_phase.samples_per_pose = 50;
  by_phase.static_s = 1800;
  for (const SetDesign& design : {by_scatter, by_phase}) {
    const SetOutcome outcome = run_set(design);
    EXPECT_EQ(outcome.named, 1) << outcome.truth << " / " << outcome.found;
    EXPECT_EQ(outcome.wrong, 0) << outcome.found;
  }
}

}  // namespace
}  // namespace plumbline::study
