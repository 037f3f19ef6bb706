// `plumbline plan`: prints, checks and times what `run` would do, without hardware.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>

#include "app/command/command.h"
#include "app/config/rig_description.h"
#include "app/io/files.h"
#include "app/sequencer/plan.h"
#include "app/sequencer/separation_plan.h"
#include "app/sequencer/shortest_plan.h"

namespace plumbline::app {

namespace {

struct PlanArguments {
  std::string config;
  std::string order;
  bool one_sided = false;
  std::optional<std::uint64_t> seed;
  bool print = false;
  std::string csv;
  std::string file;
  std::optional<double> until_u_mps2;
  double pose_sd_mps2 = 0.03;
};

std::string minutes(double seconds) {
  const auto whole = std::lround(seconds);
  return fmt::format("{} min {:02} s", whole / 60, whole % 60);
}

void show_precision(const ShortestPlan& shortest, const PlanArguments& arguments) {
  fmt::print(
      "uncertainty of a measured component by the parameters (RMS over the sphere, pose means to "
      "{} m/s²)\npositions  in this order, m/s²  D-optimal, m/s²\n",
      arguments.pose_sd_mps2);
  for (const PrecisionStep& step : shortest.course)
    fmt::print("{:>9}  {:>20.4g}  {:>15.4g}\n", step.positions, step.in_order_mps2,
               step.d_optimal_mps2);
  fmt::print(
      "{} positions reach {:.3g} m/s²; in this order {}\n", shortest.positions, shortest.u_mps2,
      shortest.in_order_positions > 0 ? fmt::format("it takes {}", shortest.in_order_positions)
                                      : std::string("all of them do not"));
}

Result<ExitCode> show_plan(const PlanArguments& arguments) {
  const auto rig = read_rig_description(arguments.config);
  if (!rig) return fail(rig.error());
  PlanOptions options = rig->plan;
  options.order = visit_order_from(arguments.order).value_or(options.order);
  options.one_sided = options.one_sided || arguments.one_sided;
  options.seed = arguments.seed.value_or(options.seed);
  Plan plan = make_plan(rig->run.grid, options, rig->sensor.rate_hz);
  if (!arguments.file.empty()) {
    auto read = read_plan_file(arguments.file);
    if (!read) return fail(read.error());
    plan = *std::move(read);
  }
  std::optional<ShortestPlan> shortest;
  if (arguments.until_u_mps2) {
    auto found = shortest_plan(plan, options, rig->run.gravity,
                               {*arguments.until_u_mps2, arguments.pose_sd_mps2});
    if (!found) return fail(found.error());
    shortest = std::move(*found);
    plan = shortest->plan;
  }
  if (rig->soft_limits) {
    if (auto allowed = check_plan(plan, *rig->soft_limits); !allowed) {
      return fail(ErrorCode::input, arguments.config + ": " + allowed.error().message);
    }
  }
  if (shortest) show_precision(*shortest, arguments);
  if (arguments.print) fmt::print("{}", to_csv(plan));
  if (!arguments.csv.empty()) {
    if (auto written = write_file_atomically(arguments.csv, to_csv(plan)); !written) {
      return fail(written.error());
    }
  }
  const PlanTime time =
      time_plan(plan, {rig->head.speed_deg_s, rig->head.acceleration_deg_s2}, rig->sensor.rate_hz,
                shortest_settling_s(rig->settling, rig->sensor.rate_hz));
  fmt::print(
      "{} steps, {}{}: about {} (moving {:.1f} s, sampling {:.1f} s, settling {:.1f} s)\n"
      "soft limits: {}\n",
      plan.steps.size(),
      arguments.file.empty() ? to_string(options.order) + std::string(" order")
                             : "from " + arguments.file,
      arguments.file.empty() && options.one_sided ? ", one-sided" : "", minutes(time.total_s()),
      time.moving_s, time.sampling_s, time.settling_s,
      rig->soft_limits ? "kept" : "not in the configuration; the drive's own are checked by run");
  return ExitCode::done;
}

}  // namespace

void add_plan(CLI::App& program, Invocation& invocation) {
  CLI::App* sub = program.add_subcommand(
      "plan", "print, check and time what run would do, without any hardware");
  auto arguments = std::make_shared<PlanArguments>();
  sub->add_option("--config", arguments->config, "rig.toml")->required();
  sub->add_option("--order", arguments->order, "instead of the order in the configuration")
      ->check(CLI::IsMember(visit_order_names()));
  sub->add_flag("--one-sided", arguments->one_sided, "approach every position in +delta direction");
  sub->add_option("--seed", arguments->seed, "of random order and verification angles");
  sub->add_option("--plan", arguments->file, "these steps (CSV) instead of [grid] and [plan]");
  sub->add_flag("--print", arguments->print, "print every step as CSV");
  sub->add_option("--csv", arguments->csv, "write the steps into this file");
  sub->add_option("--until-u", arguments->until_u_mps2,
                  "only the positions that are needed until the parameters are known so well: "
                  "standard uncertainty of a measured component, m/s² (RMS over the sphere)")
      ->check(CLI::PositiveNumber);
  sub->add_option("--pose-sd", arguments->pose_sd_mps2,
                  "for --until-u: standard deviation of a pose mean, m/s², as the floor in the "
                  "result of a unit of this kind")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  sub->callback([arguments, &invocation] {
    invocation.action = [arguments] { return show_plan(*arguments); };
  });
}

}  // namespace plumbline::app
