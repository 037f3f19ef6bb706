// The calibrated parameters: sensitivity matrix, the terms of IEEE 1293, agreement, budget.
#include <fmt/format.h>

#include <cmath>

#include "app/certificate/budget.h"
#include "app/certificate/content.h"
#include "app/certificate/figures.h"
#include "app/certificate/rounding.h"
#include "app/certificate/sensor_terms.h"
#include "estimator/parameter_name.h"

namespace plumbline::app::content {
namespace {

void add_matrix(const Composer& c) {
  Table table;
  table.caption = c.tr("Calibrated parameters (weighted least squares)");
  table.header = {c.tr("axis i"), "K_ix, mV/g", "U",        "K_iy, mV/g", "U",
                  "K_iz, mV/g",   "U",          "U_i0, mV", "U"};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    std::vector<std::string> row = {kAxisName[i]};
    const AxisEstimate& estimate = c.input.calibration.final.batch_ls[i];
    for (Eigen::Index j = 0; j < 4; ++j) {
      const RoundedResult rounded = round_result(
          1e3 * estimate.value(j), 1e3 * kCoverageFactor * std::sqrt(estimate.covariance(j, j)));
      row.push_back(rounded.value);
      row.push_back(rounded.uncertainty);
    }
    table.rows.push_back(std::move(row));
  }
  c.add(std::move(table));
}

std::string with_uncertainty(const Quantity& quantity, double factor) {
  const RoundedResult r =
      round_result(factor * quantity.value, factor * kCoverageFactor * quantity.u);
  return r.value + " ± " + r.uncertainty;
}

void add_ieee_terms(const Composer& c) {
  const SensorTerms terms = sensor_terms(c.input.calibration.final.batch_ls);
  Table table;
  table.caption = c.tr("The same in the terms of IEEE Std 1293, U with k = 2");
  table.header = {c.tr("axis"), c.tr("scale factor K1, mV/g"), c.tr("bias K0, mg"),
                  c.tr("misalignment of the input axis, mrad"),
                  c.tr("angle between input axes − 90°, mrad")};
  table.word_columns = {3, 4};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const AxisTerms& axis = terms.axis[i];
    std::string tilt;
    for (std::size_t j = 0; j < kAxisCount; ++j) {
      if (j == i) continue;
      tilt += fmt::format("{}{}: {}", tilt.empty() ? "" : "; ", kAxisName[j],
                          with_uncertainty(axis.misalignment[j], 1e3));
    }
    const std::size_t a = (i + 1) % kAxisCount, b = (i + 2) % kAxisCount;
    table.rows.push_back({kAxisName[i], with_uncertainty(axis.scale_V_per_g, 1e3),
                          with_uncertainty(axis.bias_g, 1e3), tilt,
                          fmt::format("{}–{}: {}", kAxisName[a], kAxisName[b],
                                      with_uncertainty(terms.nonorthogonality_rad[i], 1e3))});
  }
  c.add(std::move(table));
  c.add(Paragraph{
      c.tr("Mounting convention: the rows of K stand in the frame of the unit as it was mounted on "
           "the head: z along the spindle, x up at δ = h = 0, y completing a right-handed frame. A "
           "rotation of the mounting changes the entries of K and the misalignments, but neither "
           "K1 and K0 nor the angles between the input axes."),
      Tone::note});
}

/// Where the converter was coarse, that the codes were used, not their means.
void add_quantization(const Composer& c) {
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto& use = c.input.calibration.quantization[i];
    if (!use) continue;
    c.add(Paragraph{
        c.tr("Output {}: the noise of a reading is {} of a step of the converter, too little to "
             "smooth the steps. The parameters are estimated from the likelihood of the intervals "
             "between the code boundaries, not from mean voltages.",
             kAxisName[i], significant(use->sigma_V / use->step_V, 2))});
  }
}

std::string word(const Composer& c, bool yes) { return yes ? c.tr("yes") : c.tr("no"); }

