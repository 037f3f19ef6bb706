// The 12-parameter model enlarged by effects: predicted pose means and courses of the dwells.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "estimator/calibrate.h"
#include "estimator/diagnosis/enlarged_parameters.h"
#include "estimator/effects/effect.h"

namespace plumbline {

/// Head and base at every visit with the model's head effects.
std::vector<HeadGeometry> head_geometries(const VisitLog& log,
                                          const EnlargedParameters& parameters);

/// Specific force at every visit with the geometry of the model's head effects, standard g.
std::vector<Eigen::Vector3d> specific_forces_g(const VisitLog& log,
                                               const EnlargedParameters& parameters);

/// What a term of an axis may depend on at one visit, beside the effects of the model; `a_g` are
/// the specific forces of all visits, which must live as long.
TermInput term_input(const VisitLog& log, const EnlargedParameters& parameters, std::size_t axis,
                     const std::vector<Eigen::Vector3d>& a_g, std::size_t visit);

/// Predicted pose means, V, one vector of n visits per axis, full nonlinear response.
PerAxis<Eigen::VectorXd> predict_means_V(const VisitLog& log, const EnlargedParameters& parameters);
/// The same under given specific forces, whatever the head effects of the model say of them.
PerAxis<Eigen::VectorXd> predict_means_V(const VisitLog& log, const EnlargedParameters& parameters,
                                         const std::vector<Eigen::Vector3d>& a_g);

/// Predicted contrasts of the dwells, V, n × log.dwell_contrasts() per axis.
PerAxis<Eigen::MatrixXd> predict_dwells_V(const VisitLog& log,
                                          const EnlargedParameters& parameters);

/// Contrasts of one visit's dwell that one effect makes, V.
Eigen::VectorXd dwell_contrasts_V(const TermInput& input, const ActiveEffect& active);

/// Contrasts of one visit's dwell in the course of an angle, rad.
Eigen::VectorXd contrasts_rad(const VisitLog& log, std::size_t visit, const AngleCourse& course);

/// What a head effect within the dwell does to a visit, to first order in the angle.
struct HeadCourse {
  Eigen::VectorXd contrasts_rad;    ///< of the angle
  Eigen::Vector3d slope_g_per_rad;  ///< of the specific force by that angle

  /// Of the readings of an axis with these parameters.
  Eigen::VectorXd contrasts_V(const Eigen::Vector4d& twelve) const {
    return twelve.head<3>().dot(slope_g_per_rad) * contrasts_rad;
  }
};
HeadCourse head_course(const VisitLog& log, std::size_t visit, const HeadGeometry& head,
                       const ActiveEffect& active);

/// What is measured at n visits: the means, and what the samples say beyond them.
struct Observations {
  PerAxis<Eigen::VectorXd> mean_V;
  PerAxis<Eigen::MatrixXd> dwell_V;  ///< contrasts of the dwells, n × their number
};
Observations observe(const MeasurementSet& set, const VisitLog& log);

/// Rows of a stacked vector: the means (x, then y, then z; 3n rows), then the contrasts, n rows for
/// each contrast of each axis.
Eigen::Index mean_rows(const VisitLog& log);
Eigen::Index stacked_rows(const VisitLog& log);
/// The first of them, those that a model can move: only the means where it has no effects within
/// the dwell.
Eigen::Index moved_rows(const VisitLog& log, const EnlargedParameters& parameters);

/// Measured, V.
Eigen::VectorXd stacked_V(const Observations& observed);
/// Predicted, V.
Eigen::VectorXd predict_stacked_V(const VisitLog& log, const EnlargedParameters& parameters);

/// Derivatives of the moved rows of the stacked prediction by the free parameters, by central
/// differences with steps fitted to each parameter's size.
Eigen::MatrixXd prediction_jacobian(const VisitLog& log, const EnlargedParameters& parameters);
/// Whether any free shape differs by more than the step of these differences. Both have the same
/// effects.
bool shapes_differ(const EnlargedParameters& one, const EnlargedParameters& other);

}  // namespace plumbline
