#include "estimator/noise/edf.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

namespace plumbline {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The functions s_w, s_x, s_z and the basic sum carry the names of the paper.
double s_w(double t, int alpha) {
  const double a = std::abs(t);
  switch (alpha) {
    case 2:
      return -a;
    case 0:
      return a * a * a;
    case -2:
      return -std::pow(a, 5);
    case -4:
      return std::pow(a, 7);
    default:
      break;
  }
  if (a == 0) return 0;
  const double power = std::pow(a, 3 - alpha);
  return (alpha == -1 ? -power : power) * std::log(a);  // α = 1, −1, −3
}

double s_x(double t, double f, int alpha) {
  if (f == kInfinity) return s_w(t, alpha + 2);
  return f * f * (2 * s_w(t, alpha) - s_w(t - 1 / f, alpha) - s_w(t + 1 / f, alpha));
}

double s_z(double t, double f, int alpha, int d) {
  // Binomial weights of the d-th difference correlated with itself.
  static constexpr std::array<std::array<double, 4>, 4> kWeight = {
      {{1, 0, 0, 0}, {2, -1, 0, 0}, {6, -4, 1, 0}, {20, -15, 6, -1}}};
  const auto& weight = kWeight[static_cast<std::size_t>(d)];
  double sum = weight[0] * s_x(t, f, alpha);
  for (int k = 1; k <= d; ++k)
    sum += weight[static_cast<std::size_t>(k)] * (s_x(t - k, f, alpha) + s_x(t + k, f, alpha));
  return sum;
}

double basic_sum(double j_count, double m_count, double s, double f, int alpha, int d) {
  const auto squared = [&](double t) { return std::pow(s_z(t, f, alpha, d), 2); };
  double sum = squared(0) + (1 - j_count / m_count) * squared(j_count / s);
  for (double j = 1; j < j_count; ++j) sum += 2 * (1 - j / m_count) * squared(j / s);
  return sum;
}

struct Pair {
  double a0;
  double a1;
};

// Asymptotic coefficients, rows α = 2 … −4, columns d = 1 … 3; zero where α + 2d ≤ 1.
constexpr std::array<std::array<Pair, 3>, 7> kModified = {{
    {{{2.0 / 3, 1.0 / 3}, {7.0 / 9, 1.0 / 2}, {22.0 / 25, 2.0 / 3}}},
    {{{0.840, 0.345}, {0.997, 0.616}, {1.141, 0.843}}},
    {{{1.079, 0.368}, {1.033, 0.607}, {1.184, 0.848}}},
    {{{0, 0}, {1.048, 0.534}, {1.180, 0.816}}},
    {{{0, 0}, {1.302, 0.535}, {1.175, 0.777}}},
    {{{0, 0}, {0, 0}, {1.194, 0.703}}},
    {{{0, 0}, {0, 0}, {1.489, 0.702}}},
}};
constexpr std::array<std::array<Pair, 3>, 7> kUnmodified = {{
    {{{3.0 / 2, 1.0 / 2}, {35.0 / 18, 1}, {231.0 / 100, 3.0 / 2}}},
    {{{78.6, 25.2}, {790, 410}, {9950, 6520}}},
    {{{2.0 / 3, 1.0 / 6}, {2.0 / 3, 1.0 / 3}, {7.0 / 9, 1.0 / 2}}},
    {{{0, 0}, {0.852, 0.375}, {0.997, 0.617}}},
    {{{0, 0}, {1.079, 0.368}, {1.033, 0.607}}},
    {{{0, 0}, {0, 0}, {1.053, 0.553}}},
    {{{0, 0}, {0, 0}, {1.302, 0.535}}},
}};
constexpr std::array<Pair, 3> kFlickerPhase = {{{6, 4}, {15.23, 12}, {47.8, 40}}};

const Pair& at(const std::array<std::array<Pair, 3>, 7>& table, int alpha, int d) {
  return table[static_cast<std::size_t>(2 - alpha)][static_cast<std::size_t>(d - 1)];
}

// SP 1065 tables 7 (total) and 9 (Hadamard total): edf = (T/τ − c)·b in the forms given there.
double total_edf(int alpha, double span_over_tau) {
  if (alpha >= 0) return 1.50 * span_over_tau;
  if (alpha == -1) return 1.17 * span_over_tau - 0.22;
  return 0.93 * span_over_tau - 0.36;
}
double hadamard_total_edf(int alpha, double span_over_tau) {
  static constexpr std::array<Pair, 5> kTable = {
      {{0.559, 1.004}, {0.868, 1.140}, {0.938, 1.696}, {0.974, 2.554}, {1.276, 3.149}}};
  const Pair& c = kTable[static_cast<std::size_t>(-std::clamp(alpha, -4, 0))];
  return span_over_tau / (c.a0 + c.a1 / span_over_tau);
}

}  // namespace

