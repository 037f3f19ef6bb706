#include "estimator/noise/record_terms.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>

#include "estimator/noise/misfit.h"
#include "estimator/noise/spectrum_fit.h"
#include "estimator/noise/spectrum_sums.h"
#include "estimator/noise/square.h"
#include "estimator/noise/term_choice.h"

namespace plumbline {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
constexpr Index kVariances = 4;         // Q N B K
constexpr double kTwoSided95 = 3.8415;  // χ²₁
constexpr double kOneSided95 = 2.7055;

/// Covariance of the powers, then of the logarithms of the shape's parameters, those at zero left
/// out (zero rows): as the likelihood has it, and as the scatter of whole octaves about the
/// description has it (White, 1982), which holds the misfit where there is one.
struct Covariance {
  MatrixXd likelihood;
  MatrixXd scatter;
};

Covariance parameter_covariance(const SpectrumSums& sums, const TermDescription& description) {
  std::vector<std::function<void(SpectrumShape&, double)>> scale;
  for (std::size_t j = 0; j < description.shape.markov_tau_s.size(); ++j)
    scale.emplace_back([j](SpectrumShape& s, double f) { s.markov_tau_s[j] *= f; });
  if (description.shape.flicker_low_hz > 0)
    scale.emplace_back([](SpectrumShape& s, double f) { s.flicker_low_hz *= f; });
  if (std::isfinite(description.shape.flicker_high_hz))
    scale.emplace_back([](SpectrumShape& s, double f) { s.flicker_high_hz *= f; });
  const Index terms = description.fit.power.size();
  const Index all = terms + static_cast<Index>(scale.size());
  MatrixXd derivative(all, description.density.cols());
  derivative.topRows(terms) = description.density;
  constexpr double kStep = 0.02;
  for (std::size_t j = 0; j < scale.size(); ++j) {
    SpectrumShape up = description.shape;
    SpectrumShape down = description.shape;
    scale[j](up, std::exp(kStep));
    scale[j](down, std::exp(-kStep));
    derivative.row(terms + static_cast<Index>(j)) =
        description.fit.power.transpose() *
        (shape_densities(sums, up) - shape_densities(sums, down)) / (2 * kStep);
  }
  const VectorXd variance = description.variance();
  const MatrixXd information = fisher_information(sums, derivative, variance);
  Covariance covariance{MatrixXd::Zero(all, all), MatrixXd::Zero(all, all)};
  std::vector<Index> free;
  for (Index i = 0; i < all; ++i)
    if ((i >= terms || description.fit.power(i) > 0) && information(i, i) > 0) free.push_back(i);
  if (free.empty()) return covariance;
  const MatrixXd reduced = information(free, free);
  const VectorXd unit = reduced.diagonal().cwiseSqrt().cwiseInverse();
  const MatrixXd scaled = unit.asDiagonal() * reduced * unit.asDiagonal();
  const MatrixXd inverse = unit.asDiagonal() * scaled.inverse() * unit.asDiagonal();

  // Score of each octave.
  MatrixXd scores = MatrixXd::Zero(all, all);
  VectorXd score = VectorXd::Zero(all);
  std::size_t octave_end = 4;
  for (std::size_t i = 0; i < sums.bins.size(); ++i) {
    const SpectrumSum& bin = sums.bins[i];
    if (bin.first >= octave_end) {
      scores += score * score.transpose();
      score.setZero();
      octave_end *= 2;
    }
    const auto column = static_cast<Index>(i);
    const double v = variance(column);
    const double excess =
        (square_without_ramp(bin, description.fit.slope) - bin.count * v) / (2 * v * v);
    score += excess * derivative.col(column);
  }
  scores += score * score.transpose();
  covariance.likelihood(free, free) = inverse;
  covariance.scatter(free, free) = inverse * scores(free, free) * inverse;
  return covariance;
}

/// Profile of the deviance along one power.
class Profile {
 public:
  Profile(const SpectrumSums& sums, const TermDescription& description, Index term, unsigned held)
      : sums_(sums), description_(description), term_(term), held_(held | 1U << term) {}

  double deviance(double power) const {
    VectorXd start = description_.fit.power;
    start(term_) = power;
    if (!(start.sum() > 0)) {
      start = starting_powers(sums_, description_.density, held_);
      start(term_) = power;
    }
    return fit_powers(sums_, description_.density, start, held_).deviance;
  }

  /// Power above the best one at which the deviance has risen by `rise`; `unit` a first guess of
  /// the distance.
  double upper(double rise, double unit) const {
    const double best = description_.fit.power(term_);
    const double limit = description_.fit.deviance + rise;
    double low = best;
    double high = best + std::max(unit, 1e-3 * best);
    for (int doublings = 0; deviance(high) < limit && doublings < 40; ++doublings) {
      low = high;
      high = best + 2 * (high - best);
    }
    return bisect(low, high, limit);
  }

