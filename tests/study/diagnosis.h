// Does the diagnosis name what is there, and nothing else? Simulated sets with known effects,
// calibrated one after another and scored against the truth.
//
// Size of an effect: with the readings of the same unit with and without it (no noise, no rounding,
// but for effects of the converter), the change of the pose means is freed of what the 12
// parameters take up (ordinary least squares), and its RMS over the poses is divided by the RMS
// that noise alone leaves on that axis. The axis where this is largest counts; the amplitude is
// scaled until it is `size`. adc.mains_pickup averages out in the means: there the RMS over all
// samples of the change is divided by the same pose noise.
//
// Oracle: the same unit, head, room, noise and seed without the effect, fitted by generalised least
// squares under the true covariance, scored on the same left-out blocks and fresh poses.
//
// Fresh poses: the oracle's readings hold no effect, so it needs no past; a model with an effect
// that remembers does. All are therefore scored on the session as one record, in which the fresh
// poses follow those of the run, and without the first fresh pose, before which the head was homed
// and of whose predecessor the record says nothing. What evaluate() makes of the fresh poses as a
// file of their own stands beside it.
//
// Told: someone who knows which effect there is, and the true covariance, and estimates its
// parameters together with the 12 from the same readings: by the estimator's model of the effect
// from the true values on; where an effect is on no list, its amplitude, the response being known.
// What the error after exceeds this by, the search has cost; what this exceeds the oracle by, the
// readings do not tell.
//
// Effects outside the list: what counts as the right driver stands in diagnosis_own.cpp.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/enlarged_model.h"
#include "estimator/measurement.h"
#include "estimator/pose_means.h"
#include "rig/sim/random.h"
#include "rig/sim/record.h"
#include "rig/sim/world.h"

namespace plumbline::study {

// --- what is simulated ---------------------------------------------------------------------------

/// Noise of the outputs, and with it the timing of the poses.
enum class NoiseKind {
  white,     ///< nearly white; moves at the drive's speed, 1 s of settling
  examples,  ///< white, relaxations over five decades, weak random walk; a pose every 6.4 s
  coloured,  ///< relaxations and a random walk larger than the white noise of a pose
};
const char* to_string(NoiseKind kind);
const char* to_string(sim::RecordOrder order);

/// One set: everything random in it follows from `seed` and the values below.
struct SetDesign {
  std::uint64_t seed = 1;
  std::vector<std::string> effects = {};  ///< names of study_effects()
  double size = 3;                        ///< of every effect, in noise of a pose
  sim::RecordOrder order = sim::RecordOrder::snake;
  NoiseKind noise = NoiseKind::examples;
  int bits = 16;
  int samples_per_pose = 40;
  double static_s = 300;
};

/// What the parameters of an effect may depend on.
struct DrawContext {
  sim::Random& random;
  const sim::World& world;
  std::size_t axis;
  double run_s;    ///< length of the run
  double dwell_s;  ///< length of a pose
};
using DrawParameters = std::function<std::map<std::string, double>(const DrawContext&)>;

/// An effect that the study can add to a set.
struct StudyEffect {
  const char* name;  ///< id of the simulated effect; `:bias` or `:scale` appended to a column
  const char* axes;  ///< those of which one is drawn, "xyz"; "" for the head: no choice
  double largest;    ///< amplitude beyond which a size cannot be had with this design
  /// Outside the list: listed names that are no false claim, see diagnosis_own.cpp.
  std::vector<std::string> near;
  /// Drivers that count as right, for effects outside the list; empty for listed ones.
  std::vector<std::string> drivers;
  /// Parameters for an amplitude of 1; those named in `scaled` are multiplied by the amplitude.
  DrawParameters draw;
  std::vector<std::string> scaled;
};
const std::vector<StudyEffect>& study_effects();
/// Those outside the list; part of study_effects().
std::vector<StudyEffect> own_study_effects();
/// A random sign for the amplitude of that name.
DrawParameters either_sign(const char* name);
/// nullptr when there is none of that name.
const StudyEffect* find_study_effect(const std::string& name);
/// Names of all listed effects (true) or all outside the list (false), in the order of the table.
std::vector<std::string> effect_names(bool listed);

/// The unit, its noise and its room for a design, without effects.
sim::World study_world(const SetDesign& design);

/// A set with its truth and the same set without effects.
struct StudySet {
  sim::World world;           ///< with the effects, scaled
  sim::RecordedSet set;       ///< run and verification
  sim::RecordedSet plain;     ///< the same without effects
  SampleTable static_record;  ///< another day: own clock, own noise, same unit and effects
  PerAxis<Eigen::MatrixXd> covariance_V2;   ///< n × n, true, of the pose means of the run
  PerAxis<double> noise_mps2{};             ///< RMS that noise alone leaves after an ordinary fit
  std::vector<sim::EffectSetting> effects;  ///< as world.effects
  std::vector<double> size;                 ///< reached, one per effect
  std::vector<double> sigma;  ///< √(Δχ²) each would gain under the true noise: its detectability
  bool feasible = true;       ///< every effect could be scaled to the size
};
StudySet make_set(const SetDesign& design);
/// Over all samples; the column must be there.
double mean_of_column(const SampleTable& samples, const std::string& name);
/// Run and verification as that world would give them without noise and rounding.
sim::RecordedSet record_without_noise(const SetDesign& design, const sim::World& world);

// --- how it is scored ----------------------------------------------------------------------------

/// RMS over poses and axes, m/s².
struct Errors {
  double fresh = 0;    ///< on the verification poses
  double heldout = 0;  ///< on left-out blocks of time and of position
};

/// What a search claimed, held against the truth.
struct Claims {
  std::string found;        ///< what was reported, in words
  int effects = 0;          ///< true ones
  int named = 0;            ///< id and axes right
  int named_or_stated = 0;  ///< these, and those among the stated alternatives of a finding
  int wrong = 0;            ///< findings, listed or unlisted, that stand for no true effect
  int unlisted = 0;         ///< of the findings
  int driver_right = 0;     ///< true effects outside the list whose driver was told
  int near_name = 0;        ///< of these, by a listed name alone (StudyEffect::near)
  int listed_instead = 0;   ///< other listed names where only effects outside the list are

