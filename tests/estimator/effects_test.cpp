// One walk over all effects: what holds for each of them, whatever it is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "estimator/diagnosis/candidate_gains.h"
#include "estimator/diagnosis/enlarged_model.h"
#include "estimator/effects/catalogue.h"
#include "estimator/effects/covariate.h"
#include "estimator/effects/head_decay.h"
#include "estimator/effects/smooth_term.h"
#include "estimator/kinematics.h"
#include "tests/estimator/example_visits.h"

namespace plumbline {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Not;
using ::testing::SizeIs;

// Means, then contrasts of the dwells, as the Jacobian has them.
Eigen::VectorXd stacked_prediction(const VisitLog& log, const EnlargedParameters& parameters) {
  const auto mean_V = predict_means_V(log, parameters);
  const auto dwell_V = predict_dwells_V(log, parameters);
  Eigen::VectorXd all(stacked_rows(log));
  all << mean_V[0], mean_V[1], mean_V[2], dwell_V[0].reshaped(), dwell_V[1].reshaped(),
      dwell_V[2].reshaped();
  return all;
}

// An effect of the catalogue, of the x axis if it is one of the sensor.
ActiveEffect listed(const std::string& id, const std::vector<double>& p) {
  const auto& all = effect_catalogue();
  const auto found = std::find_if(all.begin(), all.end(),
                                  [&](const Effect* effect) { return effect->id() == id; });
  if (found == all.end()) throw std::invalid_argument(id);
  return activate(**found, 0, {p});
}

struct EveryEffect : testing::Test {
  VisitLog log = example_log();
  std::vector<std::unique_ptr<Effect>> columns = covariate_effects(log);
  std::vector<const Effect*> all = effect_catalogue();
  EveryEffect() {
    for (const auto& effect : columns) all.push_back(effect.get());
  }
};

TEST_F(EveryEffect, HasAnIdOfItsOwnAndNamedParameters) {
  std::set<std::string> ids;
  for (const Effect* effect : effect_catalogue()) {
    EXPECT_TRUE(ids.insert(effect->id()).second) << effect->id();
    std::set<std::string> names;
    for (const ParameterInfo& info : effect->parameters()) {
      EXPECT_TRUE(names.insert(info.name).second) << effect->id() << " " << info.name;
    }
    EXPECT_FALSE(names.empty()) << effect->id();
  }
  EXPECT_EQ(ids.size(), 30u);  // all that result.json may name, recorded columns aside
}

TEST_F(EveryEffect, DoesNothingAtZeroAmplitudeAndSomethingOtherwise) {
  for (const Effect* effect : all) {
    const auto infos = effect->parameters();
    for (std::size_t axis = 0; axis < (effect->subject() == Subject::head ? 1u : 3u); ++axis) {
      double most = 0;
      const auto hypotheses = effect->hypotheses(log, axis);
      for (const Hypothesis& hypothesis : hypotheses) {
        ActiveEffect active = activate(*effect, axis, hypothesis);
        most = std::max(most, largest_change(log, active));
        bool has_amplitude = false;
        for (std::size_t k = 0; k < infos.size(); ++k) {
          if (infos[k].role != ParameterRole::amplitude) continue;
          active.p[k] = 0;
          has_amplitude = true;
        }
        if (has_amplitude) {
          EXPECT_EQ(largest_change(log, active), 0) << effect->id();
        }
      }
      if (!hypotheses.empty()) {
        EXPECT_GT(most, 1e-9) << effect->id() << " on " << kAxisName[axis];
      }
    }
  }
}

TEST_F(EveryEffect, JacobianAgreesWithTheChangeThatAStepMakes) {
  for (const Effect* effect : all) {
    const auto hypotheses = effect->hypotheses(log, 0);
    if (hypotheses.empty()) continue;
    const auto infos = effect->parameters();
    EnlargedParameters model = twelve();
    model.effects.push_back(activate(*effect, 0, hypotheses[hypotheses.size() / 2]));
    const Eigen::MatrixXd jacobian = prediction_jacobian(log, model);
    Eigen::Index column = 12;
    for (std::size_t k = 0; k < infos.size(); ++k) {
      if (!model.effects[0].free[k]) continue;
      // Amplitudes act nearly linearly: doubling adds about the derivative times the amplitude.
      if (infos[k].role == ParameterRole::amplitude) {
        EnlargedParameters doubled = model;
        doubled.effects[0].p[k] *= 2;
        const Eigen::VectorXd stacked =
            stacked_prediction(log, doubled) - stacked_prediction(log, model);
        const Eigen::VectorXd change = stacked.head(jacobian.rows());
        EXPECT_EQ(change.squaredNorm(), stacked.squaredNorm()) << effect->id();
        const Eigen::VectorXd expected = model.effects[0].p[k] * jacobian.col(column);
        EXPECT_LT((change - expected).norm(), 0.02 * expected.norm() + 1e-12)
            << effect->id() << " " << infos[k].name;
      }
      ++column;
    }
  }
}

// Whatever stands beside it: what an effect before the converter does, a step of the code passes
// on; what moves the head moves what the sensor remembers.
TEST_F(EveryEffect, JacobianBesideOthersIsThatOfWholePredictions) {
  const std::vector<ActiveEffect> others = {
      listed("adc.code_step", {2e-4, -2.58}), listed("sensor.drift", {1e-3}),
      listed("rig.delta_eccentricity", {0.02, -0.03}), listed("rig.h_scale", {1e-4})};
  const auto terms = smooth_terms(log, SmoothTermSelection::any);
  std::vector<const Effect*> with_terms = all;
  for (const auto& term : terms) with_terms.push_back(term.get());
  for (const Effect* effect : with_terms) {
    const auto hypotheses = effect->hypotheses(log, 0);
    if (hypotheses.empty()) continue;
    EnlargedParameters model = twelve();
    model.effects.push_back(activate(*effect, 0, hypotheses[hypotheses.size() / 2]));
    for (const ActiveEffect& other : others)
      if (other.effect != effect) model.effects.push_back(other);
    const Eigen::MatrixXd jacobian = prediction_jacobian(log, model);
    const Eigen::VectorXd values = model.free_values();
    std::vector<double> own_step(12, 0);  // of those that hang on the readings about them
    for (const ActiveEffect& active : model.effects)
      for (std::size_t k = 0; k < active.p.size(); ++k)
        if (active.free[k]) own_step.push_back(active.effect->parameters()[k].step);
    for (Eigen::Index j = 0; j < values.size(); ++j) {
      const double own = own_step.at(static_cast<std::size_t>(j));
      const double step = own > 0  ? own
                          : j < 12 ? 1e-6
                                   : std::max(1e-3 * std::abs(values(j)), 1e-6);
      const auto moved = [&](double by) {
        EnlargedParameters other = model;
        other.set_free_values(values + by * Eigen::VectorXd::Unit(values.size(), j));
        return stacked_prediction(log, other);
      };
      const Eigen::VectorXd expected =
          (moved(step) - moved(-step)).head(jacobian.rows()) / (2 * step);
      EXPECT_LT((jacobian.col(j) - expected).norm(), 1e-3 * expected.norm() + 1e-9)
          << effect->id() << ", column " << j;
    }
  }
}

// The head still moves while the sensor is read: mean and contrasts are those of readings taken at
// the angle of each moment, but for the square of an angle that is small.
TEST(HeadDecay, IsTheGeometryOfEveryMoment) {
  const VisitLog log = example_log();
  for (const auto angle : {&HeadGeometry::delta_rad, &HeadGeometry::h_rad}) {
    for (const SetOffBy by :
         {SetOffBy::arrival, SetOffBy::weight, SetOffBy::way, SetOffBy::direction}) {
      const auto effect = head_decay(angle, by);
      const std::vector<Hypothesis> starts = effect->hypotheses(log, 0);
      ASSERT_EQ(starts.size(), 18u);
      const int visit = 17;
      const Visit &before = log.visits.at(visit - 1), &at = log.visits.at(visit);
      const double way_rad = angle == &HeadGeometry::delta_rad ? before.delta_rad - at.delta_rad
                                                               : before.h_rad - at.h_rad;
      double side = way_rad;  // of the last move, where there was none to this visit
      for (int k = visit; side == 0; --k)
        side = log.visits.at(static_cast<std::size_t>(k - 1)).h_rad -
               log.visits.at(static_cast<std::size_t>(k)).h_rad;
      side = std::copysign(1, side);
      for (const Hypothesis& start : starts) {
        const ActiveEffect active = activate(*effect, 0, start);
        const double rad_of[] = {kRadPerDeg, kRadPerDeg * std::cos(at.h_rad), way_rad,
                                 kRadPerDeg * side};
        const Eigen::ArrayXd decay = (-Eigen::ArrayXd::LinSpaced(8, 0, 0.07) / start.p[1]).exp();
        const double at_truth[] = {0, 1, decay.mean()};  // in the end, on arrival, on average
        Eigen::VectorXd reading_V(8);
        for (Eigen::Index m = 0; m < 8; ++m) {
          HeadGeometry head{at.delta_rad, at.h_rad};
          head.*angle += start.p[0] * rad_of[static_cast<int>(by)] *
                         (decay(m) - at_truth[static_cast<int>(start.p[2])]);
          reading_V(m) = twelve().twelve[1].head<3>().dot(specific_force_g(head, log.gamma));
        }
        const EnlargedParameters with = with_effect(twelve(), active);
        EXPECT_NEAR(predict_means_V(log, with)[1](visit), twelve().twelve[1](3) + reading_V.mean(),
                    5e-9)
            << effect->shape();
        const Eigen::VectorXd contrasts = log.contrasts.at(8).transpose() * reading_V;
        EXPECT_LT((predict_dwells_V(log, with)[1].row(visit).transpose() - contrasts).norm(), 5e-9)
            << effect->shape();
      }
    }
  }
}

TEST(Kinematics, BothFormsAgreeAndErrorsTiltByHand) {
  constexpr double kDeg = std::numbers::pi / 180;
  for (double delta : {0.0, 40.0, 215.0}) {
    for (double h : {0.0, 30.0, 80.0}) {
      const Eigen::Vector3d a = specific_force_g({delta * kDeg, h * kDeg}, 1.001);
      EXPECT_LT((a - specific_force(delta, h, 1.001).a_g).norm(), 1e-14);
    }
  }
  // At δ = h = 0 y_s = −y_b: a base rolled by +ε about x_b lifts y_b, so y_s reads −sin ε.
  const Eigen::Vector3d rolled = specific_force_g({0, 0, 0.1, 0}, 1);
  EXPECT_NEAR(rolled.x(), std::cos(0.1), 1e-15);
  EXPECT_NEAR(rolled.y(), -std::sin(0.1), 1e-15);
  EXPECT_NEAR(rolled.z(), 0, 1e-15);
  // Skew shows only when the spindle is raised: a_x += sin δ·sin η·sin h.
  const Eigen::Vector3d skewed = specific_force_g({90 * kDeg, 30 * kDeg, 0, 0.1}, 1);
  EXPECT_NEAR(skewed.x(), std::sin(0.1) * 0.5, 1e-15);
  EXPECT_NEAR(skewed.z(), std::cos(0.1) * 0.5, 1e-15);
}

TEST(VisitLog, ApproachesByTheShorterWayRound) {
  MeasurementSet set;
  for (int k = 0; k < 4; ++k) {
    const double delta_deg[] = {340, 350, 10, 300};
    set.poses.push_back({k, delta_deg[k], 0, set.samples.size(), 1});
    set.samples.t_s.push_back(k);
    for (auto& u : set.samples.u_V) u.push_back(0.1 * k);
  }
  const VisitLog log = make_visit_log(set, {});
  EXPECT_EQ(log.visits[0].delta_direction[0], 0);  // nothing says how it came there
  EXPECT_EQ(log.visits[1].delta_direction[0], 1);
  EXPECT_EQ(log.visits[2].delta_direction[0], 1);
  EXPECT_EQ(log.visits[3].delta_direction[0], -1);
}

TEST(VisitLog, HalfATurnGoesAsCommandedOrTheOtherWayRound) {
  RunHistory run;
  for (const double delta : {10.0, 190.0, 10.0}) {
    run.visits.emplace_back();
    run.visits.back().delta_rad = delta * std::numbers::pi / 180;
  }
  const VisitLog log = log_of(run);
  EXPECT_THAT(log.visits[1].delta_direction, ElementsAre(1, 1, -1));
  EXPECT_THAT(log.visits[2].delta_direction, ElementsAre(-1, -1, 1));
}

/// Everything that remembers, on one log.
struct Remembering {
  VisitLog log;
  std::vector<std::unique_ptr<SmoothTerm>> terms;
  std::vector<const Effect*> effects;

