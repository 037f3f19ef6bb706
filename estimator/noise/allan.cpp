#include "estimator/noise/allan.h"

#include <Eigen/Core>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include "estimator/noise/chi_squared.h"
#include "estimator/noise/difference_sums.h"
#include "estimator/noise/edf.h"
#include "estimator/parallel_for.h"

namespace plumbline {

namespace {

/// A mean square before the square root.
struct Variance {
  double sum = 0;
  std::size_t count = 0;
  double scale = 1;  ///< deviation² = sum / count · scale
};

/// Sum of squares of second (order 2) or third (order 3) differences over lag m, every `stride`.
Variance difference_variance(const std::vector<double>& x, std::size_t m, int order,
                             std::size_t stride) {
  Variance result;
  const std::size_t reach = static_cast<std::size_t>(order) * m;
  if (x.size() <= reach) return result;
  const std::size_t places = x.size() - reach;
  if (stride == 1) {
    // Blocks keep the four streams in cache and the rounding of the sum small.
    constexpr std::size_t kBlock = 4096;
    using Map = Eigen::Map<const Eigen::ArrayXd>;
    for (std::size_t begin = 0; begin < places; begin += kBlock) {
      const auto size = static_cast<Eigen::Index>(std::min(kBlock, places - begin));
      const Map a(x.data() + begin, size);
      const Map b(x.data() + begin + m, size);
      const Map c(x.data() + begin + 2 * m, size);
      if (order == 2) {
        result.sum += (c - 2 * b + a).square().sum();
      } else {
        const Map d(x.data() + begin + 3 * m, size);
        result.sum += (d - 3 * (c - b) - a).square().sum();
      }
    }
    result.count = places;
    return result;
  }
  for (std::size_t i = 0; i < places; i += stride) {
    const double difference = order == 2 ? x[i + 2 * m] - 2 * x[i + m] + x[i]
                                         : x[i + 3 * m] - 3 * (x[i + 2 * m] - x[i + m]) - x[i];
    result.sum += difference * difference;
    ++result.count;
  }
  return result;
}

/// Second differences over lag m of the phase averaged over m points.
Variance modified_variance(const std::vector<double>& x, std::size_t m) {
  Variance result;
  if (x.size() < 3 * m) return result;
  const auto second = [&](std::size_t i) { return x[i + 2 * m] - 2 * x[i + m] + x[i]; };
  double window = 0;
  for (std::size_t i = 0; i < m; ++i) window += second(i);
  const std::size_t places = x.size() - 3 * m + 1;
  for (std::size_t j = 0;; ++j) {
    result.sum += window * window;
    if (j + 1 == places) break;
    window += second(j + m) - second(j);
  }
  result.count = places;
  result.scale = 1 / (static_cast<double>(m) * static_cast<double>(m));
  return result;
}

/// Second differences of the phase continued at both ends by its point reflection.
Variance total_variance(const std::vector<double>& x, std::size_t m) {
  Variance result;
  const std::size_t n = x.size();
  if (n < 3 || m + 2 > n) return result;
  const auto last = static_cast<std::ptrdiff_t>(n) - 1;
  const auto lag = static_cast<std::ptrdiff_t>(m);
  const auto continued = [&](std::ptrdiff_t i) {
    if (i < 0) return 2 * x.front() - x[static_cast<std::size_t>(-i)];
    if (i > last) return 2 * x.back() - x[static_cast<std::size_t>(2 * last - i)];
    return x[static_cast<std::size_t>(i)];
  };
  for (std::ptrdiff_t i = 1; i < last; ++i) {
    const double d = continued(i - lag) - 2 * x[static_cast<std::size_t>(i)] + continued(i + lag);
    result.sum += d * d;
  }
  result.count = n - 2;
  return result;
}

/// Hadamard total variance (SP 1065, section 5.2.14): every run of 3m rates, freed of its half
/// average slope, is continued at both ends by its mirror image, and all Hadamard differences
/// within are averaged. The sum holds the mean square of each run.
Variance hadamard_total_variance(const std::vector<double>& x, std::size_t m) {
  Variance result;
  const std::size_t rates = x.size() - 1;
  if (rates < 3 * m) return result;
  if (m == 1) return difference_variance(x, 1, 3, 1);
  const std::size_t run = 3 * m;
  std::vector<double> y(run);
  std::vector<double> phase(3 * run + 1);
  for (std::size_t begin = 0; begin + run <= rates; ++begin) {
    for (std::size_t i = 0; i < run; ++i) y[i] = x[begin + i + 1] - x[begin + i];
    // Half-average slope; the middle point of an odd run belongs to neither half.
    const std::size_t half = run / 2;
    const std::size_t offset = run - half;
    double difference = 0;
    for (std::size_t i = 0; i < half; ++i) difference += y[i + offset] - y[i];
    const double slope = difference / static_cast<double>(half) / static_cast<double>(offset);
    for (std::size_t i = 0; i < run; ++i) y[i] -= slope * static_cast<double>(i);
    phase[0] = 0;
    for (std::size_t i = 0; i < 3 * run; ++i) {
      const double rate = i < run ? y[run - 1 - i] : i < 2 * run ? y[i - run] : y[3 * run - 1 - i];
      phase[i + 1] = phase[i] + rate;
    }
    // 6m differences that start within the extended run.
    double sum = 0;
    for (std::size_t i = 0; i < 2 * run; ++i) {
      const double d = phase[i + 3 * m] - 3 * (phase[i + 2 * m] - phase[i + m]) - phase[i];
      sum += d * d;
    }
    result.sum += sum / static_cast<double>(2 * run);
    ++result.count;
  }
  return result;
}

Variance overlapping_variance(const std::vector<double>& x, std::size_t m) {
  Variance result;
  if (x.size() <= 2 * m) return result;
  result.sum = second_difference_sums(x, {m}).front();
  result.count = x.size() - 2 * m;
  return result;
}

Variance variance_of(Deviation kind, const std::vector<double>& phase, std::size_t m) {
  switch (kind) {
    case Deviation::adev:
      return difference_variance(phase, m, 2, m);
    case Deviation::oadev:
      return overlapping_variance(phase, m);
    case Deviation::mdev:
    case Deviation::tdev:
      return modified_variance(phase, m);
    case Deviation::hdev:
      return difference_variance(phase, m, 3, m);
    case Deviation::ohdev:
      return difference_variance(phase, m, 3, 1);
    case Deviation::totdev:
      return total_variance(phase, m);
    case Deviation::htotdev:
      return hadamard_total_variance(phase, m);
  }
  return {};
}

bool is_hadamard(Deviation kind) {
  return kind == Deviation::hdev || kind == Deviation::ohdev || kind == Deviation::htotdev;
}

DeviationPoint deviation_of(Deviation kind, const Variance& variance, double rate_hz,
                            std::size_t m) {
  DeviationPoint point;
  if (variance.count == 0) return point;
  const double tau = static_cast<double>(m) / rate_hz;
  const double factor = (is_hadamard(kind) ? 1.0 / 6 : 1.0 / 2) * variance.scale;
  point.value = std::sqrt(factor * variance.sum / static_cast<double>(variance.count)) / tau;
  if (kind == Deviation::tdev) point.value *= tau / std::sqrt(3.0);
  point.n = static_cast<long long>(variance.count);
  return point;
}

std::size_t largest_factor(Deviation kind, std::size_t rates) {
  if (kind == Deviation::totdev) return rates / 2;
  if (kind == Deviation::htotdev) return rates / 3;
  return rates / 4;
}

}  // namespace

std::vector<std::size_t> averaging_factors(Deviation kind, std::size_t rates, TauSpacing spacing) {
  const std::size_t largest = largest_factor(kind, rates);
  std::vector<std::size_t> factors;
  if (largest == 0) return factors;
  if (spacing == TauSpacing::all) {
    factors.resize(largest);
    std::iota(factors.begin(), factors.end(), std::size_t{1});
  } else if (spacing == TauSpacing::octave) {
    for (std::size_t m = 1; m <= largest; m *= 2) factors.push_back(m);
  } else {
    constexpr int kPoints = 100;
    for (int i = 0; i < kPoints; ++i) {
      const auto m = static_cast<std::size_t>(std::lround(
          std::pow(static_cast<double>(largest), static_cast<double>(i) / (kPoints - 1))));
      if (factors.empty() || m > factors.back()) factors.push_back(m);
    }
  }
  return factors;
}

std::vector<double> integrate_record(const std::vector<double>& record, double rate_hz) {
  assert(rate_hz > 0);
  std::vector<double> phase(record.size() + 1);
  if (record.empty()) return phase;
  // The mean relative to the first value: an offset of 1e7 with noise of 1e-3 keeps its digits.
  const double first = record.front();
  double mean = 0;
  for (const double y : record) mean += y - first;
  mean = first + mean / static_cast<double>(record.size());
  double sum = 0;
  for (std::size_t i = 0; i < record.size(); ++i) {
    sum += record[i] - mean;
    phase[i + 1] = sum / rate_hz;
  }
  return phase;
}

DeviationPoint deviation_at(Deviation kind, const std::vector<double>& phase, double rate_hz,
                            std::size_t m) {
  assert(rate_hz > 0 && m >= 1);
  return deviation_of(kind, variance_of(kind, phase, m), rate_hz, m);
}

std::vector<DeviationPoint> deviations_at(Deviation kind, const std::vector<double>& phase,
                                          double rate_hz, const std::vector<std::size_t>& factors,
                                          bool all_cores) {
  std::vector<DeviationPoint> points(factors.size());
  if (kind == Deviation::oadev) {
    const std::vector<double> sums = second_difference_sums(phase, factors, all_cores);
    for (std::size_t j = 0; j < factors.size(); ++j) {
      Variance variance;
      variance.sum = sums[j];
      if (phase.size() > 2 * factors[j]) variance.count = phase.size() - 2 * factors[j];
      points[j] = deviation_of(kind, variance, rate_hz, factors[j]);
    }
    return points;
  }
  const auto work = [&](std::size_t j) {
    points[j] = deviation_at(kind, phase, rate_hz, factors[j]);
  };
  if (all_cores)
    parallel_for(factors.size(), work);
  else
    for (std::size_t j = 0; j < factors.size(); ++j) work(j);
  return points;
}

DeviationCurve deviation_curve(Deviation kind, const std::vector<double>& phase, double rate_hz,
                               TauSpacing spacing, double confidence) {
  DeviationCurve curve;
  if (phase.size() < 3) return curve;
  const double tail = 0.5 * (1 - confidence);
  const std::vector<std::size_t> factors = averaging_factors(kind, phase.size() - 1, spacing);
  const std::vector<DeviationPoint> points = deviations_at(kind, phase, rate_hz, factors);
  int alpha = 0;
  for (std::size_t j = 0; j < factors.size() && points[j].n > 0; ++j) {
    const std::size_t m = factors[j];
    const double value = points[j].value;
    alpha = noise_exponent(phase, m, is_hadamard(kind) ? 3 : 2, alpha);
    const double edf = equivalent_degrees_of_freedom(kind, alpha, m, phase.size());
    curve.tau_s.push_back(static_cast<double>(m) / rate_hz);
    curve.n.push_back(points[j].n);
    curve.value.push_back(value);
    curve.lower.push_back(value * std::sqrt(edf / chi_squared_quantile(1 - tail, edf)));
    curve.upper.push_back(value * std::sqrt(edf / chi_squared_quantile(tail, edf)));
  }
  return curve;
}

DeviationSet all_deviations(const std::vector<double>& record, double rate_hz) {
  const std::vector<double> phase = integrate_record(record, rate_hz);
  return {deviation_curve(Deviation::adev, phase, rate_hz),
          deviation_curve(Deviation::oadev, phase, rate_hz),
          deviation_curve(Deviation::mdev, phase, rate_hz),
          deviation_curve(Deviation::hdev, phase, rate_hz),
          deviation_curve(Deviation::totdev, phase, rate_hz)};
}

}  // namespace plumbline
