// What a periodic disturbance that a static record shows may be in the run.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <vector>

#include "estimator/measurement.h"
#include "estimator/noise/covariance.h"
#include "estimator/noise/noise_model.h"
#include "estimator/noise/noise_processes.h"

namespace plumbline {

/// The kinds of noise that a run may have, likeliest first. Where a spectral line of a static
/// record matters in a window's mean beside white noise, two: that of every run, in which a steady
/// line is an effect, and the same with a disturbance that wanders about the line's frequency, on
/// the clock of the run or on that of the readings alone. Otherwise the first of them only. noise:
/// as identified; mean_V: n ≥ 1 means of the windows an axis; design: n × p, what the means are
/// modelled by; goes_on: whether a line of an axis's record is known to go on steadily in the run.
std::vector<FurtherNoise> possible_noises(
    const PerAxis<NoiseModel>& noise, const std::vector<SampleWindow>& windows,
    const PerAxis<Eigen::VectorXd>& mean_V, const Eigen::MatrixXd& design,
    const std::function<bool(std::size_t axis, const SpectralLine&)>& goes_on);

}  // namespace plumbline
