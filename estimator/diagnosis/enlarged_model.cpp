#include "estimator/diagnosis/enlarged_model.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

constexpr Eigen::Index kAxes = static_cast<Eigen::Index>(kAxisCount);

// A step that changes the prediction well above rounding and well below curvature.
double difference_step(const ParameterInfo& info, double value) {
  if (info.step > 0) return info.step;
  if (info.role == ParameterRole::shape) return 1e-3 * std::max(std::abs(value), 1e-9);
  // Amplitudes: terms of 1e-5 g, angles of 1e-5 degrees and the like.
  return std::max(1e-3 * std::abs(value), 1e-6);
}

}  // namespace

std::vector<std::size_t> axes_of(const ActiveEffect& active) {
  if (active.effect->subject() == Subject::head) return {0, 1, 2};
  return {active.axis};
}

ActiveEffect activate(const Effect& effect, std::size_t axis, const Hypothesis& hypothesis) {
  ActiveEffect active{&effect, axis, hypothesis.p, {}};
  const auto parameters = effect.parameters();
  assert(parameters.size() == hypothesis.p.size());
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    active.free.push_back(parameters[k].role == ParameterRole::shape ||
                          (parameters[k].role == ParameterRole::amplitude && hypothesis.p[k] != 0));
  }
  return active;
}

namespace {

ActiveEffect with_shapes(ActiveEffect active, bool free) {
  const auto infos = active.effect->parameters();
  for (std::size_t k = 0; k < infos.size(); ++k)
    if (infos[k].role == ParameterRole::shape) active.free[k] = free;
  return active;
}

}  // namespace

ActiveEffect with_shapes_held(ActiveEffect active) { return with_shapes(std::move(active), false); }

ActiveEffect with_shapes_free(ActiveEffect active) { return with_shapes(std::move(active), true); }

Eigen::Index ActiveEffect::free_count() const { return std::count(free.begin(), free.end(), true); }

Eigen::Index EnlargedParameters::free_count() const { return first_free(effects.size()); }

Eigen::Index EnlargedParameters::first_free(std::size_t effect) const {
  Eigen::Index count = 4 * kAxes;
  for (std::size_t e = 0; e < effect; ++e) count += effects[e].free_count();
  return count;
}

Eigen::VectorXd EnlargedParameters::free_values() const {
  Eigen::VectorXd values(free_count());
  Eigen::Index row = 0;
  for (const auto& axis : twelve) {
    values.segment<4>(row) = axis;
    row += 4;
  }
  for (const ActiveEffect& active : effects) {
    for (std::size_t k = 0; k < active.p.size(); ++k) {
      if (active.free[k]) values(row++) = active.p[k];
    }
  }
  return values;
}

void EnlargedParameters::set_free_values(const Eigen::VectorXd& values) {
  assert(values.size() == free_count());
  Eigen::Index row = 0;
  for (auto& axis : twelve) {
    axis = values.segment<4>(row);
    row += 4;
  }
  for (ActiveEffect& active : effects) {
    for (std::size_t k = 0; k < active.p.size(); ++k) {
      if (active.free[k]) active.p[k] = values(row++);
    }
  }
}

double EnlargedParameters::mps2_per_V(std::size_t axis) const {
  return kStandardGravity_mps2 / twelve[axis](static_cast<Eigen::Index>(axis));
}

bool shapes_differ(const EnlargedParameters& one, const EnlargedParameters& other) {
  for (std::size_t e = 0; e < one.effects.size(); ++e) {
    const ActiveEffect& active = one.effects[e];
    const auto infos = active.effect->parameters();
    for (std::size_t k = 0; k < infos.size(); ++k)
      if (active.free[k] && infos[k].role == ParameterRole::shape &&
          std::abs(active.p[k] - other.effects[e].p[k]) > difference_step(infos[k], active.p[k]))
        return true;
  }
  return false;
}

std::vector<HeadGeometry> head_geometries(const VisitLog& log,
                                          const EnlargedParameters& parameters) {
  std::vector<HeadGeometry> heads;
  heads.reserve(log.visits.size());
  for (std::size_t k = 0; k < log.visits.size(); ++k) {
    HeadGeometry head{log.visits[k].delta_rad, log.visits[k].h_rad};
    for (const ActiveEffect& active : parameters.effects) {
      if (active.effect->subject() == Subject::head) {
        active.effect->displace(log, k, active.p.data(), head);
      }
    }
    heads.push_back(head);
  }
  return heads;
}

