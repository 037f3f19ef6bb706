// What the codes of a converter show by themselves, whatever was measured with it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline {

/// The different codes among the readings, ascending, counted from the lower end of the span; the
/// functions below take them.
std::vector<std::int64_t> codes_seen(const std::vector<double>& u_V, const Adc& adc);

/// A bit that has the same value in every reading although the readings pass through both of its
/// values.
struct StuckBit {
  int bit = 0;  ///< of the code, counted from the lower end of the span
  bool value = false;
};

/// Bits that never change. Only those whose period fits into the range of the readings twice, so
/// that a working bit could not have hidden; several neighbouring ones from the lowest on, all at
/// the same value, are a coarser step and not listed.
std::vector<StuckBit> stuck_bits(const std::vector<std::int64_t>& codes, const Adc& adc);

/// Values that readings were rounded to: origin_V + k·step_V.
struct Lattice {
  double step_V = 0;
  double origin_V = 0;
};

/// The lattice, coarser than that of the declared converter, whose points lie within half a
/// declared step of every reading; empty when chance could put them there (more often than once in
/// 10⁶) or nothing coarser shows.
std::optional<Lattice> coarser_lattice(const std::vector<std::int64_t>& codes, const Adc& adc);

}  // namespace plumbline
