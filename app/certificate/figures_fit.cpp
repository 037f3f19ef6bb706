// Pictures of the fit: noise, convergence, budget, evidence.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "app/certificate/budget.h"
#include "app/certificate/effect_words.h"
#include "app/certificate/figures.h"
#include "app/certificate/rounding.h"
#include "app/figure/allan_figure.h"
#include "app/figure/plot.h"
#include "estimator/parameter_name.h"

namespace plumbline::app {
namespace {

/// From dark to light, so that the parts of a bar stay apart without colour; what few have, last,
/// stands darker beside the lightest.
constexpr std::array kPartColors = {"#08519c", "#d55e00", "#e8b35a", "#d9d9d9", "#009e73"};

}  // namespace

Figure allan_figure(const FigureContext& context) {
  Figure figure;
  figure.caption = context.tr(
      "Overlapping Allan deviation of each output, input-referred (points, with 95 % limits), the "
      "identified terms one by one (broken lines with their names, M a Gauss-Markov process) and "
      "their sum (full line).");
  figure.description = context.tr("Allan deviation against averaging time for the axes x, y and z");
  figure.width = kFigureWidth;
  const PerAxis<NoiseModel>& noise = context.calibration->noise;
  const bool recorded = std::any_of(noise.begin(), noise.end(),
                                    [](const auto& n) { return n.oadev.value.size() > 1; });
  figure.height = recorded ? 270 : 40;
  figure.draw = [context](Canvas& canvas) {
    const Calibration& calibration = *context.calibration;
    PerAxis<NoiseModel> input_referred = calibration.noise;
    std::vector<AllanSeries> series;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const double scale =
          kStandardGravity_mps2 /
          std::abs(calibration.final.batch_ls[i].value(static_cast<Eigen::Index>(i)));
      NoiseModel& model = input_referred[i];
      DeviationCurve& curve = model.oadev;
      for (auto* values : {&curve.value, &curve.lower, &curve.upper, &model.fitted}) {
        for (double& value : *values) value *= scale;
      }
      for (NoiseTerm* term : {&model.Q, &model.N, &model.B, &model.K, &model.R}) {
        term->value *= scale;
      }
      for (NoiseTerm& term : model.record.term) term.value *= scale;
      for (MarkovTerm& markov : model.record.markov) markov.sigma *= scale;
      if (curve.value.size() > 1) {
        series.push_back({context.tr("{} axis", kAxisName[i]), &input_referred[i]});
      }
    }
    if (series.empty()) {
      canvas.text({kFigureWidth / 2, 24},
                  context.tr("no static record long enough for an Allan deviation"),
                  {12, Anchor::middle});
      return;
    }
    draw_allan_panels(
        canvas, {0, 0}, kFigureWidth, 265, series,
        {context.tr("averaging time τ, s"), context.tr("overlapping Allan deviation, {}", "m/s²")});
  };
  return figure;
}

