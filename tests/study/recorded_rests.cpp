// The page on a triad that was turned by hand: |a| − g of its rests.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>

#include "app/figure/plot.h"
#include "app/figure/svg_canvas.h"
#include "estimator/diagnosis/restored_model.h"
#include "estimator/error_figures.h"
#include "estimator/pose_means.h"
#include "estimator/scalar/calibrate_scalar.h"
#include "tests/study/recorded.h"

namespace plumbline::study {
namespace {

using app::LegendEntry;
using app::Plot;
using app::Stroke;
using app::SvgCanvas;
namespace palette = app::palette;

double rms_of(const std::vector<double>& values) {
  return rms(Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values)));
}

RunDescription description_of(const RestRecord& record) {
  RunDescription description;
  description.gravity.local_mps2 = record.local_mps2;
  return description;
}

/// The rests for which `keep` is true.
MeasurementSet part_of(const MeasurementSet& set, const std::function<bool(std::size_t)>& keep) {
  MeasurementSet part = set;
  part.poses.clear();
  for (std::size_t k = 0; k < set.poses.size(); ++k)
    if (keep(k)) part.poses.push_back(set.poses[k]);
  return part;
}

std::string effect_words(const Diagnosis& diagnosis) {
  std::string words;
  for (const FoundEffect& effect : diagnosis.effects) {
    words += (words.empty() ? "" : "; ") + effect.id;
    for (const std::size_t axis : effect.axes) words += std::string(" ") + kAxisName[axis];
    for (const EffectParameter& p : effect.parameters)
      words += fmt::format(" {} = {:.3g} ± {:.1g} {}", p.name, p.value, p.u, p.unit);
  }
  for (const UnlistedStructure& found : diagnosis.unlisted) {
    words += (words.empty() ? "" : "; ") + found.driver + " (" + found.form + ", unlisted)";
    for (const std::size_t axis : found.axes) words += std::string(" ") + kAxisName[axis];
  }
  return words.empty() ? "none" : words;
}

/// |a| − g of the rests of `set` by a calibration that did not see them, m/s².
std::vector<double> residuals(const RestRecord& record, const MeasurementSet& set,
                              const ScalarVector& nine, const Diagnosis* effects) {
  const RunDescription description = description_of(record);
  ScalarData data{{}, record.local_mps2, make_visit_log(set, description)};
  for (const PoseMean& mean : pose_means(set))
    data.reading.emplace_back(mean.mean_V[0], mean.mean_V[1], mean.mean_V[2]);
  set_attitudes(data, nine);
  ScalarParameters parameters{nine, {}};
  RestoredModel restored;  // holds what the effects are made of
  if (effects != nullptr) {
    CertifiedModel model;
    model.effects = effects->effects;
    model.unlisted = effects->unlisted;
    restored = restore_model(model, data.log);
    parameters.effects = restored.parameters.effects;
  }
  const Eigen::VectorXd residual = scalar_residual_mps2(data, parameters);
  return {residual.begin(), residual.end()};
}

/// Calibrated and diagnosed on one half, tested on the other.
std::string halves_table(const RestRecord& record) {
  const std::size_t n = record.set.poses.size();
  struct Split {
    const char* name;
    std::function<bool(std::size_t)> fitted;
  };
  const Split splits[] = {{"even rests → odd rests", [](std::size_t k) { return k % 2 == 0; }},
                          {"odd rests → even rests", [](std::size_t k) { return k % 2 == 1; }},
                          {"first half → second half", [n](std::size_t k) { return k < n / 2; }},
                          {"second half → first half", [n](std::size_t k) { return k >= n / 2; }}};
  std::vector<std::vector<std::string>> rows = {{"calibrated on → tested on",
                                                 "effects found in the first",
                                                 "tested: before, mm/s² RMS", "after"}};
  for (const Split& split : splits) {
    const MeasurementSet fitted = part_of(record.set, split.fitted);
    const MeasurementSet tested =
        part_of(record.set, [&](std::size_t k) { return !split.fitted(k); });
    const auto half = calibrate_scalar({fitted, description_of(record)}, {});
    if (!half) {
      rows.push_back({split.name, half.error().message, "–", "–"});
      continue;
    }
    const double before = rms_of(residuals(record, tested, half->estimate.value, nullptr));
    const double after = rms_of(residuals(record, tested, half->final.value, &half->diagnosis));
    rows.push_back({split.name, effect_words(half->diagnosis), mm(before), mm(after)});
  }
  return html_table(rows);
}