std::vector<Eigen::Vector3d> specific_forces_g(const VisitLog& log,
                                               const EnlargedParameters& parameters) {
  std::vector<Eigen::Vector3d> a_g;
  a_g.reserve(log.visits.size());
  for (const HeadGeometry& head : head_geometries(log, parameters))
    a_g.push_back(specific_force_g(head, log.gamma));
  return a_g;
}

EnlargedParameters with_effect(EnlargedParameters model, const ActiveEffect& active) {
  model.effects.push_back(active);
  return model;
}

EnlargedParameters without_effect(EnlargedParameters model, std::size_t effect) {
  model.effects.erase(model.effects.begin() + static_cast<std::ptrdiff_t>(effect));
  return model;
}

HeadCourse head_course(const VisitLog& log, std::size_t visit, const HeadGeometry& head,
                       const ActiveEffect& active) {
  const AngleCourse course = active.effect->angle_course(log, visit, active.p.data());
  constexpr double kStep_rad = 1e-5;
  HeadGeometry above = head, below = head;
  above.*course.angle += kStep_rad;
  below.*course.angle -= kStep_rad;
  return {
      log.contrasts.at(log.visits[visit].count).transpose() * course.course_rad,
      (specific_force_g(above, log.gamma) - specific_force_g(below, log.gamma)) / (2 * kStep_rad)};
}

namespace {

using Forces = std::vector<Eigen::Vector3d>;  ///< one per visit, g

/// Without the effects of the model.
TermInput bare_input(const VisitLog& log, const Eigen::Vector4d& twelve, std::size_t axis,
                     const Forces& a_g, std::size_t visit) {
  const double K_ii = twelve(static_cast<Eigen::Index>(axis));
  const double response_V = twelve.head<3>().dot(a_g[visit]);
  return {log, visit, axis, a_g, response_V / K_ii, twelve(3) + response_V, K_ii};
}

bool is_of_sensor(const ActiveEffect& active, std::size_t axis) {
  return active.effect->subject() == Subject::sensor && active.axis == axis;
}

/// Sum of the axis's terms at one visit that are the converter's, or of those that are not.
double terms_V(const EnlargedParameters& parameters, const TermInput& input, bool at_converter) {
  double sum_V = 0;
  for (const ActiveEffect& active : parameters.effects)
    if (is_of_sensor(active, input.axis) && active.effect->at_converter() == at_converter)
      sum_V += input.K_V_per_g * active.effect->term_g(input, active.p.data());
  return sum_V;
}

}  // namespace

TermInput term_input(const VisitLog& log, const EnlargedParameters& parameters, std::size_t axis,
                     const Forces& a_g, std::size_t visit) {
  TermInput input = bare_input(log, parameters.twelve[axis], axis, a_g, visit);
  input.output_V += terms_V(parameters, input, false);
  return input;
}

namespace {

Eigen::VectorXd means_of_axis_V(const VisitLog& log, const EnlargedParameters& parameters,
                                std::size_t axis, const Forces& a_g) {
  Eigen::VectorXd mean_V(std::ssize(a_g));
  for (Eigen::Index k = 0; k < mean_V.size(); ++k) {
    const TermInput input = term_input(log, parameters, axis, a_g, static_cast<std::size_t>(k));
    mean_V(k) = input.output_V + terms_V(parameters, input, true);
  }
  return mean_V;
}

/// What the head does within the dwells, seen by all axes.
struct HeadAtVisit {
  Eigen::Index visit;
  HeadCourse course;
};
std::vector<HeadAtVisit> head_courses(const VisitLog& log, const EnlargedParameters& parameters) {
  std::vector<HeadAtVisit> courses;
  std::vector<HeadGeometry> heads;
  for (const ActiveEffect& active : parameters.effects) {
    if (active.effect->subject() != Subject::head || !active.effect->within_dwell()) continue;
    if (heads.empty()) heads = head_geometries(log, parameters);
    for (std::size_t k = 0; k < heads.size(); ++k)
      courses.push_back({static_cast<Eigen::Index>(k), head_course(log, k, heads[k], active)});
  }
  return courses;
}

/// n × contrasts.
Eigen::MatrixXd dwells_of_axis_V(const VisitLog& log, const EnlargedParameters& parameters,
                                 std::size_t axis, const Forces& a_g,
                                 const std::vector<HeadAtVisit>& head) {
  Eigen::MatrixXd dwell_V = Eigen::MatrixXd::Zero(std::ssize(a_g), log.dwell_contrasts());
  if (!has_effect_within_dwell(parameters)) return dwell_V;
  for (const ActiveEffect& active : parameters.effects) {
    if (!is_of_sensor(active, axis) || !active.effect->within_dwell()) continue;
    for (Eigen::Index k = 0; k < dwell_V.rows(); ++k)
      dwell_V.row(k) += dwell_contrasts_V(
          term_input(log, parameters, axis, a_g, static_cast<std::size_t>(k)), active);
  }
  for (const auto& [visit, course] : head)
    dwell_V.row(visit) += course.contrasts_V(parameters.twelve[axis]);
  return dwell_V;
}

PerAxis<Eigen::MatrixXd> dwells_V(const VisitLog& log, const EnlargedParameters& parameters,
                                  const Forces& a_g) {
  const std::vector<HeadAtVisit> head = head_courses(log, parameters);
  PerAxis<Eigen::MatrixXd> dwell_V;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    dwell_V[i] = dwells_of_axis_V(log, parameters, i, a_g, head);
  return dwell_V;
}

}  // namespace

