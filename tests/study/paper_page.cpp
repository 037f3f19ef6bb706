// The page that scripts/reproduce-paper writes.
#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>

#include "app/figure/plot.h"
#include "app/figure/svg_canvas.h"
#include "tests/study/paper_study.h"

namespace plumbline::study {
namespace {

using app::LegendEntry;
using app::Plot;
using app::PlotAxis;
using app::Stroke;
using app::SvgCanvas;

struct Curve {
  std::string name;
  std::string color;
  const std::vector<double>* y;
};

std::string figure(const char* id, const std::string& what, const PlotAxis& y,
                   const std::vector<Curve>& curves) {
  SvgCanvas canvas(760, 300);
  std::vector<double> n;
  for (std::size_t k = 0; k < curves.front().y->size(); ++k)
    n.push_back(static_cast<double>(k + 1));
  Plot plot(canvas, {80, 40}, 660, 210, {"number of positions", 0, n.back(), {}, true, 8}, y);
  plot.draw_frame();
  std::vector<LegendEntry> legend;
  for (const Curve& curve : curves) {
    plot.line(n, *curve.y, Stroke{curve.color, 1.4, {}});
    legend.push_back({curve.name, Stroke{curve.color, 2, {}}, {}});
  }
  app::draw_legend(canvas, {85, 20}, legend);
  return fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n", canvas.svg(id, what),
                     what);
}

std::string name_of(std::size_t axis, std::size_t column) {
  return column == 3 ? fmt::format("U_{}0, V", kAxisName[axis])
                     : fmt::format("K_{}{}, V/g", kAxisName[axis], kAxisName[column]);
}

std::string cell(const Spread& s) { return fmt::format("<td>{:.6f} ± {:.6f}</td>", s.mean, s.sd); }

std::string coefficients(const PaperStudy& study) {
  std::string html =
      "<table><tr><th></th><th>paper = truth</th><th>least squares</th><th>eight-state "
      "filter</th><th>interval likelihood</th><th>least squares, 100 readings</th><th>interval "
      "likelihood, 100 readings</th></tr>\n";
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    for (std::size_t j = 0; j < 4; ++j) {
      html += fmt::format("<tr><th>{}</th><td>{:.7g}</td>", name_of(i, j),
                          paper_coefficients()[i](static_cast<Eigen::Index>(j)));
      for (const CoefficientSpread* spread : {&study.least_squares, &study.filter, &study.intervals,
                                              &study.many_least_squares, &study.many_intervals})
        html += cell((*spread)[i][j]);
      html += "</tr>\n";
    }
  }
  html += "<tr><th>RMS error over the sphere that the parameters make, mm/s²</th><td></td>";
  for (const double e : study.parameter_error_mps2) html += fmt::format("<td>{:.2f}</td>", 1e3 * e);
  return html + "</tr></table>\n";
}

std::string settling(const PaperStudy& study) {
  std::string html =
      "<table><tr><th>noise</th><th>recursive least squares starts with</th><th>filter starts "
      "with</th><th>settled after, RLS</th><th>filter</th><th>ratio</th></tr>\n";
  for (const SettlingRow& row : study.settling)
    html += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.0f}</td><td>{:.0f}</td><td>{:.1f}</td></tr>\n",
        row.noise, row.recursive, row.filter, row.recursive_positions, row.filter_positions,
        row.ratio());
  return html + "</table>\n";
}

