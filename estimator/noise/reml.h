// The noise of a run's window means, learned from a static record and from the run's own residuals.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "estimator/noise/noise_model.h"
#include "estimator/noise/noise_processes.h"

namespace plumbline {

/// What is known of the noise of the window means of one axis.
struct PooledNoise {
  Eigen::VectorXd power;       ///< one per process
  Eigen::MatrixXd covariance;  ///< n×n of the window means with these powers
  double deviance = 0;         ///< −2 ln of the restricted likelihood but for a constant
  /// −2 ln of the full likelihood at these powers but for a constant: comparable between designs.
  double likelihood_deviance = 0;
  bool converged = false;
  /// The record's slow noise is not the run's: it has powers of its own, and no say in these.
  bool record_apart = false;
};

/// Powers that were estimated, and what is known of them. Empty where nothing was estimated.
struct EstimatedPowers {
  Eigen::VectorXd power;       ///< one per process
  Eigen::MatrixXd covariance;  ///< of all of them, those estimated at zero included
  double gain_of_slow = 0;     ///< of −2 ln L, by the slow ones among them
};

/// The noise of record and run, each by itself.
struct Contradiction {
  double deviance = 0;  ///< by how much −2 ln L of both is better when each has powers of its own
  Eigen::VectorXd power_of_record, power_of_run;  ///< one per process
};

/// Restricted maximum likelihood (Patterson & Thompson, 1971) of the powers, all ≥ 0, given window
/// means y = design·β + noise, β free, times the likelihood of the record that `model` came from.
/// A record that determines white noise well pins it; the slow processes, which a record shorter
/// than the run barely determines, move. The ramp of the record is not carried on: over the run a
/// slow drift is told by the run itself. A record that saw what the run did not, or what the run's
/// model explains, would make the run's slow noise too large: where the run has clearly less of it,
/// the record keeps its own.
class NoisePool {
 public:
  /// extra_variance: n further known variances (positioning, rounding), or empty. `processes` must
  /// outlive this.
  NoisePool(const NoiseProcesses& processes, const NoiseModel& model,
            const Eigen::VectorXd& extra_variance);

  /// mean: n; design: n×p of full rank, n > p. `start`: powers to begin with, or null.
  PooledNoise pool(const Eigen::VectorXd& mean, const Eigen::MatrixXd& design,
                   const Eigen::VectorXd* start = nullptr) const;
  /// The same where the powers are given.
  PooledNoise at(const Eigen::VectorXd& power, const Eigen::VectorXd& mean,
                 const Eigen::MatrixXd& design) const;
  /// What is known of the powers that pool() found for this mean and design; P is the projector of
  /// their Σ and of the design. The likelihood is taken to second order about them, and
  /// covariance_of_powers() of that.
  EstimatedPowers estimated(const PooledNoise& found, const Eigen::MatrixXd& P,
                            const Eigen::VectorXd& mean, const Eigen::MatrixXd& design) const;
  /// Expected information of both sources about the `wanted` powers of `noise`, the others held; P
  /// is the projector of their Σ and of the design.
  Eigen::MatrixXd information_of(const PooledNoise& noise, const Eigen::MatrixXd& P,
                                 const std::vector<Eigen::Index>& wanted) const;
  /// −2 ln of the record's own likelihood, where that leads, but for a constant; 0 without one.
  double deviance_of_record() const;
  /// Whether the record and the run can be of one noise; nothing without a record. `both`: what
  /// pool() found for this mean and design.
  std::optional<Contradiction> contradiction(const PooledNoise& both, const Eigen::VectorXd& mean,
                                             const Eigen::MatrixXd& design) const;
  /// Σ of the window means at given powers.
  Eigen::MatrixXd covariance(const Eigen::VectorXd& power) const;
  const NoiseProcesses& processes() const { return *processes_; }

