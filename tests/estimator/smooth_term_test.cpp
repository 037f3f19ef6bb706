// Terms without a name: what they say beyond the visits that they were found on.
#include "estimator/effects/smooth_term.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <string>

#include "estimator/diagnosis/enlarged_model.h"
#include "estimator/effects/function_of_driver.h"
#include "tests/estimator/example_visits.h"

namespace plumbline {
namespace {

// What hardly changes over a run would take the place of the 12 parameters.
TEST(AverageOfThePast, ForgetsWithinTheRunThatIsSearched) {
  const VisitLog log = example_log();
  const double span_s = log.last_s() - log.first_s();
  for (const auto selection :
       {SmoothTermSelection::shown_by_these_visits, SmoothTermSelection::any}) {
    int seen = 0;
    for (const auto& term : smooth_terms(log, selection)) {
      if (!term->shape().ends_with("the average of the past")) continue;
      ++seen;
      ActiveEffect active = activate(*term, 0, term->hypotheses(log, 0).front());
      EXPECT_GT(largest_change(log, active), 0);
      active.p[3] = 1.1 * span_s;
      EXPECT_EQ(largest_change(log, active) > 0, selection == SmoothTermSelection::any);
    }
    EXPECT_GT(seen, 4);
  }
}

// A set of readings may begin long after the one before it ended.
TEST(AverageOfThePast, LagsBehindAnEvenRiseAsFarAfterAGapAsBefore) {
  constexpr double kTau_s = 10, kGap_s = 600, kRise_K_per_s = 0.01;
  VisitLog log = example_log();
  for (std::size_t k = 0; k < log.visits.size(); ++k) {
    Visit& visit = log.visits[k];
    if (k >= 30) {
      visit.t_arrival_s += kGap_s;
      visit.t_mean_s += kGap_s;
    }
    visit.temperature_K = kRise_K_per_s * visit.t_mean_s;
  }
  int seen = 0;
  for (const auto& term : smooth_terms(log, SmoothTermSelection::any)) {
    if (term->driver() != "temp_C.rate" || term->form() != TermForm::bias ||
        term->shape() != "straight line in the average of the past")
      continue;
    ++seen;
    EnlargedParameters with = twelve();
    with.effects = {activate(*term, 0, term->hypotheses(log, 0).front())};
    with.effects[0].p[3] = kTau_s;
    const Eigen::VectorXd change =
        predict_means_V(log, with)[0] - predict_means_V(log, twelve())[0];
    const Eigen::VectorXd settled = change.tail(40);
    EXPECT_LT((settled.array() - settled.mean()).abs().maxCoeff(), 0.01 * std::abs(settled.mean()));
  }
  EXPECT_EQ(seen, 1);
}

// Beside creep the 12 parameters are those of a long rest.
TEST(AverageOfThePast, OfTheAttitudeIsNothingAfterALongRest) {
  VisitLog log = example_log();
  for (std::size_t k = 30; k < log.visits.size(); ++k) {
    log.visits[k].delta_rad = log.visits[29].delta_rad;
    log.visits[k].h_rad = log.visits[29].h_rad;
  }
  int seen = 0;
  for (const auto& term : smooth_terms(log, SmoothTermSelection::shown_by_these_visits)) {
    if (term->shape() != "straight line in the change from the average of the past") continue;
    ++seen;
    EXPECT_EQ(term->driver(), "previous_pose");
    EnlargedParameters with = twelve();
    with.effects = {activate(*term, 0, term->hypotheses(log, 0).front())};
    ASSERT_EQ(with.effects[0].p[4], 0) << "no other beginning";
    const Eigen::VectorXd change =
        predict_means_V(log, with)[0] - predict_means_V(log, twelve())[0];
    EXPECT_LT(change.tail(1).cwiseAbs().maxCoeff(), 0.01 * change.cwiseAbs().maxCoeff());
    EXPECT_GT(change.head(30).cwiseAbs().maxCoeff(), 0);
  }
  EXPECT_EQ(seen, 2);  // bias and scale
}

// A model is read again for whatever visits there are.
TEST(SmoothTerms, HaveTheSameParametersWhateverWasVisited) {
  const VisitLog log = example_log(), few = example_log(57);
  const auto terms = smooth_terms(log, SmoothTermSelection::any);
  const auto others = smooth_terms(few, SmoothTermSelection::any);
  const auto names = [](const SmoothTerm& term) {
    std::vector<std::string> all;
    for (const ParameterInfo& info : term.parameters()) all.push_back(info.name);
    return all;
  };
  int seen = 0;
  for (const auto& term : terms) {
    const SmoothTerm* other =
        find_term(others, term->driver(), to_string(term->form()), term->shape());
    ASSERT_NE(other, nullptr) << term->driver() << ' ' << term->shape();
    EXPECT_EQ(names(*term), names(*other)) << term->driver() << ' ' << term->shape();
    ++seen;
  }
  EXPECT_GT(seen, 300);
}

// A model that is read again takes the first term of that driver, form and shape.
TEST(SmoothTerms, OfOneDriverFormAndShapeSayTheSame) {
  const VisitLog log = example_log();
  const auto terms = smooth_terms(log, SmoothTermSelection::any);
  std::map<std::vector<std::string>, const SmoothTerm*> first;
  int again = 0;
  for (const auto& term : terms) {
    const auto [known, fresh] =
        first.try_emplace({term->driver(), to_string(term->form()), term->shape()}, term.get());
    if (fresh) continue;
    ++again;
    EXPECT_TRUE(term->is(known->first[0], known->first[1], known->first[2]));
    for (const Hypothesis& hypothesis : term->hypotheses(log, 0)) {
      EnlargedParameters with = twelve();
      with.effects = {activate(*term, 0, hypothesis)};
      const Eigen::VectorXd said_V = predict_means_V(log, with)[0];
      with.effects[0].effect = known->second;
      ASSERT_EQ(said_V, predict_means_V(log, with)[0]) << term->driver() << ' ' << term->shape();
    }
  }
  EXPECT_GT(again, 0);
}

TEST(LegendreSeries, GoesOnBeyondTheRangeAsFarAsItIsTold) {
  const double c[] = {0.5, 0.25, 0.125};
  for (const double end : {-1.0, 1.0}) {
    EXPECT_NEAR(legendre_series(3 * end, -1, 1, c, 1), 1.5 * end, 1e-15);
    const double slope = 0.5 + 0.25 * 3 * end;
    EXPECT_NEAR(legendre_series(2 * end, -1, 1, c, 2), 0.5 * end + 0.25 + slope * end, 1e-15);
    EXPECT_EQ(legendre_series(2 * end, -1, 1, c, 3), legendre_series(end, -1, 1, c, 3));
    const auto parabola = [](double x) { return 0.5 * x + 0.25 * std::legendre(2U, x); };
    EXPECT_NEAR(legendre_series(1.5 * end, -1, 1, c, 2, 0.5), parabola(1.5 * end), 1e-15);
    EXPECT_NEAR(legendre_series(2.5 * end, -1, 1, c, 2, 0.5),
                parabola(1.5 * end) + (0.5 + 0.25 * 3 * 1.5 * end) * end, 1e-15);
  }
  EXPECT_NEAR(legendre_series(0.3, -1, 1, c, 3),
              0.5 * 0.3 + 0.25 * std::legendre(2, 0.3) + 0.125 * std::legendre(3, 0.3), 1e-15);
}

}  // namespace
}  // namespace plumbline
