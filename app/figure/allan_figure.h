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
  std::string deviation;  ///< with the unit of the records; empty: no label
};

/// The curve of one term, over the same times as the record's.
struct AllanTerm {
  std::string name;
  std::vector<double> value;
};
/// Q, N, B, K, R as far as they are present, and the Gauss-Markov processes M.
std::vector<AllanTerm> allan_terms(const NoiseModel& noise);

/// Panels of one series each, side by side, with common axes: measured values as dots with their
/// confidence limits, every term as a thin line with its name, their sum as a thick one.
void draw_allan_panels(Canvas& canvas, Point top_left, double width, double height,
                       const std::vector<AllanSeries>& series, const AllanLabels& labels);

/// Draws into the rectangle, labels included: measured curves as dots in a band of their confidence
/// limits, the sum of the fitted terms as a line.
void draw_allan(Canvas& canvas, Point top_left, double width, double height,
                const std::vector<AllanSeries>& series, const AllanLabels& labels);

/// The same as an SVG file; `unit` is that of the records.
std::string allan_svg(const std::vector<AllanSeries>& series, const std::string& unit);

}  // namespace plumbline::app
