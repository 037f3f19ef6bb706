#include "tests/study/coverage.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "estimator/noise/chi_squared.h"
#include "rig/sim/record.h"
#include "rig/sim/world.h"

namespace plumbline::study {
namespace {

sim::World world_file(const char* name) {
  const auto world = sim::read_world(std::string(PLUMBLINE_SOURCE_DIR "/rig/sim/worlds/") + name);
  if (!world) {
    fmt::print(stderr, "{}\n", world.error().message);
    std::abort();
  }
  return *world;
}

sim::World world_with(const Converter& converter) {
  sim::World world = world_file("white.toml");
  // Temperature, humidity, supply and current move as in a real room. They act on nothing here, and
  // the residual test must not be taken in by them.
  world.room = world_file("default.toml").room;
  world.adc.bits = converter.bits;
  const double sample_V = converter.noise_steps * world.adc.lsb_V();
  for (sim::NoiseTerms& noise : world.noise_V) {
    noise = {.N = sample_V / std::sqrt(world.rate_hz)};
    if (!converter.coloured) continue;
    constexpr double kRun_s = 1000;  // 324 poses in some 3 s each
    const double mean_V = sample_V / std::sqrt(sim::RecordOptions{}.samples_per_pose);
    noise.B = mean_V / 0.664;
    noise.K = mean_V / std::sqrt(kRun_s / 6);
  }
  return world;
}

/// The random walk at the first reading of the run.
PerAxis<double> walk_until_run_V(sim::World world, const sim::RecordOptions& options) {
  world.adc.bits = 24;
  const auto first_reading_V = [&] {
    const SampleTable samples = sim::record_set(world, options).run.samples;
    PerAxis<double> reading{};
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) reading[axis] = samples.u_V[axis].front();
    return reading;
  };
  // White and slow noise are drawn apart, so that without the white one the slow one stays the
  // same; flicker and walk are not, so that the flicker must go on, too small to be felt.
  for (sim::NoiseTerms& noise : world.noise_V) noise = {.B = 1e-30, .K = noise.K};
  PerAxis<double> walk = first_reading_V();
  for (sim::NoiseTerms& noise : world.noise_V) noise = {};
  const PerAxis<double> quiet = first_reading_V();
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) walk[axis] -= quiet[axis];
  return walk;
}

UnitOutcome calibrate_unit(const sim::World& world, bool coloured, std::uint64_t seed,
                           double delta_step_deg) {
  sim::RecordOptions options;
  options.seed = seed;
  options.grid.delta.stop_deg = 360 - delta_step_deg;
  options.grid.delta.step_deg = delta_step_deg;
  options.soak_s = coloured ? 600 : 100;
  options.verification_poses = 0;
  const sim::RecordedSet set = sim::record_set(world, options);
  const PerAxis<double> walk_V = coloured ? walk_until_run_V(world, options) : PerAxis<double>{};
  const Calibration calibration = calibrate({set.run, &set.soak, set.description}, {});

  UnitOutcome outcome;
  outcome.en = calibration.estimates.agreement_en;
  outcome.verdict = calibration.diagnosis.verdict;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const PerAxis<double>& K = set.truth.triad.K_V_per_g[axis];
    const Eigen::Vector4d truth(K[0], K[1], K[2], set.truth.triad.U0_V[axis] + walk_V[axis]);
    const auto normalised_error = [&](const AxisEstimate& estimate) -> Eigen::Vector4d {
      return (estimate.value - truth).cwiseQuotient(estimate.covariance.diagonal().cwiseSqrt());
    };
    const AxisEstimate& batch = calibration.estimates.batch_ls[axis];
    const Eigen::Index first = 4 * static_cast<Eigen::Index>(axis);
    outcome.normalised_error.segment<4>(first) = normalised_error(batch);
    outcome.filter_normalised_error.segment<4>(first) =
        normalised_error(calibration.estimates.ekf[axis]);
    const Eigen::Vector4d error = batch.value - truth;
    outcome.nees += error.dot(batch.covariance.ldlt().solve(error));
  }
  return outcome;
}

double share_within(const Eigen::ArrayXXd& errors, double k) {
  return (errors.abs() <= k).cast<double>().mean();
}

}  // namespace

