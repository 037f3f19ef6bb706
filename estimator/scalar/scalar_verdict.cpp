#include "estimator/scalar/scalar_verdict.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "estimator/effects/smooth_term.h"
#include "estimator/noise/chi_squared.h"

namespace plumbline {
namespace {

constexpr double kTooLarge = 0.01;
/// 2·ln likelihood, for a variance at its boundary at 1 %.
constexpr double kScatterGain = 5.4;
constexpr std::size_t kFewestRestsToDecide = 20;

std::string format(const char* pattern, double a, double b, double c) {
  char text[240];
  std::snprintf(text, sizeof text, pattern, a, b, c);
  return text;
}

std::vector<EffectParameter> reported(const ScalarFit& fit, std::size_t effect) {
  Eigen::Index row = kScalarCount;
  for (std::size_t e = 0; e < effect; ++e) {
    const auto& free = fit.parameters.effects[e].free;
    row += std::count(free.begin(), free.end(), true);
  }
  const ActiveEffect& active = fit.parameters.effects[effect];
  const auto infos = active.effect->parameters();
  std::vector<EffectParameter> parameters;
  for (std::size_t k = 0; k < infos.size(); ++k) {
    if (infos[k].role == ParameterRole::amplitude && !active.free[k]) continue;
    const double u = active.free[k] ? std::sqrt(fit.covariance(row, row)) : 0;
    if (active.free[k]) ++row;
    parameters.push_back({infos[k].name, active.axis, active.p[k], u, infos[k].unit});
  }
  return parameters;
}

std::string words_of(const std::string& id, std::size_t axis,
                     const std::vector<EffectParameter>& parameters) {
  std::string text = id + " (" + kAxisName[axis] + ")";
  for (const EffectParameter& p : parameters) {
    if (p.u <= 0) continue;
    char value[96];
    std::snprintf(value, sizeof value, " %s = %.3g ± %.1g %s", p.name.c_str(), p.value, p.u,
                  p.unit.c_str());
    text += value;
    break;
  }
  return text;
}

void add_finding(const ScalarSearchResult& search, std::size_t index, Diagnosis& diagnosis,
                 std::string& words) {
  const ScalarFinding& finding = search.findings[index];
  const ActiveEffect& active = search.fit.parameters.effects[index];
  const std::vector<EffectParameter> parameters = reported(search.fit, index);
  words += (words.empty() ? "" : "; ");
  if (const auto* smooth = dynamic_cast<const SmoothTerm*>(active.effect)) {
    diagnosis.unlisted.push_back({{},
                                  smooth->driver(),
                                  to_string(smooth->form()),
                                  {active.axis},
                                  smooth->shape(),
                                  parameters,
                                  finding.p_value,
                                  finding.heldout_gain,
                                  finding.sigmas});
    words +=
        "unlisted structure driven by " + smooth->driver() + " (" + kAxisName[active.axis] + ")";
    return;
  }
  words += words_of(active.effect->id(), active.axis, parameters);
  FoundEffect found{{finding.alternatives, {}, {}},
                    active.effect->id(),
                    {active.axis},
                    parameters,
                    finding.p_value,
                    finding.heldout_gain,
                    {},
                    finding.sigmas};
  if (!found.alternatives.empty()) {
    found.separate_by =
        "readings at known angles (calibrate with the dividing head): without angles only the sum "
        "of the three axes' terms along gravity is seen";
  }
  // The same weakness of several axes is one effect with several axes.
  for (FoundEffect& other : diagnosis.effects) {
    if (other.id != found.id) continue;
    if (other.axes.front() != active.axis) other.axes.push_back(active.axis);
    std::sort(other.axes.begin(), other.axes.end());
    other.parameters.insert(other.parameters.end(), parameters.begin(), parameters.end());
    other.p_value = std::max(other.p_value, found.p_value);
    other.heldout_gain += found.heldout_gain;
    for (const std::string& name : found.alternatives) {
      if (std::find(other.alternatives.begin(), other.alternatives.end(), name) ==
          other.alternatives.end()) {
        other.alternatives.push_back(name);
      }
    }
    if (other.separate_by.empty()) other.separate_by = found.separate_by;
    return;
  }
  diagnosis.effects.push_back(std::move(found));
}

}  // namespace

void decide_scalar_verdict(const ScalarVerdictInput& input, ScalarCalibration& result) {
  const ScalarSearchResult& search = input.search;
  Diagnosis& diagnosis = result.diagnosis;
  const auto n = static_cast<double>(result.intervals);
  const double dof = n - static_cast<double>(kScalarCount);
  const double known_dof = input.inner.blocks_dof > 0 ? input.inner.blocks_dof : 1e6;

  const auto excess_p = [&](double rms_mps2, double free) {
    const double ratio = rms_mps2 / result.expected_rms_blocks_mps2;
    return free > 0 ? f_tail(ratio * ratio, free, known_dof) : 1.0;
  };
  diagnosis.p_value = excess_p(result.residual_rms_mps2, dof);
  std::string size = format(
      "residual |a| − g %.3g mm/s² where %.3g is expected from the noise "
      "inside the rests",
      1e3 * result.residual_rms_mps2, 1e3 * result.expected_rms_mps2, 0);
  if (input.inner.excess > 1.2) {
    size += format(" (%.3g when its correlation is counted)", 1e3 * result.expected_rms_blocks_mps2,
                   0, 0);
  }
  const bool too_large = diagnosis.p_value < kTooLarge;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    diagnosis.axis_test[i] = {
        dof > 0 ? std::pow(result.residual_rms_mps2 / result.expected_rms_blocks_mps2, 2) * dof : 0,
        std::max(dof, 0.0), diagnosis.p_value};
  }
  if (!search.findings.empty()) {
    std::string words;
    for (std::size_t k = 0; k < search.findings.size(); ++k) {
      add_finding(search, k, diagnosis, words);
    }
    const double left = dof - static_cast<double>(search.fit.parameters.free_count()) +
                        static_cast<double>(kScalarCount);
    // What is left counts as noise when it is the noise's size or slow.
    const bool remains = excess_p(result.final_residual_rms_mps2, left) < kTooLarge &&
                         search.noise.scatter_gain > kScatterGain;
    diagnosis.verdict = remains ? Verdict::partly_explained : Verdict::explained;
    diagnosis.reason = size + (too_large ? ": too much; " : "; ") +
                       (remains ? "in part explained by " : "explained by ") + words +
                       format("; %.3g mm/s² after", 1e3 * result.final_residual_rms_mps2, 0, 0);
    if (remains) {
      diagnosis.reason += ", still more than the noise; among " + std::to_string(search.tried) +
                          " further hypotheses (temperature and columns where recorded, time, "
                          "order, polynomials of the attitude) none explains the rest";
    }
    return;
  }
  if (result.intervals < kFewestRestsToDecide) {
    diagnosis.verdict = Verdict::undetermined;
    diagnosis.reason = std::to_string(result.intervals) +
                       " rests are too few to tell an effect from noise; at least " +
                       std::to_string(kFewestRestsToDecide) + " are needed; " + size;
    return;
  }
  if (too_large && input.scatter_gain > kScatterGain) {
    diagnosis.verdict = Verdict::unexplained;
    diagnosis.reason =
        size + ": too much; tried and excluded: " + std::to_string(search.tried) +
        " hypotheses (nonlinearity, hysteresis, settling, drift and steps in time, temperature and "
        "other columns where recorded); the best of them, " +
        search.best_rest + format(", has p = %.2g", search.p_best_rest, 0, 0);
    return;
  }
  diagnosis.verdict = Verdict::clean;
  diagnosis.reason = size + (too_large ? "; the difference is slow noise of the biases" : "");
}

}  // namespace plumbline
