#include "estimator/noise/line_search.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <complex>
#include <numbers>

#include "estimator/median.h"
#include "estimator/noise/spectrum.h"
#include "estimator/noise/spectrum_fit.h"
#include "estimator/noise/spectrum_sums.h"

namespace plumbline {

namespace {

using Complex = std::complex<double>;

constexpr double kFalseAlarm = 1e-3;
constexpr std::size_t kFewestPeriods = 8;
constexpr int kPasses = 8;
constexpr std::size_t kMostLines = 40;
constexpr std::size_t kOrdinatesPerLevel = 64;  // ordinates whose median is a level
constexpr double kPi = std::numbers::pi;

/// One sine in the record: a·cos + b·sin of 2πf·i/rate, i the sample.
struct Sine {
  double f_hz = 0;
  double a = 0;
  double b = 0;
  double p_value = 1;
  double level = 0;  ///< two-sided density of the noise around it
  double amplitude() const { return std::hypot(a, b); }
};

/// Noise density around every ordinate of the periodogram, in units of |X|²/n.
struct Level {
  std::vector<double> value;  ///< of each block
  std::vector<double> m;      ///< ordinates that the level is worth
};

double blocks_of(std::size_t ordinates) {
  return std::floor(static_cast<double>(ordinates) / static_cast<double>(kOrdinatesPerLevel));
}

/// Smooth density (two-sided, times the rate) at all ordinates k·rate/n of a periodogram of length
/// n, from the noise terms fitted to the cosine spectrum.
std::vector<double> smooth_density(const std::vector<double>& c, double rate_hz,
                                   const std::vector<bool>& masked, std::size_t n) {
  const SpectrumSums sums = gather_spectrum(c, rate_hz, masked);
  const SpectrumShape shape;
  const Eigen::MatrixXd density = shape_densities(sums, shape);
  const SpectrumFit fit = fit_powers(sums, density, starting_powers(sums, density));
  const Eigen::VectorXd variance = density.transpose() * fit.power;
  // Linear between the middles of the bins; ordinate k of n is coefficient 2k·length/n.
  std::vector<double> smooth(n / 2 + 1);
  const double per_ordinate = 2 * static_cast<double>(c.size()) / static_cast<double>(n);
  std::size_t bin = 0;
  const auto middle = [&](std::size_t i) {
    return static_cast<double>(sums.bins[i].first) +
           0.5 * static_cast<double>(sums.bins[i].width - 1);
  };
  for (std::size_t k = 0; k < smooth.size(); ++k) {
    const double place = per_ordinate * static_cast<double>(k);
    while (bin + 2 < sums.bins.size() && middle(bin + 1) < place) ++bin;
    const double part =
        std::clamp((place - middle(bin)) / (middle(bin + 1) - middle(bin)), 0.0, 1.0);
    const auto i = static_cast<Eigen::Index>(bin);
    smooth[k] = (1 - part) * variance(i) + part * variance(i + 1);
  }
  return smooth;
}

Level measure_level(const std::vector<double>& ratio) {
  Level level;
  const auto blocks =
      static_cast<std::size_t>(std::max(1.0, blocks_of(ratio.size() - kFewestPeriods)));
  const auto begin_of = [&](std::size_t b) { return kFewestPeriods + b * kOrdinatesPerLevel; };
  std::vector<double> window;
  for (std::size_t b = 0; b < blocks; ++b) {
    // Three blocks where the spectrum cannot change much within them.
    const bool wide = begin_of(b) > 16 * kOrdinatesPerLevel && b + 1 < blocks;
    const std::size_t from = begin_of(wide ? b - 1 : b);
    const std::size_t to = b + 1 >= blocks ? ratio.size() - 1 : begin_of(wide ? b + 2 : b + 1);
    window.assign(ratio.begin() + static_cast<std::ptrdiff_t>(from),
                  ratio.begin() + static_cast<std::ptrdiff_t>(std::max(to, from + 1)));
    level.value.push_back(median(window) / std::numbers::ln2);
    // A median has 48 % of the efficiency of the mean.
    level.m.push_back(0.48 * static_cast<double>(window.size()));
  }
  return level;
}

struct Peak {
  double place = 0;  ///< ordinate, whole or half
  double power = 0;  ///< |X|²/n there
  double level = 0;
  double p_value = 1;
};

/// Ordinates and points half-way between them that noise alone would hardly reach.
std::vector<Peak> find_peaks(const std::vector<Complex>& X, std::size_t n,
                             const std::vector<double>& smooth) {
  const std::size_t half = n / 2;
  std::vector<double> ratio(half);
  const double scale = 1 / static_cast<double>(n);
  for (std::size_t k = 0; k < half; ++k) ratio[k] = std::norm(X[k]) * scale / smooth[k];
  std::vector<Peak> peaks;
  if (half < kFewestPeriods + kOrdinatesPerLevel / 2) return peaks;
  const Level level = measure_level(ratio);
  // Half-way points are not new ordinates, but nearly.
  const double trials = 2 * static_cast<double>(half);
  for (std::size_t k = kFewestPeriods; k + 1 < half; ++k) {
    const std::size_t block =
        std::min((k - kFewestPeriods) / kOrdinatesPerLevel, level.value.size() - 1);
    const double here = level.value[block];
    const double m = level.m[block];
    // A pure sine half-way between two ordinates stands in both with opposite sign.
    const double between = kPi * kPi / 16 * std::norm(X[k] - X[k + 1]) * scale / smooth[k];
    const bool is_half = between > ratio[k];
    const double ordinate = is_half ? between : ratio[k];
    if (ordinate < 8 * here) continue;
    const double p = trials * std::exp(-m * std::log1p(ordinate / here / m));
    if (!(p < kFalseAlarm)) continue;
    peaks.push_back(
        {static_cast<double>(k) + (is_half ? 0.5 : 0), ordinate * smooth[k], here * smooth[k], p});
  }
  std::sort(peaks.begin(), peaks.end(),
            [](const Peak& a, const Peak& b) { return a.power > b.power; });
  return peaks;
}

/// The place near `place` at which a pure sine explains most of the spectrum around it.
double refine_place(const std::vector<Complex>& X, std::size_t n, double place) {
  const auto first = static_cast<std::ptrdiff_t>(std::max(1.0, std::floor(place) - 8));
  const auto last = std::min(static_cast<std::ptrdiff_t>(std::floor(place) + 9),
                             static_cast<std::ptrdiff_t>(n / 2) - 1);
  const double nn = static_cast<double>(n);
  // Transform of exp(2πi·at/n): a phase times sin(π d)/sin(π d/n).
  const auto explained = [&](double at) {
    Complex product = 0;
    double square = 0;
    for (std::ptrdiff_t k = first; k <= last; ++k) {
      const double d = at - static_cast<double>(k);
      const double kernel = std::abs(d) < 1e-9 ? nn : std::sin(kPi * d) / std::sin(kPi * d / nn);
      product +=
          kernel * std::polar(1.0, -kPi * d * (nn - 1) / nn) * X[static_cast<std::size_t>(k)];
      square += kernel * kernel;
    }
    return std::norm(product) / square;
  };
  // Coarse scan over the main lobe, then golden section.
  double best = place;
  double most = explained(place);
  for (int i = -8; i <= 8; ++i) {
    const double at = place + 0.125 * i;
    const double here = explained(at);
    if (here > most) {
      most = here;
      best = at;
    }
  }
  double low = best - 0.125;
  double high = best + 0.125;
  const double golden = 0.5 * (std::sqrt(5.0) - 1);
  for (int i = 0; i < 40; ++i) {
    const double left = high - golden * (high - low);
    const double right = low + golden * (high - low);
    (explained(left) > explained(right) ? high : low) =
        explained(left) > explained(right) ? right : left;
  }
  return 0.5 * (low + high);
}

/// Calls use(i, cos, sin) for each sample; the phasor is turned step by step and set anew now and
/// then.
template <class Use>
void for_each_phase(std::size_t n, double f_hz, double rate_hz, Use&& use) {
  const double step = 2 * kPi * f_hz / rate_hz;
  const Complex turn = std::polar(1.0, step);
  constexpr std::size_t kRenew = 512;
  for (std::size_t begin = 0; begin < n; begin += kRenew) {
    Complex phase = std::polar(1.0, std::fmod(step * static_cast<double>(begin), 2 * kPi));
    const std::size_t end = std::min(n, begin + kRenew);
    for (std::size_t i = begin; i < end; ++i) {
      use(i, phase.real(), phase.imag());
      phase = {phase.real() * turn.real() - phase.imag() * turn.imag(),
               phase.real() * turn.imag() + phase.imag() * turn.real()};
    }
  }
}

/// Fits sine.f_hz by least squares and takes it out.
void subtract(std::vector<double>& record, double rate_hz, Sine& sine) {
  double cc = 0;
  double cs = 0;
  double ss = 0;
  double cy = 0;
  double sy = 0;
  for_each_phase(record.size(), sine.f_hz, rate_hz, [&](std::size_t i, double c, double s) {
    cc += c * c;
    cs += c * s;
    ss += s * s;
    cy += c * record[i];
    sy += s * record[i];
  });
  const double determinant = cc * ss - cs * cs;
  sine.a = (ss * cy - cs * sy) / determinant;
  sine.b = (cc * sy - cs * cy) / determinant;
  for_each_phase(record.size(), sine.f_hz, rate_hz,
                 [&](std::size_t i, double c, double s) { record[i] -= sine.a * c + sine.b * s; });
}

/// The record freed of its least-squares line: a trend leaks over the whole periodogram.
std::vector<double> detrended(const std::vector<double>& record) {
  const double n = static_cast<double>(record.size());
  double mean = 0;
  double moment = 0;
  const double origin = record.front();
  for (std::size_t i = 0; i < record.size(); ++i) {
    mean += record[i] - origin;
    moment += (record[i] - origin) * (static_cast<double>(i) - 0.5 * (n - 1));
  }
  mean /= n;
  const double slope = moment * 12 / (n * (n * n - 1));
  std::vector<double> flat(record.size());
  for (std::size_t i = 0; i < record.size(); ++i)
    flat[i] = record[i] - origin - mean - slope * (static_cast<double>(i) - 0.5 * (n - 1));
  return flat;
}

/// A line: one sine, or a cluster of sines closer than a few resolution widths, which is one line
/// that wanders.
struct Cluster {
  std::vector<Sine> sines;
  double low_hz = 0;  ///< what it has touched
  double high_hz = 0;
};

// In units of the resolution 1/T.
constexpr double kLink = 4;               // nearer than this is the same line
constexpr double kWanderingLink = 30;     // when that line is known to wander
constexpr std::size_t kWandering = 3;     // sines that a line must be made of to be known for it
constexpr double kSkirt = 3;              // coefficients that a removed sine has touched
constexpr std::size_t kClusterSines = 6;  // more do not make what wanders any clearer

double link(const Cluster& cluster) {
  return cluster.sines.size() >= kWandering ? kWanderingLink : kLink;
}

/// Puts together what turned out to be parts of one line.
void merge_wandering(std::vector<Cluster>& clusters, double duration_s) {
  std::sort(clusters.begin(), clusters.end(),
            [](const Cluster& a, const Cluster& b) { return a.low_hz < b.low_hz; });
  std::vector<Cluster> merged;
  for (Cluster& cluster : clusters) {
    if (!merged.empty()) {
      Cluster& before = merged.back();
      const double link_hz = std::max(link(before), link(cluster)) / duration_s;
      if (cluster.low_hz - before.high_hz < link_hz) {
        before.high_hz = std::max(before.high_hz, cluster.high_hz);
        before.sines.insert(before.sines.end(), cluster.sines.begin(), cluster.sines.end());
        continue;
      }
    }
    merged.push_back(std::move(cluster));
  }
  clusters = std::move(merged);
}

SpectralLine describe(const Cluster& cluster, double duration_s) {
  SpectralLine line;
  double power = 0;
  double moment = 0;
  double level = 0;
  for (const Sine& sine : cluster.sines) {
    const double square = std::pow(sine.amplitude(), 2);
    power += square;
    moment += square * (sine.f_hz - cluster.low_hz);
    line.p_value = std::min(line.p_value, sine.p_value);
    level = std::max(level, sine.level);
  }
  line.f_hz = cluster.low_hz + moment / power;
  line.amplitude = std::sqrt(power);
  // White noise around a sine: var A = 2S/T, and u_f = √3/(πT)·u_A/A (Rife & Boorstyn, 1974).
  line.u = std::sqrt(2 * level / duration_s);
  line.u_f_hz = std::sqrt(3.0) / (kPi * duration_s) * line.u / line.amplitude;
  return line;
}

/// Power and spread of a line that wanders, from the periodogram X of length n before anything was
/// taken out.
void measure_wandering(const Cluster& cluster, const std::vector<Complex>& X, std::size_t n,
                       double rate_hz, SpectralLine& line) {
  const double nn = static_cast<double>(n);
  const double step_hz = rate_hz / nn;
  const auto from =
      static_cast<std::size_t>(std::max(1.0, std::floor((cluster.low_hz / step_hz) - kSkirt)));
  const auto to = std::min(X.size() - 1,
                           static_cast<std::size_t>(std::ceil(cluster.high_hz / step_hz + kSkirt)));
  double level = 0;
  for (const Sine& sine : cluster.sines) level = std::max(level, sine.level * rate_hz);
  double power = 0;
  double moment = 0;
  double second = 0;
  double squares = 0;
  for (std::size_t k = from; k <= to; ++k) {
    const double excess = std::norm(X[k]) / nn - level;
    const double d = static_cast<double>(k - from);
    power += excess;
    moment += excess * d;
    second += excess * d * d;
    squares += excess * excess;
  }
  if (!(power > 0)) return;
  const double mean = moment / power;
  line.amplitude = 2 * std::sqrt(power / nn);
  line.f_hz = (static_cast<double>(from) + mean) * step_hz;
  line.width_hz = 2 * step_hz * std::sqrt(std::max(0.0, second / power - mean * mean));
  // Ordinates of what wanders are independent exponential values.
  line.u = std::max(line.u, 0.5 * line.amplitude * std::sqrt(squares) / power);
  line.u_f_hz = std::max(line.u_f_hz, 0.5 * line.width_hz * std::sqrt(squares) / power);
}

/// Whole multiples of the frequency of a line: its harmonics.
void name_harmonics(std::vector<SpectralLine>& lines, double duration_s) {
  constexpr double kHighest = 30;
  std::vector<std::size_t> by_frequency(lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) by_frequency[i] = i;
  std::sort(by_frequency.begin(), by_frequency.end(),
            [&](std::size_t a, std::size_t b) { return lines[a].f_hz < lines[b].f_hz; });
  for (std::size_t j = 0; j < by_frequency.size(); ++j) {
    SpectralLine& line = lines[by_frequency[j]];
    for (std::size_t i = 0; i < j; ++i) {
      const SpectralLine& base = lines[by_frequency[i]];
      if (base.harmonic > 1) continue;
      const double order = std::round(line.f_hz / base.f_hz);
      const double allowed =
          3 * std::hypot(line.u_f_hz, order * std::max(base.u_f_hz, 0.5 * base.width_hz)) +
          0.2 / duration_s;
      // An allowance wider than the distance of the harmonics would name anything.
      if (order < 2 || order > kHighest || allowed > 0.02 * base.f_hz) continue;
      if (std::abs(line.f_hz - order * base.f_hz) > allowed) continue;
      line.harmonic = static_cast<int>(order);
      line.fundamental_hz = base.f_hz;
      break;
    }
  }
}

void mask(double low_hz, double high_hz, double rate_hz, std::vector<bool>& masked) {
  const double per_hz = 2 * static_cast<double>(masked.size()) / rate_hz;
  const auto from = static_cast<std::size_t>(std::max(0.0, low_hz * per_hz));
  const std::size_t to =
      std::min(masked.size() - 1, static_cast<std::size_t>(std::max(0.0, high_hz * per_hz)));
  for (std::size_t k = from; k <= to; ++k) masked[k] = true;
}

/// Coefficient up to which, going from `from` in steps of `direction`, the skirts of a line that
/// wanders stand out of the noise.
std::size_t end_of_skirt(const std::vector<double>& c, const std::vector<double>& smooth,
                         std::ptrdiff_t from, std::ptrdiff_t direction) {
  constexpr std::ptrdiff_t kStep = 24;
  constexpr std::ptrdiff_t kFarthest = 100;
  constexpr double kStandsOut = 1.8;  // 2.8 standard deviations of the mean of 24 squares
  const auto last = static_cast<std::ptrdiff_t>(c.size()) - 1;
  for (std::ptrdiff_t step = 0; step < kFarthest; ++step) {
    double sum = 0;
    for (std::ptrdiff_t i = 0; i < kStep; ++i) {
      const std::ptrdiff_t k = from + direction * i;
      if (k < 1 || k > last)
        return static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k, 1, last));
      const auto ordinate =
          std::min(static_cast<std::size_t>(k) * (smooth.size() - 1) / c.size(), smooth.size() - 1);
      sum += c[static_cast<std::size_t>(k)] * c[static_cast<std::size_t>(k)] / smooth[ordinate];
    }
    if (sum < kStandsOut * static_cast<double>(kStep)) break;
    from += direction * kStep;
  }
  return static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(from, 1, last));
}