std::string parameter_name(Eigen::Index parameter) {
  const auto axis = static_cast<std::size_t>(parameter / 4);
  const auto column = static_cast<std::size_t>(parameter % 4);
  if (column == kAxisCount) return fmt::format("U_{}0", kAxisName[axis]);
  return fmt::format("K_{}{}", kAxisName[axis], kAxisName[column]);
}

std::string to_string(const Converter& converter) {
  return fmt::format("{} bits, white noise of {} steps{}", converter.bits, converter.noise_steps,
                     converter.coloured ? ", flicker and walk as large in a pose mean" : "");
}

const std::vector<Converter>& converters() {
  static const std::vector<Converter> all = {{16, 4.0}, {12, 1.0}, {12, 0.5}, {16, 4.0, true}};
  return all;
}

std::vector<UnitOutcome> calibrate_units(const Converter& converter, const UnitSeries& series) {
  assert(series.units >= 0 && series.threads >= 1);
  const sim::World world = world_with(converter);
  const auto count = static_cast<std::size_t>(series.units);
  std::vector<UnitOutcome> outcomes(count);
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t unit = next++; unit < count; unit = next++)
      outcomes[unit] = calibrate_unit(world, converter.coloured, series.first_seed + unit,
                                      series.delta_step_deg);
  };
  std::vector<std::jthread> helpers;
  for (int thread = 1; thread < series.threads; ++thread) helpers.emplace_back(work);
  work();
  helpers.clear();  // joins
  return outcomes;
}

Coverage summarise(const std::vector<UnitOutcome>& outcomes) {
  assert(outcomes.size() >= 2);
  const auto units = static_cast<Eigen::Index>(outcomes.size());
  const auto n = static_cast<double>(units);
  Eigen::ArrayXXd errors(units, kParameters);
  Eigen::ArrayXXd filter_errors(units, kParameters);
  Coverage coverage;
  for (Eigen::Index unit = 0; unit < units; ++unit) {
    const UnitOutcome& outcome = outcomes[static_cast<std::size_t>(unit)];
    errors.row(unit) = outcome.normalised_error.transpose();
    filter_errors.row(unit) = outcome.filter_normalised_error.transpose();
    coverage.mean_nees += outcome.nees;
    for (const double en : outcome.en) {
      coverage.en_within_share += en <= 1 ? 1 : 0;
      coverage.largest_en = std::max(coverage.largest_en, en);
    }
    const bool unexplained = outcome.verdict == Verdict::unexplained;
    coverage.unexplained_share += unexplained ? 1 : 0;
    coverage.undecided_share += !unexplained && outcome.verdict != Verdict::clean ? 1 : 0;
  }
  coverage.mean_nees /= n;
  coverage.en_within_share /= n * kAxisCount;
  coverage.unexplained_share /= n;
  coverage.undecided_share /= n;
  coverage.units = static_cast<int>(units);
  coverage.overall_share = share_within(errors, 1.96);
  coverage.overall_share_k2 = share_within(errors, 2);
  coverage.filter_share = share_within(filter_errors, 1.96);
  for (Eigen::Index parameter = 0; parameter < kParameters; ++parameter) {
    const Eigen::ArrayXd z = errors.col(parameter);
    coverage.share(parameter) = share_within(z, 1.96);
    coverage.share_k2(parameter) = share_within(z, 2);
    coverage.mean(parameter) = z.mean();
    coverage.sd(parameter) = std::sqrt((z - z.mean()).square().sum() / (n - 1));
  }
  const Eigen::ArrayXd share_of_unit = (errors.abs() <= 1.96).cast<double>().rowwise().mean();
  coverage.u_overall_share =
      std::sqrt((share_of_unit - coverage.overall_share).square().sum() / (n * (n - 1)));
  return coverage;
}

Interval binomial_interval(int count, double probability) {
  const double k = normal_quantile(0.5 + probability / 2);
  const double half_width = k * std::sqrt(0.95 * 0.05 / count);
  return {0.95 - half_width, std::min(1.0, 0.95 + half_width)};
}

Interval nees_interval(int units, double probability) {
  const double dof = static_cast<double>(kParameters) * units;
  return {chi_squared_quantile(0.5 - probability / 2, dof) / units,
          chi_squared_quantile(0.5 + probability / 2, dof) / units};
}

}  // namespace plumbline::study
