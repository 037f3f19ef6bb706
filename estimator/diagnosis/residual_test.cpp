// Interim form: χ² of the whitened residual under the noise of the static record alone.
#include "estimator/diagnosis/residual_test.h"

#include "estimator/fit/least_squares.h"
#include "estimator/noise/chi_squared.h"

namespace plumbline {

ResidualTestResult test_residual(const NoiseModel& noise, const ResidualTestInput& input) {
  ResidualTestResult result;
  NoiseModel proven = noise;
  for (NoiseTerm* term : {&proven.Q, &proven.N, &proven.B, &proven.K, &proven.R})
    if (!term->present) *term = {};
  result.noise.power = noise_powers(proven);
  result.noise.covariance = mean_covariance(proven, input.windows);
  if (input.extra_variance.size() > 0) result.noise.covariance.diagonal() += input.extra_variance;
  const std::optional<Whitening> whitening = Whitening::of(result.noise.covariance);
  if (!whitening) return result;
  const LeastSquaresResult fit =
      solve_least_squares(whitening->apply(input.design), whitening->apply(input.mean));
  result.chi2 = fit.residual_sum_of_squares;
  result.dof = static_cast<double>(fit.degrees_of_freedom);
  result.p_value = chi_squared_tail(result.chi2, result.dof);
  return result;
}

}  // namespace plumbline
