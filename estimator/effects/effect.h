// What the 12-parameter model lacks, one effect at a time.
//
// An effect is one file of this folder: its id, its parameters with units, its response in full
// (not linearised), and where a search has to start. catalogue.h lists them; nothing else names
// one.
//
// Parameter values are handed over as `p[0], p[1] …` in the order of parameters().
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimator/angle_units.h"
#include "estimator/effects/visit_log.h"

namespace plumbline {

/// How the response depends on a parameter, and so how it is searched and refined.
enum class ParameterRole {
  amplitude,  ///< zero means no effect; estimated, its uncertainty comes from the fit
  shape,      ///< continuous but nonlinear (a time constant); searched on a grid, then refined
  index,      ///< discrete (a pose, a harmonic, a bit); searched over all its values
};

struct ParameterInfo {
  std::string name;  ///< as in result.json
  std::string unit;
  ParameterRole role = ParameterRole::amplitude;
  double step = 0;     ///< over which the response is differentiated; 0: fitted to role and value
  bool place = false;  ///< shape: a place, which may be zero or negative, and not a size
  /// Amplitude: where next to nothing is known of it, what is left is another effect.
  bool needed = false;
  /// Shape: the direction of what has two amplitudes, known as well as they are.
  bool direction = false;
  /// How something went that nothing recorded says: a program needs it, a reader does not.
  bool unrecorded = false;
  /// Index: when something happened, which lies somewhere between two samples.
  bool instant = false;
};

/// Where the search begins: shapes and indices at given values, amplitudes at a small typical size
/// (the sign is free). Amplitudes that are zero here stay out of this hypothesis.
struct Hypothesis {
  std::vector<double> p;
};

enum class Subject {
  head,    ///< changes the geometry: seen by all three axes through one set of numbers
  sensor,  ///< changes the reading of one axis
};

/// The state of one axis at one visit that a term may depend on.
struct TermInput {
  const VisitLog& log;
  std::size_t visit;
  std::size_t axis;
  const std::vector<Eigen::Vector3d>& a_g;  ///< specific force at every visit, geometry included
  double response_g;                        ///< Σ_j K_ij·a_j / K_ii at this visit
  /// What the converter is given: U_i0 + Σ_j K_ij·a_j and the axis's terms that are not the
  /// converter's own.
  double output_V;
  double K_V_per_g;  ///< K_ii

  const Visit& at() const { return log.visits[visit]; }
  double a() const { return a_g[visit](static_cast<Eigen::Index>(axis)); }
};

/// What a number of the visit is multiplied with to become a term: the components of the specific
/// force of axes i + first and, if any, i + second for an effect on axis i; of none, 1.
struct ForceFactor {
  std::optional<std::size_t> first = {}, second = {};

