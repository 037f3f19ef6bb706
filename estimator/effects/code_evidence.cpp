#include "estimator/effects/code_evidence.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include "estimator/noise/chi_squared.h"

namespace plumbline {

namespace {

std::vector<std::int64_t> codes_of(std::span<const double> u_V, const Adc& adc) {
  std::vector<std::int64_t> codes;
  codes.reserve(u_V.size());
  for (const double u : u_V) codes.push_back(std::llround((u - adc.min_V) / adc.lsb_V()));
  return codes;
}

std::span<const double> readings_of(const MeasurementSet& set, std::size_t axis, const Pose& pose) {
  return std::span(set.samples.u_V[axis]).subspan(pose.first, pose.count);
}

/// The bit at its value, when that is the same in all codes.
std::optional<StuckBit> unchanging(const std::vector<std::int64_t>& codes, int bit) {
  const auto is_set = [bit](std::int64_t code) { return ((code >> bit) & 1) != 0; };
  if (codes.empty()) return {};
  const bool value = is_set(codes.front());
  if (!std::all_of(codes.begin(), codes.end(),
                   [&](std::int64_t code) { return is_set(code) == value; }))
    return {};
  return StuckBit{.bit = bit, .value = value};
}

}  // namespace

double smallest_step(std::vector<double> readings) {
  std::sort(readings.begin(), readings.end());
  double step = 0;
  for (std::size_t k = 1; k < readings.size(); ++k) {
    const double difference = readings[k] - readings[k - 1];
    // Readings printed with few digits differ by rounding of the text; that is no step.
    if (difference > 1e-9 * std::abs(readings[k]) && (step == 0 || difference < step))
      step = difference;
  }
  return step;
}

Adc aligned_with(const SampleTable& readings, const Adc& declared) {
  constexpr double kTurn = 2 * std::numbers::pi;
  constexpr double kOneShift = 0.99;  // of the mean length, were all the same
  constexpr double kNoShift = 0.05;   // of a step
  constexpr double kHighest = 0.75;   // of a step: the middle of a code is above its lower end
  std::complex<double> sum = 0;
  std::size_t count = 0;
  for (const std::vector<double>& u_V : readings.u_V) {
    for (const double u : u_V)
      sum += std::polar(1.0, kTurn * std::remainder((u - declared.min_V) / declared.lsb_V(), 1));
    count += u_V.size();
  }
  double shift = std::arg(sum) / kTurn;
  if (std::abs(sum) < kOneShift * static_cast<double>(count) || std::abs(shift) < kNoShift)
    return declared;
  if (shift < kHighest - 1) shift += 1;
  const double shift_V = shift * declared.lsb_V();
  return {declared.bits, declared.min_V + shift_V, declared.max_V + shift_V};
}

std::vector<std::int64_t> codes_seen(std::span<const double> u_V, const Adc& adc) {
  std::vector<std::int64_t> codes = codes_of(u_V, adc);
  std::sort(codes.begin(), codes.end());
  codes.erase(std::unique(codes.begin(), codes.end()), codes.end());
  return codes;
}

int bits_that_would_show(const std::vector<std::int64_t>& codes, const Adc& adc) {
  constexpr std::size_t kEnough = 12;  // different codes that agree by chance once in 4000
  if (codes.size() < kEnough) return 0;
  const std::int64_t range = codes.back() - codes.front();
  int bits = 0;
  while (bits < adc.bits && range >= std::int64_t{4} << bits) ++bits;
  return bits;
}

std::vector<StuckBit> stuck_bits(const std::vector<std::int64_t>& codes, const Adc& adc) {
  std::vector<StuckBit> stuck;
  int low_run = 0;  // neighbouring stuck bits from the lowest on
  for (int bit = 0; bit < bits_that_would_show(codes, adc); ++bit) {
    const std::optional<StuckBit> found = unchanging(codes, bit);
    if (!found) continue;
    stuck.push_back(*found);
    if (low_run == bit && stuck.front().value == stuck.back().value) ++low_run;
  }
  if (low_run > 1) stuck.erase(stuck.begin(), stuck.begin() + low_run);
  return stuck;
}

namespace {

/// log of the number of ways to choose k out of n.
double log_choices(double n, double k) {
  return log_gamma(n + 1) - log_gamma(k + 1) - log_gamma(n - k + 1);
}

/// How many readings jump away from the others of their dwell by this bit, and would lie next to
/// them, on its other side, if the bit were what it is not.
std::size_t readings_that_jump(const MeasurementSet& set, std::size_t axis, const Adc& adc,
                               const StuckBit& stuck) {
  constexpr std::int64_t kBeyondNoise = 4;  // codes
  const std::int64_t size = std::int64_t{1} << stuck.bit;
  const std::int64_t sign = stuck.value ? -1 : 1;
  std::size_t jumps = 0;
  for (const Pose& pose : set.poses) {
    if (pose.count == 0) continue;
    std::vector<std::int64_t> codes = codes_of(readings_of(set, axis, pose), adc);
    for (std::int64_t& code : codes) code *= sign;
    const auto [least, greatest] = std::minmax_element(codes.begin(), codes.end());
    const std::int64_t low = *least, high = *greatest;
    if (high - low < 3 * size / 4) continue;
    // Those far below belong next to the others, above or below.
    std::int64_t least_moved = low + size, most_moved = low + size, least_kept = high;
    std::size_t moved = 0;
    for (const std::int64_t code : codes) {
      if (2 * code < low + high) {
        ++moved;
        most_moved = std::max(most_moved, code + size);
      } else {
        least_kept = std::min(least_kept, code);
      }
    }
    const bool apart = least_moved > high || most_moved < least_kept;
    const std::int64_t spread = std::max(high, most_moved) - std::min(least_kept, least_moved);
    // A spike comes to lie anywhere, a reading without its bit where noise takes the others.
    const std::int64_t noise = std::max(high - least_kept, most_moved - least_moved);
    if (apart && spread <= std::min(size / 4, 2 * noise + kBeyondNoise)) jumps += moved;
  }
  return jumps;
}

/// Bits that never change and that readings of one dwell jump by.
std::vector<StuckBit> jumping_bits(const MeasurementSet& set, std::size_t axis,
                                   const std::vector<std::int64_t>& codes, const Adc& adc) {
  constexpr int kLowest = 3;          // below it noise makes such jumps
  constexpr std::size_t kEnough = 2;  // readings: a single one may be a spike
  std::vector<StuckBit> found;
  for (int bit = kLowest; bit < adc.bits; ++bit) {
    std::optional<StuckBit> stuck = unchanging(codes, bit);
    if (!stuck || readings_that_jump(set, axis, adc, *stuck) < kEnough) continue;
    stuck->is_jumped_over = true;
    found.push_back(*stuck);
  }
  return found;
}

/// The codes as if the converter had never had these bits, ascending like the bits.
std::vector<std::int64_t> without_bits(const std::vector<std::int64_t>& codes,
                                       const std::vector<StuckBit>& bits) {
  std::vector<std::int64_t> left = codes;
  // From the highest on, so that the places of the others stay.
  for (auto bit = bits.rbegin(); bit != bits.rend(); ++bit)
    for (std::int64_t& code : left)
      code = (code >> (bit->bit + 1) << bit->bit) | (code & ((std::int64_t{1} << bit->bit) - 1));
  return left;
}

}  // namespace

std::size_t dwells_over_codes(const MeasurementSet& set, std::size_t axis, const Adc& adc,
                              const std::vector<StuckBit>& stuck) {
  constexpr std::size_t kReadingsPerCode = 4;  // at least, so that none is missing by chance
  std::size_t dwells = 0;
  for (const Pose& pose : set.poses) {
    std::map<std::int64_t, std::size_t> readings;
    for (const std::int64_t code : without_bits(codes_of(readings_of(set, axis, pose), adc), stuck))
      ++readings[code];
    if (pose.count < kReadingsPerCode * readings.size()) continue;
    // In the tails of noise a code is missing soon: only one between two that are common counts.
    const auto over =
        std::adjacent_find(readings.begin(), readings.end(), [](const auto& a, const auto& b) {
          return b.first - a.first > 1 && std::min(a.second, b.second) >= kReadingsPerCode;
        });
    dwells += over != readings.end() ? 1 : 0;
  }
  return dwells;
}

namespace {

/// Lines through intervals, (height at zero, slope), as the polygon of all of them.
using Polygon = std::vector<Eigen::Vector2d>;

/// The part of a convex polygon where normal·x ≤ bound.
Polygon clipped(const Polygon& polygon, const Eigen::Vector2d& normal, double bound) {
  Polygon left;
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Eigen::Vector2d &here = polygon[k], &next = polygon[(k + 1) % polygon.size()];
    const double above_here = normal.dot(here) - bound, above_next = normal.dot(next) - bound;
    if (above_here <= 0) left.push_back(here);
    if ((above_here < 0 && above_next > 0) || (above_here > 0 && above_next < 0))
      left.push_back(here + (next - here) * (above_here / (above_here - above_next)));
  }
  return left;
}

/// Mean of the lines that pass each x within `half` of its y, and the lower factor of their
/// covariance, all of them equally likely; `near` where there are none.
struct FeasibleLine {
  Eigen::Vector2d mean;
  Eigen::Matrix2d root_covariance = Eigen::Matrix2d::Zero();
};
FeasibleLine feasible_line(const std::vector<double>& x, const std::vector<double>& y,
                           const Eigen::Vector2d& near, double half) {
  const double reach = 2, slope_reach = 2 / std::max(1.0, x.back());
  Polygon lines;
  for (const auto& [a, b] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}})
    lines.push_back(near + Eigen::Vector2d(a * reach, b * slope_reach));
  for (std::size_t k = 0; k < x.size(); ++k) {
    lines = clipped(lines, {1, x[k]}, y[k] + half);
    lines = clipped(lines, {-1, -x[k]}, half - y[k]);
  }
  FeasibleLine result{near};
  if (lines.size() < 3) return result;
  // Area, first and second moments of the triangles about the first corner.
  double area = 0;
  Eigen::Vector2d first = Eigen::Vector2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  for (std::size_t k = 1; k + 1 < lines.size(); ++k) {
    const Eigen::Vector2d u = lines[k] - lines[0], v = lines[k + 1] - lines[0], sum = u + v;
    const double triangle = 0.5 * std::abs(u(0) * v(1) - u(1) * v(0));
    area += triangle;
    first += triangle / 3 * sum;
    second += triangle / 12 * (u * u.transpose() + v * v.transpose() + sum * sum.transpose());
  }
  if (!(area > 0)) return result;
  const Eigen::Vector2d off = first / area;
  result.mean = lines[0] + off;
  result.root_covariance =
      Eigen::LLT<Eigen::Matrix2d>(second / area - off * off.transpose()).matrixL();
  if (!result.root_covariance.allFinite()) result.root_covariance.setZero();
  return result;
}

