// Errors before and after, what was found in the residual, noise, conformity.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/certificate/content.h"
#include "app/certificate/effect_words.h"
#include "app/certificate/figures.h"
#include "app/certificate/rounding.h"
#include "estimator/decision.h"
#include "estimator/noise/chi_squared.h"
#include "estimator/parameter_name.h"
#include "estimator/shifted_parameters.h"

namespace plumbline::app::content {
namespace {

double scale_mps2(const Calibration& calibration, std::size_t axis) {
  return kStandardGravity_mps2 /
         std::abs(calibration.final.batch_ls[axis].value(static_cast<Eigen::Index>(axis)));
}

/// A definition in a file has lines of its own.
std::string one_line(const std::string& text) {
  std::string line;
  for (const char ch : text) {
    const bool space = ch == '\n' || ch == '\t' || ch == ' ';
    if (!space) {
      line += ch;
    } else if (!line.empty() && line.back() != ' ') {
      line += ' ';
    }
  }
  while (line.ends_with(' ')) line.pop_back();
  return line;
}

/// "0.004" or "< 0.001": a p-value far below what it is compared with says no more.
std::string p_value_text(double p) { return p < 1e-6 ? "< 10⁻⁶" : significant(p, 2); }

void add_effect_table(const Composer& c) {
  const Diagnosis& diagnosis = c.input.calibration.diagnosis;
  Table table;
  table.caption = c.tr("Effects found in the residual and added to the model");
  table.header = {c.tr("effect"), c.tr("axes"), c.tr("parameters, U with k = 2"), c.tr("p-value"),
                  c.tr("held-out excess removed")};
  table.word_columns = {1, 2};
  const auto share = [](double gain) {
    return std::isfinite(gain) ? fmt::format("{:.0f} %", 100 * gain) : std::string("–");
  };
  const auto parameters_text = [](const std::vector<EffectParameter>& parameters) {
    std::string text;
    for (const EffectParameter& p : parameters)
      if (!p.unrecorded) text += (text.empty() ? "" : "; ") + parameter_text(p);
    return text;
  };
  for (const FoundEffect& effect : diagnosis.effects) {
    table.rows.push_back({fmt::format("{} ({})", effect_name(effect.id, c.tr), effect.id),
                          axes_text(effect.axes), parameters_text(effect.parameters),
                          p_value_text(effect.p_value), share(effect.heldout_gain)});
  }
  for (const UnlistedStructure& found : diagnosis.unlisted) {
    const std::string parameters = parameters_text(found.parameters);
    table.rows.push_back({unlisted_name(found, c.tr), axes_text(found.axes),
                          c.tr.phrase(found.shape) + (parameters.empty() ? "" : ": " + parameters),
                          p_value_text(found.p_value), share(found.heldout_gain)});
  }
  c.add(std::move(table));
}

/// What the parameters of the added effects stand for.
void add_terms(const Composer& c) {
  Facts facts;
  for (const FoundEffect& effect : c.input.calibration.diagnosis.effects) {
    const std::string term =
        effect.definition.empty() ? effect_term(effect.id, c.tr) : one_line(effect.definition);
    if (!term.empty()) facts.rows.emplace_back(effect_name(effect.id, c.tr), term);
  }
  for (const UnlistedStructure& found : c.input.calibration.diagnosis.unlisted) {
    const auto says_where = [](const EffectParameter& p) { return p.name == "ref"; };
    std::string text;
    if (std::any_of(found.parameters.begin(), found.parameters.end(), says_where))
      text = c.tr("zero where {} = ref: there the twelve parameters are stated", found.driver);
    if (found.driver == kTemperatureColumn)
      text += (text.empty() ? "" : "; ") +
              c.tr("temp_C is counted from the reference temperature: T − T₀");
    if (!text.empty()) facts.rows.emplace_back(unlisted_name(found, c.tr), text);
  }
  if (facts.rows.empty()) return;
  c.add(Paragraph{c.tr("The added terms; a in g, those of an output referred to its input:")});
  c.add(std::move(facts));
}

void add_alternatives(const Composer& c) {
  const Diagnosis& diagnosis = c.input.calibration.diagnosis;
  Facts facts;
  const auto add = [&](const std::string& name, const Ambiguity& ambiguity) {
    std::string others;
    for (const std::string& other : ambiguity.alternatives) {
      others += (others.empty() ? "" : "; ") + effect_name(other, c.tr) + " (" + other + ")";
    }
    std::string text = others.empty() ? c.tr("nothing else explains the data as well")
                                      : c.tr("these data do not tell it from: {}", others);
    if (!ambiguity.separate_by.empty()) {
      text += ". " + c.tr("To tell them apart: {}", c.tr.phrase(ambiguity.separate_by));
    }
    facts.rows.push_back({name, text});
  };
  for (const FoundEffect& effect : diagnosis.effects) add(effect_name(effect.id, c.tr), effect);
  for (const UnlistedStructure& found : diagnosis.unlisted)
    if (!found.alternatives.empty()) add(unlisted_name(found, c.tr), found);
  if (facts.rows.empty()) return;
  c.add(Paragraph{c.tr("What could not be told apart:")});
  c.add(std::move(facts));
}

/// What the twelve parameters were without the added effects, where that was something else.
void add_shifted(const Composer& c) {
  const std::vector<ShiftedParameter> shifted = shifted_parameters(c.input.calibration);
  if (c.input.scalar != nullptr || shifted.empty()) return;
  Table table;
  table.caption = c.tr(
      "Parameters that the added effects changed by more than the expanded uncertainty, mV/g (mV)");
  table.header = {c.tr("parameter"), c.tr("twelve parameters alone"),
                  c.tr("with the added effects"), c.tr("change in U")};
  for (const ShiftedParameter& p : shifted) {
    const double U = 1e3 * p.expanded_u();
    table.rows.push_back({parameter_name(p.axis, p.column), round_result(1e3 * p.before, U).value,
                          round_result(1e3 * p.after, U).value, significant(p.in_expanded_u(), 2)});
  }
  c.add(std::move(table));
}

/// An effect that was looked for and not found, and how large it would have had to be.
struct NotFound {
  std::string id;
  std::vector<std::size_t> axes;  ///< empty: the head's
  std::string parameter;
  double limit = 0;
  std::string unit;
  double worst = 0;  ///< of a bit: the highest that would show on all of the axes
};

/// Whether it may be there in the place of something that was found.
bool is_alternative(const std::string& id, const Diagnosis& diagnosis) {
  for (const auto& [name, ambiguity] : diagnosis.findings())
    for (const std::string& sum : ambiguity.alternatives) {
      const std::vector<std::string> members = members_of(sum);
      if (std::find(members.begin(), members.end(), id) != members.end()) return true;
    }
  return false;
}

/// One row for each parameter: the largest limit of the axes that show the effect at all.
std::vector<NotFound> not_found_rows(const Diagnosis& diagnosis) {
  std::vector<NotFound> rows;
  for (const DetectionLimit& limit : diagnosis.not_found) {
    if (!std::isfinite(limit.limit) || is_alternative(limit.id, diagnosis)) continue;
    auto row = std::find_if(rows.begin(), rows.end(), [&](const NotFound& r) {
      return r.id == limit.id && r.parameter == limit.parameter && r.unit == limit.unit;
    });
    if (row == rows.end())
      row = rows.insert(rows.end(), {limit.id, {}, limit.parameter, 0, limit.unit, limit.worst});
    if (limit.axis) row->axes.push_back(*limit.axis);
    row->limit = std::max(row->limit, limit.limit);
    row->worst = std::min(row->worst, limit.worst);
  }
  return rows;
}

void add_not_found(const Composer& c) {
  const std::vector<NotFound> rows = not_found_rows(c.input.calibration.diagnosis);
  if (rows.empty()) return;
  Table table;
  table.caption = c.tr(
      "Looked for and not found: the size that would stand out by five standard deviations (an "
      "effect of 1.6 times that size is found as a rule)");
  table.header = {c.tr("effect"), c.tr("axes"), c.tr("parameter"), c.tr("detection limit")};
  table.word_columns = {1, 2};
  for (const NotFound& item : rows) {
    const std::string unit = printed_unit(item.unit);
    table.rows.push_back(
        {effect_name(item.id, c.tr), item.axes.empty() ? "–" : axes_text(item.axes), item.parameter,
         item.id == "adc.stuck_bit" ? fmt::format("{:.0f} … {:.0f}", item.limit, item.worst)
                                    : significant(item.limit, 2) + before_unit(unit) + unit});
  }
  c.add(std::move(table));
}

/// Share of the poses that say something of the RMS which the others do not: residuals that follow
/// each other alike are fewer (Bartlett 1946; what noise alone makes of each term taken off).
double independent_share(const std::vector<PoseResult>& poses, std::size_t axis) {
  constexpr std::size_t kMostLags = 30;
  const auto residual = [&](std::size_t k) { return poses[k].residual_after_mps2[axis]; };
  const auto n = static_cast<double>(poses.size());
  double square = 0, inflation = 1;
  for (std::size_t k = 0; k < poses.size(); ++k) square += residual(k) * residual(k);
  for (std::size_t lag = 1; square > 0 && lag <= kMostLags && 4 * lag < poses.size(); ++lag) {
    double product = 0;
    for (std::size_t k = lag; k < poses.size(); ++k) product += residual(k) * residual(k - lag);
    inflation += 2 * std::max(0.0, product * product / (square * square) - 1 / n);
  }
  return 1 / inflation;
}

/// "17.0 … 20.1": 95 % limits of an RMS over so many poses, and of the largest of them where they
/// are normally distributed with that RMS.
std::string limits_text(double low_mps2, double high_mps2) {
  return milli_mps2(low_mps2) + " … " + milli_mps2(high_mps2);
}
std::string rms_limits(double rms_mps2, double dof) {
  const auto limit = [&](double p) {
    return rms_mps2 * std::sqrt(dof / chi_squared_quantile(p, dof));
  };
  return limits_text(limit(0.975), limit(0.025));
}
std::string largest_limits(double rms_mps2, double poses) {
  const auto limit = [&](double p) {
    return rms_mps2 * std::sqrt(chi_squared_quantile(std::pow(p, 1 / poses), 1));
  };
  return limits_text(limit(0.025), limit(0.975));
}

void add_limits(const Composer& c) {
  const Calibration& calibration = c.input.calibration;
  const bool both = calibration.diagnosis.enlarges_model();
  Table table;
  table.caption = c.tr("95 % confidence limits of these errors, mm/s²");
  table.header = {c.tr("quantity"), "x", "y", "z"};
  PerAxis<double> independent;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    independent[i] = independent_share(calibration.pose_results, i);
  const auto rows = [&](const std::string& label, const PerAxis<double>& rms, std::size_t poses) {
    std::vector<std::string> of_rms = {c.tr("RMS, {}", label)},
                             of_largest = {c.tr("largest at that RMS, {}", label)};
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const auto n = static_cast<double>(poses);
      of_rms.push_back(rms_limits(rms[i], std::max(1.0, n * independent[i])));
      of_largest.push_back(largest_limits(rms[i], n));
    }
    table.rows.push_back(std::move(of_rms));
    table.rows.push_back(std::move(of_largest));
  };
  const std::string before = c.tr(", before"), after = both ? c.tr(", after") : "";
  const std::string left_out = c.tr("poses left out of the fit");
  if (both) rows(left_out + before, calibration.before.heldout_pose_rms_mps2, calibration.poses);
  rows(left_out + after, calibration.after.heldout_pose_rms_mps2, calibration.poses);
  if (const Evaluation* v = c.input.verification; v != nullptr) {
    const std::string fresh = c.tr("fresh verification poses");
    if (both) rows(fresh + before, v->before.pose_rms_mps2, v->poses);
    rows(fresh + after, v->after.pose_rms_mps2, v->poses);
  }
  c.add(std::move(table));
  c.add(Paragraph{c.tr("Of an RMS: by the χ² distribution, with the poses counted that are "
                       "independent of those before them. Of the largest: where it lies if the "
                       "errors are normally distributed with that RMS; one far above it stands for "
                       "more than noise."),
                  Tone::note});
}

}  // namespace

