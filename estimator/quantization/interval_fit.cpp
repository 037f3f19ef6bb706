#include "estimator/quantization/interval_fit.h"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>

#include "estimator/noise/chi_squared.h"

namespace plumbline {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A code boundary in standard deviations of the noise, and the probability beyond it on the side
/// away from zero.
struct Edge {
  double z = 0;
  double tail = 0;
};

Edge edge_at(double z) { return {z, normal_below(-std::abs(z))}; }

/// log P(low < z < high) of the standard normal distribution, also far out in the tails.
double log_between(const Edge& low, const Edge& high) {
  const bool same_side = (low.z > 0) == (high.z > 0);
  const double inside = same_side ? std::abs(high.tail - low.tail) : 1 - (low.tail + high.tail);
  if (inside > 1e-290) return std::log(inside);
  // Mills' ratio.
  const double nearer = std::min(std::abs(low.z), std::abs(high.z));
  return -0.5 * nearer * nearer - std::log(nearer) - 0.918938533204672742;
}

/// log(eᵃ + eᵇ).
double log_of_sum(double a, double b) {
  return std::max(a, b) + std::log1p(std::exp(-std::abs(a - b)));
}

/// Noise of one reading, steps: a share of the readings, zero or a few in a thousand, has noise
/// that is kWider times as large (Tukey's contaminated normal distribution).
struct ReadingNoise {
  double sigma = 0;
  double contamination = 0;
};
/// What recorded sensors show beyond 4 standard deviations (ADIS16405: 3 to 15 readings in 10 000,
/// and of those every third beyond 5). Where the noise is a tenth of a step, one such reading says
/// otherwise that the edge of a code is near.
constexpr double kContamination = 0.005;
constexpr double kWider = 3;
/// What contamination must gain of the log evidence: it costs what single readings beyond an edge
/// say.
constexpr double kContaminationGain = 6;
/// Of the readings of a pose, off the most frequent code: where more are, it is not by accident.
constexpr double kMostOff = 0.05;

double log_between(const Edge& low, const Edge& high, double contamination) {
  const double clean = log_between(low, high);
  if (contamination == 0) return clean;
  return log_of_sum(
      std::log1p(-contamination) + clean,
      std::log(contamination) + log_between(edge_at(low.z / kWider), edge_at(high.z / kWider)));
}

/// log-likelihood of a pose's codes when its true output is u.
double log_likelihood(const CodeCounts& codes, double u, const ReadingNoise& noise) {
  double sum = 0, last_code = -kInfinity;
  Edge high;
  for (std::size_t i = 0; i < codes.count.size(); ++i) {
    const auto& [code, count] = codes.count[i];
    const bool adjacent = code == last_code + 1;  // its boundary is that of the code before
    const Edge low = adjacent                     ? high
                     : codes.at_low_end && i == 0 ? edge_at(-kInfinity)
                                                  : edge_at((code - 0.5 - u) / noise.sigma);
    high = codes.at_high_end && i + 1 == codes.count.size()
               ? edge_at(kInfinity)
               : edge_at((code + 0.5 - u) / noise.sigma);
    sum += count * log_between(low, high, noise.contamination);
    last_code = code;
  }
  return sum;
}

/// Zeroth (log), first and second central moment of N(u; mean, variance) × likelihood.
struct TiltedMoments {
  double log_mass = 0;
  double mean = 0;
  double variance = 0;
};

TiltedMoments integrate(const CodeCounts& codes, const ReadingNoise& noise, double mean,
                        double variance) {
  constexpr int kPoints = 32;
  constexpr double kWidth = 6;        // standard deviations
  constexpr double kNegligible = 18;  // in log
  const double sd = std::sqrt(variance);
  // Where both factors can be felt: within the Gaussian, and near the codes that were seen.
  const double reach = kWidth * noise.sigma;
  double low =
      std::max(mean - kWidth * sd, std::min(codes.count.front().first - 0.5 - reach, mean));
  double high =
      std::min(mean + kWidth * sd, std::max(codes.count.back().first + 0.5 + reach, mean));
  std::array<double, kPoints + 1> log_density{};
  double top = -kInfinity;
  for (int zoom = 0; zoom < 6; ++zoom) {
    const double step = (high - low) / kPoints;
    top = -kInfinity;
    for (int i = 0; i <= kPoints; ++i) {
      const double u = low + step * i;
      const double z = (u - mean) / sd;
      double& value = log_density[static_cast<std::size_t>(i)];
      value = -0.5 * z * z + log_likelihood(codes, u, noise);
      top = std::max(top, value);
    }
    int first = 0, last = kPoints;
    while (first < last && log_density[static_cast<std::size_t>(first)] < top - kNegligible)
      ++first;
    while (last > first && log_density[static_cast<std::size_t>(last)] < top - kNegligible) --last;
    if (last - first > kPoints / 3) break;
    high = low + step * std::min(kPoints, last + 1);
    low = low + step * std::max(0, first - 1);
  }
  const double step = (high - low) / kPoints;
  double mass = 0, first_moment = 0, second_moment = 0;
  for (int i = 0; i <= kPoints; ++i) {
    const double end = i == 0 || i == kPoints ? 0.5 : 1;
    const double weight = end * std::exp(log_density[static_cast<std::size_t>(i)] - top);
    const double d = low + step * i - mean;
    mass += weight;
    first_moment += weight * d;
    second_moment += weight * d * d;
  }
  const double shift = first_moment / mass;
  return {top + std::log(mass * step / (sd * std::sqrt(2 * std::numbers::pi))), mean + shift,
          std::max(second_moment / mass - shift * shift, 1e-12 * variance)};
}

/// Readings on the most frequent code, and in all.
struct Agreement {
  double most = 0, readings = 0;
};
Agreement agreement_of(const CodeCounts& codes) {
  Agreement agreement;
  for (const auto& [code, count] : codes.count) {
    agreement.most = std::max(agreement.most, count);
    agreement.readings += count;
  }
  return agreement;
}

/// Whether readings of the pose may be of those with wider noise: some, but few do not agree.
bool may_be_contaminated(const CodeCounts& codes) {
  const auto [most, readings] = agreement_of(codes);
  return most < readings && readings - most <= kMostOff * readings;
}

/// What is left of the readings off the most frequent code: each with the probability that it is
/// not one of those with wider noise.
CodeCounts without_contamination(CodeCounts codes, const ReadingNoise& noise, double mean,
                                 double variance) {
  const double sd = std::sqrt(noise.sigma * noise.sigma + variance);
  const double most = agreement_of(codes).most;
  for (auto& [code, count] : codes.count) {
    if (count == most) continue;
    const Edge low = edge_at((code - 0.5 - mean) / sd), high = edge_at((code + 0.5 - mean) / sd);
    count *= std::exp(std::log1p(-noise.contamination) + log_between(low, high) -
                      log_between(low, high, noise.contamination));
  }
  return codes;
}

/// With contamination the likelihood is no longer concave in log, as Gaussian sites need it: the
/// moments are those that remain without the contamination expected at the prior.
TiltedMoments moments_of(const CodeCounts& codes, const ReadingNoise& noise, double mean,
                         double variance) {
  const ReadingNoise clean{noise.sigma, 0};
  if (noise.contamination == 0 || !may_be_contaminated(codes))
    return integrate(codes, clean, mean, variance);
  TiltedMoments moments =
      integrate(without_contamination(codes, noise, mean, variance), clean, mean, variance);
  moments.log_mass = integrate(codes, noise, mean, variance).log_mass;
  return moments;
}

/// Expectation propagation at given sigma and scatter.
class Propagation {
 public:
  Propagation(const Eigen::MatrixXd& A, const std::vector<CodeCounts>& codes,
              const Eigen::VectorXd& known_variance, const Eigen::VectorXd& known)
      : A_(A), codes_(codes), known_variance_(known_variance), known_(known) {
    mean_.resize(A.rows());
    for (Eigen::Index k = 0; k < A.rows(); ++k)
      mean_(k) = codes[static_cast<std::size_t>(k)].mean - known(k);
    reset();
  }

