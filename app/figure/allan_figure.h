// The Allan deviation of one or more channels, with confidence limits and the fitted terms.
#pragma once

#include <string>
#include <vector>

#include "app/figure/canvas.h"
#include "estimator/noise/noise_model.h"

namespace plumbline::app {

struct AllanSeries {
  std::string label;
  const NoiseModel* noise = nullptr;  ///< never null
};

struct AllanLabels {
  std::string tau = "averaging time τ, s";
  std::string deviation;  ///< with the unit of the records
};

/// Draws into the rectangle, labels included: measured curves as dots in a band of their confidence
/// limits, the sum of the fitted terms as a line.
void draw_allan(Canvas& canvas, Point top_left, double width, double height,
                const std::vector<AllanSeries>& series, const AllanLabels& labels);

/// The same as an SVG file; `unit` is that of the records.
std::string allan_svg(const std::vector<AllanSeries>& series, const std::string& unit);

}  // namespace plumbline::app