Figure convergence_figure(const FigureContext& context) {
  Figure figure;
  figure.caption = context.tr(
      "Estimate of each parameter against the number of positions, as difference from the final "
      "least-squares value; the grey band is the final standard uncertainty times two.");
  figure.description =
      context.tr("Convergence of recursive least squares, filter and batch least squares");
  figure.width = kFigureWidth;
  constexpr double kPanelWidth = 112, kPanelHeight = 76, kStepX = 164, kStepY = 118, kTop = 50;
  figure.height = kTop + 3 * kStepY - 4;
  figure.draw = [context](Canvas& canvas) {
    const Calibration& calibration = *context.calibration;
    const Convergence& run = calibration.convergence;
    const std::size_t count = std::max({run.rls.size(), run.ekf.size(), run.batch_ls.size()});
    if (count < 2) return;
    draw_legend(canvas, {52, 18},
                {{context.tr("recursive least squares"), {palette::kBlue, 1.5, {}}, ""},
                 {context.tr("eight-state filter"), {palette::kOrange, 1.5, {6, 3}}, ""},
                 {context.tr("batch least squares"), {palette::kBlack, 1.2, {1.5, 2}}, ""}});
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      for (Eigen::Index j = 0; j < 4; ++j) {
        const AxisEstimate& final = calibration.estimates.batch_ls[i];
        const double reference = final.value(j);
        const double two_u = 2 * std::sqrt(final.covariance(j, j));
        const auto curve = [&](const std::vector<TriadEstimate>& history) {
          std::vector<double> values;
          values.reserve(history.size());
          for (const TriadEstimate& e : history)
            values.push_back(1e3 * (e[i].value(j) - reference));
          return values;
        };
        const auto rls = curve(run.rls), ekf = curve(run.ekf), batch = curve(run.batch_ls);
        // The first positions would flatten everything that matters; the panel shows what follows.
        double half = 4e3 * two_u / 2;
        for (const auto* values : {&rls, &ekf}) {
          for (std::size_t k = count / 4; k < values->size(); ++k) {
            half = std::max(half, 1.2 * std::abs((*values)[k]));
          }
        }
        if (!(half > 0)) half = 1;
        PlotAxis x{i == 2 ? context.tr("positions") : "", 0, static_cast<double>(count)};
        x.ticks = 3;
        PlotAxis y{j == 0   ? context.tr("difference, mV/g")
                   : j == 3 ? context.tr("difference, mV")
                            : "",
                   -half, half};
        y.ticks = 4;
        Plot plot(canvas,
                  {62 + (j == 3 ? 24 : 0) + static_cast<double>(j) * kStepX,
                   kTop + static_cast<double>(i) * kStepY},
                  kPanelWidth, kPanelHeight, x, y);
        plot.draw_frame(
            j == 3 ? fmt::format("U_{}0", kAxisName[i])
                   : fmt::format("K_{}{}", kAxisName[i], kAxisName[static_cast<std::size_t>(j)]));
        plot.band({0, static_cast<double>(count)}, {-1e3 * two_u, -1e3 * two_u},
                  {1e3 * two_u, 1e3 * two_u}, palette::kGrey, 0.25);
        const auto positions = [](std::size_t n) {
          std::vector<double> values(n);
          for (std::size_t k = 0; k < n; ++k) values[k] = static_cast<double>(k + 1);
          return values;
        };
        plot.line(positions(rls.size()), rls, {palette::kBlue, 1.4, {}});
        plot.line(positions(ekf.size()), ekf, {palette::kOrange, 1.4, {6, 3}});
        plot.line(positions(batch.size()), batch, {palette::kBlack, 1.1, {1.5, 2}});
      }
    }
  };
  return figure;
}

Figure budget_figure(const FigureContext& context, const RunDescription& description) {
  constexpr double kLeft = 70, kBar = 16, kStep = 24, kTop = 46;
  Figure figure;
  figure.caption = context.tr(
      "What the variance of each scale factor K_ii and offset U_i0 is made of, in shares; on the "
      "right the expanded uncertainty.");
  figure.description = context.tr("Bars of the uncertainty budget");
  figure.width = kFigureWidth;
  figure.height = kTop + 6 * kStep + 34;
  std::vector<Budget> budgets;
  for (const bool offset : {false, true}) {
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      budgets.push_back(budget_of(*context.calibration, description, i,
                                  offset ? 3 : static_cast<Eigen::Index>(i)));
    }
  }
  figure.draw = [context, budgets](Canvas& canvas) {
    const double width = kFigureWidth - kLeft - 130;
    const std::array<std::string, kPartColors.size()> names = {
        context.tr("readings"), context.tr("angle δ"), context.tr("angle h"),
        context.tr("local gravity"), context.tr("alternatives")};
    std::size_t parts = 0;
    for (const Budget& budget : budgets) parts = std::max(parts, budget.lines.size());
    std::vector<LegendEntry> legend;
    for (std::size_t k = 0; k < parts; ++k) legend.push_back({names[k], {}, kPartColors[k], 1});
    draw_legend(canvas, {kLeft, 22}, legend);
    double y = kTop;
    for (const Budget& budget : budgets) {
      const bool offset = budget.column == 3;
      canvas.text({kLeft - 8, y + 12}, parameter_name(budget.axis, budget.column),
                  {11, Anchor::end});
      double x = kLeft;
      for (std::size_t k = 0; k < budget.lines.size(); ++k) {
        const double part = width * budget.lines[k].share;
        if (part > 0.05) canvas.rectangle({x, y}, part, kBar, kPartColors[k]);
        x += part;
      }
      canvas.polyline({{kLeft, y},
                       {kLeft + width, y},
                       {kLeft + width, y + kBar},
                       {kLeft, y + kBar},
                       {kLeft, y}},
                      {palette::kBlack, 0.7, {}});
      canvas.text({kLeft + width + 10, y + 12},
                  fmt::format("U = {} {}", significant(2e3 * budget.u, 2), offset ? "mV" : "mV/g"),
                  {11});
      y += kStep;
    }
    for (int share = 0; share <= 100; share += 25) {
      const double x = kLeft + width * share / 100;
      canvas.line({x, y - 4}, {x, y}, {palette::kBlack, 0.7, {}});
      canvas.text({x, y + 12}, fmt::format("{} %", share), {10, Anchor::middle});
    }
  };
  return figure;
}