/// Both intervals of every parameter and whether they agree (JCGM 101, clause 8).
void add_monte_carlo(const Composer& c) {
  const auto& report = c.input.calibration.uncertainty;
  if (!report) return;
  Table table;
  table.caption = c.tr(
      "Twelve parameters: 95 % intervals by the law of propagation (GUM) and by Monte Carlo "
      "(JCGM 101), mV/g and mV");
  table.header = {
      c.tr("parameter"), "GUM",        c.tr("Monte Carlo"), c.tr("u, GUM"), c.tr("u, Monte Carlo"),
      c.tr("tolerance"), c.tr("agree")};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    for (std::size_t j = 0; j < 4; ++j) {
      const ParameterUncertainty& p = report->parameter[i][j];
      const double expanded = 1e3 * kCoverageFactor * p.budget.combined;
      const auto interval = [&](double low, double high) {
        return round_result(1e3 * low, expanded).value + " … " +
               round_result(1e3 * high, expanded).value;
      };
      table.rows.push_back({parameter_name(i, static_cast<Eigen::Index>(j)),
                            interval(p.gum_low, p.gum_high), interval(p.mc_low, p.mc_high),
                            significant(1e3 * p.budget.combined, 2), significant(1e3 * p.mc_u, 2),
                            significant(1e3 * p.tolerance, 1), word(c, p.validated)});
    }
  }
  c.add(std::move(table));
  c.add(Paragraph{
      report->validated
          ? c.tr("{} trials. The ends of all intervals agree within the tolerance of JCGM 101, "
                 "clause 8: the law of propagation is validated.",
                 report->trials)
          : c.tr("{} trials. Not all intervals agree within the tolerance of JCGM 101, clause 8: "
                 "where they do not, the Monte Carlo interval holds.",
                 report->trials)});
}

void add_agreement(const Composer& c) {
  const Calibration& calibration = c.input.calibration;
  Table table;
  table.caption = c.tr("Twelve parameters alone, three ways of estimating");
  table.header = {c.tr("parameter"), c.tr("least squares, mV/g (mV)"), c.tr("recursive − batch"),
                  c.tr("filter − batch"), c.tr("U of batch")};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    for (Eigen::Index j = 0; j < 4; ++j) {
      const AxisEstimate& batch = calibration.estimates.batch_ls[i];
      const double expanded = 1e3 * kCoverageFactor * std::sqrt(batch.covariance(j, j));
      const RoundedResult rounded = round_result(1e3 * batch.value(j), expanded);
      const auto difference = [&](const AxisEstimate& other) {
        return difference_beside(1e3 * (other.value(j) - batch.value(j)), expanded);
      };
      table.rows.push_back(
          {parameter_name(i, j), rounded.value,
           calibration.estimates.rls ? difference((*calibration.estimates.rls)[i]) : "–",
           difference(calibration.estimates.ekf[i]), rounded.uncertainty});
    }
  }
  c.add(std::move(table));
  const auto& en = calibration.estimates.agreement_en;
  c.add(Paragraph{c.tr(
      "Largest E_n number between filter and least squares: x {}, y {}, z {} (agreement up to 1).",
      significant(en[0], 2), significant(en[1], 2), significant(en[2], 2))});
}

std::string source_name(const Composer& c, BudgetSource source) {
  switch (source) {
    case BudgetSource::readings:
      return c.tr("scatter of the readings");
    case BudgetSource::delta:
      return c.tr("positioning in δ, each pose");
    case BudgetSource::h:
      return c.tr("positioning in h, each pose");
    case BudgetSource::alternatives:
      return c.tr("alternatives of the findings");
    case BudgetSource::gravity:
      break;
  }
  return c.tr("local gravity");
}

std::string degrees_of_freedom(double dof) {
  return std::isfinite(dof) && dof < 1e5 ? fmt::format("{:.0f}", std::floor(dof)) : "∞";
}