double greenhall_edf(int alpha, int d, std::size_t m_factor, std::size_t phase_points,
                     bool overlapping, bool modified) {
  assert(alpha + 2 * d > 1 && alpha >= -4 && alpha <= 2);
  constexpr double kMaxTerms = 100;
  const double m = static_cast<double>(m_factor);
  const double f = modified ? 1 : m;
  const double s = overlapping ? m : 1;
  const double filter_length = m / f + m * d;
  const double count = 1 + std::floor(s * (static_cast<double>(phase_points) - filter_length) / m);
  if (count < 1) return 1;
  const double terms = std::min(count, (d + 1) * s);
  const double r = count / s;

  if (modified) {
    if (terms <= kMaxTerms)
      return std::pow(s_z(0, 1, alpha, d), 2) * count / basic_sum(terms, count, s, 1, alpha, d);
    if (r > d + 1) {
      const Pair& c = at(kModified, alpha, d);
      return r / (c.a0 - c.a1 / r);
    }
    return std::pow(s_z(0, 1, alpha, d), 2) * kMaxTerms /
           basic_sum(kMaxTerms, kMaxTerms, kMaxTerms / r, 1, alpha, d);
  }
  if (alpha == 2) {
    const double a0 = at(kUnmodified, 2, d).a0;
    return count / (a0 - 0.5 * d / r);
  }
  if (alpha == 1) {
    if (terms <= kMaxTerms)
      return std::pow(s_z(0, m, 1, d), 2) * count / basic_sum(terms, count, s, m, 1, d);
    const Pair& b = kFlickerPhase[static_cast<std::size_t>(d - 1)];
    const double scale = std::pow(b.a0 + b.a1 * std::log(m), 2);
    if (r > d + 1) {
      const Pair& c = at(kUnmodified, 1, d);
      return scale * r / (c.a0 - c.a1 / r);
    }
    const double s_prime = kMaxTerms / r;
    return scale * kMaxTerms / basic_sum(kMaxTerms, kMaxTerms, s_prime, s_prime, 1, d);
  }
  if (terms <= kMaxTerms) {
    const double f_prime = m * (d + 1) <= kMaxTerms ? m : kInfinity;
    return std::pow(s_z(0, f_prime, alpha, d), 2) * count /
           basic_sum(terms, count, s, f_prime, alpha, d);
  }
  if (r > d + 1) {
    const Pair& c = at(kUnmodified, alpha, d);
    return r / (c.a0 - c.a1 / r);
  }
  return std::pow(s_z(0, kInfinity, alpha, d), 2) * kMaxTerms /
         basic_sum(kMaxTerms, kMaxTerms, kMaxTerms / r, kInfinity, alpha, d);
}

double equivalent_degrees_of_freedom(Deviation kind, int alpha, std::size_t m,
                                     std::size_t phase_points) {
  const double span_over_tau = static_cast<double>(phase_points - 1) / static_cast<double>(m);
  double edf = 1;
  switch (kind) {
    case Deviation::adev:
    case Deviation::oadev:
      edf = greenhall_edf(std::max(alpha, -2), 2, m, phase_points, kind == Deviation::oadev, false);
      break;
    case Deviation::mdev:
    case Deviation::tdev:
      edf = greenhall_edf(std::max(alpha, -2), 2, m, phase_points, true, true);
      break;
    case Deviation::hdev:
    case Deviation::ohdev:
      edf = greenhall_edf(alpha, 3, m, phase_points, kind == Deviation::ohdev, false);
      break;
    case Deviation::totdev:
      // The table ends at white noise; in phase noise there is nothing to gain from the
      // continuation, and the overlapping variance has nearly the same degrees of freedom.
      edf = alpha > 0 ? greenhall_edf(alpha, 2, m, phase_points, true, false)
                      : total_edf(alpha, span_over_tau);
      break;
    case Deviation::htotdev:
      edf = hadamard_total_edf(alpha, span_over_tau);
      break;
  }
  return std::max(edf, 1.0);
}

int noise_exponent(const std::vector<double>& phase, std::size_t m, int differences, int fallback) {
  constexpr std::size_t kFewest = 30;
  std::vector<double> z;
  z.reserve(phase.size() / m + 1);
  for (std::size_t i = 0; i < phase.size(); i += m) z.push_back(phase[i]);
  if (z.size() < kFewest) return fallback;
  for (int d = 0;; ++d) {
    double mean = 0;
    for (const double v : z) mean += v;
    mean /= static_cast<double>(z.size());
    double product = 0;
    double square = 0;
    for (std::size_t i = 0; i < z.size(); ++i) {
      const double v = z[i] - mean;
      square += v * v;
      if (i + 1 < z.size()) product += v * (z[i + 1] - mean);
    }
    if (!(square > 0)) return fallback;
    const double r1 = product / square;
    const double delta = r1 / (1 + r1);
    if (d >= differences || (d >= 1 && delta < 0.25) || (d == 0 && delta < 0.25)) {
      // Phase with exponent α − 2 and d differences taken: f^(−2δ).
      const int phase_exponent = -static_cast<int>(std::lround(2 * delta)) - 2 * d;
      return std::clamp(phase_exponent + 2, differences == 3 ? -4 : -2, 2);
    }
    for (std::size_t i = 0; i + 1 < z.size(); ++i) z[i] = z[i + 1] - z[i];
    z.pop_back();
  }
}

}  // namespace plumbline
