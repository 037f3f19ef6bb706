// Runs made up for tests: ideal head, white noise, ADC, everything known.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <utility>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/measurement.h"

namespace plumbline {

/// A converter whose steps matter, and one whose steps are fine against the noise.
constexpr Adc kTwelveBits{12, -5.0, 0.0}, kSixteenBits{16, -5.0, 0.0};

struct SyntheticOptions {
  double sigma_V = 3e-4;  ///< of one sample
  std::size_t samples_per_pose = 20;
  bool varied_dwells = false;  ///< every second pose has half as many
  bool random_order = false;
  double still_s = 60;  ///< length of the record
  /// From the beginning of one pose to that of the next, s, at a position.
  std::function<double(double delta_deg, double h_deg)> pose_s = {};
  int delta_step_deg = 30;
  int h_step_deg = 20;
  double k2_x_V_per_g2 = 0;  ///< a quadratic that the model does not know
  /// Anything else that an axis does, V, of the specific force in g and the time in s.
  PerAxis<std::function<double(const std::array<double, 3>&, double)>> more_V = {};
  /// Of the base about x_b, and about y_b, at a time in s.
  std::function<double(double)> base_roll_rad = {}, base_tilt_rad = {};
  /// By how much the noise of x is larger, of the specific force in g and the time since arrival in
  /// s.
  std::function<double(const std::array<double, 3>&, double)> noise_x = {};
  /// What is added to δ, to h and to the base roll at a position, degrees.
  std::function<double(double delta_deg, double h_deg)> delta_error_deg = {}, h_error_deg = {},
                                                        roll_error_deg = {};
};

struct SyntheticRun {
  PerAxis<std::array<double, 4>> truth;  ///< [K_ix K_iy K_iz U_i0]
  RunDescription description;
  MeasurementSet run;
  SampleTable still;  ///< before the run, at δ = h = 0
};

inline SyntheticRun synthetic_run(std::uint64_t seed, const Adc& adc,
                                  const SyntheticOptions& options = {}) {
  constexpr double kRate_hz = 100;
  constexpr double kRadians = 3.14159265358979323846 / 180;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  SyntheticRun result;
  result.truth = {{{0.032002, -0.0017435, 7.4811e-5, -2.5865},
                   {0.0022174, 0.031399, 0.00016485, -2.4363},
                   {-0.00033471, -0.0017407, -0.032812, -2.3423}}};
  for (auto& row : result.truth)
    for (std::size_t j = 0; j < 4; ++j) row[j] += (j < 3 ? 3e-4 : 0.03) * normal(random);
  result.description.gravity = {9.8101, 0.00002};
  result.description.adc = adc;
  const double gamma = 9.8101 / kStandardGravity_mps2;

  bool moving = false;  // the record is at rest
  double arrival_s = 0;
  const auto add_sample = [&](SampleTable& table, double t_s, double to_delta_deg,
                              double to_h_deg) {
    const auto error_deg = [&](const auto& error) {
      return error ? error(to_delta_deg, to_h_deg) : 0;
    };
    const double delta_deg = to_delta_deg + error_deg(options.delta_error_deg);
    const double h_deg = to_h_deg + error_deg(options.h_error_deg) +
                         (options.base_tilt_rad ? options.base_tilt_rad(t_s) / kRadians : 0);
    const double c = std::cos(h_deg * kRadians);
    const double roll_rad = (options.base_roll_rad ? options.base_roll_rad(t_s) : 0) +
                            error_deg(options.roll_error_deg) * kRadians;
    const double cd = std::cos(delta_deg * kRadians), sd = std::sin(delta_deg * kRadians);
    const double up[] = {c * std::cos(roll_rad), -std::sin(roll_rad),
                         std::sin(h_deg * kRadians) * std::cos(roll_rad)};
    const std::array<double, 3> a = {gamma * (up[0] * cd + up[1] * sd),
                                     gamma * (up[1] * cd - up[0] * sd), gamma * up[2]};
    table.t_s.push_back(t_s);
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const auto& row = result.truth[axis];
      double u_V = row[0] * a[0] + row[1] * a[1] + row[2] * a[2] + row[3];
      if (axis == 0) u_V += options.k2_x_V_per_g2 * a[0] * a[0];
      if (options.more_V[axis]) u_V += options.more_V[axis](a, t_s);
      const bool noisy = axis == 0 && options.noise_x && moving;
      u_V += options.sigma_V * (noisy ? options.noise_x(a, t_s - arrival_s) : 1) * normal(random);
      table.u_V[axis].push_back(adc.min_V +
                                adc.lsb_V() * std::round((u_V - adc.min_V) / adc.lsb_V()));
    }
  };
  const auto still = static_cast<int>(options.still_s * kRate_hz);
  for (int i = 0; i < still; ++i) add_sample(result.still, i / kRate_hz, 0, 0);
  std::vector<std::pair<int, int>> positions;
  for (int h = 0; h <= 80; h += options.h_step_deg)
    for (int delta = 0; delta < 360; delta += options.delta_step_deg)
      positions.emplace_back(delta, h);
  if (options.random_order) std::shuffle(positions.begin(), positions.end(), random);
  double t_s = options.still_s + 1;
  for (const auto& [delta, h] : positions) {
    const std::size_t half = options.varied_dwells ? 1 + result.run.poses.size() % 2 : 1;
    const std::size_t count = options.samples_per_pose / half;
    result.run.poses.push_back({std::ssize(result.run.poses), static_cast<double>(delta),
                                static_cast<double>(h), result.run.samples.size(), count});
    moving = true;
    arrival_s = t_s;
    for (std::size_t i = 0; i < count; ++i)
      add_sample(result.run.samples, t_s + static_cast<double>(i) / kRate_hz, delta, h);
    t_s += options.pose_s ? options.pose_s(delta, h) : 3;
  }
  return result;
}

inline Calibration calibrated(const SyntheticRun& data, const CalibrationOptions& options = {}) {
  return calibrate({data.run, &data.still, data.description}, options);
}

}  // namespace plumbline