double angle_deg(const RestResult& a, const RestResult& b) {
  return std::acos(std::clamp(a.direction.dot(b.direction), -1.0, 1.0)) * 180 / std::numbers::pi;
}

/// Pairs of rests so far apart in attitude and in order.
struct PairClass {
  const char* name;
  double from_deg, to_deg;
  std::size_t from_apart, to_apart;
};
constexpr double kAny = 181;
constexpr std::size_t kEver = 1U << 30U;

/// How much the residuals of such pairs differ: RMS / √2, which is their own RMS when they have
/// nothing in common.
struct PairScatter {
  std::size_t pairs = 0;
  double before_mps2 = 0;
  double after_mps2 = 0;
};
PairScatter scatter_of(const std::vector<RestResult>& rests, const PairClass& c) {
  std::vector<double> before, after;
  for (std::size_t i = 0; i < rests.size(); ++i) {
    for (std::size_t j = i + c.from_apart; j < std::min(rests.size(), i + c.to_apart); ++j) {
      const double angle = angle_deg(rests[i], rests[j]);
      if (angle < c.from_deg || angle >= c.to_deg) continue;
      before.push_back(rests[i].residual_before_mps2 - rests[j].residual_before_mps2);
      after.push_back(rests[i].residual_after_mps2 - rests[j].residual_after_mps2);
    }
  }
  if (before.empty()) return {};
  return {before.size(), rms_of(before) / std::numbers::sqrt2, rms_of(after) / std::numbers::sqrt2};
}

/// Do rests that are alike in attitude, or close in time, have like residuals?
std::string likeness_table(const std::vector<RestResult>& rests) {
  static constexpr PairClass kClasses[] = {
      {"next to each other, less than 6° apart", 0, 6, 1, 2},
      {"less than 6° apart, others between them", 0, 6, 2, kEver},
      {"6 to 15° apart", 6, 15, 1, kEver},
      {"15 to 45° apart", 15, 45, 1, kEver},
      {"more than 45° apart", 45, kAny, 1, kEver},
      {"next to each other, whatever the attitude", 0, kAny, 1, 2}};
  std::vector<std::vector<std::string>> rows = {
      {"pairs of rests", "pairs", "RMS difference / √2 before, mm/s²", "after"}};
  for (const PairClass& c : kClasses) {
    const PairScatter scatter = scatter_of(rests, c);
    if (scatter.pairs == 0) continue;
    rows.push_back(
        {c.name, std::to_string(scatter.pairs), mm(scatter.before_mps2), mm(scatter.after_mps2)});
  }
  return html_table(rows);
}

/// A third of the rests, by how restless they are inside.
struct Third {
  double expected_mps2 = 0;  ///< from the scatter inside
  double before_mps2 = 0;
  double after_mps2 = 0;
};
std::array<Third, 3> thirds_of(std::vector<RestResult> rests) {
  std::sort(rests.begin(), rests.end(), [](const RestResult& a, const RestResult& b) {
    return a.expected_mps2 < b.expected_mps2;
  });
  std::array<Third, 3> thirds;
  for (std::size_t third = 0; third < thirds.size(); ++third) {
    std::vector<double> expected, before, after;
    for (std::size_t k = third * rests.size() / 3; k < (third + 1) * rests.size() / 3; ++k) {
      expected.push_back(rests[k].expected_mps2);
      before.push_back(rests[k].residual_before_mps2);
      after.push_back(rests[k].residual_after_mps2);
    }
    thirds[third] = {rms_of(expected), rms_of(before), rms_of(after)};
  }
  return thirds;
}