  void reset() {
    precision_ = (known_variance_.array() + 1.0 / 12).inverse();
    shift_ = precision_.cwiseProduct(mean_);
  }

  /// Evidence (log, but for a constant). Starts from the sites as they are.
  double run(const ReadingNoise& noise, double scatter, int most_sweeps) {
    double evidence = -kInfinity;
    converged = false;
    for (int sweep = 0; sweep < most_sweeps && !converged; ++sweep) {
      const double last = evidence;
      evidence = sweep_once(noise, scatter * scatter, sweep == 0 ? 1.0 : 0.8);
      converged = std::abs(evidence - last) < 2e-3;
    }
    return evidence;
  }

  void solve() {
    const Eigen::MatrixXd weighted = precision_.asDiagonal() * A_;
    covariance = Eigen::Matrix4d(A_.transpose() * weighted).inverse();
    value = covariance * (A_.transpose() * shift_);
  }

  Eigen::VectorXd equivalent_variance() const { return precision_.cwiseInverse(); }
  Eigen::VectorXd equivalent_mean() const { return known_ + shift_.cwiseQuotient(precision_); }

  Eigen::Vector4d value;
  Eigen::Matrix4d covariance;
  bool converged = false;

 private:
  double sweep_once(const ReadingNoise& noise, double scatter2, double damping) {
    solve();
    double evidence = 0.5 * std::log(covariance.determinant());
    for (Eigen::Index k = 0; k < A_.rows(); ++k) {
      const Eigen::Vector4d row = A_.row(k).transpose();
      const double variance = row.dot(covariance * row), mean = row.dot(value);
      const double free = 1 / variance - precision_(k);
      if (!(free > 1e-9 / variance)) continue;  // this pose alone determines a direction
      const double cavity_variance = 1 / free;
      const double cavity_mean = cavity_variance * (mean / variance - shift_(k));
      const double total = cavity_variance + known_variance_(k) + scatter2;
      const TiltedMoments tilted =
          moments_of(codes_[static_cast<std::size_t>(k)], noise, known_(k) + cavity_mean, total);
      // The old site as it stands in the evidence …
      const double old_variance = 1 / precision_(k), old_mean = shift_(k) / precision_(k);
      const double spread = cavity_variance + old_variance;
      const double from_fit = old_mean - mean, from_cavity = old_mean - cavity_mean;
      evidence += tilted.log_mass + 0.5 * std::log(spread) +
                  0.5 * from_cavity * from_cavity / spread + 0.5 * std::log(precision_(k)) -
                  0.5 * precision_(k) * from_fit * from_fit;
      // … and the new one: derivatives of the log mass by the mean.
      const double slope = (tilted.mean - known_(k) - cavity_mean) / total;
      const double curvature = (1 - tilted.variance / total) / total;
      const double rest = 1 - curvature * cavity_variance;
      const double precision = std::max(curvature / std::max(rest, 1e-6), 1e-6);
      const double shift = curvature > 1e-9 ? precision * (cavity_mean + slope / curvature)
                                            : slope + precision * cavity_mean;
      precision_(k) += damping * (precision - precision_(k));
      shift_(k) += damping * (shift - shift_(k));
    }
    return evidence;
  }

