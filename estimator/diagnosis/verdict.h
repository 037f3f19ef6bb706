// From the residual tests of three axes to one verdict and one sentence for a person.
#pragma once

#include <optional>
#include <string>

#include "estimator/calibrate.h"

namespace plumbline {

/// One axis as the verdict sees it.
struct AxisVerdictInput {
  bool noise_known = false;    ///< some noise was identified
  bool responds = false;       ///< the scale factor differs from zero
  double p_value = 1;          ///< of the residual test
  double rms_mps2 = 0;         ///< residual of the pose means
  double expected_mps2 = 0;    ///< what the identified noise would leave
  double u_expected_mps2 = 0;  ///< by chance, and as the noise is known only so well
};

struct VerdictInput {
  std::size_t poses = 0;
  PerAxis<AxisVerdictInput> axis;
};

/// A verdict "unexplained" is wrong in at most this share of sets that have nothing to explain.
inline constexpr double kFalseAlarmShare = 0.01;
/// Fewer poses cannot tell a missing effect from noise.
inline constexpr std::size_t kFewestPosesToDecide = 30;

/// True when the data allow a decision about this axis and its residual is not the noise's. Each of
/// the three axes gets a third of kFalseAlarmShare (Bonferroni).
bool is_unexplained(const VerdictInput& input, std::size_t axis);

/// Fills verdict, reason and p_value.
void decide_verdict(const VerdictInput& input, Diagnosis& diagnosis);

/// How large the residual of the axes concerned was against what the noise beside the findings
/// leaves, what it comes from, and what is left: "x axis: residual 0.088 m/s² where 0.028 ± 0.002
/// is expected; explained by sensor.quadratic (x) …; after: x axis 0.028 m/s²".
std::string reason_of_findings(const PerAxis<std::optional<AxisVerdictInput>>& residual,
                               const std::string& findings, const PerAxis<double>& after_mps2);

}  // namespace plumbline