  int missed() const { return effects - named_or_stated - driver_right; }
  /// Findings beyond those that stand for, or in place of, a true effect.
  int additional() const { return std::max(0, wrong - missed()); }
  bool any() const { return wrong + named_or_stated + driver_right > 0; }
};

struct SetOutcome : Claims {
  SetDesign design;
  bool feasible = true;
  std::string truth;  ///< effects as simulated, in words
  std::vector<double> size;
  std::vector<double> sigma;
  Verdict verdict = Verdict::undetermined;
  double p_value = 1;
  double heldout_gain = 0;  ///< of the best finding

  int parameters = 0, parameters_within = 0;  ///< of named effects, within ±1.96·u
  int K_within = 0, U0_within = 0;            ///< of 9 and 3, of the certified model
  double worst_K = 0, worst_U0 = 0;           ///< largest |error|/u

  Errors before, after, oracle;
  double plain_oracle_fresh = 0;  ///< ordinary least squares without the effect
  double told_fresh = 0;          ///< of one who is told which effect there is
  /// By how much the run's readings favour what is true over what was found (criterion_of()).
  double truth_ahead = 0;
  double evaluated_fresh = 0;  ///< evaluate() on the fresh poses as a file of their own
  double seconds = 0;          ///< of calibrate()

  Claims naive;            ///< of the naive search
  double naive_fresh = 0;  ///< its error after
};

SetOutcome run_set(const SetDesign& design);
/// Scores a calibration of a set; run_set() is make_set(), calibrate(), this and the naive search.
SetOutcome score(const SetDesign& design, const StudySet& set, const Calibration& calibration);
/// A diagnosis held against the truth.
Claims check_claims(const SetDesign& design, const StudySet& set, const Diagnosis& diagnosis);
/// The 12 parameters in the estimator's convention: columns act about their mean over the run.
PerAxis<Eigen::Vector4d> true_twelve(const StudySet& set);
/// Fills the oracle's errors.
void score_oracle(const StudySet& set, SetOutcome& outcome);
/// One who is told the effects and estimates them from the same readings, under the true noise; NaN
/// where the estimator does not consider a listed one with these readings.
struct Told {
  double fresh_mps2 = std::numeric_limits<double>::quiet_NaN();  ///< error on the fresh poses
  double criterion = std::numeric_limits<double>::quiet_NaN();   ///< as criterion_of()
};
Told told_effects(const SetDesign& design, const StudySet& set);
/// -2 ln L of the run's readings under what was found and the true noise, but for a constant, and
/// ln of the number of means for each parameter (Schwarz, 1978).
double criterion_of(const StudySet& set, const Calibration& calibration);
/// Error of a model on the fresh poses that count; `poses` and `log` are those of the session.
double fresh_error_mps2(const StudySet& set, const std::vector<PoseMean>& poses,
                        const VisitLog& log, const EnlargedParameters& model);
/// Root mean square over the axes.
double over_axes(const PerAxis<double>& rms_mps2);
/// The fresh poses appended to the run: one record on one clock.
MeasurementSet session(const StudySet& set);

/// What most people would do: forward selection by BIC on the pose means, as if their noise were
/// white and of one size per axis. Same candidates (and preference for names), linearised about the
/// 12 parameters with shapes and indices where a search starts, until none lowers the BIC or ten
/// are taken.
struct NaiveResult {
  Diagnosis diagnosis;  ///< effects and unlisted only: ids, axes, drivers
  double fresh_mps2 = 0;
};
NaiveResult search_naively(const StudySet& set);

/// Writes the set as files that the command line program reads.
Result<void> dump(const StudySet& set, const std::string& folder);

// --- tables --------------------------------------------------------------------------------------

/// 95 % limits of a share, k out of n (Clopper & Pearson, 1934): exact, never too narrow.
struct Share {
  int k = 0;
  int n = 0;
  double value() const { return n > 0 ? static_cast<double>(k) / n : 0; }
  double lower() const;
  double upper() const;
};
std::string csv_header();
/// One line; its last column is the command line that makes the same set again.
std::string csv_row(const SetOutcome& outcome);
/// The command line that makes the same set again: tells the sets of a study apart.
std::string reproduce(const SetDesign& design);
/// Rows of an earlier piece of a study; a last line that was cut short is left out. `name` stands
/// for the text in messages. Errors: ErrorCode::input for rows of another version of the study.
Result<std::vector<SetOutcome>> read_csv(const std::string& text, const std::string& name);
/// Tables of what the issue asks for, for each kind of set among the given ones.
std::string summary(const std::vector<SetOutcome>& outcomes, double detectable_sigma);

/// Kinds of sets, each with tables of its own.
enum class SetKind { clean, single, multiple, own };
SetKind kind_of(const SetDesign& design);

/// By their names in command lines and tables.
NoiseKind noise_of(const std::string& name);
sim::RecordOrder order_of(const std::string& name);
/// "a+b" in parts; none for "none".
std::vector<std::string> effect_parts(const std::string& names);
std::string joined_name(const SetDesign& design);

}  // namespace plumbline::study
