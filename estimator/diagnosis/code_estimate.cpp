#include "estimator/diagnosis/code_estimate.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "estimator/quantization/quantized_axis.h"

namespace plumbline {
namespace {

enum Parameter : std::size_t { kLsb, kOrigin };  // of adc.quantization

/// Without its lowest bit, and with all others, a converter rounds to steps of twice the size.
bool lacks_lowest_bit(const VisitLog& log, const ActiveEffect& active) {
  const std::vector<StuckBit>& stuck = log.codes[active.axis].stuck_bits;
  return active.effect->id() == "adc.stuck_bit" && stuck.size() == 1 && stuck.front().bit == 0;
}

bool rounds(const VisitLog& log, const ActiveEffect& active) {
  return (active.effect->id() == "adc.quantization" && active.effect->certain(log, active.axis)) ||
         lacks_lowest_bit(log, active);
}

CodeScale scale_of(const VisitLog& log, const ActiveEffect& rounding) {
  const double declared_V = log.adc->lsb_V();
  CodeScale scale = scale_of(*log.adc);
  if (lacks_lowest_bit(log, rounding)) {
    // Code 2k is read for 2k + 1 or the other way round: a quarter of a step off the middle of
    // both.
    scale.origin_V = log.adc->min_V + 0.5 * declared_V;
    scale.step_V = 2 * declared_V;
    scale.off_scale = 0.3;
    return scale;
  }
  // Readings are rounded to the declared step once more.
  scale.origin_V = rounding.p[kOrigin];
  scale.step_V = rounding.p[kLsb];
  scale.off_scale = 0.6 * declared_V / scale.step_V;
  return scale;
}

/// An axis whose steps have edges, and the effect that says so, if one had to.
struct RoundedAxis {
  CodeScale scale;
  std::optional<std::size_t> effect;
};

/// Nothing where noise smooths the steps, where they are not evenly spaced or where the voltage
/// changes within the dwells.
std::optional<RoundedAxis> rounded_axis(const VisitLog& log, const SearchResult& found,
                                        std::size_t axis) {
  std::optional<RoundedAxis> rounded;
  if (found.beyond_V2[axis]) rounded = {scale_of(*log.adc), std::nullopt};
  for (std::size_t e = 0; e < found.fit.parameters.effects.size(); ++e) {
    const ActiveEffect& active = found.fit.parameters.effects[e];
    const auto axes = axes_of(active);
    if (std::find(axes.begin(), axes.end(), axis) == axes.end()) continue;
    const std::string id = active.effect->id();
    if (rounds(log, active))
      rounded = {scale_of(log, active), e};
    else if (active.effect->within_dwell() || id.starts_with("adc.") ||
             id.starts_with("unlisted:code"))
      return std::nullopt;
  }
  return rounded;
}

Eigen::MatrixXd design_of(const VisitLog& log, const EnlargedParameters& model) {
  const auto force_g = specific_forces_g(log, model);
  Eigen::MatrixXd A(std::ssize(force_g), 4);
  for (Eigen::Index k = 0; k < A.rows(); ++k)
    A.row(k) << force_g[static_cast<std::size_t>(k)].transpose(), 1;
  return A;
}

}  // namespace

std::optional<CodeEstimate> estimate_from_codes(const SearchInput& input, const MeasurementSet& run,
                                                const SearchResult& found) {
  const VisitLog& log = input.log;
  const auto n = std::ssize(log.visits);
  const Eigen::MatrixXd A = design_of(log, found.fit.parameters);
  std::optional<CodeEstimate> codes;  // a copy of what was found is not made for nothing
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const auto rounded = rounded_axis(log, found, axis);
    if (!rounded) continue;
    const EnlargedParameters before = rounded->effect
                                          ? without_effect(found.fit.parameters, *rounded->effect)
                                          : found.fit.parameters;
    const Eigen::VectorXd known_V = predict_means_V(log, before)[axis] - A * before.twelve[axis];
    const auto quantized =
        quantized_axis(run, A, input.known_V2[axis], known_V, rounded->scale, axis);
    if (!quantized) continue;
    if (!codes) codes = {.before_converter = found, .left_out = {}, .deviation_V = {}};
    SearchResult& result = codes->before_converter;
    // How far the poses scatter beyond their codes is left to the noise, which knows of slow parts.
    result.own_V2[axis] = quantized->variance_without_V2(std::pow(quantized->use.scatter_V, 2));
    const NoisePool pool(input.processes, without_record(input.noise[axis]), result.own_V2[axis]);
    result.noise[axis] = pool.pool(quantized->mean_V - known_V, A);
    result.observed.mean_V[axis] = quantized->mean_V;
    result.whitening.set(axis, result.noise[axis].covariance);
    if (!rounded->effect) continue;
    codes->left_out.push_back(*rounded->effect);
    const ActiveEffect& active = found.fit.parameters.effects[*rounded->effect];
    for (const auto& away : active.effect->one_deviation_away(log, axis, active.p)) {
      const double step = away[kLsb] / active.p[kLsb] - 1;
      Eigen::VectorXd change_V = Eigen::VectorXd::Zero(stacked_rows(log));
      change_V.segment(static_cast<Eigen::Index>(axis) * n, n) =
          (away[kOrigin] - active.p[kOrigin]) +
          step * (quantized->mean_V.array() - active.p[kOrigin]);
      codes->deviation_V.push_back(std::move(change_V));
    }
  }
  if (!codes) return std::nullopt;
  std::sort(codes->left_out.rbegin(), codes->left_out.rend());
  SearchResult& result = codes->before_converter;
  for (const std::size_t e : codes->left_out) result.remove(e);
  result.fit = fit_enlarged(log, result.observed, result.whitening, result.fit.parameters);
  if (!result.fit.determined) return std::nullopt;
  return codes;
}

EnlargedEstimate CodeEstimate::with_converter(const EnlargedEstimate& estimate,
                                              const SearchResult& found) const {
  EnlargedEstimate whole{found.fit.parameters, found.fit.covariance};
  whole.parameters.twelve = estimate.parameters.twelve;
  std::vector<Eigen::Index> kept(12);  // their places among all free parameters
  std::iota(kept.begin(), kept.end(), 0);
  Eigen::Index place = std::ssize(kept);
  auto next = estimate.parameters.effects.begin();
  for (std::size_t e = 0; e < whole.parameters.effects.size(); ++e) {
    ActiveEffect& active = whole.parameters.effects[e];
    const Eigen::Index count = active.free_count();
    if (std::find(left_out.begin(), left_out.end(), e) != left_out.end()) {
      // The noise of the readings hardly depends on anything else.
      const Eigen::MatrixXd own = whole.covariance.block(place, place, count, count);
      whole.covariance.middleRows(place, count).setZero();
      whole.covariance.middleCols(place, count).setZero();
      whole.covariance.block(place, place, count, count) = own;
    } else {
      active = *next++;
      for (Eigen::Index k = place; k < place + count; ++k) kept.push_back(k);
    }
    place += count;
  }
  whole.covariance(kept, kept) = estimate.covariance;
  return whole;
}

}  // namespace plumbline
