// The whole engine: measured data in, everything that is reported out. No files, no clock.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "estimator/column_range.h"
#include "estimator/effects/visit_log.h"
#include "estimator/measurement.h"
#include "estimator/noise/noise_model.h"
#include "estimator/uncertainty/monte_carlo.h"

namespace plumbline {

class Effect;

/// Four parameters of one axis, [K_ix K_iy K_iz] in V/g and U_i0 in V, with their covariance.
struct AxisEstimate {
  Eigen::Vector4d value = Eigen::Vector4d::Zero();
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
};
using TriadEstimate = PerAxis<AxisEstimate>;

/// The same model estimated in several ways.
struct ModelEstimates {
  TriadEstimate batch_ls;
  std::optional<TriadEstimate> rls;  ///< only for the 12-parameter model
  TriadEstimate ekf;
  PerAxis<double> agreement_en{};  ///< largest E_n between EKF and batch per axis
};

/// Estimates after 1, 2, … poses: for the picture "estimate against number of positions".
struct Convergence {
  std::vector<TriadEstimate> rls;       ///< one per pose, in visiting order
  std::vector<TriadEstimate> ekf;       ///< one per pose
  std::vector<TriadEstimate> batch_ls;  ///< one per pose; meaningless before four poses
};

/// A parameter by the Kalman filter that has it in its state, and E_n against the batch fit.
struct FilterEstimate {
  double value = 0;
  double u = 0;
  double en = 0;
};

struct EffectParameter {
  std::string name;
  std::optional<std::size_t> axis;
  double value = 0;
  double u = 0;
  std::string unit;
  std::optional<FilterEstimate> filter = {};
  bool estimated = false;   ///< by the fit, and not chosen among instants, bits or poses
  bool unrecorded = false;  ///< ParameterInfo's
};

/// How large an effect that was not found would have had to be: its amplitude at 5 standard
/// uncertainties. Where it depends on when, where or how fast (a shape or an index that was
/// searched over), the middle of all of them, and the best and the worst of them. Infinite: these
/// poses do not show the effect, however large.
struct DetectionLimit {
  std::string id;
  std::optional<std::size_t> axis;  ///< nothing for the head
  std::string parameter;
  double limit = 0;
  double best = 0;
  double worst = 0;
  std::string unit;
  double sigmas = 0;  ///< by how many the effect stands out of what the final model leaves
};

/// Where a head can go.
struct HeadReach {
  double delta_min_deg = 0;
  double delta_max_deg = 350;
  double h_min_deg = 0;
  double h_max_deg = 80;
  bool is_limit = false;  ///< it must not go beyond; otherwise it is just where the run was
};

/// Poses that tell an effect from what could pass for it.
struct SeparatingPlan {
  struct Stop {
    double delta_deg = 0;
    double h_deg = 0;
  };
  std::vector<Stop> stops;    ///< in visiting order, some more than once
  double samples_factor = 1;  ///< dwell, in dwells of the run
  double decides_sigma = 0;   ///< expected distance of the nearest rival, standard deviations
};

/// What these data cannot tell a finding from, and what would.
struct Ambiguity {
  /// Listed effects and sums of them; of a structure others, too: "unlisted:DRIVER:FORM".
  std::vector<std::string> alternatives;
  std::string separate_by;         ///< words
  SeparatingPlan separating_plan;  ///< no stops: nothing to decide, or poses do not decide it
};

/// An effect that the 12-parameter model lacks and the data show.
struct FoundEffect : Ambiguity {
  std::string id;
  std::vector<std::size_t> axes;
  std::vector<EffectParameter> parameters;
  double p_value = 1;
  double heldout_gain = 0;
  std::string definition = {};  ///< of an effect that a user described, as they wrote it
  double sigmas = 0;  ///< the loss of fit without it, as that of a single Gaussian quantity
};

/// Structure that no listed effect explains.
struct UnlistedStructure : Ambiguity {
  std::string driver;
  std::string form;  ///< bias, scale, geometry or sample
  std::vector<std::size_t> axes;
  std::string shape;
  std::vector<EffectParameter> parameters;
  double p_value = 1;
  double heldout_gain = 0;
  double sigmas = 0;  ///< as FoundEffect::sigmas
  /// Whether it is the noise within the dwells that follows the driver: no mean knows of it.
  bool is_of_noise() const { return shape.starts_with("noise, "); }
  /// Whether it is slow noise that the static record knows nothing of.
  bool is_wandering() const { return is_of_noise() && form == "bias"; }
  /// Whether a reading, not the head, is said to follow the time.
  bool follows_the_time() const { return driver == "t_s" && (form == "bias" || form == "scale"); }
};

enum class Verdict { clean, explained, partly_explained, unexplained, undetermined };
const char* to_string(Verdict verdict);

/// Test of one axis's residual against what the identified noise would leave.
struct ResidualTest {
  double statistic = 0;
  double dof = 0;
  double p_value = 1;
};

struct Diagnosis {
  Verdict verdict = Verdict::undetermined;
  std::string reason;  ///< one sentence for a person
  PerAxis<ResidualTest> axis_test;
  double p_value = 1;  ///< of the whole test
  std::vector<FoundEffect> effects;
  std::vector<UnlistedStructure> unlisted;
  std::vector<DetectionLimit> not_found;  ///< every effect that could have been found and was not
  RunHistory history;                     ///< where something was found that remembers it

