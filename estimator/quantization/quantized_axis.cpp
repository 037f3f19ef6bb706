#include "estimator/quantization/quantized_axis.h"

#include <cmath>

#include "estimator/fit/least_squares.h"

namespace plumbline {
namespace {

constexpr double kStepsThatSmooth = 0.9;
constexpr Eigen::Index kFewestPoses = 12;

/// Standard deviation of a reading, steps: inside the poses or, with single readings, about the
/// least-squares fit.
double scatter_of_readings(const std::vector<CodeCounts>& codes, const Eigen::MatrixXd& A,
                           const Eigen::VectorXd& known) {
  double square = 0, dof = 0;
  Eigen::VectorXd mean(A.rows());
  for (Eigen::Index k = 0; k < A.rows(); ++k) {
    const CodeCounts& pose = codes[static_cast<std::size_t>(k)];
    mean(k) = pose.mean - known(k);
    dof -= 1;
    for (const auto& [code, count] : pose.count) {
      square += count * (code - pose.mean) * (code - pose.mean);
      dof += count;
    }
  }
  if (dof > 0) return std::sqrt(square / dof);
  const LeastSquaresResult fit = solve_least_squares(A, mean);
  return std::sqrt(fit.residual_sum_of_squares / static_cast<double>(fit.degrees_of_freedom));
}

}  // namespace

std::optional<QuantizedAxis> quantized_axis(const MeasurementSet& run, const Eigen::MatrixXd& A,
                                            const Eigen::VectorXd& known_V2,
                                            const Eigen::VectorXd& known_V, const CodeScale& scale,
                                            std::size_t axis) {
  if (A.rows() < kFewestPoses) return std::nullopt;
  const auto codes = count_codes(run.samples, run.poses, axis, scale);
  const double step_V = scale.step_V;
  const Eigen::VectorXd known = known_V / step_V;
  if (!codes || scatter_of_readings(*codes, A, known) > kStepsThatSmooth) return std::nullopt;
  const IntervalFit fit = fit_intervals(A, *codes, known_V2 / (step_V * step_V), known);
  if (!fit.converged) return std::nullopt;

  QuantizedAxis result;
  result.mean_V = (scale.origin_V + step_V * fit.equivalent_mean.array()).matrix();
  result.variance_V2 = step_V * step_V * fit.equivalent_variance;
  result.use = {step_V, step_V * fit.sigma, step_V * fit.scatter};
  return result;
}

}  // namespace plumbline