 private:
  struct Point;
  struct Climb;
  struct Seen;
  /// Densities in the record's bins: of its own, and bins × processes those that it shares with the
  /// run; empty without a record.
  struct Record {
    Eigen::VectorXd own;
    Eigen::MatrixXd shared;
    double price = 0;  ///< of −2 ln L, for having noise of its own
  };
  const Record& record_for(const PooledNoise& noise) const {
    return noise.record_apart ? record_apart_ : record_;
  }
  /// The record's restricted likelihood and its derivatives; zero without a record.
  Point record_at(const Eigen::VectorXd& power, const Record& record) const;
  /// Where the record by itself leads.
  Climb climb_of_record() const;
  /// The record with slow noise of its own.
  Record apart() const;
  Eigen::MatrixXd lower_covariance(const Eigen::VectorXd& power) const;
  Seen see(const Eigen::MatrixXd& P, const Eigen::VectorXd& py) const;
  /// `normal` and `right` of both sources; P is the projector of the powers' Σ and of the design.
  Point scoring_step(const Eigen::VectorXd& power, const Eigen::MatrixXd& P,
                     const Eigen::VectorXd& py, const Record& record) const;
  Point evaluate(const Eigen::VectorXd& power, const Eigen::VectorXd& mean,
                 const Eigen::MatrixXd& design, const Record& record) const;
  Eigen::VectorXd starting_powers() const;
  /// The window means cannot tell quantization from white noise: without a record it stays at zero.
  bool quantization_is_free() const {
    return record_.shared.size() > 0 && record_.shared.col(kTermQ).sum() > 0;
  }
  /// All but that.
  std::vector<bool> free_powers() const {
    std::vector<bool> free(static_cast<std::size_t>(processes_->count()), true);
    free[kTermQ] = quantization_is_free();
    return free;
  }
  /// By how much −2 ln of the restricted likelihood is better with the slow processes of `found`
  /// than without any.
  double gain_of_slow_noise(const PooledNoise& found, const Eigen::VectorXd& mean,
                            const Eigen::MatrixXd& design) const;
  /// The highest likelihood from powers to begin with and with which of them are free; `evaluate`
  /// makes a Point of powers.
  template <typename Evaluate>
  Climb climb(const Eigen::VectorXd& first, const std::vector<bool>& free,
              const Evaluate& evaluate) const;
  /// The same of run and record together.
  Climb climb(const Eigen::VectorXd& first, const std::vector<bool>& free,
              const Eigen::VectorXd& mean, const Eigen::MatrixXd& design,
              const Record& record) const;
  PooledNoise pooled(const Climb& climb, bool record_apart) const;
  /// Variance over the run that the walks among these powers make.
  double walk_variance_V2(const Eigen::VectorXd& power) const;

  const NoiseProcesses* processes_;
  NoiseModel model_;
  bool own_noise_ = false;    ///< extra variance makes Σ regular without white noise
  Eigen::VectorXd known_V2_;  ///< extra variance
  Record record_, record_apart_;
};

/// Whether the record of any axis is clearly likelier with the smooth processes than without: one
/// triad, one kind of noise. `windows`: of the run, which says how slow they are.
bool records_show_smooth_noise(const PerAxis<NoiseModel>& noise,
                               const std::vector<SampleWindow>& windows);

/// A model that knows nothing of the noise but leaves all of it to the run.
NoiseModel without_record(NoiseModel model);

/// A model that knows of the record only what changes slowly, for channels that make of a slow
/// change `slope` times what they make of it on average (a coarse converter, at the record's place
/// within the step) and of white noise something else. Precondition: slope > 0.
NoiseModel with_slow_noise_only(NoiseModel model, double slope);

/// The same noise in the terms that the eight-state filter knows: white noise, one walk or the
/// strongest Gauss-Markov process in its place, and flicker for the others.
NoiseModel in_filter_terms(NoiseModel model, const NoiseProcesses& processes,
                           const PooledNoise& pooled, double span_s);

/// P = Σ⁻¹ − Σ⁻¹X(X'Σ⁻¹X)⁻¹X'Σ⁻¹, which whitens and removes the design at once: r'Σ⁻¹r = y'Py for
/// the generalised least-squares residual r.
struct Projector {
  Eigen::MatrixXd P;
  double log_determinant = 0;            ///< ln|Σ| + ln|X'Σ⁻¹X|
  double log_determinant_of_design = 0;  ///< ln|X'Σ⁻¹X|
};
/// Of `covariance` the lower triangle is enough.
Projector make_projector(Eigen::MatrixXd covariance, const Eigen::MatrixXd& design);

}  // namespace plumbline