void add_errors(const Composer& c) {
  const Calibration& calibration = c.input.calibration;
  const bool both = calibration.diagnosis.enlarges_model();
  c.add(Heading{both ? c.tr("Error before and after the added effects")
                     : c.tr("Error of the calibrated model")});
  Table table;
  table.caption = c.tr("Input-referred errors, mm/s²");
  table.header = {c.tr("quantity")};
  for (const char* axis : kAxisName) {
    if (both) {
      table.header.push_back(c.tr("{}, before", axis));
      table.header.push_back(c.tr("{}, after", axis));
    } else {
      table.header.push_back(axis);
    }
  }
  const auto row = [&](const std::string& label, const PerAxis<double>& before,
                       const PerAxis<double>& after) {
    std::vector<std::string> cells = {label};
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      if (both) cells.push_back(milli_mps2(before[i]));
      cells.push_back(milli_mps2(after[i]));
    }
    table.rows.push_back(std::move(cells));
  };
  const ErrorFigures& b = calibration.before;
  const ErrorFigures& a = calibration.after;
  row(c.tr("RMS of the pose means, fitted poses"), b.fit_pose_rms_mps2, a.fit_pose_rms_mps2);
  row(c.tr("RMS of the pose means, poses left out of the fit"), b.heldout_pose_rms_mps2,
      a.heldout_pose_rms_mps2);
  row(c.tr("largest pose mean, poses left out of the fit"), b.heldout_pose_max_abs_mps2,
      a.heldout_pose_max_abs_mps2);
  if (const Evaluation* v = c.input.verification; v != nullptr) {
    row(c.tr("RMS of the pose means, fresh verification poses"), v->before.pose_rms_mps2,
        v->after.pose_rms_mps2);
    row(c.tr("largest pose mean, fresh verification poses"), v->before.pose_max_abs_mps2,
        v->after.pose_max_abs_mps2);
  }
  row(c.tr("RMS of single readings"), b.sample_rms_mps2, a.sample_rms_mps2);
  row(c.tr("expected RMS of the pose means from the noise alone"), calibration.floor_pose_rms_mps2,
      calibration.floor_pose_rms_mps2);
  row(c.tr("standard uncertainty of the expected RMS"), calibration.u_floor_pose_rms_mps2,
      calibration.u_floor_pose_rms_mps2);
  c.add(std::move(table));
  if (calibration.poses > 0) add_limits(c);
  if (!both) return;
  c.add(Paragraph{c.tr("Before: with the twelve parameters alone. After: with the added effects as "
                       "well. The calibration adjusts nothing at the unit itself."),
                  Tone::note});
}

