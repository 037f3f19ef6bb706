// What the codes of a converter show by themselves, whatever was measured with it.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// Smallest difference between two different readings, in their unit; 0 where all are alike.
double smallest_step(std::vector<double> readings);

/// The converter with its span moved by part of a step, so that readings lie at whole codes: some
/// state the middle of a code, some an end of it. As declared where no one shift fits nearly all.
Adc aligned_with(const SampleTable& readings, const Adc& declared);

/// The different codes among the readings, ascending, counted from the lower end of the span; the
/// functions below take them.
std::vector<std::int64_t> codes_seen(std::span<const double> u_V, const Adc& adc);

/// A bit that has the same value in every reading although the readings pass through both of its
/// values.
struct StuckBit {
  int bit = 0;  ///< of the code, counted from the lower end of the span
  bool value = false;
  bool is_jumped_over = false;  ///< by readings of one dwell, which lie together but for the bit
};

/// How many bits, from the lowest on, would be seen not to change: those whose period fits into the
/// range of the readings twice, so that a working bit could not have hidden.
int bits_that_would_show(const std::vector<std::int64_t>& codes, const Adc& adc);

/// Bits that never change, of those that would show; several neighbouring ones from the lowest on,
/// all at the same value, are a coarser step and not listed.
std::vector<StuckBit> stuck_bits(const std::vector<std::int64_t>& codes, const Adc& adc);

/// Values that readings were rounded to: origin_V + k·step_V.
struct Lattice {
  double step_V = 0;
  double origin_V = 0;
  /// Steps and origins with their points there, too: both may be off together by the first or by
  /// the second of these, independent of each other, one standard deviation each.
  struct Offset {
    double step_V = 0, origin_V = 0;
  };
  std::array<Offset, 2> deviation = {};
  /// What each point from k = 0 on was read as (code_faults()); NaN where it was not seen.
  std::vector<double> reading_V = {};

  double seen_V(double point) const;  ///< reading_V of any point
  double u_step_V() const { return std::hypot(deviation[0].step_V, deviation[1].step_V); }
};

/// In how many dwells of `set` the readings of an axis step over a code of `adc`, bits that are
/// stuck left out: most readings share few codes, and none lies between two that are common. Noise
/// of a sound converter does not do that.
std::size_t dwells_over_codes(const MeasurementSet& set, std::size_t axis, const Adc& adc,
                              const std::vector<StuckBit>& stuck = {});

/// The lattice, coarser than that of the declared converter, whose points lie within half a
/// declared step of every reading; empty when chance could put them there more often than `chance`
/// or nothing coarser shows. Every one of `dwells_over_codes` counts as even odds besides.
std::optional<Lattice> coarser_lattice(const std::vector<std::int64_t>& codes, const Adc& adc,
                                       std::size_t dwells_over_codes = 0, double chance = 1e-6);

/// What the codes of one axis show. A coarser step often leaves a bit without change, and a bit
/// without change leaves codes out as a coarser step does: the one that explains the other is
/// there. Only a lowest bit alone and a step of twice the size are the same, and both are told.
struct CodeFaults {
  std::vector<StuckBit> stuck_bits;
  std::optional<Lattice> coarser_lattice;
  bool any() const { return coarser_lattice || !stuck_bits.empty(); }
};
CodeFaults code_faults(const MeasurementSet& set, std::size_t axis, const Adc& adc);

}  // namespace plumbline
