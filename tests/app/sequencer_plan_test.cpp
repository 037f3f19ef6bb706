// Plans: what is visited, in which order, from which side, and how long it takes.
#include "app/sequencer/plan.h"

#include <gmock/gmock.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "app/sequencer/separation_plan.h"
#include "app/sequencer/shortest_plan.h"

namespace plumbline::app {
namespace {

using storage::PoseKind;
using testing::HasSubstr;

constexpr AxisMotion kHead{30, 60};  // °/s, °/s²
constexpr double kRate_Hz = 100;

/// 36 × 9 nodes with tilt steps of 22.5°, without soak and verification.
Plan full_grid(VisitOrder order, bool one_sided) {
  const Grid grid{{0, 350, 10}, {0, 180, 22.5}};
  PlanOptions options;
  options.order = order;
  options.one_sided = one_sided;
  options.soak_s = 0;
  options.verification_poses = 0;
  return make_plan(grid, options, kRate_Hz);
}

double moving_s(VisitOrder order, bool one_sided) {
  return time_plan(full_grid(order, one_sided), kHead, kRate_Hz, 0).moving_s;
}

TEST(Travel, TrapezoidAndTriangle) {
  EXPECT_DOUBLE_EQ(travel_s(45, kHead), 2.0);  // 15° to speed up and brake, 30° at 30°/s
  EXPECT_DOUBLE_EQ(travel_s(-45, kHead), 2.0);
  EXPECT_DOUBLE_EQ(travel_s(15, kHead), 1.0);    // the speed is only just reached
  EXPECT_DOUBLE_EQ(travel_s(3.75, kHead), 0.5);  // a triangle: 2·sqrt(3.75 / 60)
  EXPECT_DOUBLE_EQ(travel_s(0, kHead), 0.0);
  EXPECT_DOUBLE_EQ(travel_s({0, 0}, {3.75, 45}, kHead), 2.0);  // the slower axis counts
}

// Worked by hand: 315 steps of 10° take 2·sqrt(10/60) = 0.8165 s each, 8 tilt steps of 22.5° take
// 22.5/30 + 0.5 = 1.25 s each; a return of 350° takes 350/30 + 0.5 = 12.1667 s.
TEST(PlanTiming, OrdersOfTheFullGrid) {
  EXPECT_NEAR(moving_s(VisitOrder::raster, false), 354.53, 0.01);
  EXPECT_NEAR(moving_s(VisitOrder::snake, false), 267.20, 0.01);
  EXPECT_NEAR(moving_s(VisitOrder::spiral, false), 267.20, 0.01);
}

// One-sided raster: the 8 returns go 2° further (+2/30 s) and come back (2·sqrt(2/60) s). Snake: on
// 4 rings 35 steps become 12° and back by 2°.
TEST(PlanTiming, OneSidedOrdersOfTheFullGrid) {
  EXPECT_NEAR(moving_s(VisitOrder::raster, true), 357.98, 0.01);
  EXPECT_NEAR(moving_s(VisitOrder::snake, true), 329.23, 0.01);
  EXPECT_NEAR(moving_s(VisitOrder::spiral, true), 267.20, 0.01);
}

TEST(PlanTiming, CountsSoakSamplesAndSettling) {
  PlanOptions options;
  options.soak_s = 600;
  options.samples_per_pose = 40;
  options.verification_poses = 24;
  const Plan plan = make_plan(Grid{}, options, kRate_Hz);
  const PlanTime time = time_plan(plan, kHead, kRate_Hz, 0.5);
  ASSERT_EQ(plan.steps.size(), 1u + 324u + 24u);
  EXPECT_NEAR(time.sampling_s, 600 + 348 * 0.4, 1e-9);
  EXPECT_NEAR(time.settling_s, 349 * 0.5, 1e-9);
  EXPECT_NEAR(time.total_s(), time.moving_s + time.sampling_s + time.settling_s, 1e-9);
}

TEST(Plan, SoakComesFirstWithItsSamples) {
  PlanOptions options;
  options.soak_s = 12.5;
  options.soak_delta_deg = 90;
  options.soak_h_deg = 30;
  const Plan plan = make_plan(Grid{}, options, kRate_Hz);
  EXPECT_EQ(plan.steps[0].kind, PoseKind::soak);
  EXPECT_EQ(plan.steps[0].samples, 1250);
  EXPECT_EQ(plan.steps[0].target.delta_deg, 90);
  EXPECT_EQ(plan.steps[0].target.h_deg, 30);
  EXPECT_EQ(plan.steps[1].kind, PoseKind::grid);
}

TEST(Plan, PrintsAsCsv) {
  const Grid grid{{0, 90, 90}, {0, 10, 10}};
  PlanOptions options;
  options.order = VisitOrder::snake;
  options.one_sided = true;
  options.soak_s = 0;
  options.verification_poses = 0;
  options.samples_per_pose = 7;
  EXPECT_EQ(to_csv(make_plan(grid, options, kRate_Hz)),
            "ordinal,kind,delta_deg,h_deg,samples,via\n"
            "0,grid,0,0,7,-2:0\n"
            "1,grid,90,0,7,\n"
            "2,grid,90,10,7,\n"
            "3,grid,0,10,7,-2:10\n");
}

TEST(Plan, SpiralTurnsOnInOneDirection) {
  const Plan plan = full_grid(VisitOrder::spiral, false);
  for (std::size_t i = 1; i < plan.steps.size(); ++i)
    ASSERT_EQ(plan.steps[i].target.delta_deg - plan.steps[i - 1].target.delta_deg, 10);
}

TEST(Plan, OrderNamesReadBack) {
  for (const std::string& name : visit_order_names()) {
    ASSERT_TRUE(visit_order_from(name).has_value()) << name;
    EXPECT_EQ(to_string(*visit_order_from(name)), name);
  }
  EXPECT_FALSE(visit_order_from("zigzag").has_value());
}

TEST(PlanCheck, NamesTheStepAndTheAngle) {
  const Plan plan = full_grid(VisitOrder::snake, false);
  const rig::SoftLimits limits{{-5, -5}, {365, 100}};
  const auto checked = check_plan(plan, limits);
  ASSERT_FALSE(checked.has_value());
  EXPECT_EQ(checked.error().code, ErrorCode::input);
  // Rings at 0, 22.5, 45, 67.5, 90 are fine; ring 5 starts at step 180 on the far end.
  EXPECT_THAT(checked.error().message, HasSubstr("step 180"));
  EXPECT_THAT(checked.error().message, HasSubstr("h = 112.5°"));
  EXPECT_THAT(checked.error().message, HasSubstr("above the soft limit of 100°"));
  EXPECT_TRUE(check_plan(plan, {{0, 0}, {350, 180}}).has_value());
}

TEST(PlanCheck, LooksAtApproachPositionsToo) {
  const auto checked = check_plan(full_grid(VisitOrder::raster, true), {{0, 0}, {350, 180}});
  ASSERT_FALSE(checked.has_value());
  EXPECT_THAT(checked.error().message, HasSubstr("step 0 "));
  EXPECT_THAT(checked.error().message, HasSubstr("δ = -2°"));
  EXPECT_THAT(checked.error().message, HasSubstr("below the soft limit of 0°"));
}

/// A grid and options as a user might write them.
struct Case {
  Grid grid;
  PlanOptions options;
};

Case any_case() {
  Case made;
  made.grid.delta.step_deg = *rc::gen::element(1.0, 5.0, 7.5, 10.0, 90.0, 120.0);
  made.grid.delta.start_deg = *rc::gen::element(-90.0, 0.0, 15.0);
  made.grid.delta.stop_deg =
      made.grid.delta.start_deg + made.grid.delta.step_deg * *rc::gen::inRange(0, 3);
  made.grid.h.step_deg = *rc::gen::element(0.5, 10.0, -22.5);  // from above as well
  made.grid.h.stop_deg = made.grid.h.step_deg * *rc::gen::inRange(1, 5);
  made.options.order = *rc::gen::element(VisitOrder::raster, VisitOrder::snake, VisitOrder::spiral,
                                         VisitOrder::random);
  made.options.one_sided = *rc::gen::arbitrary<bool>();
  made.options.soak_s = *rc::gen::element(0.0, 1.0);
  made.options.verification_poses = *rc::gen::inRange(0, 6);
  made.options.seed = *rc::gen::arbitrary<std::uint32_t>();
  return made;
}

/// δ folded into one turn from the grid's start on, in units that compare exactly.
std::pair<long long, long long> key(const rig::HeadAngles& angles, double start_deg) {
  double delta = std::fmod(angles.delta_deg - start_deg, 360.0);
  if (delta < 0) delta += 360.0;
  return {std::llround(delta * 1e6), std::llround(angles.h_deg * 1e6)};
}

RC_GTEST_PROP(PlanProperty, VisitsEveryNodeOnce, ()) {
  const Case made = any_case();
  const Plan plan = make_plan(made.grid, made.options, kRate_Hz);
  std::map<std::pair<long long, long long>, int> visits;
  long long ordinal = 0;
  for (const PlanStep& step : plan.steps) {
    RC_ASSERT(step.ordinal == ordinal++);
    if (step.kind == PoseKind::grid) ++visits[key(step.target, made.grid.delta.start_deg)];
  }
  const auto count = [](const AngleRange& range) {
    return std::lround((range.stop_deg - range.start_deg) / range.step_deg) + 1;
  };
  RC_ASSERT(std::ssize(visits) == count(made.grid.delta) * count(made.grid.h));
  for (const auto& [node, times] : visits) RC_ASSERT(times == 1);
}

RC_GTEST_PROP(PlanProperty, OneSidedArrivesInPositiveDirection, ()) {
  Case made = any_case();
  made.options.one_sided = true;
  const Plan plan = make_plan(made.grid, made.options, kRate_Hz);
  RC_ASSERT(!plan.steps.front().via.empty());  // where the head comes from is not known
  double delta_deg = plan.steps.front().via.back().delta_deg;
  for (const PlanStep& step : plan.steps) {
    if (!step.via.empty()) {
      RC_ASSERT(step.via.size() == 1u);
      RC_ASSERT(step.via[0].h_deg == step.target.h_deg);
      delta_deg = step.via[0].delta_deg;
      RC_ASSERT(delta_deg <= step.target.delta_deg - made.options.approach_deg);
    }
    RC_ASSERT(step.target.delta_deg >= delta_deg);
    delta_deg = step.target.delta_deg;
  }
}

RC_GTEST_PROP(PlanProperty, VerificationLiesOffTheGridAndWithinItsSpan, ()) {
  const Case made = any_case();
  const Plan plan = make_plan(made.grid, made.options, kRate_Hz);
  const double delta_clearance = std::min(1.0, made.grid.delta.step_deg / 4);
  const double h_clearance = std::min(1.0, std::abs(made.grid.h.step_deg) / 4);
  std::vector<rig::HeadAngles> grid;
  for (const PlanStep& step : plan.steps)
    if (step.kind == PoseKind::grid) grid.push_back(step.target);
  int verifications = 0;
  for (const PlanStep& step : plan.steps) {
    if (step.kind != PoseKind::verification) continue;
    ++verifications;
    RC_ASSERT(step.target.h_deg >= std::min(made.grid.h.start_deg, made.grid.h.stop_deg));
    RC_ASSERT(step.target.h_deg <= std::max(made.grid.h.start_deg, made.grid.h.stop_deg));
    for (const rig::HeadAngles& node : grid) {
      const double apart = std::remainder(step.target.delta_deg - node.delta_deg, 360.0);
      RC_ASSERT(std::abs(apart) >= delta_clearance - 1e-6 ||
                std::abs(step.target.h_deg - node.h_deg) >= h_clearance - 1e-6);
    }
  }
  RC_ASSERT(verifications == made.options.verification_poses);
}

TEST(Plan, SeedDecidesRandomOrderAndVerification) {
  PlanOptions options;
  options.order = VisitOrder::random;
  const std::string first = to_csv(make_plan(Grid{}, options, kRate_Hz));
  EXPECT_EQ(first, to_csv(make_plan(Grid{}, options, kRate_Hz)));
  options.seed = 2;
  EXPECT_NE(first, to_csv(make_plan(Grid{}, options, kRate_Hz)));
}

TEST(ShortestPlan, FewerPositionsThanTheOrderOfTheGrid) {
  PlanOptions options;
  options.order = VisitOrder::raster;
  options.one_sided = true;
  const Plan all = make_plan({{0, 350, 10}, {0, 80, 10}}, options, kRate_Hz);
  const auto shortest = shortest_plan(all, options, {}, {0.02, 0.03});
  ASSERT_TRUE(shortest) << shortest.error().message;
  // By hand: of 324 positions the first ring and some of the next are needed in the order of the
  // grid; spread over the sphere, four parameters of variance (0.02/0.03)² take a dozen.
  EXPECT_LE(shortest->positions, 16U);
  EXPECT_GE(shortest->positions, 6U);
  EXPECT_GT(shortest->in_order_positions, 36U);
  EXPECT_LE(shortest->u_mps2, 0.02);
  std::size_t grid = 0;
  for (std::size_t k = 0; k < shortest->plan.steps.size(); ++k) {
    const PlanStep& step = shortest->plan.steps[k];
    EXPECT_EQ(step.ordinal, static_cast<long long>(k));
    grid += step.kind == PoseKind::grid ? 1 : 0;
    if (k > 0 && step.target.delta_deg < shortest->plan.steps[k - 1].target.delta_deg) {
      EXPECT_EQ(step.via.size(), 1U) << k;
    } else if (k > 0) {
      EXPECT_TRUE(step.via.empty()) << k;
    }
  }
  EXPECT_EQ(grid, shortest->positions);
  const auto& course = shortest->course;
  for (std::size_t k = 1; k < course.size(); ++k) {
    EXPECT_LE(course[k].d_optimal_mps2, course[k - 1].d_optimal_mps2);
    EXPECT_LE(course[k].d_optimal_mps2, course[k].in_order_mps2 * (1 + 1e-9));
  }
  const auto never = shortest_plan(all, options, {}, {1e-6, 0.03});
  ASSERT_FALSE(never);
  EXPECT_THAT(never.error().message, HasSubstr("all 324 positions"));
}

TEST(PlanFile, ReadsBackWhatWasWritten) {
  PlanOptions options;
  options.one_sided = true;
  options.order = VisitOrder::random;
  const Plan plan = make_plan(Grid{}, options, kRate_Hz);
  const auto read = plan_from_csv(to_csv(plan), "plan.csv");
  ASSERT_TRUE(read.has_value()) << read.error().message;
  EXPECT_EQ(to_csv(*read), to_csv(plan));
  EXPECT_EQ(read->steps.size(), plan.steps.size());
}

TEST(PlanFile, IsRefusedWithTheLine) {
  const std::string header = "ordinal,kind,delta_deg,h_deg,samples,via\n";
  for (const auto& [text, place] : std::vector<std::pair<std::string, std::string>>{
           {"t_s,pose\n", "p.csv:1:"},
           {header + "0,grid,10,20,40,\n1,gird,10,20,40,\n", "p.csv:3:"},
           {header + "0,grid,10,nan,40,\n", "p.csv:2:"},
           {header + "0,grid,10,20,0,\n", "p.csv:2:"},
           {header + "0,grid,10,20,40,5\n", "p.csv:2:"},
           {header + "1,grid,10,20,40,\n", "p.csv:2:"},
           {header, "p.csv: holds no step"}}) {
    const auto plan = plan_from_csv(text, "p.csv");
    ASSERT_FALSE(plan.has_value()) << text;
    EXPECT_EQ(plan.error().code, ErrorCode::input);
    EXPECT_EQ(plan.error().message.find(place), 0u) << plan.error().message;
  }
}

}  // namespace
}  // namespace plumbline::app