void add_findings(const Composer& c) {
  const Diagnosis& diagnosis = c.input.calibration.diagnosis;
  c.add(Heading{c.tr("What the residual shows")});
  std::string verdict = to_string(diagnosis.verdict);
  std::replace(verdict.begin(), verdict.end(), '_', ' ');
  // The effects follow as a table, with expanded uncertainties.
  const std::string reason = diagnosis.reason.substr(0, diagnosis.reason.find("; explained by "));
  const std::string p_value =
      (diagnosis.p_value < 1e-6 ? "" : "= ") + p_value_text(diagnosis.p_value);
  const std::string pattern =
      c.input.scalar == nullptr
          ? c.tr("Verdict: {}. {} p {} for noise alone.")
          : c.tr("Verdict: {}. {} p {} for the noise inside the rests alone.");
  std::string text =
      fmt::format(fmt::runtime(pattern), c.tr(verdict), sentence(c.tr.phrase(reason)), p_value);
  if (reason.find("±") != std::string::npos) {
    text += " " + c.tr("± gives standard uncertainties here.");
  }
  c.add(Paragraph{text, diagnosis.verdict == Verdict::unexplained ? Tone::warning : Tone::plain});
  if (!c.input.calibration.diagnosis.findings().empty()) {
    add_effect_table(c);
    add_terms(c);
    add_shifted(c);
    add_alternatives(c);
  }
  if (auto figure = evidence_figure({c.calibration, c.tr})) c.add(*std::move(figure));
  add_not_found(c);
}