/// Codes, ascending, on the points of a lattice.
struct LatticeFit {
  bool good = false;  ///< all within `tolerance`
  double middle = 0;  ///< of their distances from the points, the first of which is the first code
  double spread = 0;
};
LatticeFit lattice_fit(std::span<const std::int64_t> codes, double step, double tolerance) {
  // The lowest code lies up to half a declared step off its point. Where the lattice leaves
  // little room beside that, the remainders would wrap unless they are centred, and lie far apart.
  const int shifts = static_cast<int>(std::ceil(1 / (step - tolerance)));
  LatticeFit best;
  for (int k = 0; k < shifts; ++k) {
    const double shift = (k + 0.5) / shifts - 0.5;
    double low = step, high = -step;
    for (const std::int64_t code : codes) {
      const double off = std::remainder(static_cast<double>(code - codes.front()) - shift, step);
      low = std::min(low, off);
      high = std::max(high, off);
      if (high - low > tolerance) break;
    }
    const double spread = high - low;
    if (spread <= tolerance && (!best.good || spread < best.spread))
      best = {true, shift + 0.5 * (low + high), spread};
  }
  return best;
}

double range_of(std::span<const std::int64_t> codes) {
  return static_cast<double>(codes.back() - codes.front());
}

/// The codes that lie closest together, of more and more of them.
std::vector<std::span<const std::int64_t>> closest_codes(const std::vector<std::int64_t>& codes) {
  constexpr std::size_t kFewest = 64, kRatio = 4;
  std::vector<std::span<const std::int64_t>> all;
  for (std::size_t count = kFewest; count < codes.size() / 2; count *= kRatio) {
    std::span<const std::int64_t> closest(codes.data(), count);
    for (std::size_t first = 1; first + count <= codes.size(); ++first) {
      const std::span<const std::int64_t> next(codes.data() + first, count);
      if (range_of(next) < range_of(closest)) closest = next;
    }
    all.push_back(closest);
  }
  return all;
}

}  // namespace