  const Eigen::MatrixXd& A_;
  const std::vector<CodeCounts>& codes_;
  const Eigen::VectorXd& known_variance_;
  const Eigen::VectorXd& known_;
  Eigen::VectorXd mean_;       ///< of the codes, less what is known
  Eigen::VectorXd precision_;  ///< of the sites
  Eigen::VectorXd shift_;      ///< precision × mean of the sites
};

struct Scales {
  double sigma = 0.1;
  double scatter = 0.003;
};

/// From the scatter inside the poses and, with single readings, from the residual.
Scales first_guess(const Eigen::MatrixXd& A, const std::vector<CodeCounts>& codes,
                   const Eigen::VectorXd& known) {
  double square = 0, dof = 0;
  Eigen::VectorXd mean(A.rows());
  for (Eigen::Index k = 0; k < A.rows(); ++k) {
    const CodeCounts& pose = codes[static_cast<std::size_t>(k)];
    mean(k) = pose.mean - known(k);
    double readings = 0;
    for (const auto& [code, count] : pose.count) {
      square += count * (code - pose.mean) * (code - pose.mean);
      readings += count;
    }
    dof += readings - 1;
  }
  Scales scales;
  if (dof > 0) {
    const double variance = square / dof;
    // Readings that flip between two codes now and then come from less noise than they show.
    scales.sigma = std::clamp(std::sqrt(std::max(variance - 1.0 / 12, 0.25 * variance)), 0.01, 3.0);
  } else {
    const Eigen::VectorXd residual = mean - A * A.colPivHouseholderQr().solve(mean);
    const double variance = residual.squaredNorm() / static_cast<double>(A.rows() - 4) - 1.0 / 12;
    scales.sigma = std::clamp(std::sqrt(std::max(variance, 0.0)), 0.05, 3.0);
  }
  return scales;
}

}  // namespace