void add_noise(const Composer& c) {
  const Calibration& calibration = c.input.calibration;
  c.add(Heading{c.tr("Noise")});
  Table table;
  table.caption = c.tr(
      "Identified noise, input-referred, with standard uncertainties; “<” gives the 95 % upper "
      "limit of a term that is not present");
  table.header = {c.tr("axis"), "Q, m/s",  "N, m/s/√s", "B, m/s²",
                  "K, m/s²/√s", "R, m/s³", c.tr("fit"), c.tr("source")};
  table.word_columns = {6, 7};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const NoiseModel& noise = calibration.noise[i];
    const auto terms = reported_terms(noise);
    const double scale = scale_mps2(calibration, i);
    const bool known = noise.source != "none";
    const auto term = [&](const NoiseTerm& t) {
      if (!known) return std::string("–");
      if (!t.present) {
        return t.upper_limit > 0 ? "< " + significant(t.upper_limit * scale, 2) : std::string("–");
      }
      const RoundedResult r = round_result(t.value * scale, t.u * scale);
      return r.value + " ± " + r.uncertainty;
    };
    table.rows.push_back({kAxisName[i], term(terms[kTermQ]), term(terms[kTermN]),
                          term(terms[kTermB]), term(terms[kTermK]), term(terms[kTermR]),
                          !known           ? "–"
                          : noise.adequate ? c.tr("adequate")
                                           : c.tr("not adequate"),
                          noise.source.empty() ? "–" : c.tr(noise.source)});
  }
  c.add(std::move(table));
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    if (calibration.noise[i].remark.empty()) continue;
    c.add(Paragraph{
        c.tr("Noise of the {} axis: {}.", kAxisName[i], c.tr.phrase(calibration.noise[i].remark)),
        Tone::note});
  }
  const bool recorded = std::any_of(calibration.noise.begin(), calibration.noise.end(),
                                    [](const auto& n) { return n.oadev.value.size() > 1; });
  // A calibration without angles has no static record of its own.
  if (recorded || c.input.scalar == nullptr) c.add(allan_figure({c.calibration, c.tr}));
}

void add_decision(const Composer& c) {
  const Decision decision = stated_decision(c.input.calibration.decision, c.input.events);
  const bool stated = decision.status != DecisionStatus::none;
  c.add(Heading{c.tr("Statement of conformity")});
  if (!stated && !(decision.limit_mps2 > 0)) {
    c.add(Paragraph{c.tr("No acceptance limit was given; no statement of conformity is made.")});
    return;
  }
  Facts facts;
  facts.rows = {{c.tr("Decision"), stated ? c.tr(to_words(decision.status))
                                          : c.tr("none: the run was not finished, and what it did "
                                                 "not reach may hold the largest error")},
                {c.tr("Limit"), c.tr("largest error {} mm/s²", milli_mps2(decision.limit_mps2))},
                {c.tr("Measured value"),
                 c.tr("largest error {} mm/s², standard uncertainty {} mm/s²",
                      milli_mps2(decision.max_abs_error_mps2), milli_mps2(decision.u_mps2))},
                {c.tr("Guard band"), fmt::format("{} mm/s²", milli_mps2(decision.guard_band_mps2))},
                {c.tr("Decision rule"), decision.rule.empty() ? "" : c.tr(decision.rule)}};
  c.add(std::move(facts));
}

}  // namespace plumbline::app::content
