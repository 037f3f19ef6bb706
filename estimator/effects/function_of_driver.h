// Functions of one variable with free coefficients, added to a bias, a scale or an angle: the
// shapes that structure without a name is described with.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "estimator/effects/driver.h"
#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// What an angle of the head may grow with besides: what pulls at a tilted spindle.
enum class Pull { none, cosine_of_h, sine_of_h };

/// What a function of the visits acts on.
struct Target {
  TermForm form = TermForm::bias;
  double HeadGeometry::*angle = &HeadGeometry::delta_rad;  ///< geometry
  /// Scale: the components multiplied are those of axes i + other and, if any, i + second.
  std::size_t other = 0;
  std::optional<std::size_t> second = {};
  Pull pull = Pull::none;      ///< geometry
  bool any_direction = false;  ///< geometry: for towards_a_direction()

  std::string words() const;
  /// Whether what is added to all visits alike is what the 12 parameters describe.
  bool mean_in_the_twelve() const;
  const char* unit() const;
  double typical_size() const;
  /// What the function is multiplied with: for a scale the components.
  ForceFactor factor() const;
  /// The same for an angle.
  double factor_at(const Visit& visit) const;
};

inline constexpr Target kBias{}, kScale{.form = TermForm::scale};
/// The angles of head and base; the tilt of the base is for towards_a_direction() and
/// in_both_directions(), what turns the triad in its seat for about_some_axis().
inline constexpr Target kDelta{.form = TermForm::geometry};
inline constexpr Target kH{.form = TermForm::geometry, .angle = &HeadGeometry::h_rad};
inline constexpr Target kRoll{.form = TermForm::geometry, .angle = &HeadGeometry::roll_rad};
inline constexpr Target kSkew{.form = TermForm::geometry, .angle = &HeadGeometry::skew_rad};
inline constexpr Target kTilt{
    .form = TermForm::geometry, .angle = &HeadGeometry::h_rad, .any_direction = true};
inline constexpr Target kSeat{.form = TermForm::geometry, .angle = &HeadGeometry::seat_y_rad};

/// Σ c_d·P_d, d = 1 … degree, of the range from low to high. Beyond it degree 1 goes straight on,
/// degree 2 as a parabola as far as `curved`, in half-ranges, and then straight on; higher degrees
/// are held.
double legendre_series(double value, double low, double high, const double* c, int degree,
                       double curved = 0);

/// Its slope at a value within the range: P′_d = P′_{d−2} + (2d − 1)·P_{d−1}.
double legendre_slope(double value, double low, double high, const double* c, int degree);

/// Numbers of cycles in the range of a driver: least, least + step … most.
struct Cycles {
  double least, step, most;
};

/// legendre_series() over the range that was seen.
std::unique_ptr<SmoothTerm> polynomial(DriverPointer driver, const Target& target, int degree);
/// Of a component of the specific force.
std::unique_ptr<SmoothTerm> square(DriverPointer driver, const Target& target);
/// Harmonics of order 1 … `order` of an angle.
std::unique_ptr<SmoothTerm> harmonic_series(DriverPointer driver, const Target& target, int order);
/// One harmonic of an angle, this one or a higher one, as far as the positions tell it from lower
/// ones.
std::unique_ptr<SmoothTerm> harmonic(DriverPointer driver, const Target& target, int lowest);
/// Of order n, 2n … or n, 3n … of an angle: what repeats itself with each of n parts of the turn.
std::unique_ptr<SmoothTerm> harmonics_of_part(DriverPointer angle, const Target& target);
/// One wave of unknown period, none shorter than `shortest`.
std::unique_ptr<SmoothTerm> wave(DriverPointer driver, const Target& target, const Cycles& cycles,
                                 double shortest = 0);
/// Whether this is a wave(): its parameters are start, period and the two amplitudes.
bool is_wave(const Effect& effect);
/// Something at one of the positions of an angle and at no other, of those that were visited three
/// times or more: a damaged division of the head.
std::unique_ptr<SmoothTerm> one_position(DriverPointer angle, const Target& target);
/// A bell of unknown middle and width: something that happened once and took a while, or one place
/// of an angle.
std::unique_ptr<SmoothTerm> bell(DriverPointer driver, const Target& target);
/// What passes through a resonance: as 1/(1 + x²) about an unknown value.
std::unique_ptr<SmoothTerm> resonance(DriverPointer driver, const Target& target);
/// What passes by: to one side and to the other as x/(1 + x²) about an unknown value.
std::unique_ptr<SmoothTerm> passage(DriverPointer driver, const Target& target);
/// To one side and to the other of an unknown value, over an unknown width (the slope of a bell): a
/// seam between two segments of a characteristic.
std::unique_ptr<SmoothTerm> seam(DriverPointer driver, const Target& target);
/// Codes of an unknown band that all read as one of its edges: codes that are missing.
std::unique_ptr<SmoothTerm> missing_band(DriverPointer code, const Target& target);
/// The same between two unknown values of an angle and nothing elsewhere.
std::unique_ptr<SmoothTerm> sector(DriverPointer angle, const Target& target);
/// The same between two unknown times, at once or with soft edges; of a dwell in which it begins or
/// ends it is there for a part.
std::unique_ptr<SmoothTerm> window(DriverPointer clock, const Target& target);
/// A wave that dies away with the time, from the first pose on.
std::unique_ptr<SmoothTerm> dying_wave(DriverPointer clock, const Target& target);
/// There at once from an unknown time on, then it dies away by an unknown time constant, no longer
/// than `longest_s`: what lasts is a step.
std::unique_ptr<SmoothTerm> relaxation(DriverPointer clock, const Target& target, double longest_s);
/// There for part of every period, of unknown length and width: something switches on and off.
std::unique_ptr<SmoothTerm> pulses(DriverPointer driver, const Target& target);
/// Grows in a straight line and falls back at once, over and over.
std::unique_ptr<SmoothTerm> saw_tooth(DriverPointer driver, const Target& target);
/// Whether this is a saw_tooth(): its parameters are the width of an edge, period, place of an edge
/// and amplitude.
bool is_saw_tooth(const Effect& effect);
/// Nothing on one side of an unknown value, proportional to the distance from it on the other; of a
/// component of the specific force, and of a change, also nothing up to an unknown size on both
/// sides.
std::unique_ptr<SmoothTerm> bend(DriverPointer driver, const Target& target);
/// There where one bit of the code is set, `adc` saying how large bits are; without it none are
/// looked for.
std::unique_ptr<SmoothTerm> bit_of_code(DriverPointer code, const Target& target,
                                        const std::optional<Adc>& adc);
