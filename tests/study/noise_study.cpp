#include "tests/study/noise_study.h"

#include <algorithm>
#include <cmath>

#include "estimator/noise/identify.h"
#include "estimator/parallel_for.h"
#include "rig/sim/noise.h"

namespace plumbline::study {

namespace {

constexpr double kRate_hz = 100;

RecordTerms identify_one(const NoiseCase& noise_case, std::uint64_t seed) {
  sim::ChannelNoise noise(noise_case.truth, kRate_hz, seed, 0);
  std::vector<double> record(noise_case.samples);
  for (double& value : record) {
    value = noise.next_V(1 / kRate_hz);
    if (noise_case.step > 0) value = noise_case.step * std::round(value / noise_case.step + 0.37);
  }
  return identify_noise(record, kRate_hz).record;
}

}  // namespace

const std::vector<NoiseCase>& noise_cases() {
  static const std::vector<NoiseCase> cases = {
      {.name = "four terms, 1e6 samples",
       .truth = {.Q = 1e-5, .N = 1e-3, .B = 1e-4, .K = 1e-5},
       .samples = 1'000'000,
       .bound = {0.051, 0.0012, 0.227, 0.24}},
      {.name = "quantization rules, 1e6 samples",
       .truth = {.Q = 4e-4, .N = 2.5e-4, .B = 8e-6, .K = 4e-7},
       .samples = 1'000'000,
       .bound = {0.0007, 0.0059, 0, 0}},
      {.name = "white noise alone, 30000 samples", .truth = {.N = 1e-3}, .samples = 30'000},
      {.name = "white and flicker, 16 bits, 30000 samples",
       .truth = {.N = 2.5e-5, .B = 6e-5},
       .samples = 30'000,
       .step = 7.6e-5},
      {.name = "white, flicker and walk, 60000 samples",
       .truth = {.N = 2.5e-5, .B = 4e-5, .K = 2e-5},
       .samples = 60'000},
      // Corners a factor of 4 apart: B² = π·s²/ln 4.
      {.name = "white and relaxations up to 2 Hz, 60000 samples",
       .truth = {.N = 2.5e-5,
                 .relaxation = 4e-5,
                 .relaxation_tau_s = {0.0796, 0.318, 1.27, 5.09, 20.4, 81.5, 326}},
       .samples = 60'000,
       .relaxation_B = 6.02e-5},
      {.name = "white and one relaxation of 1 s, 60000 samples",
       .truth = {.N = 2.5e-5, .relaxation = 5e-5, .relaxation_tau_s = {1}},
       .samples = 60'000}};
  return cases;
}

NoiseStudy study_noise(const NoiseCase& noise_case, int records, std::uint64_t first_seed) {
  const auto count = static_cast<std::size_t>(records);
  std::vector<RecordTerms> found(count);
  parallel_for(count, [&](std::size_t i) { found[i] = identify_one(noise_case, first_seed + i); });
  NoiseStudy study;
  const sim::NoiseTerms& truth = noise_case.truth;
  const double values[kTermCount] = {truth.Q, truth.N, std::max(truth.B, noise_case.relaxation_B),
                                     truth.K, truth.R};
  const double share = 1 / static_cast<double>(records);
  for (std::size_t i = 0; i < kTermCount; ++i) {
    NoiseFigures& figures = study.term[i];
    figures.truth = values[i];
    double square = 0;
    double fourth = 0;
    for (const RecordTerms& record : found) {
      const NoiseTerm& term = record.term[i];
      figures.mean += share * term.value;
      square += share * term.value * term.value;
      fourth += share * std::pow(term.value, 4);
      figures.mean_u += share * term.u;
      figures.covered += std::abs(term.value - values[i]) <= 1.96 * term.u ? share : 0;
      figures.present += term.present ? share : 0;
    }
    figures.power_sd = std::sqrt(std::max(0.0, fourth - square * square));
    figures.sd = std::sqrt(std::max(0.0, square - figures.mean * figures.mean));
  }
  for (const RecordTerms& record : found) {
    study.adequate += record.adequate ? share : 0;
    study.lines += record.lines.empty() ? 0 : share;
    study.markov += record.markov.empty() ? 0 : share;
  }
  return study;
}

}  // namespace plumbline::study
