// The pictures of a certificate.
#pragma once

#include <memory>
#include <optional>

#include "app/certificate/document.h"
#include "app/certificate/language.h"
#include "estimator/calibrate.h"

namespace plumbline::app {

inline constexpr double kFigureWidth = 700;  ///< px

struct FigureContext {
  std::shared_ptr<const Calibration> calibration;  ///< never null
  Translator tr;
};

/// Residual of every pose over δ × h, one map per axis, one colour scale for all (m/s²); before and
/// after side by side when effects were added.
Figure residual_map(const FigureContext& context, const Grid& grid);
/// Residuals in units of what the noise alone would leave, beside the normal distribution.
Figure residual_histogram(const FigureContext& context);
/// Residual against the time of the run, and against temperature when it was recorded.
Figure residual_course(const FigureContext& context);
/// What the residual would be without each added effect, against the variable that shows it best,
/// with the fitted term; the largest six. Nothing when no effect was added.
std::optional<Figure> fitted_terms_figure(const FigureContext& context);
/// Overlapping Allan deviation of each output with the fitted terms.
Figure allan_figure(const FigureContext& context);
/// Estimates of the twelve parameters against the number of positions, three estimators.
Figure convergence_figure(const FigureContext& context);
/// What the variance of each scale factor and offset is made of, as bars.
Figure budget_figure(const FigureContext& context, const RunDescription& description);
/// By how many standard deviations the ten strongest candidates stand out of the residual, those
/// that were added to the model first; nothing when there was no search.
std::optional<Figure> evidence_figure(const FigureContext& context);

}  // namespace plumbline::app
