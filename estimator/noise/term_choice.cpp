#include "estimator/noise/term_choice.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "estimator/noise/noise_model.h"

namespace plumbline {

namespace {

using Eigen::Index;
using Eigen::VectorXd;

// What 2·ln L must gain. The correlation time of a Gauss-Markov process is searched over decades.
constexpr double kMarkovGain = 9;
constexpr double kLowLimitGain = 4;
constexpr double kHighLimitGain = 3;
// Flicker that is barely seen has no limits to be seen: chance brings them in, and then B moves by
// many times its own size. This much must 2·ln L fall without any flicker.
constexpr double kClearFlicker = 40;
constexpr double kQuantizationGain = 4;
constexpr std::size_t kMostMarkov = 3;
constexpr double kShortestTau = 5;        // samples; what is faster is the sensor's bandwidth
constexpr double kNarrowestFlicker = 10;  // high over low limit
constexpr unsigned kHoldQ = 1;

/// Minimum of a function of one variable over [low, high] by golden section.
double golden_minimum(double low, double high, int steps,
                      const std::function<double(double)>& function) {
  const double part = 0.5 * (std::sqrt(5.0) - 1);
  double a = high - part * (high - low);
  double b = low + part * (high - low);
  double at_a = function(a);
  double at_b = function(b);
  for (int i = 0; i < steps; ++i) {
    if (at_a < at_b) {
      high = b;
      b = a;
      at_b = at_a;
      a = high - part * (high - low);
      at_a = function(a);
    } else {
      low = a;
      a = b;
      at_a = at_b;
      b = low + part * (high - low);
      at_b = function(b);
    }
  }
  return at_a < at_b ? a : b;
}

/// A description that was tried, for the spread.
struct Tried {
  Eigen::Vector4d coefficient;
  double score = 0;
  double prior = 1;
};

/// One parameter of a shape that is not a power, as its logarithm.
struct ShapeParameter {
  double low;
  double high;
  std::function<void(SpectrumShape&, double)> set;
};

class Chooser {
 public:
  explicit Chooser(const SpectrumSums& sums) : sums_(sums) {
    plain_ = shape_densities(sums, {});
    duration_s_ = sums.duration_s();
    flicker_top_hz_ = 0.5 * sums.frequency_hz(static_cast<double>(sums.bins.back().first));
  }

  TermChoice choose(bool quantization) {
    falls_off_ = !quantization;
    TermDescription start = describe({}, false, nullptr);
    if (quantization) {
      const TermDescription with = describe({}, true, nullptr);
      if (with.score() < start.score()) start = with;
    }
    TermChoice choice;
    choice.chosen = grow(start);
    // A flicker that ends below the upper end of the spectrum looks like less white noise and some
    // quantization.
    if (start.quantization) {
      if (const TermDescription other = grow(describe({}, false, nullptr));
          other.score() < choice.chosen.score())
        choice.chosen = other;
    }
    // Limits of the flicker, cheaper one by one, can stand in the way of a Gauss-Markov term.
    const SpectrumShape& shape = choice.chosen.shape;
    if (shape.markov_tau_s.empty() &&
        (shape.flicker_low_hz > 0 || std::isfinite(shape.flicker_high_hz))) {
      if (const TermDescription other = grow(polish(with_markov(start)));
          other.score() < choice.chosen.score())
        choice.chosen = other;
    }
    if (quantization) {
      const TermDescription other =
          polish(describe(choice.chosen.shape, !choice.chosen.quantization, nullptr));
      note(other, 1);
      if (other.score() < choice.chosen.score()) choice.chosen = other;
    }
    choice.without_markov =
        choice.chosen.shape.markov_tau_s.empty() ? choice.chosen : without_markov_;
    choice.spread = spread(choice.chosen);
    return choice;
  }

