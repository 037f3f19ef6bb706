#include "estimator/diagnosis/verdict.h"

#include <algorithm>
#include <cstdio>

namespace plumbline {
namespace {

/// Why nothing can be said about this axis; empty when something can.
std::string obstacle(const VerdictInput& input, std::size_t axis) {
  if (!input.axis[axis].responds) return "the output does not follow the specific force";
  if (!input.axis[axis].noise_known) return "no noise could be identified";
  return {};
}

std::string comparison(const AxisVerdictInput& axis) {
  char text[120];
  std::snprintf(text, sizeof text, "residual %.3g m/s² where %.3g ± %.1g is expected",
                axis.rms_mps2, axis.expected_mps2, axis.u_expected_mps2);
  return text;
}

void append(std::string& text, std::size_t axis, const std::string& words) {
  if (!text.empty()) text += "; ";
  text += std::string(kAxisName[axis]) + " axis: " + words;
}

}  // namespace

const char* to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::clean:
      return "clean";
    case Verdict::explained:
      return "explained";
    case Verdict::partly_explained:
      return "partly_explained";
    case Verdict::unexplained:
      return "unexplained";
    case Verdict::undetermined:
      break;
  }
  return "undetermined";
}

std::vector<Diagnosis::Finding> Diagnosis::findings() const {
  std::vector<Finding> all;
  for (const FoundEffect& effect : effects) all.push_back({effect.id, effect});
  for (const UnlistedStructure& structure : unlisted) all.push_back({structure.driver, structure});
  return all;
}

bool Diagnosis::enlarges_model() const {
  return !effects.empty() ||
         std::any_of(unlisted.begin(), unlisted.end(),
                     [](const UnlistedStructure& found) { return !found.is_of_noise(); });
}

bool is_unexplained(const VerdictInput& input, std::size_t axis) {
  return input.poses >= kFewestPosesToDecide && obstacle(input, axis).empty() &&
         input.axis[axis].p_value < kFalseAlarmShare / static_cast<double>(kAxisCount);
}

void decide_verdict(const VerdictInput& input, Diagnosis& diagnosis) {
  diagnosis.p_value = 1;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (obstacle(input, axis).empty())
      diagnosis.p_value =
          std::min(diagnosis.p_value, static_cast<double>(kAxisCount) * input.axis[axis].p_value);
  if (input.poses < kFewestPosesToDecide) {
    diagnosis.verdict = Verdict::undetermined;
    diagnosis.reason = std::to_string(input.poses) + " poses are too few to tell an effect from " +
                       "noise; at least " + std::to_string(kFewestPosesToDecide) + " are needed";
    return;
  }

  std::string excess;
  std::string obstacles;
  std::string ordinary;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const std::string words = obstacle(input, axis);
    if (!words.empty()) {
      append(obstacles, axis, words);
      continue;
    }
    append(is_unexplained(input, axis) ? excess : ordinary, axis, comparison(input.axis[axis]));
  }
  if (!excess.empty()) {
    diagnosis.verdict = Verdict::unexplained;
    diagnosis.reason = excess;
  } else if (!obstacles.empty()) {
    diagnosis.verdict = Verdict::undetermined;
    diagnosis.reason = obstacles;
  } else {
    diagnosis.verdict = Verdict::clean;
    diagnosis.reason = "the residual is what the identified noise leaves: " + ordinary;
  }
}

std::string reason_of_findings(const PerAxis<std::optional<AxisVerdictInput>>& residual,
                               const std::string& findings, const PerAxis<double>& after_mps2) {
  std::string before, after;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    if (!residual[axis]) continue;
    append(before, axis, comparison(*residual[axis]));
    char text[40];
    std::snprintf(text, sizeof text, "%s%s axis %.3g m/s²", after.empty() ? "" : ", ",
                  kAxisName[axis], after_mps2[axis]);
    after += text;
  }
  return before + "; explained by " + findings + "; after: " + after;
}

}  // namespace plumbline