CodeScale scale_of(const Adc& adc) {
  constexpr double kOffScale = 0.02;
  return {.origin_V = 0.5 * (adc.min_V + adc.max_V),
          .step_V = adc.lsb_V(),
          .off_scale = kOffScale,
          .lowest_V = adc.min_V,
          .highest_V = adc.max_V - adc.lsb_V()};
}

std::optional<std::vector<CodeCounts>> count_codes(const SampleTable& samples,
                                                   const std::vector<Pose>& poses, std::size_t axis,
                                                   const CodeScale& scale) {
  const double first = (scale.lowest_V - scale.origin_V) / scale.step_V + 0.5;
  const double last = (scale.highest_V - scale.origin_V) / scale.step_V - 0.5;
  std::vector<CodeCounts> all;
  all.reserve(poses.size());
  for (const Pose& pose : poses) {
    std::map<double, double> count;
    CodeCounts codes;
    for (std::size_t row = pose.first; row < pose.first + pose.count; ++row) {
      const double exact = (samples.u_V[axis][row] - scale.origin_V) / scale.step_V;
      const double code = std::round(exact);
      if (!(std::abs(exact - code) < scale.off_scale)) return std::nullopt;
      count[code] += 1;
      codes.mean += code / static_cast<double>(pose.count);
    }
    codes.count.assign(count.begin(), count.end());
    codes.at_low_end = codes.count.front().first < first;
    codes.at_high_end = codes.count.back().first > last;
    all.push_back(std::move(codes));
  }
  return all;
}