std::string comparison(const PaperStudy& study) {
  const SettlingRow& equal = study.settling.front();
  const auto nearest = std::min_element(study.settling.begin(), study.settling.end(),
                                        [](const SettlingRow& a, const SettlingRow& b) {
                                          return std::abs(a.ratio() - 4) < std::abs(b.ratio() - 4);
                                        });
  std::string html = "<table><tr><th></th><th>paper</th><th>here</th></tr>\n";
  const auto row = [&](const char* what, const std::string& paper, const std::string& ours) {
    html += fmt::format("<tr><th>{}</th><td>{}</td><td>{}</td></tr>\n", what, paper, ours);
  };
  row("filter against least squares at the end", "equal accuracy",
      fmt::format("{:.2f} and {:.2f} mm/s²", 1e3 * study.parameter_error_mps2[1],
                  1e3 * study.parameter_error_mps2[0]));
  row("filter settles sooner than recursive least squares", "4 times",
      fmt::format("{:.1f} times from equal priors and weights; {:.1f} times when recursive least "
                  "squares starts with {}",
                  equal.ratio(), nearest->ratio(), nearest->recursive));
  row("absolute error of the measured acceleration", "about 0.2 m/s²",
      fmt::format("one reading and least squares: {:.3f} m/s² RMS, {:.3f} for 95 % of the "
                  "readings, {:.3f} at most",
                  study.one_reading.rms, study.one_reading.p95, study.one_reading.largest));
  row("noise of the converter", "0.11 m/s²", "step/√12 = 0.108 m/s² at 0.032 V/g");
  row("the same with 100 readings and interval likelihood", "–",
      fmt::format("{:.3f} m/s² RMS, {:.3f} for 95 %", study.many_readings.rms,
                  study.many_readings.p95));
  return html + "</table>\n";
}

}  // namespace

std::string paper_page(const PaperStudy& study) {
  const auto course = [](double from, double to) {
    return PlotAxis{"K_xx, V/g", from, to, {}, true, 5};
  };
  std::string html =
      "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>The paper "
      "reproduced</title>\n<style>body{font:15px sans-serif;max-width:1100px;margin:2em auto;"
      "padding:0 1em}table{border-collapse:collapse;margin:1em 0}td,th{border:1px solid "
      "#ccc;padding:.25em .6em;text-align:left;font-weight:normal}tr:first-child th{font-weight:"
      "bold}figure{margin:1.5em 0}figcaption{color:#555}</style>\n<h1>The paper reproduced</h1>\n";
  html += fmt::format(
      "<p>Kostyuk &amp; Lakoza, “Application of the extended Kalman filter to the calibration of "
      "inertial sensors” (2012), on {} simulated units: 36 × 9 positions ring by ring, 12 bits "
      "over "
      "5 V (a step of 1.22 mV, 0.374 m/s²), the paper's coefficients as truth, white noise of {} "
      "steps before rounding, offsets that differ by up to half a step. Values are means and "
      "standard deviations over the units; one reading a position unless said.</p>\n",
      study.units, study.sigma_steps);
  html += "<h2>The paper's figures beside ours</h2>\n" + comparison(study);
  html +=
      "<h2>How soon do the estimates settle?</h2>\n<p>Settled: the first number of positions from "
      "which on the estimate of K_xx stays within 1 % of the truth; median over the units.</p>\n" +
      settling(study);
  const SettlingRow& equal = study.settling.front();
  html += fmt::format(
      "<p>From equal priors and equal weights both are the same estimator and settle together "
      "(ratio {:.1f}): the factor 4 does not hold there. It appears when recursive least squares "
      "starts in the textbook's way, at zero with a covariance P₀ of some tens and readings "
      "of weight one: the start then counts as much as many readings, and it takes positions to "
      "outweigh it. A filter that knows how small the noise of a reading is forgets its start at "
      "once.</p>\n",
      equal.ratio());
  html += figure("f2",
                 "Figure 2. Recursive least squares: estimate of K_xx against the number of "
                 "positions, first unit",
                 course(0.02, 0.036),
                 {{"P₀ = 15·I, weight 1", app::palette::kOrange, &study.recursive_course},
                  {"nothing known", app::palette::kBlue, &study.diffuse_course}});
  html += figure("f3",
                 "Figure 3. Eight-state filter: the same; as printed, with unit noise on the "
                 "parameters, it never settles",
                 course(0.02, 0.036),
                 {{"as printed (eq. 13–15)", app::palette::kLightGrey, &study.printed_course},
                  {"corrected", app::palette::kBlue, &study.filter_course}});
  html += figure("f4", "Figure 4. Absolute error of the measured a_x at each position, first unit",
                 {"error, m/s²", 0, 0.3, {}, true, 5},
                 {{"one reading, least squares", app::palette::kOrange, &study.error_one},
                  {"100 readings, interval likelihood", app::palette::kBlue, &study.error_many}});
  html += "<h2>Coefficients</h2>\n" + coefficients(study);
  return html + "</html>\n";
}

}  // namespace plumbline::study
