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

/// Draws into the rectangle, labels included: measured curves as dots in a band of their confidence
/// limits, the sum of the fitted terms as a dashed line. `unit` is that of the records.
void draw_allan(Canvas& canvas, Point top_left, double width, double height,
                const std::vector<AllanSeries>& series, const std::string& unit);

/// The same as an SVG file.
std::string allan_svg(const std::vector<AllanSeries>& series, const std::string& unit);

}  // namespace plumbline::app