  /// g, g² or 1.
  double of(const Eigen::Vector3d& a_g, std::size_t axis) const {
    const auto component_g = [&](const std::optional<std::size_t>& next) {
      return next ? a_g(static_cast<Eigen::Index>((axis + *next) % kAxisCount)) : 1;
    };
    return component_g(first) * component_g(second);
  }
};

/// How one angle of the head moves while the sensor is read.
struct AngleCourse {
  double HeadGeometry::*angle = &HeadGeometry::delta_rad;
  Eigen::VectorXd course_rad;  ///< at every sample of the visit
};

/// Stateless and immutable.
class Effect {
 public:
  virtual ~Effect() = default;
  virtual std::string id() const = 0;
  virtual Subject subject() const = 0;
  virtual std::vector<ParameterInfo> parameters() const = 0;
  /// Starting points on these data for `axis` (0 for the head); empty when the data cannot show the
  /// effect at all. Precondition: the log has all of columns().
  virtual std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const = 0;
  /// Hypotheses close to `hypothesis`, too many to search among all the others; the one that the
  /// search chose is compared with these.
  virtual std::vector<Hypothesis> closer(const VisitLog&, std::size_t /*axis*/,
                                         const Hypothesis&) const {
    return {};
  }
  /// Hypotheses that say in one what several `instances` of the effect `repeated` on the same axis
  /// say one by one, or what one of them hints at; none where they have nothing in common.
  virtual std::vector<Hypothesis> in_one(const VisitLog&, std::size_t /*axis*/,
                                         const Effect& /*repeated*/,
                                         const std::vector<std::vector<double>>& /*p*/) const {
    return {};
  }
  /// Head: moves the geometry of visit `visit`, by angles that do not depend on what it is.
  virtual void displace(const VisitLog& log, std::size_t visit, const double* p,
                        HeadGeometry& head) const;
  /// Sensor: the bracketed term, input-referred, mean over the dwell, in g.
  virtual double term_g(const TermInput& input, const double* p) const;
  /// Where the term (head: the angle) is a number of the visit, whatever the model is, times
  /// factor(): that number at every visit, for whoever asks again and again. Empty where the term
  /// is no such product.
  virtual std::vector<double> numbers_of_visits(const VisitLog&, std::size_t /*axis*/,
                                                const double* /*p*/) const {
    return {};
  }
  virtual ForceFactor factor() const { return {}; }
  /// Sensor: whether those numbers are the same whatever the axis.
  virtual bool same_numbers_on_axes() const { return false; }
  /// term_g() and displace() from that number.
  double term_of_number_g(const TermInput& input, double number) const {
    return number * factor().of(input.a_g[input.visit], input.axis);
  }
  virtual void displace_by_number(const VisitLog& log, std::size_t visit, double number,
                                  const double* p, HeadGeometry& head) const;
  /// Sensor: whether it may be one of this axis.
  virtual bool acts_on(std::size_t /*axis*/) const { return true; }
  /// Sensor: whether it is a function of what the converter is given, all other terms included.
  virtual bool at_converter() const { return false; }
  /// Sensor: whether the noise of single readings is smaller where it acts.
  virtual bool quiets() const { return false; }
  /// Whether it changes while the head rests; course_g() or angle_course() says how.
  virtual bool within_dwell() const { return false; }
  /// Sensor: the term at every sample of the visit, g.
  virtual Eigen::VectorXd course_g(const TermInput& input, const double* p) const;
  /// Head, within the dwell: that of which displace() adds the mean.
  virtual AngleCourse angle_course(const VisitLog& log, std::size_t visit, const double* p) const;
  /// The visit with the beginning of which it sets in for good, if it is one that does.
  virtual std::optional<std::size_t> sets_in_at(const VisitLog&,
                                                const std::vector<double>& /*p*/) const {
    return {};
  }
  /// Sensor: whether one source outside the triad is felt by every axis.
  virtual bool of_the_room() const { return false; }
  /// Whether it depends on earlier visits, or on what was recorded then.
  virtual bool remembers() const { return false; }
  /// Whether its response at a visit before which nothing is recorded is a guess that no parameter
  /// stands for.
  virtual bool guesses_at_start() const { return false; }
  /// Whether the codes prove what hypotheses() lists, so that it joins the model unasked.
  virtual bool certain(const VisitLog&, std::size_t /*axis*/) const { return false; }
  /// Standard uncertainty of parameter `k` by the range to which the data narrow its choice: where
  /// it is not fitted, and the most that it can be where it is; 0 where there is no such range.
  virtual double choice_uncertainty(const VisitLog&, std::size_t /*axis*/,
                                    const std::vector<double>& /*p*/, std::size_t /*k*/) const {
    return 0;
  }
  /// Index parameters that are known by a range only: `p` with all of them off together by one
  /// standard deviation, once for each independent way.
  virtual std::vector<std::vector<double>> one_deviation_away(
      const VisitLog&, std::size_t /*axis*/, const std::vector<double>& /*p*/) const {
    return {};
  }
  /// Other parameters that may be true of a later set although `p` was found on `run`: they say
  /// the same of all of that, or concern how the head comes to the first pose of a set.
  virtual std::vector<std::vector<double>> left_open_by(const RunHistory& /*run*/,
                                                        const std::vector<double>& /*p*/) const {
    return {};
  }
  /// The same, but open at the visits where nothing recorded decides the response (whether a force
  /// rose that came back to what it was); empty where there are none or `p` leaves them open.
  virtual std::vector<double> with_ties_open(const VisitLog&, std::size_t /*axis*/,
                                             const std::vector<double>& /*p*/) const {
    return {};
  }
  /// Where `p` leaves visits open: parameters one or the other of which is true of each of them,
  /// and that say the same as `p` of all others.
  virtual std::vector<std::vector<double>> ways_at_ties(const std::vector<double>& /*p*/) const {
    return {};
  }
  /// Whether it may stand in a model more than once for one axis: at another pose, say.
  virtual bool repeats() const { return false; }
  /// The same response by parameters as one would state them: positive amplitudes, angles within
  /// one turn.
  virtual void normalise(std::vector<double>&) const {}
  /// Whether it is the fault of one visit alone, which no other visit can predict.
  virtual bool concerns_one_visit() const { return false; }
  /// Recorded columns that it is a function of, kTemperatureColumn among them.
  virtual std::vector<std::string> columns() const { return {}; }
  /// What a user wrote to describe it; empty for built-in effects.
  virtual std::string definition() const { return {}; }
  /// What belonged to one run only does not carry over to another set of the same unit.
  virtual bool carries_over() const { return true; }
};

/// Helpers that several effects share.
namespace effect {

inline constexpr double kTurn_rad = 360 * kRadPerDeg;
/// Instants within a dwell are looked for in so many parts of it.
inline constexpr std::size_t kPartsOfDwell = 8;
/// Typical sizes that a search starts from, small against 1 g.
inline constexpr double kSmallTerm = 1e-3;
inline constexpr double kSmallAngle_deg = 0.02;

/// A parameter that says when something happened.
inline ParameterInfo instant(std::string name) {
  ParameterInfo info{std::move(name), "s", ParameterRole::index};
  info.instant = true;
  return info;
}
/// How many positions a turn has, as closely as two of these angles lie together. Harmonics of more
/// than half of that look like lower ones.
int positions_of_a_turn(std::vector<double> angles_rad);
/// A harmonic of order n of an angle that takes so many positions: n and the amplitudes of cosine
/// and sine, of a typical `size`. Two positions a period show only how they differ: there one of
/// the amplitudes is zero, the one that `angle_rad`, of any position, does not show.
Hypothesis harmonic(int n, int positions, double angle_rad, double size);
/// Times of the samples of the visit from the first on.
Eigen::ArrayXd since_arrival_s(const Visit& visit);
/// exp(−(t − t_arrival)/τ) at those times.
Eigen::ArrayXd decay_since_arrival(const Visit& visit, double tau_s);
/// Mean over the dwell of exp(−(t − origin)/τ), in closed form for even spacing.
double mean_decay(const Visit& visit, double origin_s, double tau_s);
/// What an arrival sets off and what dies away, exp(−t/τ)·(c·cos 2πft + s·sin 2πft), t since
/// arrival, p = f, τ, c, s: at every sample, and the mean over the dwell.
Eigen::VectorXd ringing(const Visit& visit, const double* p);
double mean_of_ringing(const Visit& visit, const double* p);
/// Where a search of it starts, of size 1; none for a dwell that does not show it.
std::vector<Hypothesis> starts_of_ringing(const Visit& visit);
/// Frequency and phase of a line, sin(2π·f·t + phase), t on the clock of the run.
ParameterInfo line_frequency();
ParameterInfo line_phase();
/// Where the fit of a phase starts: it keeps the sign of a shape, and from half a turn up no phase
/// comes near zero.
double start_of_phase_deg(const DwellLine& line);
/// Mean over the dwell of such a line of amplitude 1.
double mean_of_sine(const Visit& visit, double f_hz, double phase_deg);
/// The same at every sample.
Eigen::VectorXd sine(const Visit& visit, double f_hz, double phase_deg);
/// A positive amplitude, a phase within one turn.
void normalise_sine(double& amplitude, double& phase_deg);
/// Whether a component of the specific force, g, is zero but for rounding.
inline bool is_nearly_zero(double a_g) { return std::abs(a_g) < 1e-9; }
/// `count` values from `first` to `last` in equal ratios.
std::vector<double> geometric(double first, double last, int count);
/// Share of Gaussian noise of standard deviation `sd` about `value` that lies below `edge`; with no
/// noise 0 or 1.
double share_below(double edge, double value, double sd);
/// How many whole numbers there are from the whole number `first` to `last`. None where a fit has
/// strayed so far that they are not finite.
int whole_numbers(double first, double last);
/// Share of Gaussian noise of standard deviation `sd` about `value`, both in units of a bit, where
/// that bit of the code is as `set` says: codes with the bit set begin at odd numbers.
double share_with_bit(double value, double sd, bool set);
inline constexpr double kLeastNoise = 0.02;  ///< steps, where a search for more starts
inline constexpr double kMostNoise = 3;      ///< steps, beyond which nothing of them is left
inline constexpr double kReach = 6;  ///< standard deviations beyond which noise does not come

}  // namespace effect

}  // namespace plumbline