  /// The same below; 0 when even that does not raise the deviance so much.
  double lower(double rise) const {
    const double limit = description_.fit.deviance + rise;
    if (deviance(0) < limit) return 0;
    return bisect(description_.fit.power(term_), 0, limit);
  }

 private:
  double bisect(double inside, double outside, double limit) const {
    for (int i = 0; i < 14; ++i) {
      const double middle = 0.5 * (inside + outside);
      (deviance(middle) < limit ? inside : outside) = middle;
    }
    return 0.5 * (inside + outside);
  }

  const SpectrumSums& sums_;
  const TermDescription& description_;
  Index term_;
  unsigned held_;
};

/// Value, uncertainty, presence and limit of one of Q, N, B, K. `inflation`: of its uncertainty by
/// misfit.
NoiseTerm judge_term(const SpectrumSums& sums, const TermDescription& description,
                     const MatrixXd& covariance, double information, Index term, double inflation) {
  const double power = description.fit.power(term);
  const double factor = square(inflation);
  const Profile profile(sums, description, term, 0);
  NoiseTerm result;
  result.value = std::sqrt(power);
  const double unit = inflation / std::sqrt(std::max(information, 1e-300));
  result.upper_limit = std::sqrt(profile.upper(kOneSided95 * factor, unit));
  if (!(power > 0)) {
    result.u = result.upper_limit / 1.645;  // half-normal about zero with the same upper limit
    return result;
  }
  result.u = inflation * std::sqrt(covariance(term, term)) / (2 * result.value);
  const double gain = profile.deviance(0) - description.fit.deviance;
  result.present = gain > kVarianceGain * factor;
  if (result.value < 6 * result.u) {
    // The likelihood is not a parabola here: the wider side counts.
    const double above = std::sqrt(profile.upper(kTwoSided95 * factor, unit)) - result.value;
    const double below = result.value - std::sqrt(profile.lower(kTwoSided95 * factor));
    result.u = std::max({result.u * (result.present ? 1 : 0), above / 1.96, below / 1.96});
  }
  return result;
}

/// Adds to the uncertainties what depends on the choice of terms.
void add_choice(const SpectrumSums& sums, const TermChoice& choice, RecordTerms& result) {
  Eigen::Vector4d square_u = choice.spread;
  // Relaxation processes side by side are flicker, and a slow one is a walk: where the terms
  // without them are a fair description, too, it counts in full.
  constexpr double kFair = 1.5;
  if (!choice.chosen.shape.markov_tau_s.empty() &&
      misfit_of(sums, choice.without_markov).worst_ratio < kFair) {
    for (const Index i : {Index{kTermB}, Index{kTermK}})
      square_u(i) += square(std::sqrt(choice.without_markov.fit.power(i)) -
                            std::sqrt(choice.chosen.fit.power(i)));
  }
  for (Index i = 0; i < kVariances; ++i) {
    NoiseTerm& term = result.term[static_cast<std::size_t>(i)];
    term.u = std::sqrt(square(term.u) + square_u(i));
    term.present = term.present && term.value > 1.645 * term.u;
    if (square_u(i) > 0.01 * square(term.u))
      term.upper_limit = std::max(term.upper_limit, term.value + 1.645 * term.u);
  }
}

/// What rounding does to the uncertainties; true where the step is too coarse for the noise.
bool add_rounding(double rate_hz, RecordTerms& result) {
  if (!(result.step > 0)) return false;
  NoiseTerm& white = result.term[kTermN];
  // The converter's own share of the white noise is step²/12 (Sheppard). Whether it belongs to N
  // depends on what N is taken to be of, the record or the sensor.
  const double rounding = square(result.step) / 12 / rate_hz;
  const double sensor = std::sqrt(std::max(0.0, square(white.value) - rounding));
  white.u = std::hypot(white.u, (white.value - sensor) / std::sqrt(3.0));
  white.upper_limit = std::max(white.upper_limit, white.value + 1.645 * white.u);
  const double sigma = white.value * std::sqrt(rate_hz);
  if (sigma > 0.5 * result.step) return false;
  // With less noise than this the rounding error is neither white nor independent of the signal.
  white.u = std::hypot(white.u, 0.3 * result.step / std::sqrt(rate_hz));
  for (const std::size_t i : {kTermB, kTermK}) {
    NoiseTerm& term = result.term[i];
    term.u = std::hypot(term.u, 0.5 * term.value);
    term.upper_limit = std::max(term.upper_limit, term.value + 1.645 * term.u);
  }
  return true;
}

std::string remark_on(const RecordTerms& terms, const Misfit& misfit, bool rolls_off, bool coarse) {
  std::string remark;
  char text[160];
  if (!terms.lines.empty()) {
    const SpectralLine& line = terms.lines.front();
    std::snprintf(text, sizeof text, "a periodic line at %.4g Hz, amplitude %.3g, is not noise",
                  line.f_hz, line.amplitude);
    add_remark(remark, text);
    std::size_t harmonics = 0;
    for (const SpectralLine& other : terms.lines) harmonics += other.harmonic > 1 ? 1 : 0;
    if (terms.lines.size() > 1) {
      std::snprintf(text, sizeof text, "%zu lines in all, %zu of them harmonics",
                    terms.lines.size(), harmonics);
      add_remark(remark, text);
    }
  }
  if (rolls_off) {
    std::snprintf(text, sizeof text,
                  "the spectrum falls above %.3g Hz as no term does: the terms hold below",
                  terms.band_hz);
    add_remark(remark, text);
  }
  if (coarse) {
    std::snprintf(text, sizeof text, "the noise is below half a step of the values (%.3g)",
                  terms.step);
    add_remark(remark, text);
  }
  if (!misfit.adequate()) {
    std::snprintf(text, sizeof text, "the terms do not describe the spectrum of this record");
    add_remark(remark, text);
  }
  return remark;
}

}  // namespace

