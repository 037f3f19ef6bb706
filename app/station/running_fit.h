// The twelve parameters as far as the poses so far tell, for people who watch a run.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "app/io/json.h"
#include "app/sequencer/engine_report.h"
#include "estimator/measurement.h"

namespace plumbline::app {

/// Of one axis: U = K_x·a_x + K_y·a_y + K_z·a_z + U0.
struct RunningAxis {
  std::array<double, 4> value{};  ///< K in V/g, U0 in V
  /// Standard uncertainties from the scatter of the residuals; the certificate's budget knows more.
  std::array<double, 4> u{};
  double rms_mps2 = 0;                ///< of the residuals
  std::vector<double> residual_mps2;  ///< of each pose, input-referred
};

/// Equal weights, poses at rest, no effects. Nothing before the poses determine the parameters.
std::optional<PerAxis<RunningAxis>> running_fit(const std::vector<PoseMean>& poses, double gamma);

/// Pooled standard deviation of one sample within the poses, V.
PerAxis<double> pooled_sd_V(const std::vector<PoseMean>& poses);

Json running_fit_json(const PerAxis<RunningAxis>& fit);

}  // namespace plumbline::app