/// How a step is searched for; once found, both say the same.
enum class StepEdge { sharp, gradual };
/// Nothing on one side of an unknown value, an unknown power of the distance from it on the other.
std::unique_ptr<SmoothTerm> power_beyond(DriverPointer driver, const Target& target);
/// Proportional to a component of the specific force, the axis's own, with or without an offset,
/// beyond an unknown value or size and nothing up to it: an amplifier that changes its range.
std::unique_ptr<SmoothTerm> gain_beyond(DriverPointer component, const Target& target);
/// From one side to the other twice a turn, at an unknown angle and over an unknown part of it: a
/// load that is thrown across a play.
std::unique_ptr<SmoothTerm> thrown(DriverPointer angle, const Target& target);
/// Half a wave over half of the turn and nothing over the other: what presses to one side only.
std::unique_ptr<SmoothTerm> half_wave(DriverPointer angle, const Target& target);
/// From nothing to all of it about an unknown value (logistic function).
std::unique_ptr<SmoothTerm> step(DriverPointer driver, const Target& target, StepEdge edge);
/// What dies away with the time, by an unknown time constant; of a target whose mean the 12
/// parameters do not hold, one no longer than `longest_s`.
std::unique_ptr<SmoothTerm> decay(DriverPointer clock, const Target& target, double longest_s);
/// An unknown power of the distance from where the driver began.
std::unique_ptr<SmoothTerm> power(DriverPointer driver, const Target& target);
/// ln(1 + distance from where the driver began over an unknown one).
std::unique_ptr<SmoothTerm> logarithm(DriverPointer driver, const Target& target);
/// What follows the driver through a play of unknown width: by how much it lags behind, or how far
/// it is from the driver's reference.
enum class OfPlay { lag, follower };
std::unique_ptr<SmoothTerm> play(DriverPointer driver, const Target& target, OfPlay of);
/// What the driver draws along against friction: from −1 to 1, over an unknown reach.
std::unique_ptr<SmoothTerm> friction(DriverPointer driver, const Target& target);

/// One of two states, to which the driver brings it beyond one or the other of two unknown values:
/// a relay, or a spring that snaps.
std::unique_ptr<SmoothTerm> relay(DriverPointer driver, const Target& target);

/// A harmonic of an angle, with amplitude and phase in a straight line of the driver.
std::unique_ptr<SmoothTerm> line_times_harmonic(DriverPointer driver, DriverPointer angle,
                                                const Target& target);
/// A field fixed to the base, as env.base_field, whose strength follows the driver in a straight
/// line.
std::unique_ptr<SmoothTerm> line_times_field(DriverPointer driver, DriverPointer delta,
                                             DriverPointer h, const Target& target);
/// What comes from one side, as strong as the driver says in a straight line, and is seen by what
/// the turn and the tilt leave turned towards it: light.
std::unique_ptr<SmoothTerm> line_on_one_side(DriverPointer driver, DriverPointer delta,
                                             DriverPointer h, const Target& target);
/// With the sign of a two-valued driver: at once when it changes, then dying away by an unknown
/// time constant.
std::unique_ptr<SmoothTerm> fading_reversal(DriverPointer direction, DriverPointer clock,
                                            const Target& target);
/// The same in every visit, but all of it dies away with the time from the first pose on.
std::unique_ptr<SmoothTerm> fading_direction(DriverPointer direction, DriverPointer clock,
                                             const Target& target);
/// A straight line of the driver between two values of an angle, and nothing elsewhere.
std::unique_ptr<SmoothTerm> line_in_a_part(DriverPointer driver, DriverPointer angle,
                                           const Target& target);
/// Two straight lines and their product.
std::unique_ptr<SmoothTerm> line_times_line(DriverPointer driver, DriverPointer other,
                                            const Target& target);
/// The same in a parabola.
std::unique_ptr<SmoothTerm> parabola_times_harmonic(DriverPointer driver, DriverPointer angle,
                                                    const Target& target);
/// A bell of one angle times one of another: what stands at one place beside the head.
std::unique_ptr<SmoothTerm> spot(DriverPointer angle, DriverPointer other, const Target& target);
/// The products of a harmonic of one angle and a harmonic of another.
std::unique_ptr<SmoothTerm> harmonic_times_harmonic(DriverPointer angle, DriverPointer other,
                                                    const Target& target);

}  // namespace plumbline