/// Leaves out the skirts of lines that wander.
void mask_skirts(const std::vector<Cluster>& clusters, double rate_hz,
                 const std::vector<double>& smooth, const std::vector<double>& c,
                 std::vector<bool>& masked) {
  const double per_hz = 2 * static_cast<double>(c.size()) / rate_hz;
  const double skirt_hz = kSkirt * rate_hz / static_cast<double>(c.size());
  for (const Cluster& cluster : clusters) {
    if (cluster.sines.size() < kWandering) continue;
    const auto low = static_cast<std::ptrdiff_t>((cluster.low_hz - skirt_hz) * per_hz);
    const auto high = static_cast<std::ptrdiff_t>((cluster.high_hz + skirt_hz) * per_hz);
    const std::size_t from = end_of_skirt(c, smooth, low, -1);
    const std::size_t to = end_of_skirt(c, smooth, high, 1);
    for (std::size_t k = from; k <= to; ++k) masked[k] = true;
  }
}

}  // namespace

LineSearch find_lines(const std::vector<double>& record, double rate_hz) {
  assert(record.size() >= 64 && rate_hz > 0);
  LineSearch search;
  search.record = record;
  search.spectrum = cosine_transform(record);
  const double duration_s = static_cast<double>(record.size()) / rate_hz;
  const std::vector<double> flat = detrended(record);
  std::vector<double> rest = flat;
  std::vector<Cluster> clusters;
  std::vector<Complex> original;
  for (int pass = 0; pass < kPasses; ++pass) {
    std::size_t n = 0;
    const std::vector<Complex> X = fourier_transform(rest, n);
    if (pass == 0) original = X;
    const double step_hz = rate_hz / static_cast<double>(n);
    const std::vector<double> smooth = smooth_density(search.spectrum, rate_hz, search.masked, n);
    std::vector<Peak> taken;
    bool changed = false;
    for (const Peak& peak : find_peaks(X, n, smooth)) {
      // Side lobes of a stronger one are left to the next pass.
      double lobes = 0;
      bool near = false;
      for (const Peak& strong : taken) {
        const double d = std::abs(strong.place - peak.place);
        near = near || d < 8;
        lobes += strong.power / std::pow(kPi * std::max(d, 1.0), 2);
      }
      if (near || peak.power < 4 * lobes) continue;
      const double f_hz = peak.place * step_hz;
      auto home = std::find_if(clusters.begin(), clusters.end(), [&](const Cluster& cluster) {
        const double link_hz = link(cluster) / duration_s;
        return f_hz > cluster.low_hz - link_hz && f_hz < cluster.high_hz + link_hz;
      });
      if (home == clusters.end()) {
        if (clusters.size() >= kMostLines) continue;
        home = clusters.insert(clusters.end(), {{}, f_hz, f_hz});
      }
      if (home->sines.size() >= kClusterSines && f_hz > home->low_hz && f_hz < home->high_hz)
        continue;
      home->low_hz = std::min(home->low_hz, f_hz);
      home->high_hz = std::max(home->high_hz, f_hz);
      changed = true;
      if (home->sines.size() >= kClusterSines) continue;
      Sine sine;
      sine.f_hz = refine_place(X, n, peak.place) * step_hz;
      sine.p_value = peak.p_value;
      sine.level = peak.level / rate_hz;
      subtract(rest, rate_hz, sine);
      home->sines.push_back(sine);
      taken.push_back(peak);
    }
    if (!changed) break;
    merge_wandering(clusters, duration_s);
    for (std::size_t i = 0; i < record.size(); ++i)
      search.record[i] = record[i] - (flat[i] - rest[i]);
    search.spectrum = cosine_transform(search.record);
    search.masked.assign(search.spectrum.size(), false);
    for (const Cluster& cluster : clusters)
      mask(cluster.low_hz - kSkirt / duration_s, cluster.high_hz + kSkirt / duration_s, rate_hz,
           search.masked);
    mask_skirts(clusters, rate_hz, smooth, search.spectrum, search.masked);
  }
  for (const Cluster& cluster : clusters) {
    search.lines.push_back(describe(cluster, duration_s));
    if (cluster.sines.size() > 1)
      measure_wandering(cluster, original, 2 * (original.size() - 1), rate_hz, search.lines.back());
  }
  std::sort(search.lines.begin(), search.lines.end(),
            [](const SpectralLine& a, const SpectralLine& b) { return a.amplitude > b.amplitude; });
  name_harmonics(search.lines, duration_s);
  return search;
}

}  // namespace plumbline
