// The identified noise of one channel: the five terms of IEEE Std 952, and the Allan curve they
// fit.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// Order of the five terms wherever they form a vector or matrix.
enum NoiseTermIndex : std::size_t { kTermQ, kTermN, kTermB, kTermK, kTermR, kTermCount };
inline constexpr const char* kTermName[kTermCount] = {"Q", "N", "B", "K", "R"};

/// The squares of the coefficients, [Q² N² B² K² R²]: every variance is linear in them.
using NoisePowers = Eigen::Matrix<double, kTermCount, 1>;
using NoisePowerMatrix = Eigen::Matrix<double, kTermCount, kTermCount>;

/// Coefficient of one noise term with its standard uncertainty.
struct NoiseTerm {
  double value = 0;
  double u = 0;
  bool present = false;    ///< distinguishable from zero on this record
  double upper_limit = 0;  ///< 95 % upper limit, meaningful when absent

  double coefficient() const { return present ? value : 0.0; }
};

/// A sine in the record, or a narrow-band disturbance that wanders about one frequency.
struct SpectralLine {
  double f_hz = 0;
  double u_f_hz = 0;
  double amplitude = 0;  ///< of the sine, U; √(2·power) of what wanders
  double u = 0;
  double width_hz = 0;  ///< 0 for a sine; of what wanders, twice the standard deviation
  double p_value = 1;   ///< chance that noise alone shows such a line anywhere in the spectrum
  int harmonic = 1;     ///< order: the frequency is this multiple of fundamental_hz
  double fundamental_hz = 0;  ///< of a harmonic of another line; otherwise 0
};

/// A deviation curve with confidence limits; all vectors have the same length.
struct DeviationCurve {
  std::vector<double> tau_s;
  std::vector<long long> n;  ///< number of analysed differences
  std::vector<double> value;
  std::vector<double> lower;
  std::vector<double> upper;
};

/// First-order Gauss-Markov process: exponentially correlated noise.
struct MarkovTerm {
  double sigma = 0;  ///< standard deviation of the process, U
  double u = 0;
  double tau_s = 0;  ///< correlation time
  double u_tau_s = 0;
};

/// What a static record says about itself: every term that describes its spectrum. The random walk
/// K here never forgets; what forgets is a Gauss-Markov term.
struct RecordTerms {
  /// Q, N, B, K, R. Uncertainties hold the misfit where the terms do not describe the record, and
  /// for B and K what depends on the choice of terms.
  std::array<NoiseTerm, kTermCount> term;
  std::vector<MarkovTerm> markov;   ///< shortest correlation time first
  std::vector<SpectralLine> lines;  ///< strongest first
  /// Of the five coefficients, order Q N B K R; zero rows for terms at zero.
  NoisePowerMatrix correlation = NoisePowerMatrix::Zero();
  /// The terms describe frequencies up to this one: the Nyquist frequency, or where the sensor's
  /// own bandwidth ends.
  double band_hz = 0;
  /// Flicker is 1/f between these, flat below and 1/f² above, where the record shows it; 0 and
  /// infinity: 1/f everywhere.
  double flicker_low_hz = 0;
  double flicker_high_hz = std::numeric_limits<double>::infinity();
  /// Step between the values that occur in the record, U; 0 when there is none.
  double step = 0;
  double chi2 = 0;  ///< of the smoothed spectrum about the terms
  double dof = 0;
  double p_value = 1;
  bool adequate = false;  ///< all of these terms together, lines too, describe the record
  bool adequate_without_lines = false;  ///< the same terms, the lines left in
  double p_value_without_lines = 1;
  std::string remark;  ///< what a person should know; empty when there is nothing
};

/// One more thing that a person should know, after what is there.
inline void add_remark(std::string& remark, std::string_view more) {
  if (!remark.empty()) remark += "; ";
  remark += more;
}

/// Neighbouring coefficients of a record's cosine spectrum taken together (term_fit.h). A list of
/// them is all that a record says about the noise powers: its likelihood can be pooled with other
/// data.
struct SpectrumBin {
  double frequency_hz = 0;  ///< in the middle
  double count = 0;         ///< coefficients c in the bin
  double square = 0;        ///< Σc², U²
  double cross = 0;         ///< Σc·m, m the coefficient of a ramp of 1 U/s
  double ramp = 0;          ///< Σm²
  double known = 0;         ///< variance of a coefficient beyond the powers that are asked for, U²
  /// Mean variance of a coefficient for Q², N², B², K² = 1.
  Eigen::Vector4d density = Eigen::Vector4d::Zero();
};

/// A record's spectrum described by a walk that forgets at a given rate, and the powers that fit.
struct SpectrumDescription {
  double walk_decay_per_s = 0;
  NoisePowers power = NoisePowers::Zero();
  double deviance = 0;            ///< −2 ln of the likelihood of the record but for a constant
  std::vector<SpectrumBin> bins;  ///< with the densities that belong to the rate
};

/// Noise of one channel in units of the record ("U"; V for the outputs of a triad).
struct NoiseModel {
  NoiseTerm Q;  ///< quantization, U·s:             σ² = 3Q²/τ²
  NoiseTerm N;  ///< velocity random walk, U·√s:    σ² = N²/τ
  NoiseTerm B;  ///< bias instability, U:           σ² = 2B²ln2/π
  NoiseTerm K;  ///< acceleration random walk, U/√s: σ² = K²τ/3
  NoiseTerm R;  ///< ramp, U/s:                     σ² = R²τ²/2
  double rate_hz = 0;
  /// Rate at which the random walk K forgets, 1/s: a first-order Gauss-Markov process with this
  /// inverse correlation time and driving density K². 0: never, the walk of IEEE Std 952.
  double walk_decay_per_s = 0;
  DeviationCurve oadev;        ///< overlapping Allan deviation of the record
  std::vector<double> fitted;  ///< Allan deviation of the fitted terms at oadev.tau_s
  double chi2 = 0;
  double dof = 0;
  double p_value = 1;
  bool adequate = false;  ///< the terms describe the record
  std::string source;     ///< "static record", "bursts at the poses" or "none"
  double mean = 0;        ///< of the static record, U
  std::string remark;     ///< what a person should know: too short, constant, a periodic line …

  /// All that the static record shows, for a report; without one, nothing.
  RecordTerms record;

  /// Correlation of the five coefficients, order Q N B K R; zero rows for terms at zero.
  NoisePowerMatrix correlation = NoisePowerMatrix::Zero();
  std::vector<SpectrumBin> spectrum;  ///< what the record says about the powers
  /// The record by walks that forget faster and faster, the unbounded walk first: a run that sees
  /// longer times may prefer another than the record does. Empty without a static record.
  std::vector<SpectrumDescription> descriptions;
};

/// [Q² N² B² K² R²] as identified. The ramp counts only when it is present: an unproven trend
/// extrapolated to a longer run would swamp everything else.
NoisePowers noise_powers(const NoiseModel& model);

/// Q, N, B, K, R as a person should read them: of the record where there is one (its walk never
/// forgets), otherwise as the engine uses them.
std::array<NoiseTerm, kTermCount> reported_terms(const NoiseModel& model);

}  // namespace plumbline