IntervalFit fit_intervals(const Eigen::MatrixXd& A, const std::vector<CodeCounts>& codes,
                          const Eigen::VectorXd& known_variance, const Eigen::VectorXd& known) {
  constexpr int kSearchSweeps = 6, kFinalSweeps = 40, kMostEvaluations = 64;
  constexpr double kLeastSigma = 0.002, kLeastScatter = 0.0003, kMost = 5;
  const Scales guess = first_guess(A, codes, known);
  const bool single = std::all_of(codes.begin(), codes.end(), [](const CodeCounts& pose) {
    return pose.count.size() == 1 && pose.count.front().second < 2;
  });

  // Pattern search over both logarithms; with single readings they cannot be told apart.
  Propagation search(A, codes, known_variance, known);
  std::array<double, 2> at = {std::log(guess.sigma), std::log(kLeastScatter)};
  double contamination = 0;
  const auto evidence_of = [&](const std::array<double, 2>& x) {
    return search.run({std::exp(x[0]), contamination}, std::exp(x[1]), kSearchSweeps);
  };
  double best = evidence_of(at);
  int evaluations = 1;
  const auto climb = [&](std::size_t dimensions, double first_step) {
    for (double step = first_step; step > 0.1 && evaluations < kMostEvaluations;) {
      bool better = false;
      for (std::size_t d = 0; d < dimensions; ++d) {
        for (const double sign : {-1.0, 1.0}) {
          std::array<double, 2> next = at;
          next[d] += sign * step;
          if (next[0] < std::log(kLeastSigma) || next[1] < std::log(kLeastScatter) ||
              std::max(next[0], next[1]) > std::log(kMost)) {
            continue;
          }
          const double evidence = evidence_of(next);
          ++evaluations;
          if (!(evidence > best + 1e-3)) continue;
          best = evidence;
          at = next;
          better = true;
          break;
        }
      }
      if (!better) step /= 2;
    }
  };
  climb(1, 0.8);
  if (!single) {
    // Scatter that the codes do not ask for costs precision: it has to earn its place.
    constexpr double kScatterGain = 2;
    const std::array<double, 2> without = at;
    const double evidence_without = best;
    at[1] = std::log(guess.scatter);
    best = evidence_of(at);
    climb(2, 0.8);
    if (best < evidence_without + kScatterGain) {
      at = without;
      best = evidence_without;
    }
    const std::array<double, 2> clean = at;
    const double evidence_clean = best;
    contamination = kContamination;
    best = evidence_of(at);
    if (best > evidence_clean) climb(2, 0.8);
    if (best < evidence_clean + kContaminationGain) {
      at = clean;
      contamination = 0;
    }
  }

  IntervalFit fit;
  fit.sigma = std::exp(at[0]);
  fit.scatter = std::exp(at[1]);
  search.reset();
  search.run({fit.sigma, contamination}, fit.scatter, kFinalSweeps);
  search.solve();
  fit.converged = search.converged && search.value.allFinite() && search.covariance.allFinite();
  fit.value = search.value;
  fit.covariance = search.covariance;
  fit.equivalent_mean = search.equivalent_mean();
  fit.equivalent_variance = search.equivalent_variance();
  return fit;
}

CodeSites sites_about(const Eigen::VectorXd& expected, const std::vector<CodeCounts>& codes,
                      double sigma) {
  // Steps; from far off a site is the step's whole width.
  constexpr std::array<double, 9> kOff = {0.005, 0.015, 0.05, 0.15, 0.5, 1.5, 5, 15, 50};
  constexpr double kMostVariance = 1;
  struct Weighed {
    CodeSites sites;
    Eigen::VectorXd log_mass;
    double off = 0;
    double evidence() const { return log_mass.sum(); }
  };
  const Eigen::Index n = expected.size();
  const auto set_site = [&](Weighed& at, Eigen::Index k, double contamination) {
    const double off2 = at.off * at.off;
    const TiltedMoments tilted =
        moments_of(codes[static_cast<std::size_t>(k)], {sigma, contamination}, expected(k), off2);
    at.log_mass(k) = tilted.log_mass;
    const double precision = std::max(1 / tilted.variance - 1 / off2, 1 / kMostVariance);
    // That the expectation and the site together have the mean that they have with the codes.
    at.sites.mean(k) = tilted.mean + (tilted.mean - expected(k)) / (off2 * precision);
    at.sites.variance(k) = 1 / precision;
  };
  std::vector<Weighed> clean;
  for (const double off : kOff) {
    clean.push_back({{Eigen::VectorXd(n), Eigen::VectorXd(n)}, Eigen::VectorXd(n), off});
    for (Eigen::Index k = 0; k < n; ++k) set_site(clean.back(), k, 0);
  }
  const auto likeliest = std::max_element(
      clean.begin(), clean.end(),
      [](const Weighed& a, const Weighed& b) { return a.evidence() < b.evidence(); });
  CodeSites sites = likeliest->sites;
  double to_beat = likeliest->evidence() + kContaminationGain;
  // A reading that noise alone would not carry over an edge makes all seem further off.
  for (auto it = clean.begin(); it != std::next(likeliest); ++it) {
    Weighed contaminated = *it;
    for (Eigen::Index k = 0; k < n; ++k)
      if (may_be_contaminated(codes[static_cast<std::size_t>(k)]))
        set_site(contaminated, k, kContamination);
    if (!(contaminated.evidence() > to_beat)) continue;
    to_beat = contaminated.evidence();
    sites = std::move(contaminated.sites);
  }
  return sites;
}

}  // namespace plumbline
