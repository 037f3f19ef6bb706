// A calibration without angles: what differs from one on the head. The other chapters are shared.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/certificate/content.h"
#include "app/certificate/rounding.h"
#include "app/certificate/scalar_results.h"
#include "app/figure/plot.h"

namespace plumbline::app {

Calibration shared_chapters(const ScalarCalibration& scalar) {
  Calibration calibration;
  calibration.poses = scalar.intervals;
  calibration.samples = scalar.samples;
  calibration.skipped_rows = scalar.skipped_rows;
  calibration.diagnosis = scalar.diagnosis;
  calibration.decision = scalar.decision;
  calibration.before = scalar.before;
  calibration.after = scalar.after;
  calibration.floor_pose_rms_mps2 = scalar.floor_pose_rms_mps2;
  calibration.u_floor_pose_rms_mps2 = scalar.u_floor_pose_rms_mps2;
  calibration.noise = scalar.noise;
  // What refers an output to its input.
  for (Eigen::Index i = 0; i < 3; ++i) {
    calibration.final.batch_ls[static_cast<std::size_t>(i)].value(i) =
        kStandardGravity_mps2 / scalar.final.value(3 + i);
  }
  return calibration;
}

namespace content {
namespace {

constexpr double kMilli = 1e3;

void add_nine(const Composer& c, const ScalarEstimate& estimate, const std::string& caption) {
  const std::string& unit = c.input.scalar->source.reading_unit;
  Table table;
  table.caption = caption;
  table.header = {c.tr("axis"), c.tr("bias, {}", unit), "U", c.tr("scale, m/s² per {}", unit), "U"};
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    const RoundedResult bias = round_result(estimate.value(i), kCoverageFactor * estimate.u(i));
    const RoundedResult scale =
        round_result(estimate.value(3 + i), kCoverageFactor * estimate.u(3 + i));
    table.rows.push_back(
        {kAxisName[axis], bias.value, bias.uncertainty, scale.value, scale.uncertainty});
  }
  c.add(std::move(table));
  Table angles;
  angles.caption = c.tr("Non-orthogonality");
  angles.header = {c.tr("angle"), "mrad", "U"};
  constexpr const char* kAngle[] = {"yz", "zy", "zx"};
  for (Eigen::Index i = 0; i < 3; ++i) {
    const RoundedResult angle =
        round_result(kMilli * estimate.value(6 + i), kMilli * kCoverageFactor * estimate.u(6 + i));
    angles.rows.push_back({kAngle[i], angle.value, angle.uncertainty});
  }
  c.add(std::move(angles));
}

Figure residual_figure(const Composer& c) {
  Figure figure;
  figure.caption = c.tr(
      "Residual |a| − g of every rest over time: nine parameters (grey circles), certified model "
      "(blue dots).");
  figure.description = c.tr("Scatter plot of the residual of every rest against time");
  const ScalarCalibration& calibration = c.input.scalar->calibration;
  std::vector<double> t, before, after;
  double largest = 1e-9;
  for (const RestResult& rest : calibration.rests) {
    t.push_back(rest.t_mean_s);
    before.push_back(kMilli * rest.residual_before_mps2);
    after.push_back(kMilli * rest.residual_after_mps2);
    largest = std::max({largest, std::abs(before.back()), std::abs(after.back())});
  }
  figure.draw = [=, tr = c.tr, width = figure.width, height = figure.height](Canvas& canvas) {
    if (t.empty()) return;
    const auto [first, last] = std::minmax_element(t.begin(), t.end());
    const double margin = std::max(0.02 * (*last - *first), 0.5);
    Plot plot(canvas, {70, 20}, width - 90, height - 70,
              {.label = tr("time, s"), .min = *first - margin, .max = *last + margin},
              {.label = "|a| − g, mm/s²", .min = -1.1 * largest, .max = 1.1 * largest});
    plot.draw_frame();
    plot.points(t, before, 3.6, palette::kGrey);
    plot.points(t, after, 2, palette::kBlue);
  };
  return figure;
}

/// One parameter: what the rests leave, and what local gravity adds to a scale.
void add_budget_of(const Composer& c, Eigen::Index index, Table& table) {
  const ScalarCalibration& calibration = c.input.scalar->calibration;
  const Gravity& gravity = c.input.description.gravity;
  const std::string& unit = c.input.scalar->source.reading_unit;
  const bool scale = index >= 3;
  const double value = calibration.final.value(index), u = calibration.final.u(index);
  const double by_gravity = scale ? value / gravity.local_mps2 * gravity.u_mps2 : 0;
  const double by_rests = std::sqrt(std::max(0.0, u * u - by_gravity * by_gravity));
  const double dof = static_cast<double>(calibration.intervals) - 9;
  const double share = u > 0 ? by_rests * by_rests / (u * u) : 0;
  const auto row = [&](const std::string& name, const std::string& what, double estimate,
                       const std::string& own, const std::string& nu,
                       const std::string& sensitivity, double part, double of_variance) {
    table.rows.push_back({name, what, significant(estimate, 6), c.tr("normal"), own, nu,
                          sensitivity, significant(part, 2),
                          fmt::format("{:.1f} %", 100 * of_variance)});
  };
  const char* axis = kAxisName[static_cast<std::size_t>(index % 3)];
  const std::string rests_dof = dof > 0 ? fmt::format("{:.0f}", dof) : "–";
  row(scale ? c.tr("scale {}, m/s² per {}", axis, unit) : c.tr("bias {}, {}", axis, unit),
      c.tr("scatter of the rests"), value, significant(by_rests, 2), rests_dof, "1", by_rests,
      share);
  if (scale) {
    row("", c.tr("local gravity"), gravity.local_mps2, significant(gravity.u_mps2, 2), "∞",
        significant(value / gravity.local_mps2, 2), by_gravity, 1 - share);
  }
  const double effective = share > 0 && dof > 0 ? dof / (share * share) : INFINITY;
  row("", c.tr("combined"), value, "U = " + significant(2 * u, 2),
      effective < 1e5 ? fmt::format("{:.0f}", std::floor(effective)) : "∞", "k = 2", u, 1);
}

}  // namespace

void add_scalar_budget(const Composer& c) {
  c.add(Heading{c.tr("Uncertainty budget")});
  Table table =
      budget_table(c, c.tr("Bias and scale (GUM, JCGM 100:2008), U with k = 2"), c.tr("c·u"));
  for (Eigen::Index index = 0; index < 6; ++index) add_budget_of(c, index, table);
  c.add(std::move(table));
  c.add(
      Paragraph{c.tr("The scatter of the rests contains the noise of the readings, their rounding, "
                     "and what the unit does not repeat from rest to rest. It is measured; no "
                     "Monte Carlo comparison is made for a calibration without angles."),
                Tone::note});
}

std::string scalar_error_sentence(const Composer& c) {
  const ScalarCalibration& calibration = c.input.scalar->calibration;
  const auto worst = [](const PerAxis<double>& v) { return *std::max_element(v.begin(), v.end()); };
  return c.tr(
      "Residual |a| − g of a rest that took no part in the fit, worst axis: {} mm/s² RMS; the "
      "noise inside the rests would leave {} mm/s².",
      milli_mps2(worst(calibration.after.heldout_pose_rms_mps2)),
      milli_mps2(worst(calibration.floor_pose_rms_mps2)));
}

std::string scalar_method(const Composer& c) {
  return c.tr(
      "scalar calibration: at rest the specific force has the magnitude of local gravity whatever "
      "the attitude; {} rests, {} readings, no angles used",
      c.input.calibration.poses, c.input.calibration.samples);
}

void add_scalar_results(const Composer& c) {
  const ScalarCalibration& calibration = c.input.scalar->calibration;
  c.add(Heading{c.tr("Results")});
  c.add(Paragraph{c.tr(
      "Specific force:  a = T·S·(m − b), with the reading m, the bias b, S = diag(scale) and T = "
      "[[1, −yz, zy], [0, 1, −zx], [0, 0, 1]]. The magnitude of a does not tell a rotation of the "
      "whole triad nor its sign: z is the sensitive axis z, x is perpendicular to the sensitive "
      "axes y and z, the scales are positive. Expanded uncertainties with coverage factor k = 2 "
      "(about 95 %).")});
  if (calibration.diagnosis.enlarges_model()) {
    add_nine(c, calibration.final, c.tr("Nine parameters, estimated together with the effects"));
    add_nine(c, calibration.estimate, c.tr("Nine parameters alone, for comparison"));
  } else {
    add_nine(c, calibration.final, c.tr("Nine parameters"));
  }
}

void add_scalar_errors(const Composer& c) {
  const ScalarCalibration& calibration = c.input.scalar->calibration;
  c.add(Heading{c.tr("Error of the calibrated model")});
  Table table;
  table.caption =
      c.tr("Residual |a| − g, mm/s²; per axis weighted with the axis's share of gravity squared");
  table.header = {c.tr("quantity"), "x", "y", "z"};
  const auto row = [&](const std::string& label, const PerAxis<double>& v) {
    table.rows.push_back({label, milli_mps2(v[0]), milli_mps2(v[1]), milli_mps2(v[2])});
  };
  row(c.tr("nine parameters, rests left out of the fit"), calibration.before.heldout_pose_rms_mps2);
  row(c.tr("certified model, rests left out of the fit"), calibration.after.heldout_pose_rms_mps2);
  row(c.tr("certified model, largest"), calibration.after.heldout_pose_max_abs_mps2);
  row(c.tr("what the noise inside the rests would leave"), calibration.floor_pose_rms_mps2);
  c.add(std::move(table));
  c.add(residual_figure(c));
  if (calibration.head) {
    c.add(Paragraph{c.tr("Cross-check of the head: {}.", c.tr.phrase(calibration.head->words))});
  }
}

}  // namespace content
}  // namespace plumbline::app
