#include "app/io/evaluation_json.h"

#include <algorithm>

namespace plumbline::app {

namespace {

Json to_json(const EvaluationFigures& figures) {
  return {{"pose_rms", json_array(figures.pose_rms_mps2)},
          {"pose_max_abs", json_array(figures.pose_max_abs_mps2)},
          {"sample_rms", json_array(figures.sample_rms_mps2)}};
}

double max_abs_error(const Evaluation& evaluation) {
  const auto& per_axis = evaluation.after.pose_max_abs_mps2;
  return *std::max_element(per_axis.begin(), per_axis.end());
}

}  // namespace

std::optional<bool> within_limits(const Evaluation& evaluation,
                                  const std::optional<Limits>& limits) {
  if (!limits) return std::nullopt;
  return max_abs_error(evaluation) <= limits->max_abs_error_mps2;
}

Json evaluation_json(const Evaluation& evaluation, std::size_t skipped_rows,
                     const std::optional<Limits>& limits, const Provenance& provenance) {
  Json decision = {{"status", "none"}};
  if (const auto within = within_limits(evaluation, limits)) {
    decision = {{"status", *within ? "pass" : "fail"},
                {"limit_mps2", limits->max_abs_error_mps2},
                {"max_abs_error_mps2", json_number(max_abs_error(evaluation))}};
  }
  return {{"schema", "plumbline.evaluation/1"},
          {"provenance", json_provenance(provenance)},
          {"data",
           {{"poses", evaluation.poses},
            {"samples", evaluation.samples},
            {"moved_in_between", evaluation.head != BetweenSets::nowhere},
            {"skipped_rows", skipped_rows},
            {"outlying_readings",
             json_per_axis([&](std::size_t axis) { return evaluation.outlying_readings[axis]; })}}},
          {"error", {{"before", to_json(evaluation.before)}, {"after", to_json(evaluation.after)}}},
          {"left_out", evaluation.left_out},
          {"decided_otherwise", evaluation.decided_otherwise},
          {"decision", decision}};
}

}  // namespace plumbline::app