  explicit Remembering(VisitLog visits)
      : log(std::move(visits)), terms(smooth_terms(log, SmoothTermSelection::any)) {
    for (const Effect* effect : effect_catalogue())
      if (effect->remembers()) effects.push_back(effect);
    for (const auto& term : terms)
      if (term->remembers()) effects.push_back(term.get());
  }
  PerAxis<Eigen::VectorXd> with(std::size_t effect, const Hypothesis& hypothesis) const {
    EnlargedParameters model = twelve();
    model.effects.push_back(activate(*effects[effect], 0, hypothesis));
    return predict_means_V(log, model);
  }
};

TEST(VisitLog, WhatIsRememberedGoesOnInASetThatFollows) {
  constexpr int kSplit = 23, kAll = 60;
  const Remembering whole(example_log());
  VisitLog after = example_log(kSplit, kAll);
  put_in_front(history_of(example_log(0, kSplit)), BetweenSets::nowhere, after);
  const Remembering continued(std::move(after)), alone(example_log(kSplit, kAll));
  ASSERT_EQ(whole.effects.size(), continued.effects.size());
  ASSERT_GT(whole.effects.size(), 50U);
  std::size_t told_apart = 0;
  for (std::size_t e = 0; e < whole.effects.size(); ++e) {
    SCOPED_TRACE(whole.effects[e]->id());
    for (const Hypothesis& hypothesis : whole.effects[e]->hypotheses(whole.log, 0)) {
      const auto expected = whole.with(e, hypothesis), got = continued.with(e, hypothesis);
      const auto without = alone.with(e, hypothesis);
      for (std::size_t i = 0; i < kAxisCount; ++i)
        EXPECT_LT((expected[i] - got[i]).tail(kAll - kSplit).cwiseAbs().maxCoeff(), 1e-12);
      told_apart += (expected[0].tail(kAll - kSplit) - without[0]).norm() > 1e-9 ? 1 : 0;
    }
  }
  EXPECT_GT(told_apart, 100U) << "hypotheses to which it makes no difference prove nothing";
}

TEST(VisitLog, NobodyKnowsWhereTheHeadWentBetweenTwoSets) {
  VisitLog log = example_log(23, 60);
  put_in_front(history_of(example_log(0, 23)), BetweenSets::anywhere, log);
  EXPECT_EQ(log.earlier, 23U);
  EXPECT_EQ(log.before(23), nullptr);
  EXPECT_EQ(log.visits[23].delta_direction[0], 0);
  EXPECT_EQ(log.before(24), &log.visits[23]);
}

TEST(VisitLog, AnotherClockOrAnotherRecordHasNoHistory) {
  const VisitLog alone = example_log(0, 23);
  VisitLog log = alone;
  put_in_front(history_of(example_log(23, 60)), BetweenSets::nowhere, log);
  EXPECT_EQ(log.visits.size(), alone.visits.size()) << "it came later";
  RunHistory without_humidity = history_of(alone);
  without_humidity.covariate_names = {"supply_V"};
  log = example_log(23, 60);
  put_in_front(without_humidity, BetweenSets::nowhere, log);
  EXPECT_EQ(log.earlier, 0U);
}

const Effect& catalogued(const std::string& id) {
  const auto& all = effect_catalogue();
  return **std::find_if(all.begin(), all.end(),
                        [&](const Effect* effect) { return effect->id() == id; });
}

// To and fro between 0 and 330° both ways are the same; fresh poses are not.
TEST(Backlash, TheWayIsThatOfTheDriveWhereItIsKnown) {
  const Effect& backlash = catalogued("rig.backlash");
  VisitLog log = example_log();
  for (const int way : {0, 1}) {
    log.goes_as_commanded = way == 1;
    const auto hypotheses = backlash.hypotheses(log, 0);
    ASSERT_FALSE(hypotheses.empty());
    for (const Hypothesis& hypothesis : hypotheses) EXPECT_EQ(hypothesis.p[1], way);
  }
}

TEST(Backlash, ARunThatNeverGoesTheLongWayLeavesOpenWhichWayItIs) {
  const Effect& backlash = catalogued("rig.backlash");
  const auto run_through = [](const std::vector<double>& delta_deg) {
    RunHistory run;
    for (const double delta : delta_deg) {
      run.visits.emplace_back();
      run.visits.back().delta_rad = delta * std::numbers::pi / 180;
    }
    return run;
  };
  // How it comes to the first pose of a set is open in any case.
  const std::vector<double> found = {0.1, 0, 0};
  const auto other_way = Contains(ElementsAre(0.1, 1, 0));
  EXPECT_THAT(backlash.left_open_by(run_through({0, 120, 240, 120, 0}), found),
              AllOf(SizeIs(8), other_way));
  EXPECT_THAT(backlash.left_open_by(run_through({0, 120, 240, 0, 120}), found),
              AllOf(SizeIs(5), Not(other_way)));
}

// Half a turn is as short one way as the other: a head may take either.
TEST(Backlash, MayBeLeftOpenWhereBothWaysAreAlike) {
  const Effect& backlash = catalogued("rig.backlash");
  RunHistory run;
  for (const double delta : {0.0, 100.0, 280.0, 280.0, 300.0, 120.0}) {
    run.visits.emplace_back();
    run.visits.back().delta_rad = delta * std::numbers::pi / 180;
  }
  const VisitLog log = log_of(run);
  const std::vector<double> found = {0.1, 0, 0};
  const std::vector<double> open = backlash.with_ties_open(log, 0, found);
  ASSERT_FALSE(open.empty());
  EXPECT_TRUE(backlash.with_ties_open(log, 0, open).empty());
  const auto turned_deg = [&](std::size_t visit, const std::vector<double>& p) {
    HeadGeometry head;
    backlash.displace(log, visit, p.data(), head);
    return head.delta_rad * 180 / std::numbers::pi;
  };
  for (const std::size_t visit : {1U, 4U}) EXPECT_NEAR(turned_deg(visit, open), 0.05, 1e-12);
  for (const std::size_t visit : {2U, 3U, 5U}) EXPECT_EQ(turned_deg(visit, open), 0);
  const auto ways = backlash.ways_at_ties(open);
  ASSERT_EQ(ways.size(), 2U);
  for (std::size_t visit = 1; visit < log.visits.size(); ++visit)
    EXPECT_NEAR(0.5 * (turned_deg(visit, ways[0]) + turned_deg(visit, ways[1])),
                turned_deg(visit, open), 1e-12);
}

TEST(DeltaPeriodic, OfOrdersThatLookTheSameOnTheGridTheLowestStandsForAll) {
  const auto orders = [](double step_deg) {
    VisitLog log = example_log();
    for (std::size_t k = 0; k < log.visits.size(); ++k)
      log.visits[k].delta_rad = static_cast<double>(k) * step_deg * std::numbers::pi / 180;
    std::vector<double> found;
    for (const Hypothesis& start : catalogued("rig.delta_periodic").hypotheses(log, 0))
      found.push_back(start.p[0]);
    return found;
  };
  EXPECT_THAT(orders(10), SizeIs(15));
  EXPECT_THAT(orders(15), ElementsAre(3, 4, 5, 6, 7, 8, 9, 10, 11, 12));
  EXPECT_THAT(orders(60), ElementsAre(3));
}

// Codes are numbered from the lowest that a set shows, and another set shows another.
TEST(Quantization, IsTheSameInASetThatBeginsAtAnotherCode) {
  constexpr double kStep_V = 4 * 5.0 / 65536;
  VisitLog found = example_log(), later = found;
  const auto lattice_from = [](double origin_V) {
    Lattice lattice{kStep_V, origin_V};
    for (int k = 0; k < 300; ++k) lattice.reading_V.push_back(origin_V + kStep_V * k);
    return lattice;
  };
  const double origin_V = -5 + 8000 * kStep_V;
  found.codes[0].coarser_lattice = lattice_from(origin_V);
  later.codes[0].coarser_lattice = lattice_from(origin_V + 7 * kStep_V);
  EnlargedParameters with = twelve();
  with.effects = {
      activate(catalogued("adc.quantization"), 0, {{kStep_V, origin_V, 0.2 * kStep_V}})};
  EXPECT_LT((predict_means_V(found, with)[0] - predict_means_V(later, with)[0]).norm(), 1e-12);
}

// A fit may try what sends an axis far beyond all steps of the converter, where one more is none.
TEST(Converter, APredictionEndsHoweverFarBeyondItsRange) {
  VisitLog log = example_log();
  ASSERT_TRUE(log.adc);
  const double step_V = log.adc->lsb_V();
  const auto with = [&](const char* id, const std::vector<double>& p) {
    return activate(catalogued(id), 0, {p});
  };
  EnlargedParameters model = twelve();
  model.effects = {with("adc.stuck_bit", {3, 1, step_V}),
                   with("adc.quantization", {4 * step_V, -2.5, step_V}),
                   with("adc.quantization", {0.5 * step_V, -2.5, step_V})};
  for (const double far_V : {1e3, 1e14, 1e17, -1e17, 1e300}) {
    model.twelve[0](3) = far_V;
    EXPECT_TRUE(predict_means_V(log, model)[0].allFinite()) << far_V;
  }
  model.twelve[0](3) = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(predict_means_V(log, model)[0].allFinite());
}

TEST(CodeStep, LiesWhereTheConverterIsGivenItWhateverMakesTheVoltage) {
  const VisitLog log = example_log();
  EnlargedParameters model = twelve();
  const std::vector<double> output_V = [&] {
    const Eigen::VectorXd bare_V = predict_means_V(log, model)[0];
    return std::vector<double>(bare_V.begin(), bare_V.end());
  }();
  constexpr double at_V = -2.58, step_V = 1e-4, rate_V_per_s = 5e-5;
  model.effects = {listed("adc.code_step", {step_V, at_V}),
                   listed("sensor.drift", {rate_V_per_s * 3600 / model.twelve[0](0)})};
  const Eigen::VectorXd with_V = predict_means_V(log, model)[0];
  int moved_over = 0;
  for (std::size_t k = 0; k < log.visits.size(); ++k) {
    const double bare_V = output_V[k], given_V = bare_V + rate_V_per_s * log.visits[k].t_mean_s;
    if (std::abs(given_V - at_V) < 6 * log.input_sd_V[0]) continue;
    EXPECT_NEAR(with_V(static_cast<Eigen::Index>(k)), given_V + (given_V > at_V ? step_V : -step_V),
                1e-9);
    moved_over += (bare_V > at_V) != (given_V > at_V) ? 1 : 0;
  }
  EXPECT_GT(moved_over, 3);
}

}  // namespace
}  // namespace plumbline