void add_budget_rows(const Composer& c, const Budget& budget, Table& table) {
  const std::string name = parameter_name(budget.axis, budget.column);
  const bool offset = budget.column == 3;
  const std::string unit = offset ? "mV" : "mV/g";
  bool first = true;
  for (const BudgetLine& line : budget.lines) {
    // What cannot matter is left out: gravity acts on no offset.
    if (offset && line.source == BudgetSource::gravity) continue;
    const bool gravity = line.source == BudgetSource::gravity;
    const bool own_unit = line.source == BudgetSource::readings ||
                          line.source == BudgetSource::alternatives;  // that of the parameter
    const std::string input_unit = own_unit ? unit : gravity ? "m/s²" : "″";
    const double scale = own_unit ? 1e3 : 1;
    table.rows.push_back(
        {first ? name : "", source_name(c, line.source),
         own_unit  ? significant(scale * line.estimate, 6) + " " + unit
         : gravity ? significant(line.estimate, 7) + " m/s²"
                   : "0″",
         c.tr("normal"),
         significant(scale * line.u, 2) + (input_unit == "″" ? "" : " ") + input_unit,
         degrees_of_freedom(line.dof), own_unit ? "1" : significant(1e3 * line.sensitivity, 2),
         significant(1e3 * line.contribution, 2), fmt::format("{:.1f} %", 100 * line.share)});
    first = false;
  }
  table.rows.push_back({"", c.tr("combined"), significant(1e3 * budget.value, 6) + " " + unit,
                        c.tr("normal"),
                        fmt::format("U = {} {}", significant(2e3 * budget.u, 2), unit),
                        degrees_of_freedom(budget.dof_effective), "k = 2",
                        significant(1e3 * budget.u, 2), "100.0 %"});
}

}  // namespace

void add_parameters(const Composer& c) {
  c.add(Heading{c.tr("Results")});
  c.add(Paragraph{c.tr(
      "Output voltage of axis i:  U_i = K_ix·a_x + K_iy·a_y + K_iz·a_z + U_i0, with the specific "
      "force a in the frame of the triad in units of g_n = 9.80665 m/s². Expanded uncertainties "
      "U with coverage factor k = 2 (about 95 %).")});
  add_matrix(c);
  add_quantization(c);
  add_ieee_terms(c);
}

Table budget_table(const Composer& c, std::string caption, std::string contribution) {
  Table table;
  table.caption = std::move(caption);
  table.header = {c.tr("parameter"), c.tr("quantity"), c.tr("estimate"), c.tr("distribution"),
                  c.tr("u"),         c.tr("ν"),        c.tr("c"),        std::move(contribution),
                  c.tr("share")};
  table.word_columns = {1, 3};
  return table;
}

void add_budget(const Composer& c) {
  const Calibration& calibration = c.input.calibration;
  c.add(Heading{c.tr("Uncertainty budget")});
  Table table =
      budget_table(c, c.tr("Scale factors and offsets (GUM, JCGM 100:2008), U with k = 2"),
                   c.tr("c·u, mV/g (mV)"));
  bool alternatives = false;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    for (const Eigen::Index column : {static_cast<Eigen::Index>(i), Eigen::Index{3}}) {
      const Budget budget = budget_of(calibration, c.input.description, i, column);
      alternatives |= budget.lines.back().source == BudgetSource::alternatives;
      add_budget_rows(c, budget, table);
    }
  }
  c.add(std::move(table));
  c.add(Paragraph{
      c.tr("The scatter of the readings contains the identified noise, the rounding by the "
           "converter, the repeatability of the unit within the run, and what estimating the "
           "added effects together with the parameters costs."),
      Tone::note});
  if (alternatives)
    c.add(Paragraph{c.tr("What was found could be something else on these data, with other "
                         "parameters: the alternatives stand with the findings, and each counts "
                         "by its odds."),
                    Tone::note});
  c.add(budget_figure({c.calibration, c.tr}, c.input.description));
  add_monte_carlo(c);
}

void add_estimators(const Composer& c) {
  c.add(Heading{c.tr("Agreement of the estimators")});
  add_agreement(c);
  c.add(convergence_figure({c.calibration, c.tr}));
}

}  // namespace plumbline::app::content