double value_step(const std::vector<double>& record) {
  std::vector<double> values(record);
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  if (values.size() < 2 || values.size() * 4 > record.size()) return 0;
  // The smallest difference, made precise by ever longer multiples of it.
  double step = kUnbounded;
  const double noise = 1e-9 * (values.back() - values.front());
  for (std::size_t i = 1; i < values.size(); ++i)
    if (values[i] - values[i - 1] > noise) step = std::min(step, values[i] - values[i - 1]);
  if (!std::isfinite(step)) return 0;
  double multiples = 0;
  double covered = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double difference = values[i] - values[i - 1];
    const double whole = std::round(difference / step);
    if (std::abs(difference - whole * step) > 0.1 * step) return 0;
    multiples += whole;
    covered += difference;
  }
  return multiples > 0 ? covered / multiples : 0;
}

RecordTerms describe_record(const LineSearch& search, const std::vector<double>& record,
                            double rate_hz) {
  RecordTerms result;
  result.lines = search.lines;
  result.step = value_step(record);

  result.band_hz = find_band_hz(search.spectrum, rate_hz, search.masked);
  const bool rolls_off = result.band_hz < 0.49 * rate_hz;
  const SpectrumSums whole = gather_spectrum(search.spectrum, rate_hz, search.masked,
                                             rolls_off ? result.band_hz : kUnbounded);
  SpectrumSums sums = whole;
  TermChoice choice = choose_terms(sums, !rolls_off);
  Misfit all = misfit_of(sums, choice.chosen);
  for (int round = 0; round < 2 && all.doubtful(); ++round) {
    SpectrumSums fewer = without_humps(whole, choice.chosen);
    if (fewer.bins.size() == sums.bins.size()) break;
    sums = std::move(fewer);
    choice = choose_terms(sums, !rolls_off);
  }
  const TermDescription& chosen = choice.chosen;
  const Misfit misfit = misfit_of(sums, chosen);
  if (sums.bins.size() < whole.bins.size())
    all = measure_misfit(whole, shape_densities(whole, chosen.shape).transpose() * chosen.fit.power,
                         chosen.fit.slope, chosen.parameters());
  const Covariance covariances = parameter_covariance(sums, chosen);
  const MatrixXd& covariance = covariances.likelihood;
  // Where the terms do not describe the record, a term is as uncertain as the octaves that it
  // rests on are far off. Few octaves say so, hence the factor.
  const auto inflation = [&](Index i) {
    constexpr double kFewOctaves = 1.5;
    if (!misfit.doubtful() || !(covariance(i, i) > 0)) return 1.0;
    return std::max(1.0, kFewOctaves * std::sqrt(covariances.scatter(i, i) / covariance(i, i)));
  };
  double general = 1;  // for what has no score of its own
  if (misfit.doubtful())
    for (Index i = 0; i < covariance.rows(); ++i) general = std::max(general, inflation(i));
  const MatrixXd information = fisher_information(sums, chosen.density, chosen.variance());

  for (Index i = 0; i < kVariances; ++i)
    result.term[static_cast<std::size_t>(i)] =
        judge_term(sums, chosen, covariance, information(i, i), i,
                   chosen.fit.power(i) > 0 ? inflation(i) : general);
  result.flicker_low_hz = chosen.shape.flicker_low_hz;
  result.flicker_high_hz = chosen.shape.flicker_high_hz;

  NoiseTerm& ramp = result.term[kTermR];
  ramp.value = std::abs(chosen.fit.slope);
  ramp.u = general * std::sqrt(chosen.fit.slope_variance);
  ramp.present = square(ramp.value) > kRampGain * square(ramp.u);
  ramp.upper_limit = ramp.value + 1.645 * ramp.u;

  const Index terms = chosen.fit.power.size();
  for (std::size_t j = 0; j < chosen.shape.markov_tau_s.size(); ++j) {
    const auto i = kVariances + static_cast<Index>(j);
    const auto log_tau = terms + static_cast<Index>(j);
    if (!(chosen.fit.power(i) > 0)) continue;
    MarkovTerm term;
    term.sigma = std::sqrt(chosen.fit.power(i));
    term.u = inflation(i) * std::sqrt(covariance(i, i)) / (2 * term.sigma);
    term.tau_s = chosen.shape.markov_tau_s[j];
    term.u_tau_s = inflation(log_tau) * term.tau_s * std::sqrt(covariance(log_tau, log_tau));
    result.markov.push_back(term);
  }
  std::sort(result.markov.begin(), result.markov.end(),
            [](const MarkovTerm& a, const MarkovTerm& b) { return a.tau_s < b.tau_s; });

  add_choice(sums, choice, result);

  for (Index i = 0; i < kVariances; ++i)
    for (Index j = 0; j < kVariances; ++j)
      if (covariance(i, i) > 0 && covariance(j, j) > 0)
        result.correlation(i, j) =
            covariance(i, j) / std::sqrt(covariance(i, i) * covariance(j, j));
  if (ramp.u > 0) result.correlation(kTermR, kTermR) = 1;

  result.chi2 = all.chi2;
  result.dof = all.dof;
  result.p_value = all.p_value();
  result.adequate = chosen.fit.converged && all.adequate() && !rolls_off;
  result.p_value_without_lines = result.p_value;
  result.adequate_without_lines = result.adequate && search.lines.empty();
  if (!search.lines.empty()) {
    double least = 1;
    for (const SpectralLine& line : search.lines) least = std::min(least, line.p_value);
    result.p_value_without_lines = least;
  }
  const bool coarse = add_rounding(rate_hz, result);
  result.adequate = result.adequate && !coarse;
  result.remark = remark_on(result, all, rolls_off, coarse);
  return result;
}