/// Is the residual larger where the rest is restless inside?
std::string quietness_table(const std::array<Third, 3>& thirds) {
  static constexpr const char* kName[] = {"quietest third", "middle third", "most restless third"};
  std::vector<std::vector<std::string>> rows = {
      {"rests", "expected from the scatter inside, mm/s² RMS", "residual before", "after"}};
  for (std::size_t third = 0; third < thirds.size(); ++third) {
    rows.push_back({kName[third], mm(thirds[third].expected_mps2), mm(thirds[third].before_mps2),
                    mm(thirds[third].after_mps2)});
  }
  return html_table(rows);
}

/// What can drive the rest of the residual, and what cannot.
std::string exclusions(const ScalarCalibration& c, const std::array<Third, 3>& thirds) {
  constexpr double kAlike = 0.8;  // of the scatter of pairs that have nothing in common
  const PairScatter any = scatter_of(c.rests, {"", 45, kAny, 1, kEver});
  const PairScatter near = scatter_of(c.rests, {"", 0, 15, 1, kEver});
  const PairScatter neighbours = scatter_of(c.rests, {"", 0, kAny, 1, 2});
  const bool by_attitude = near.pairs > 0 && near.after_mps2 < kAlike * any.after_mps2;
  const bool by_time = neighbours.after_mps2 < kAlike * any.after_mps2;
  const bool by_noise = thirds[0].after_mps2 < kAlike * thirds[2].after_mps2;
  std::string text = fmt::format(
      "Pairs more than 45° apart scatter by {} mm/s² (RMS difference / √2). ", mm(any.after_mps2));
  text += fmt::format("Those within 15° of each other scatter by {}: {}. ", mm(near.after_mps2),
                      by_attitude ? "part of the rest follows the attitude"
                                  : "no function of the attitude can drive the rest");
  text += fmt::format("Neighbours in time scatter by {}: {}. ", mm(neighbours.after_mps2),
                      by_time ? "part of the rest drifts" : "no drift does, either");
  text += fmt::format("The quietest third is off by {} where its own scatter leaves {}: {}. ",
                      mm(thirds[0].after_mps2), mm(thirds[0].expected_mps2),
                      by_noise ? "the noise inside the rests has a part in it"
                               : "nor is it the noise inside the rests");
  if (!by_attitude && !by_time && !by_noise) {
    text +=
        "What is left is scatter from rest to rest: the sensor, or the way it lay, did not repeat. "
        "Nothing that was recorded tells which.";
  }
  return "<p>" + text + "</p>\n";
}

std::string figure(const char* id, const std::string& words, const std::string& x_label,
                   const std::vector<RestResult>& rests,
                   const std::function<double(const RestResult&)>& x_of) {
  std::vector<double> x, before, after;
  double most = 0;
  for (const RestResult& rest : rests) {
    x.push_back(x_of(rest));
    before.push_back(kMilli * rest.residual_before_mps2);
    after.push_back(kMilli * rest.residual_after_mps2);
    most = std::max({most, std::abs(before.back()), std::abs(after.back())});
  }
  const auto [least, greatest] = std::minmax_element(x.begin(), x.end());
  const double margin = 0.03 * (*greatest - *least);
  SvgCanvas canvas(760, 280);
  Plot plot(canvas, {70, 40}, 670, 190, {x_label, *least - margin, *greatest + margin, {}, true, 8},
            {"|a| − g, mm/s²", -1.1 * most, 1.1 * most, {}, true, 5});
  plot.draw_frame();
  plot.line({*least - margin, *greatest + margin}, {0, 0}, Stroke{palette::kGrey, 1, {}});
  plot.points(x, before, 3, palette::kOrange);
  plot.points(x, after, 3, palette::kBlue);
  app::draw_legend(canvas, {75, 20},
                   {LegendEntry{"before", {}, palette::kOrange, 1},
                    LegendEntry{"after", {}, palette::kBlue, 1}});
  return fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n", canvas.svg(id, words),
                     words);
}