bool has_effect_within_dwell(const EnlargedParameters& parameters) {
  return std::any_of(parameters.effects.begin(), parameters.effects.end(),
                     [](const ActiveEffect& active) { return active.effect->within_dwell(); });
}

bool has_effect_on(const EnlargedParameters& parameters, std::size_t axis) {
  return std::any_of(parameters.effects.begin(), parameters.effects.end(),
                     [&](const ActiveEffect& active) { return is_of_sensor(active, axis); });
}

PerAxis<Eigen::VectorXd> predict_means_V(const VisitLog& log,
                                         const EnlargedParameters& parameters) {
  return predict_means_V(log, parameters, specific_forces_g(log, parameters));
}

PerAxis<Eigen::VectorXd> predict_means_V(const VisitLog& log, const EnlargedParameters& parameters,
                                         const Forces& a_g) {
  PerAxis<Eigen::VectorXd> mean_V;
  for (std::size_t i = 0; i < kAxisCount; ++i) mean_V[i] = means_of_axis_V(log, parameters, i, a_g);
  return mean_V;
}

Eigen::VectorXd dwell_contrasts_V(const TermInput& input, const ActiveEffect& active) {
  return input.K_V_per_g * (input.log.contrasts.at(input.at().count).transpose() *
                            active.effect->course_g(input, active.p.data()));
}

PerAxis<Eigen::MatrixXd> predict_dwells_V(const VisitLog& log,
                                          const EnlargedParameters& parameters) {
  return dwells_V(log, parameters, specific_forces_g(log, parameters));
}

Observations observe(const MeasurementSet& set, const VisitLog& log) {
  Observations observed;
  const auto n = std::ssize(set.poses);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    observed.mean_V[i].resize(n);
    observed.dwell_V[i].resize(n, log.dwell_contrasts());
    for (Eigen::Index k = 0; k < n; ++k) {
      const Pose& pose = set.poses[static_cast<std::size_t>(k)];
      const Eigen::Map<const Eigen::VectorXd> dwell_V(set.samples.u_V[i].data() + pose.first,
                                                      static_cast<Eigen::Index>(pose.count));
      observed.mean_V[i](k) = dwell_V.mean();
      observed.dwell_V[i].row(k) = log.contrasts.at(pose.count).transpose() * dwell_V;
    }
  }
  return observed;
}

Eigen::Index mean_rows(const VisitLog& log) { return kAxes * std::ssize(log.visits); }
Eigen::Index stacked_rows(const VisitLog& log) {
  return (1 + log.dwell_contrasts()) * mean_rows(log);
}