 private:
  /// `near`: a fit with the same terms to start from, or null.
  TermDescription describe(const SpectrumShape& shape, bool quantization,
                           const VectorXd* near) const {
    TermDescription result;
    result.shape = shape;
    result.quantization = quantization;
    result.density.resize(shape.terms(), plain_.cols());
    result.density.topRows(plain_.rows()) = plain_;
    fill_shape(sums_, shape, result.density);
    const unsigned held = quantization ? 0 : kHoldQ;
    VectorXd start = starting_powers(sums_, result.density, held);
    // A little of everything, so that no term is shut out by where the last fit ended.
    if (near != nullptr && near->size() == start.size()) start = *near + 1e-3 * start;
    if (!quantization) start(0) = 0;
    result.fit = fit_powers(sums_, result.density, start, held);
    return result;
  }

  /// Adds what the record shows, the most convincing first.
  TermDescription grow(TermDescription now) {
    for (;;) {
      note(now, 1);
      if (now.shape.markov_tau_s.empty() && now.score() < without_markov_.score())
        without_markov_ = now;
      TermDescription best;
      const auto consider = [&](TermDescription candidate) {
        if (candidate.score() < best.score()) best = std::move(candidate);
      };
      const SpectrumShape& shape = now.shape;
      // Where the spectrum falls off at its end, such limits bend with it.
      const bool limits = falls_off_ || shape.flicker_low_hz > 0 ||
                          std::isfinite(shape.flicker_high_hz) || has_clear_flicker(now);
      if (limits && shape.flicker_low_hz == 0) {
        const double high = std::min(shape.flicker_high_hz, flicker_top_hz_);
        consider(search(now, shape,
                        {std::log(1 / duration_s_), std::log(high / kNarrowestFlicker),
                         [](SpectrumShape& s, double v) { s.flicker_low_hz = v; }}));
      }
      if (limits && !std::isfinite(shape.flicker_high_hz)) {
        const double low = std::max(shape.flicker_low_hz, 1 / duration_s_);
        consider(search(now, shape,
                        {std::log(low * kNarrowestFlicker), std::log(flicker_top_hz_),
                         [](SpectrumShape& s, double v) { s.flicker_high_hz = v; }}));
      }
      if (shape.markov_tau_s.size() < kMostMarkov) consider(with_markov(now));
      if (!(best.score() < now.score())) return now;
      now = polish(std::move(best));
    }
  }

  bool has_clear_flicker(const TermDescription& now) const {
    constexpr unsigned kHoldB = 1U << kTermB;
    if (!(now.fit.power(kTermB) > 0)) return false;
    const unsigned held = kHoldB | (now.quantization ? 0 : kHoldQ);
    VectorXd start = starting_powers(sums_, now.density, held);
    start(kTermB) = 0;
    if (!now.quantization) start(kTermQ) = 0;
    if (!(start.sum() > 0)) return true;
    return fit_powers(sums_, now.density, start, held).deviance > now.fit.deviance + kClearFlicker;
  }

  TermDescription with_markov(const TermDescription& now) {
    SpectrumShape more = now.shape;
    more.markov_tau_s.push_back(0);
    return search(now, more,
                  {std::log(kShortestTau / sums_.rate_hz), std::log(0.25 * duration_s_),
                   [](SpectrumShape& s, double v) { s.markov_tau_s.back() = v; }});
  }

  /// Best value on a grid, then between its neighbours. An empty range gives an infinite score.
  TermDescription search(const TermDescription& now, const SpectrumShape& shape,
                         const ShapeParameter& parameter) {
    TermDescription best;
    double best_log = parameter.low;
    VectorXd last;
    const auto at = [&](double log_value) {
      SpectrumShape trial = shape;
      parameter.set(trial, std::exp(log_value));
      TermDescription description = describe(trial, now.quantization, &last);
      last = description.fit.power;
      return description;
    };
    constexpr double kStep = 0.9;
    const double points = std::max(1.0, (parameter.high - parameter.low) / kStep);
    if (parameter.high < parameter.low) return best;
    for (double log_value = parameter.low; log_value <= parameter.high; log_value += kStep) {
      TermDescription here = at(log_value);
      note(here, std::min(1.0, 4 / points));
      if (here.fit.deviance < best.fit.deviance) {
        best = std::move(here);
        best_log = log_value;
      }
    }
    if (best.score() > now.score() + 3) return best;  // refinement would not help it
    const double refined = golden_minimum(
        std::max(parameter.low, best_log - kStep), std::min(parameter.high, best_log + kStep), 8,
        [&](double log_value) { return at(log_value).fit.deviance; });
    TermDescription here = at(refined);
    return here.fit.deviance < best.fit.deviance ? here : best;
  }

