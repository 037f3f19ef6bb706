#include "estimator/noise/misfit.h"

#include <algorithm>
#include <cmath>

#include "estimator/noise/chi_squared.h"
#include "estimator/noise/spectrum_fit.h"
#include "estimator/noise/square.h"

namespace plumbline {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Normal deviate of a sum of squares that has `count` degrees of freedom (Wilson & Hilferty).
double deviate(double sum, double count) {
  const double s = 2 / (9 * count);
  return (std::cbrt(sum / count) - (1 - s)) / std::sqrt(s);
}

}  // namespace

double Misfit::p_value() const { return chi_squared_tail(chi2, dof); }
double Misfit::octave_p_value() const { return chi_squared_tail(octave_chi2, octave_dof); }
bool Misfit::adequate() const {
  return p_value() > kInadequate && octave_p_value() > 0.1 * kInadequate;
}
bool Misfit::doubtful() const { return std::min(p_value(), octave_p_value()) < 0.01; }

Misfit measure_misfit(const SpectrumSums& sums, const VectorXd& variance, double slope,
                      double parameters) {
  constexpr double kFewest = 8;
  Misfit misfit;
  double count = 0;
  double sum = 0;
  double octave_count = 0;
  double octave_sum = 0;
  std::size_t octave_end = 16;
  int used = 0;
  int octaves = 0;
  const auto close_octave = [&] {
    if (octave_count >= kFewest) {
      misfit.octave_chi2 += square(deviate(octave_sum, octave_count));
      ++octaves;
      if (octave_count >= 32) {
        const double ratio = octave_sum / octave_count;
        misfit.worst_ratio = std::max({misfit.worst_ratio, ratio, 1 / std::max(ratio, 1e-9)});
      }
    }
    octave_count = 0;
    octave_sum = 0;
  };
  const std::size_t top = sums.bins.back().first + sums.bins.back().width;
  double slope_sum = 0;
  double slope_square = 0;
  for (std::size_t i = 0; i < sums.bins.size(); ++i) {
    const SpectrumSum& bin = sums.bins[i];
    const double ratio = square_without_ramp(bin, slope) / variance(static_cast<Index>(i));
    if (bin.first >= octave_end) {
      close_octave();
      octave_end *= 2;
    }
    octave_count += bin.count;
    octave_sum += ratio;
    if (4 * bin.first > top) {
      const double x = std::log2(2 * static_cast<double>(bin.first) / static_cast<double>(top));
      slope_sum += x * (ratio - bin.count);
      slope_square += 2 * bin.count * x * x;
    }
    count += bin.count;
    sum += ratio;
    if (count < kFewest) continue;
    misfit.chi2 += square(deviate(sum, count));
    ++used;
    count = 0;
    sum = 0;
  }
  close_octave();
  misfit.dof = std::max(1.0, used - parameters);
  misfit.octave_dof = std::max(1.0, octaves - parameters);
  if (slope_square > 0) misfit.slope_z = slope_sum / std::sqrt(slope_square);
  return misfit;
}

Misfit misfit_of(const SpectrumSums& sums, const TermDescription& description) {
  return measure_misfit(sums, description.variance(), description.fit.slope,
                        description.parameters());
}

SpectrumSums without_humps(const SpectrumSums& sums, const TermDescription& description) {
  constexpr double kStandsOut = 5;
  constexpr double kByMuch = 1.15;
  constexpr double kMostOfAll = 0.25;
  const VectorXd variance =
      shape_densities(sums, description.shape).transpose() * description.fit.power;
  SpectrumSums rest = sums;
  rest.bins.clear();
  std::vector<bool> stands(sums.bins.size(), false);
  for (std::size_t i = 0; i < sums.bins.size(); ++i) {
    const SpectrumSum& bin = sums.bins[i];
    const double ratio =
        square_without_ramp(bin, description.fit.slope) / variance(static_cast<Index>(i));
    stands[i] = ratio > kByMuch * bin.count && deviate(ratio, bin.count) > kStandsOut;
  }
  for (std::size_t i = 0; i < sums.bins.size(); ++i) {
    // The neighbours are its slopes.
    const bool beside = (i > 0 && stands[i - 1]) || (i + 1 < stands.size() && stands[i + 1]);
    if (!stands[i] && !beside) rest.bins.push_back(sums.bins[i]);
  }
  const auto all = static_cast<double>(sums.bins.size());
  return all - static_cast<double>(rest.bins.size()) <= kMostOfAll * all ? rest : sums;
}

double find_band_hz(const std::vector<double>& c, double rate_hz, const std::vector<bool>& masked) {
  constexpr double kFalls = -6;
  constexpr double kFallsNoMore = -3;
  const double nyquist_hz = 0.5 * rate_hz;
  constexpr int kMostHalfOctaves = 12;  // down to a hundredth of the rate
  for (int halves = 0; halves < kMostHalfOctaves; ++halves) {
    const double band_hz = nyquist_hz * std::pow(2.0, -0.5 * halves);
    const SpectrumSums sums = gather_spectrum(c, rate_hz, masked, band_hz);
    if (sums.bins.size() < 48) break;
    const bool whole = halves == 0;
    const unsigned held = whole ? 0 : 1;  // a fall hides what quantization there may be
    const MatrixXd density = shape_densities(sums, {});
    const SpectrumFit fit = fit_powers(sums, density, starting_powers(sums, density, held), held);
    const Misfit misfit = measure_misfit(sums, density.transpose() * fit.power, fit.slope, 4);
    if (misfit.slope_z > (whole ? kFalls : kFallsNoMore)) return band_hz;
  }
  return nyquist_hz;
}

}  // namespace plumbline
