// The pictures of a certificate.
#pragma once

#include "app/certificate/document.h"
#include "estimator/calibrate.h"

namespace plumbline::app {

/// Residual of every pose over δ × h, one map per axis, one colour scale for the three (m/s²).
Figure residual_map(const Calibration& calibration, const Grid& grid);
/// Residuals in units of what the noise alone would leave, beside the normal distribution.
Figure residual_histogram(const Calibration& calibration);
/// Overlapping Allan deviation of each output with the fitted terms.
Figure allan_figure(const Calibration& calibration);
/// Estimates of the twelve parameters against the number of positions, three estimators.
Figure convergence_figure(const Calibration& calibration);
/// Residual against the time of the run, and against temperature when it was recorded.
Figure residual_course(const Calibration& calibration);

}  // namespace plumbline::app