namespace {

Eigen::VectorXd stacked(const PerAxis<Eigen::VectorXd>& mean_V,
                        const PerAxis<Eigen::MatrixXd>& dwell_V) {
  const Eigen::Index n = mean_V[0].size();
  const Eigen::Index contrasts = dwell_V[0].cols();
  Eigen::VectorXd all((1 + contrasts) * kAxes * n);
  for (Eigen::Index i = 0; i < kAxes; ++i) {
    const auto axis = static_cast<std::size_t>(i);
    all.segment(i * n, n) = mean_V[axis];
    all.segment((kAxes + i * contrasts) * n, contrasts * n) = dwell_V[axis].reshaped();
  }
  return all;
}

/// What one column of the Jacobian is about.
struct FreeParameter {
  std::optional<std::size_t> axis;  ///< the only one that it concerns
  double step;                      ///< of the central difference
};

std::vector<FreeParameter> free_parameters(const EnlargedParameters& parameters) {
  std::vector<FreeParameter> all;
  for (std::size_t i = 0; i < 4 * kAxisCount; ++i) all.push_back({i / 4, 1e-6});
  for (const ActiveEffect& active : parameters.effects) {
    const auto infos = active.effect->parameters();
    std::optional<std::size_t> axis;
    if (active.effect->subject() == Subject::sensor) axis = active.axis;
    for (std::size_t k = 0; k < active.p.size(); ++k) {
      if (active.free[k]) all.push_back({axis, difference_step(infos[k], active.p[k])});
    }
  }
  return all;
}

/// Writes the columns of the twelve of an axis without effects of the sensor: the readings are
/// linear in them.
void set_linear_columns(const Forces& a_g, const std::vector<HeadAtVisit>& head,
                        Eigen::Index contrasts, std::size_t axis, Eigen::MatrixXd& jacobian) {
  const Eigen::Index n = std::ssize(a_g), i = static_cast<Eigen::Index>(axis);
  for (Eigen::Index component = 0; component < 4; ++component) {
    auto column = jacobian.col(4 * i + component);
    for (Eigen::Index k = 0; k < n; ++k)
      column(i * n + k) = component < 3 ? a_g[static_cast<std::size_t>(k)](component) : 1;
    auto dwells = column.segment((kAxes + i * contrasts) * n, contrasts * n).reshaped(n, contrasts);
    for (const auto& [visit, course] : head)
      dwells.row(visit) += course.contrasts_V(Eigen::Vector4d::Unit(component));
  }
}

}  // namespace

Eigen::VectorXd stacked_V(const Observations& observed) {
  return stacked(observed.mean_V, observed.dwell_V);
}

Eigen::VectorXd predict_stacked_V(const VisitLog& log, const EnlargedParameters& parameters) {
  const Forces a_g = specific_forces_g(log, parameters);
  return stacked(predict_means_V(log, parameters, a_g), dwells_V(log, parameters, a_g));
}

Eigen::MatrixXd prediction_jacobian(const VisitLog& log, const EnlargedParameters& parameters) {
  const Eigen::VectorXd centre = parameters.free_values();
  const std::vector<FreeParameter> free = free_parameters(parameters);
  const Forces a_g = specific_forces_g(log, parameters);
  const std::vector<HeadAtVisit> head = head_courses(log, parameters);
  const Eigen::Index n = std::ssize(a_g), contrasts = log.dwell_contrasts();
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(stacked_rows(log), centre.size());
  PerAxis<bool> is_linear;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    is_linear[axis] = !has_effect_on(parameters, axis);
    if (is_linear[axis]) set_linear_columns(a_g, head, contrasts, axis, jacobian);
  }
  std::vector<std::size_t> others;
  for (std::size_t j = 0; j < free.size(); ++j)
    if (!free[j].axis || !is_linear[*free[j].axis]) others.push_back(j);
  parallel_for(others.size(), [&](std::size_t c) {
    const auto j = static_cast<Eigen::Index>(others[c]);
    const auto& [only_axis, step] = free[others[c]];
    const auto moved = [&](double by) {
      EnlargedParameters other = parameters;
      Eigen::VectorXd values = centre;
      values(j) += by;
      other.set_free_values(values);
      return other;
    };
    const EnlargedParameters above = moved(step), below = moved(-step);
    if (!only_axis) {
      jacobian.col(j) =
          (predict_stacked_V(log, above) - predict_stacked_V(log, below)) / (2 * step);
      return;
    }
    // What belongs to one axis leaves the head, and so the forces, as they are.
    const std::size_t axis = *only_axis;
    const auto i = static_cast<Eigen::Index>(axis);
    jacobian.col(j).segment(i * n, n) =
        (means_of_axis_V(log, above, axis, a_g) - means_of_axis_V(log, below, axis, a_g)) /
        (2 * step);
    jacobian.col(j).segment((kAxes + i * contrasts) * n, contrasts * n) =
        (dwells_of_axis_V(log, above, axis, a_g, head) -
         dwells_of_axis_V(log, below, axis, a_g, head))
            .reshaped() /
        (2 * step);
  });
  return jacobian;
}

}  // namespace plumbline