namespace {

/// A candidate, and how strongly it stands out of the residual.
struct Candidate {
  std::string name;
  double sigmas = 0;
  bool added = false;
};

/// All that were added to the model, then the strongest of the listed ones that were not, up to
/// ten.
std::vector<Candidate> strongest_candidates(const Diagnosis& diagnosis, const Translator& tr) {
  constexpr std::size_t kMost = 10;
  const auto candidate = [&](const std::string& name, const std::vector<std::size_t>& axes,
                             double sigmas, bool added) {
    return Candidate{shortened(axes.empty() ? name : name + " (" + axes_text(axes) + ")", 60),
                     sigmas, added};
  };
  std::vector<Candidate> added, rest;
  for (const FoundEffect& e : diagnosis.effects) {
    added.push_back(candidate(effect_name(e.id, tr), e.axes, e.sigmas, true));
  }
  for (const UnlistedStructure& u : diagnosis.unlisted) {
    added.push_back(candidate(unlisted_name(u, tr), u.axes, u.sigmas, true));
  }
  for (const DetectionLimit& limit : diagnosis.not_found) {
    std::vector<std::size_t> axes;
    if (limit.axis) axes.push_back(*limit.axis);
    Candidate one = candidate(effect_name(limit.id, tr), axes, limit.sigmas, false);
    // One entry a parameter, all with the strength of the whole.
    const auto same = [&](const Candidate& c) { return c.name == one.name; };
    if (std::none_of(rest.begin(), rest.end(), same)) rest.push_back(std::move(one));
  }
  const auto stronger = [](const Candidate& a, const Candidate& b) { return a.sigmas > b.sigmas; };
  std::stable_sort(added.begin(), added.end(), stronger);
  std::stable_sort(rest.begin(), rest.end(), stronger);
  if (added.size() < kMost) {
    rest.resize(std::min(rest.size(), kMost - added.size()));
    added.insert(added.end(), rest.begin(), rest.end());
  }
  return added;
}

}  // namespace

std::optional<Figure> evidence_figure(const FigureContext& context) {
  constexpr double kLeft = 20, kRight = 60, kName = 14, kBar = 10, kStep = 32, kTop = 4, kLimit = 5;
  const std::vector<Candidate> list =
      strongest_candidates(context.calibration->diagnosis, context.tr);
  if (list.empty()) return std::nullopt;
  Figure figure;
  figure.caption = context.tr(
      "Evidence of the candidates: by how many standard deviations each stands out of the "
      "residual, on a logarithmic scale. "
      "Dark: added to the model; light: the strongest of those that were not. Many hypotheses are "
      "tried, so that noise alone gives some; the line stands at 5, which the limits of "
      "detection refer to.");
  figure.description = context.tr("Bars of the evidence for each candidate");
  figure.width = kFigureWidth;
  figure.height = kTop + static_cast<double>(list.size()) * kStep + 24;
  figure.draw = [list](Canvas& canvas) {
    // From one σ on; effects differ by orders of magnitude.
    double most = 10;
    for (const Candidate& c : list) most = std::max(most, c.sigmas);
    const double decades = std::log10(most);
    const auto x_of = [&](double sigmas) {
      const double share = std::clamp(std::log10(std::max(sigmas, 1.0)) / decades, 0.0, 1.0);
      return kLeft + share * (kFigureWidth - kLeft - kRight);
    };
    double y = kTop;
    for (const Candidate& c : list) {
      canvas.text({kLeft, y + kName - 3}, c.name, {11});
      canvas.rectangle({kLeft, y + kName}, x_of(c.sigmas) - kLeft, kBar,
                       c.added ? palette::kBlue : palette::kGrey);
      canvas.text({x_of(c.sigmas) + 6, y + kName + kBar - 1}, significant(c.sigmas, 2) + " σ",
                  {11});
      y += kStep;
    }
    // Beside the bars only, not through the names.
    for (double top = kTop + kName; top < y; top += kStep) {
      canvas.line({x_of(kLimit), top - 1}, {x_of(kLimit), top + kBar + 1},
                  {palette::kBlack, 0.8, {}});
    }
    for (double tick = 1; tick <= most; tick *= 10) {
      canvas.line({x_of(tick), y}, {x_of(tick), y + 4}, {palette::kBlack, 0.7, {}});
      canvas.text({x_of(tick), y + 16}, fmt::format("{:.0f}", tick), {10, Anchor::middle});
    }
    canvas.text({x_of(kLimit), y + 16}, "5", {10, Anchor::middle});
  };
  return figure;
}

}  // namespace plumbline::app
