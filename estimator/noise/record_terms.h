// All terms that describe a record's spectrum, chosen by what the record shows.
#pragma once

#include <array>
#include <vector>

#include "estimator/noise/line_search.h"
#include "estimator/noise/noise_model.h"

namespace plumbline {

/// Q, N, B, K, R, and Gauss-Markov terms and limits of the flicker where they are needed, by
/// maximum restricted Whittle likelihood of what find_lines() has left of the record.
///
/// - A Gauss-Markov term or a limit of the flicker joins when it raises 2·ln L by more than chance
///   would in one record of some hundreds, over all correlation times tried.
/// - A term is present when 2·ln L falls by more than 3.84 without it: 2.5 % at the edge of the
///   range of a variance (½χ²₀ + ½χ²₁: Self & Liang, 1987).
/// - Where the terms do not describe the record, uncertainties grow by the ratio of the scatter of
///   whole octaves to what chance leaves.
/// - A spectrum that falls at its upper end, as no term does, is described up to where it begins to
///   fall (RecordTerms::band_hz): the sensor's bandwidth.
RecordTerms describe_record(const LineSearch& search, const std::vector<double>& record,
                            double rate_hz);

/// What each part of a record's terms adds to its Allan variance, U².
struct AllanParts {
  std::array<double, kTermCount> term{};  ///< Q, N, B (with its limits), K, R
  std::vector<double> markov;             ///< one for each Gauss-Markov term
  double lines = 0;
};
/// At averaging time tau_s (IEEE Std 952-1997, annex C).
AllanParts allan_parts_of(const RecordTerms& terms, double tau_s);

/// Allan deviation that the terms would show at averaging time tau_s, lines included.
double allan_deviation_of(const RecordTerms& terms, double tau_s);

/// Step between the values of a record: the largest number that all differences are a multiple of,
/// when there are many samples for each value; otherwise 0.
double value_step(const std::vector<double>& record);

}  // namespace plumbline