std::string error_table(const ScalarCalibration& c) {
  const auto cells = [](const PerAxis<double>& values) {
    return fmt::format("{} / {} / {}", mm(values[0]), mm(values[1]), mm(values[2]));
  };
  return html_table({{"mm/s², along x / y / z", "before", "after", "noise inside the rests"},
                     {"left-out rests (blocks of time and of attitude), RMS",
                      cells(c.before.heldout_pose_rms_mps2), cells(c.after.heldout_pose_rms_mps2),
                      cells(c.floor_pose_rms_mps2)},
                     {"the same, largest", cells(c.before.heldout_pose_max_abs_mps2),
                      cells(c.after.heldout_pose_max_abs_mps2), ""},
                     {"fitted rests, RMS", cells(c.before.fit_pose_rms_mps2),
                      cells(c.after.fit_pose_rms_mps2), ""},
                     {"fitted rests, |a| − g with n − 9 degrees of freedom",
                      mm(c.residual_rms_mps2), mm(c.final_residual_rms_mps2),
                      fmt::format("{}; {} with its correlation", mm(c.expected_rms_mps2),
                                  mm(c.expected_rms_blocks_mps2))}});
}

std::string findings_table(const Diagnosis& diagnosis) {
  if (diagnosis.effects.empty() && diagnosis.unlisted.empty())
    return "<p>No effect is claimed.</p>\n";
  std::vector<std::vector<std::string>> rows = {{"effect", "p of the search",
                                                 "removes of the excess, left out",
                                                 "these data cannot tell from", "what would"}};
  for (const FoundEffect& effect : diagnosis.effects) {
    Diagnosis one;
    one.effects = {effect};
    rows.push_back({effect_words(one), fmt::format("{:.1g}", effect.p_value),
                    fmt::format("{:.0f} %", 100 * effect.heldout_gain),
                    fmt::format("{}", fmt::join(effect.alternatives, ", ")), effect.separate_by});
  }
  for (const UnlistedStructure& found : diagnosis.unlisted) {
    rows.push_back({found.driver + ", " + found.form + ", " + found.shape,
                    fmt::format("{:.1g}", found.p_value),
                    fmt::format("{:.0f} %", 100 * found.heldout_gain), "", ""});
  }
  return html_table(rows);
}

}  // namespace

Result<std::string> rest_page(const RestRecord& record) {
  const auto calibrated = calibrate_scalar({record.set, description_of(record)}, {});
  if (!calibrated) return fail(calibrated.error());
  const ScalarCalibration& c = *calibrated;
  std::string body = fmt::format("<p>{} {} rests, local gravity {:.5f} m/s².</p>\n", record.source,
                                 c.intervals, record.local_mps2);
  body += "<h2>What was found</h2>\n<p><b>" + std::string(to_string(c.diagnosis.verdict)) +
          "</b>: " + c.diagnosis.reason + ".</p>\n" + findings_table(c.diagnosis);
  body += "<h2>Before and after</h2>\n" + error_table(c);
  body +=
      "<p>The left-out figures above are of fits without the block; which effects to add was "
      "decided on all rests. Here that, too, is decided on one half and tested on the "
      "other:</p>\n" +
      halves_table(record);
  body += figure("time", "Residuals in the order of the rests", "rest", c.rests,
                 [first = c.rests.front().pose.number](const RestResult& rest) {
                   return static_cast<double>(rest.pose.number - first + 1);
                 });
  for (Eigen::Index i = 0; i < 3; ++i) {
    const std::string axis = kAxisName[static_cast<std::size_t>(i)];
    body += figure(("a_" + axis).c_str(), "Residuals against a_" + axis, "a_" + axis + " / g",
                   c.rests, [i](const RestResult& rest) { return rest.direction(i); });
  }
  const std::array<Third, 3> thirds = thirds_of(c.rests);
  body +=
      "<h2>What drives the rest?</h2>\n<p>What follows the attitude makes rests that are alike in "
      "attitude alike in their residuals, whenever they were; what drifts makes neighbours alike. "
      "What is left when both are alike is scatter from rest to rest.</p>\n" +
      likeness_table(c.rests) +
      "<p>Were the rests with more scatter inside the worse ones, the noise would be to "
      "blame:</p>\n" +
      quietness_table(thirds) + "<h2>In words</h2>\n" + exclusions(c, thirds);
  return html_page(record.title, body);
}

}  // namespace plumbline::study
