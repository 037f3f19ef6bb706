#include "estimator/noise/chi_squared.h"

#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <unsupported/Eigen/SpecialFunctions>

namespace plumbline {

namespace {

// Beyond this the cube-root normal approximation of Wilson and Hilferty is good to 1e-8 in the
// quantile, while the incomplete gamma function gets slow.
constexpr double kManyDegrees = 1e5;

}  // namespace

double chi_squared_tail(double x, double dof) {
  assert(dof > 0);
  if (!(x > 0)) return 1;
  if (dof > kManyDegrees) {
    const double s = 2 / (9 * dof);
    return 0.5 * std::erfc((std::cbrt(x / dof) - (1 - s)) / std::sqrt(2 * s));
  }
  return Eigen::numext::igammac(0.5 * dof, 0.5 * x);
}

double log_gamma(double x) { return Eigen::numext::lgamma(x); }

double f_tail(double f, double dof1, double dof2) {
  assert(dof1 > 0 && dof2 > 0);
  if (!(f > 0)) return 1;
  if (dof2 > kManyDegrees) return chi_squared_tail(f * dof1, dof1);
  return Eigen::numext::betainc(0.5 * dof2, 0.5 * dof1, dof2 / (dof2 + dof1 * f));
}

double normal_below(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

double normal_two_sided_tail(double z) { return std::erfc(z / std::sqrt(2.0)); }

double normal_quantile(double p) {
  assert(p > 0 && p < 1);
  return Eigen::numext::ndtri(p);
}

double chi_squared_quantile(double p, double dof) {
  assert(dof > 0 && p > 0 && p < 1);
  const double s = 2 / (9 * dof);
  const double guess = 1 - s + normal_quantile(p) * std::sqrt(s);
  const double start = dof * guess * guess * guess;
  if (dof > kManyDegrees) return start;
  // Bracket, then bisect in log x: the tail is monotone, and sixty halvings are cheap.
  double low = start > 0 ? std::log(start) : -1;
  double high = low;
  while (chi_squared_tail(std::exp(low), dof) < 1 - p) low -= 1;
  while (chi_squared_tail(std::exp(high), dof) > 1 - p) high += 1;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (chi_squared_tail(std::exp(middle), dof) > 1 - p ? low : high) = middle;
  }
  return std::exp(0.5 * (low + high));
}

}  // namespace plumbline