  /// All findings with what they could be as well; name: the id, or the driver without one.
  struct Finding {
    std::string name;
    const Ambiguity& ambiguity;
  };
  std::vector<Finding> findings() const;
  /// Whether any of them joined the model of the means.
  bool enlarges_model() const;
};

/// Input-referred errors in m/s² (volts / K_ii · g_n).
struct ErrorFigures {
  PerAxis<double> fit_pose_rms_mps2{};
  PerAxis<double> heldout_pose_rms_mps2{};
  PerAxis<double> heldout_pose_max_abs_mps2{};
  PerAxis<double> sample_rms_mps2{};
};

enum class DecisionStatus { pass, fail, conditional_pass, conditional_fail, none };
const char* to_string(DecisionStatus status);

/// Conformity with the limit, with guard band (ILAC G8).
struct Decision {
  DecisionStatus status = DecisionStatus::none;
  double limit_mps2 = 0;          ///< 0 without limits
  double max_abs_error_mps2 = 0;  ///< the measured value that is judged
  double u_mps2 = 0;              ///< its standard uncertainty
  double guard_band_mps2 = 0;
  std::string rule;  ///< the decision rule in words
};

/// One pose as the engine saw it, for pictures and tables; residuals are input-referred.
struct PoseResult {
  Pose pose;
  double t_mean_s = 0;
  double temp_C = 0;  ///< NaN when not recorded
  PerAxis<double> mean_V{};
  PerAxis<double> sd_V{};  ///< of the samples within the pose
  PerAxis<double> residual_before_mps2{};
  PerAxis<double> residual_after_mps2{};
};

/// One effect of the certified model, pose by pose, on the axis where it does most.
struct FittedTerm {
  std::string name;  ///< id of the effect; driver and shape of a structure without a name
  std::size_t axis = 0;
  std::string driver;             ///< the variable of which its values look most like a function
  std::vector<double> at;         ///< of that, at every pose, as recorded; angles in degrees
  std::vector<double> term_mps2;  ///< what it adds, input-referred
};

/// Directions of the parameter space that the poses do not determine.
struct Observability {
  int rank = 4;          ///< of the four columns [a_x a_y a_z 1]
  double condition = 0;  ///< of the column-scaled design
  std::string
      unobservable;  ///< names the direction when rank < 4, e.g. "K_z and U_0 (only a_z = 0 seen)"
};

/// Where converter steps are coarse against the noise, and the codes were used as intervals.
struct QuantizationUse {
  double step_V = 0;
  double sigma_V = 0;    ///< noise of one reading before rounding, estimated
  double scatter_V = 0;  ///< from pose to pose beyond positioning, estimated
};

struct CalibrationInput {
  const MeasurementSet& run;
  const SampleTable* static_record = nullptr;  ///< null: noise is taken from the bursts
  const RunDescription& description;
};

struct CalibrationOptions {
  std::uint64_t seed = 1;
  std::vector<std::shared_ptr<const Effect>> own_effects = {};  ///< of the user; searched for too
  std::optional<HeadReach> reach = {};  ///< for suggested poses; nothing: what the run visited
};

/// Everything `result.json` and the certificate say. When observability.rank < 4 nothing below it
/// is filled.
struct Calibration {
  Observability observability;
  std::size_t poses = 0;
  std::size_t samples = 0;
  std::size_t skipped_rows = 0;
  PerAxis<std::size_t> outlying_readings{};  ///< left out (outlying_readings.h)
  std::vector<ColumnRange> ranges;           ///< of the recorded columns
  PerAxis<NoiseModel> noise;
  PerAxis<std::optional<QuantizationUse>> quantization;  ///< nothing: steps do not matter
  ModelEstimates estimates;                              ///< the paper's 12-parameter model
  ModelEstimates final;  ///< re-estimated together with the effects; the certified model
  Convergence convergence;
  Diagnosis diagnosis;
  ErrorFigures before;
  ErrorFigures after;
  PerAxis<double> floor_pose_rms_mps2{};
  PerAxis<double> u_floor_pose_rms_mps2{};  ///< from the uncertainty of the noise terms
  /// Of final.batch_ls, by the GUM and by its Supplement 1.
  std::optional<UncertaintyReport> uncertainty;
  Decision decision;
  std::vector<PoseResult> pose_results;
  std::vector<FittedTerm> fitted_terms;  ///< largest first
  /// Schwarz's criterion of the pose means but for a constant: the smaller, the better do model and
  /// noise explain them. 0 where nothing was searched.
  double schwarz_criterion = 0;
};

/// Identifies the noise, estimates the 12 parameters in three ways, tests the residual, searches it
/// for what the model lacks and adds that, decides. Deterministic in input and options.seed.
/// Preconditions: there are poses, each with angles and with at least one sample.
Calibration calibrate(const CalibrationInput& input, const CalibrationOptions& options);

/// Errors of a calibrated model on an independent set of the same unit.
struct EvaluationFigures {
  PerAxis<double> pose_rms_mps2{};
  PerAxis<double> pose_max_abs_mps2{};
  PerAxis<double> sample_rms_mps2{};
};
struct Evaluation {
  std::size_t poses = 0;
  std::size_t samples = 0;
  PerAxis<std::size_t> outlying_readings{};  ///< left out
  EvaluationFigures before;                  ///< the 12 parameters alone
  EvaluationFigures after;                   ///< the certified model
  BetweenSets head = BetweenSets::anywhere;  ///< between the calibration run and this set
  /// Effects with parameters that the calibration run had left open and this set decided otherwise.
  std::vector<std::string> decided_otherwise;
  /// What of it is not applied: it belonged to the run, needs a column that the set lacks, or is a
  /// term that this version does not have.
  std::vector<std::string> left_out;
  std::vector<std::string> lacking;  ///< columns that the set lacks and effects need
  std::vector<BeyondRange> beyond;   ///< columns that were elsewhere during the calibration
};

/// What of a calibration is needed to apply it to other data.
struct CertifiedModel {
  TriadEstimate twelve;  ///< before any effect
  TriadEstimate final;   ///< together with the effects
  std::vector<FoundEffect> effects;
  std::vector<UnlistedStructure> unlisted;
  RunHistory history;                                           ///< of the calibration run
  std::vector<ColumnRange> ranges = {};                         ///< of its recorded columns
  std::vector<std::shared_ptr<const Effect>> own_effects = {};  ///< that `effects` may name
};
CertifiedModel certified_model(const Calibration& calibration,
                               const std::vector<std::shared_ptr<const Effect>>& own_effects = {});

/// Where its times say that the set followed the calibration run, effects that remember what came
/// before go on from there. `head`: how it came to the first pose of the set; where that is not
/// known, the way that leaves less. So with what the run left open of an effect
/// (Effect::left_open_by).
Evaluation evaluate(const CertifiedModel& model, const MeasurementSet& set,
                    const RunDescription& description, std::optional<BetweenSets> head = {});

/// The axis whose error is the largest multiple of what is expected.
std::size_t axis_standing_out(const PerAxis<double>& error, const PerAxis<double>& expected);

/// The axis on which fresh poses are further off than the noise of a pose explains (by chance on
/// one axis of 1000, the uncertainty of the noise included); nothing where they confirm the model.
std::optional<std::size_t> contradicted_axis(const Calibration& calibration,
                                             const Evaluation& verification);

}  // namespace plumbline