  /// All parameters of the shape moved once more around their values, now that there are others.
  TermDescription polish(TermDescription now) const {
    const auto improve = [&](double value, const auto& set) {
      const double centre = std::log(value);
      const auto at = [&](double log_value) {
        SpectrumShape trial = now.shape;
        set(trial, std::exp(log_value));
        return describe(trial, now.quantization, &now.fit.power);
      };
      TermDescription here =
          at(golden_minimum(centre - 0.7, centre + 0.7, 8,
                            [&](double log_value) { return at(log_value).fit.deviance; }));
      if (here.fit.deviance < now.fit.deviance) now = std::move(here);
    };
    for (std::size_t j = 0; j < now.shape.markov_tau_s.size(); ++j)
      improve(now.shape.markov_tau_s[j],
              [j](SpectrumShape& shape, double value) { shape.markov_tau_s[j] = value; });
    if (now.shape.flicker_low_hz > 0)
      improve(now.shape.flicker_low_hz,
              [](SpectrumShape& shape, double value) { shape.flicker_low_hz = value; });
    if (std::isfinite(now.shape.flicker_high_hz))
      improve(now.shape.flicker_high_hz,
              [](SpectrumShape& shape, double value) { shape.flicker_high_hz = value; });
    return now;
  }

  void note(const TermDescription& description, double prior) {
    tried_.push_back({description.fit.power.head<4>().cwiseSqrt(), description.score(), prior});
  }

  /// Mean square distance of what was tried, with the weight that its likelihood gives it – half as
  /// steep, since none of the descriptions is quite true.
  Eigen::Vector4d spread(const TermDescription& chosen) const {
    const Eigen::Vector4d centre = chosen.fit.power.head<4>().cwiseSqrt();
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    double weights = 1;
    for (const Tried& tried : tried_) {
      const double weight =
          tried.prior * std::exp(-0.25 * std::max(0.0, tried.score - chosen.score()));
      sum += weight * (tried.coefficient - centre).cwiseAbs2();
      weights += weight;
    }
    return sum / weights;
  }

  const SpectrumSums& sums_;
  Eigen::MatrixXd plain_;  ///< densities of Q, N, B, K without limits
  double duration_s_ = 0;
  double flicker_top_hz_ = 0;
  bool falls_off_ = false;
  TermDescription without_markov_;
  std::vector<Tried> tried_;
};

}  // namespace

double TermDescription::parameters() const {
  double count = 1;
  for (Index i = 0; i < fit.power.size(); ++i) count += fit.power(i) > 0 ? 1 : 0;
  count += static_cast<double>(shape.markov_tau_s.size());
  count += shape.flicker_low_hz > 0 ? 1 : 0;
  count += std::isfinite(shape.flicker_high_hz) ? 1 : 0;
  return count;
}

double TermDescription::score() const {
  double score = fit.deviance;
  if (quantization) score += kQuantizationGain;
  score += kMarkovGain * static_cast<double>(shape.markov_tau_s.size());
  if (shape.flicker_low_hz > 0) score += kLowLimitGain;
  if (std::isfinite(shape.flicker_high_hz)) score += kHighLimitGain;
  return score;
}

TermChoice choose_terms(const SpectrumSums& sums, bool quantization) {
  return Chooser(sums).choose(quantization);
}

}  // namespace plumbline