namespace {

/// Of a Gauss-Markov process of variance 1.
double markov_allan_variance(double tau_s, double correlation_s) {
  const double x = tau_s / correlation_s;
  if (x < 1e-3) return x / 3;
  return 2 / x * (1 - (3 - 4 * std::exp(-x) + std::exp(-2 * x)) / (2 * x));
}

/// Of flicker with coefficient 1 U between the limits that the record shows.
double flicker_allan_variance(const RecordTerms& terms, double tau_s) {
  using std::numbers::ln2;
  using std::numbers::pi;
  if (terms.flicker_low_hz == 0 && !std::isfinite(terms.flicker_high_hz)) return 2 * ln2 / pi;
  // The continuum of relaxation processes, two in an octave.
  const double step = 0.5 * ln2;
  const double low = std::log(terms.flicker_low_hz > 0 ? terms.flicker_low_hz : 1e-5 / tau_s);
  const double high =
      std::log(std::isfinite(terms.flicker_high_hz) ? terms.flicker_high_hz : 1e5 / tau_s);
  const auto processes = std::lround((high - low) / step);
  double variance = 0;
  for (long k = 0; k < processes; ++k) {
    const double hz = std::exp(low + (static_cast<double>(k) + 0.5) * step);
    variance += step / pi * markov_allan_variance(tau_s, 1 / (2 * pi * hz));
  }
  return variance;
}

}  // namespace

AllanParts allan_parts_of(const RecordTerms& terms, double tau_s) {
  const auto power = [&](std::size_t i) { return square(terms.term[i].value); };
  AllanParts parts;
  parts.term[kTermQ] = 3 * power(kTermQ) / square(tau_s);
  parts.term[kTermN] = power(kTermN) / tau_s;
  parts.term[kTermB] = power(kTermB) * flicker_allan_variance(terms, tau_s);
  parts.term[kTermK] = power(kTermK) * tau_s / 3;
  parts.term[kTermR] = 0.5 * power(kTermR) * square(tau_s);
  for (const MarkovTerm& term : terms.markov)
    parts.markov.push_back(square(term.sigma) * markov_allan_variance(tau_s, term.tau_s));
  for (const SpectralLine& line : terms.lines) {
    const double x = std::numbers::pi * line.f_hz * tau_s;
    parts.lines += square(line.amplitude * square(std::sin(x)) / x);
  }
  return parts;
}

double allan_deviation_of(const RecordTerms& terms, double tau_s) {
  const AllanParts parts = allan_parts_of(terms, tau_s);
  double variance = parts.lines;
  for (const double part : parts.term) variance += part;
  for (const double part : parts.markov) variance += part;
  return std::sqrt(variance);
}

}  // namespace plumbline