std::optional<Lattice> coarser_lattice(const std::vector<std::int64_t>& codes, const Adc& adc,
                                       std::size_t dwells_over_codes, double chance) {
  constexpr double kFinest = 1.15, kCoarsest = 128;  // of the declared step
  if (codes.size() < 5) return {};
  // In declared steps from the lowest code. Rounding twice leaves half a step either way.
  const double range = range_of(codes);
  constexpr double kTolerance = 1.05;
  const double resolution = 0.15 / range;
  const auto fit = [&](double step) {
    // Between its points a lattice leaves codes out.
    if (static_cast<double>(codes.size()) > range / step + 2) return LatticeFit{};
    return lattice_fit(codes, step, kTolerance);
  };
  const std::vector<std::span<const std::int64_t>> close_codes = closest_codes(codes);
  // Codes that lie close together rule out many steps at once: a step shorter by a share of that
  // over their range moves the points among them by no more than kMoves.
  const auto steps_ruled_out = [&](double step) -> double {
    constexpr double kMoves = 0.05;
    for (const auto& close : close_codes)
      if (!lattice_fit(close, step, kTolerance + kMoves).good)
        return std::max(1.0, std::floor(kMoves / range_of(close) / (resolution / 3)));
    return 0;
  };
  /// Neighbouring steps that fit.
  struct Steps {
    double first = 0, last = 0;
    double tightest = 0, least_spread = 0;
  };
  // Every lattice point is rounded to one code; codes a whole declared step apart are two for one.
  const auto is_exact = [](double spread) { return spread < 1 - 1e-9; };
  const auto steps_below = [&](double& tried, double finest) {
    Steps steps;
    while (tried > finest) {
      const double ruled_out = steps_ruled_out(tried);
      const bool good = ruled_out == 0 && fit(tried).good;
      if (!good && steps.first > 0) break;
      if (good) {
        if (steps.first == 0) steps.first = tried;
        steps.last = tried;
      }
      tried *= std::pow(1 - resolution / 3, std::max(1.0, ruled_out));
    }
    // Of the coarsest of them without doubt: a finer one may fit where some of its points are not
    // seen.
    steps.tightest = 0.5 * (steps.first + steps.last);
    steps.least_spread = kTolerance;
    constexpr int kCloser = 64;
    double points = 0;  // of those without doubt so far
    for (int k = 0; k <= kCloser && steps.first > 0; ++k) {
      const double step = steps.first + (steps.last - steps.first) * k / kCloser;
      const LatticeFit closer = fit(step);
      const bool exact = closer.good && is_exact(closer.spread);
      const double points_here = exact ? std::round((range - closer.middle) / step) : 0;
      if (points > 0 && points_here != points) break;
      points = points_here;
      if (!closer.good || closer.spread >= steps.least_spread) continue;
      steps.tightest = step;
      steps.least_spread = closer.spread;
    }
    return steps;
  };
  // From the coarsest down: every part of a step that fits would fit, too. A step must occur often
  // enough to be told from chance. Next to the true step a simple ratio may fit almost as well.
  double tried = std::min(kCoarsest, (range + 1) / 4);
  Steps found = steps_below(tried, kFinest);
  if (found.first == 0) return {};
  const double no_part = std::max(kFinest, found.first / 1.5);
  while (!is_exact(found.least_spread) && tried > no_part) {
    const Steps next = steps_below(tried, no_part);
    if (next.first > 0 && is_exact(next.least_spread)) found = next;
  }
  // Of all sets of so many codes within the range, those that lie on one of the lattices. The code
  // of a point changes for some point whenever the origin moves a little.
  const double allowed = is_exact(found.least_spread) ? 1 : 2;
  const double step = found.tightest;
  const double seen = static_cast<double>(codes.size());
  const double points = std::max(seen, std::floor(range / step) + 1);
  const double lattices = std::log(kCoarsest / kFinest) / resolution * points;
  const double log_chance = std::log(lattices) + log_choices(allowed * points, seen) -
                            log_choices(range + 1, seen) +
                            static_cast<double>(dwells_over_codes) * std::log(0.5);
  if (log_chance > std::log(chance)) return {};
  const double lsb_V = adc.lsb_V(),
               front_V = adc.min_V + lsb_V * static_cast<double>(codes.front());
  const LatticeFit middle = fit(step);
  std::vector<double> points_seen, steps_seen;
  for (const std::int64_t code : codes) {
    steps_seen.push_back(static_cast<double>(code - codes.front()));
    points_seen.push_back(std::round((steps_seen.back() - middle.middle) / step));
  }
  const FeasibleLine line = feasible_line(points_seen, steps_seen, {middle.middle, step},
                                          std::max(0.5, 0.5 * middle.spread));
  Lattice lattice{lsb_V * line.mean(1), front_V + lsb_V * line.mean(0)};
  for (std::size_t d = 0; d < 2; ++d) {
    const Eigen::Vector2d off = lsb_V * line.root_covariance.col(static_cast<Eigen::Index>(d));
    lattice.deviation.at(d) = {off(1), off(0)};
  }
  return lattice;
}

double Lattice::seen_V(double point) const {
  return point >= 0 && point < static_cast<double>(reading_V.size())
             ? reading_V[static_cast<std::size_t>(point)]
             : std::numeric_limits<double>::quiet_NaN();
}

namespace {

/// With each point as it was read: what rounds may stand behind the declared converter, so that
/// readings are no codes of that.
void take_readings(Lattice& lattice, std::span<const double> u_V) {
  for (const double reading_V : u_V) {
    const long k = std::lround((reading_V - lattice.origin_V) / lattice.step_V);
    if (k < 0) continue;
    const auto place = static_cast<std::size_t>(k);
    if (place >= lattice.reading_V.size())
      lattice.reading_V.resize(place + 1, std::numeric_limits<double>::quiet_NaN());
    lattice.reading_V[place] = reading_V;
  }
}

}  // namespace

CodeFaults code_faults(const MeasurementSet& set, std::size_t axis, const Adc& adc) {
  const std::vector<std::int64_t> codes = codes_seen(set.samples.u_V[axis], adc);
  CodeFaults faults{jumping_bits(set, axis, codes, adc),
                    coarser_lattice(codes, adc, dwells_over_codes(set, axis, adc))};
  if (faults.coarser_lattice) take_readings(*faults.coarser_lattice, set.samples.u_V[axis]);
  for (const StuckBit& bit : stuck_bits(codes, adc))
    if (std::none_of(faults.stuck_bits.begin(), faults.stuck_bits.end(),
                     [&](const StuckBit& known) { return known.bit == bit.bit; }))
      faults.stuck_bits.push_back(bit);
  std::sort(faults.stuck_bits.begin(), faults.stuck_bits.end(),
            [](const StuckBit& a, const StuckBit& b) { return a.bit < b.bit; });
  if (faults.stuck_bits.empty() || !faults.coarser_lattice) return faults;
  // That something is wrong is certain; what it is, is the question.
  constexpr double kWithoutBits = 1e-3;
  if (coarser_lattice(without_bits(codes, faults.stuck_bits), adc,
                      dwells_over_codes(set, axis, adc, faults.stuck_bits), kWithoutBits))
    faults.stuck_bits.clear();
  else if (faults.stuck_bits.size() > 1 || faults.stuck_bits.front().bit > 0)
    faults.coarser_lattice.reset();
  else
    faults.coarser_lattice = {2 * adc.lsb_V(),
                              adc.min_V + adc.lsb_V() * static_cast<double>(codes.front())};
  return faults;
}

}  // namespace plumbline
