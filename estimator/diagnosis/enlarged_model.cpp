#include "estimator/diagnosis/enlarged_model.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

constexpr Eigen::Index kAxes = static_cast<Eigen::Index>(kAxisCount);

using Forces = std::vector<Eigen::Vector3d>;  ///< one per visit, g

/// numbers_of_visits() of each effect, for models that differ in other parameters; where an effect
/// has none here, its term is worked out.
using VisitNumbers = std::vector<std::vector<double>>;

VisitNumbers no_numbers(const EnlargedParameters& parameters) {
  return VisitNumbers(parameters.effects.size());
}

std::vector<double> numbers_of(const VisitLog& log, const ActiveEffect& active) {
  return active.effect->numbers_of_visits(log, active.axis, active.p.data());
}

HeadGeometry head_geometry(const VisitLog& log, const EnlargedParameters& parameters,
                           const VisitNumbers& numbers, std::size_t visit) {
  HeadGeometry head{log.visits[visit].delta_rad, log.visits[visit].h_rad};
  for (std::size_t e = 0; e < parameters.effects.size(); ++e) {
    const ActiveEffect& active = parameters.effects[e];
    if (active.effect->subject() != Subject::head) continue;
    if (numbers[e].empty())
      active.effect->displace(log, visit, active.p.data(), head);
    else
      active.effect->displace_by_number(log, visit, numbers[e][visit], active.p.data(), head);
  }
  return head;
}

Forces specific_forces_g(const VisitLog& log, const EnlargedParameters& parameters,
                         const VisitNumbers& numbers) {
  Forces a_g;
  a_g.reserve(log.visits.size());
  for (std::size_t k = 0; k < log.visits.size(); ++k)
    a_g.push_back(specific_force_g(head_geometry(log, parameters, numbers, k), log.gamma));
  return a_g;
}

}  // namespace

std::vector<HeadGeometry> head_geometries(const VisitLog& log,
                                          const EnlargedParameters& parameters) {
  const VisitNumbers numbers = no_numbers(parameters);
  std::vector<HeadGeometry> heads;
  heads.reserve(log.visits.size());
  for (std::size_t k = 0; k < log.visits.size(); ++k)
    heads.push_back(head_geometry(log, parameters, numbers, k));
  return heads;
}

std::vector<Eigen::Vector3d> specific_forces_g(const VisitLog& log,
                                               const EnlargedParameters& parameters) {
  return specific_forces_g(log, parameters, no_numbers(parameters));
}

Eigen::VectorXd contrasts_rad(const VisitLog& log, std::size_t visit, const AngleCourse& course) {
  return log.contrasts.at(log.visits[visit].count).transpose() * course.course_rad;
}

HeadCourse head_course(const VisitLog& log, std::size_t visit, const HeadGeometry& head,
                       const ActiveEffect& active) {
  const AngleCourse course = active.effect->angle_course(log, visit, active.p.data());
  return {contrasts_rad(log, visit, course), slope_g_per_rad(head, course.angle, log.gamma)};
}

namespace {

/// Without the effects of the model.
TermInput bare_input(const VisitLog& log, const Eigen::Vector4d& twelve, std::size_t axis,
                     const Forces& a_g, std::size_t visit) {
  const double K_ii = twelve(static_cast<Eigen::Index>(axis));
  const double response_V = twelve.head<3>().dot(a_g[visit]);
  return {log, visit, axis, a_g, response_V / K_ii, twelve(3) + response_V, K_ii};
}

double term_V(const ActiveEffect& active, const std::vector<double>& numbers,
              const TermInput& input) {
  return input.K_V_per_g * (numbers.empty()
                                ? active.effect->term_g(input, active.p.data())
                                : active.effect->term_of_number_g(input, numbers[input.visit]));
}

/// Sum of the axis's terms at one visit that are the converter's, or of those that are not.
double terms_V(const EnlargedParameters& parameters, const VisitNumbers& numbers,
               const TermInput& input, bool at_converter) {
  double sum_V = 0;
  for (std::size_t e = 0; e < parameters.effects.size(); ++e) {
    const ActiveEffect& active = parameters.effects[e];
    if (is_of_sensor(active, input.axis) && active.effect->at_converter() == at_converter)
      sum_V += term_V(active, numbers[e], input);
  }
  return sum_V;
}

TermInput term_input(const VisitLog& log, const EnlargedParameters& parameters,
                     const VisitNumbers& numbers, std::size_t axis, const Forces& a_g,
                     std::size_t visit) {
  TermInput input = bare_input(log, parameters.twelve[axis], axis, a_g, visit);
  input.output_V += terms_V(parameters, numbers, input, false);
  return input;
}

double mean_V(const VisitLog& log, const EnlargedParameters& parameters,
              const VisitNumbers& numbers, std::size_t axis, const Forces& a_g, std::size_t visit) {
  const TermInput input = term_input(log, parameters, numbers, axis, a_g, visit);
  return input.output_V + terms_V(parameters, numbers, input, true);
}

Eigen::VectorXd means_of_axis_V(const VisitLog& log, const EnlargedParameters& parameters,
                                const VisitNumbers& numbers, std::size_t axis, const Forces& a_g) {
  Eigen::VectorXd means_V(std::ssize(a_g));
  for (Eigen::Index k = 0; k < means_V.size(); ++k)
    means_V(k) = mean_V(log, parameters, numbers, axis, a_g, static_cast<std::size_t>(k));
  return means_V;
}

}  // namespace

TermInput term_input(const VisitLog& log, const EnlargedParameters& parameters, std::size_t axis,
                     const Forces& a_g, std::size_t visit) {
  return term_input(log, parameters, no_numbers(parameters), axis, a_g, visit);
}

namespace {

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
  const VisitNumbers numbers = no_numbers(parameters);
  for (const ActiveEffect& active : parameters.effects) {
    if (!is_of_sensor(active, axis) || !active.effect->within_dwell()) continue;
    for (Eigen::Index k = 0; k < dwell_V.rows(); ++k)
      dwell_V.row(k) += dwell_contrasts_V(
          term_input(log, parameters, numbers, axis, a_g, static_cast<std::size_t>(k)), active);
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

PerAxis<Eigen::VectorXd> predict_means_V(const VisitLog& log,
                                         const EnlargedParameters& parameters) {
  return predict_means_V(log, parameters, specific_forces_g(log, parameters));
}

PerAxis<Eigen::VectorXd> predict_means_V(const VisitLog& log, const EnlargedParameters& parameters,
                                         const Forces& a_g) {
  const VisitNumbers numbers = no_numbers(parameters);
  PerAxis<Eigen::VectorXd> means_V;
  for (std::size_t i = 0; i < kAxisCount; ++i)
    means_V[i] = means_of_axis_V(log, parameters, numbers, i, a_g);
  return means_V;
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
Eigen::Index moved_rows(const VisitLog& log, const EnlargedParameters& parameters) {
  return has_effect_within_dwell(parameters) ? stacked_rows(log) : mean_rows(log);
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

// A step that changes the prediction well above rounding and well below curvature.
double difference_step(const ParameterInfo& info, double value) {
  if (info.step > 0) return info.step;
  if (info.role == ParameterRole::shape) return 1e-3 * std::max(std::abs(value), 1e-9);
  // Amplitudes: terms of 1e-5 g, angles of 1e-5 degrees and the like.
  return std::max(1e-3 * std::abs(value), 1e-6);
}

/// What one column of the Jacobian is about.
struct FreeParameter {
  std::optional<std::size_t> effect;  ///< none: one of the twelve
  std::optional<std::size_t> axis;    ///< the only one that it concerns
  double step;                        ///< of the central difference
};

std::vector<FreeParameter> free_parameters(const EnlargedParameters& parameters) {
  std::vector<FreeParameter> all;
  for (std::size_t i = 0; i < 4 * kAxisCount; ++i) all.push_back({{}, i / 4, 1e-6});
  for (std::size_t e = 0; e < parameters.effects.size(); ++e) {
    const ActiveEffect& active = parameters.effects[e];
    std::optional<std::size_t> axis;
    if (active.effect->subject() == Subject::sensor) axis = active.axis;
    for (const EstimatedParameter& parameter : estimated_of(parameters, e))
      all.push_back({e, axis, difference_step(parameter.info, parameter.value)});
  }
  return all;
}

/// Differences of predictions. There are many effects with many parameters: for each no more is
/// worked out than what hangs on it.
class Differences {
 public:
  /// All of these must outlive it. a_g, head: of the model.
  Differences(const VisitLog& log, const EnlargedParameters& parameters, const Forces& a_g,
              const std::vector<HeadAtVisit>& head)
      : log_(log), a_g_(a_g), head_(head), within_dwell_(has_effect_within_dwell(parameters)) {
    model_.parameters = parameters;
    for (const ActiveEffect& active : parameters.effects) {
      model_.numbers.push_back(numbers_of(log, active));
      remembers_ = remembers_ || active.effect->remembers();
      if (active.effect->at_converter()) asks_converter_[active.axis] = true;
    }
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      if (has_effect_on(parameters, axis)) look_at(axis);
  }

  /// Central difference of the stacked prediction by the free parameter of index `j`. `column`:
  /// zero. Precondition: the axis that it concerns, if it is one only, has effects.
  void set_column(Eigen::Index j, const FreeParameter& about,
                  Eigen::Ref<Eigen::VectorXd> column) const {
    const Neighbour above = neighbour(j, about, about.step);
    const Neighbour below = neighbour(j, about, -about.step);
    if (!about.axis) {
      set_change_of_all(above, below, column);
    } else {
      const std::size_t axis = *about.axis;
      const auto n = std::ssize(a_g_), row = static_cast<Eigen::Index>(axis) * n;
      // What the converter makes of its input, it does so in units of the axis's own sensitivity.
      const bool is_own = j == static_cast<Eigen::Index>(4 * axis + axis);
      column.segment(row, n) = about.effect ? change_by_effect_V(*about.effect, above, below)
                               : is_own && asks_converter_[axis]
                                   ? means_V(above, axis) - means_V(below, axis)
                                   : change_of_output_V(axis, above, below);
      if (within_dwell_)
        set_dwells(axis, dwells_of_V(above, axis) - dwells_of_V(below, axis), column);
    }
    column /= 2 * about.step;
  }

 private:
  struct Neighbour {
    EnlargedParameters parameters;
    VisitNumbers numbers;
  };

  void look_at(std::size_t axis) {
    constexpr double kStep_V = 1e-6;
    const auto n = std::ssize(a_g_);
    passed_on_[axis] = Eigen::VectorXd::Ones(n);
    for (Eigen::Index row = 0; row < n; ++row) {
      const auto k = static_cast<std::size_t>(row);
      const TermInput given = term_input(log_, model_.parameters, model_.numbers, axis, a_g_, k);
      inputs_[axis].push_back(given);
      if (!asks_converter_[axis]) continue;
      const auto made_V = [&](double by_V) {
        TermInput other = given;
        other.output_V += by_V;
        return terms_V(model_.parameters, model_.numbers, other, true);
      };
      passed_on_[axis](row) += (made_V(kStep_V) - made_V(-kStep_V)) / (2 * kStep_V);
    }
  }

  Neighbour neighbour(Eigen::Index j, const FreeParameter& about, double by) const {
    Neighbour other = model_;
    Eigen::VectorXd values = model_.parameters.free_values();
    values(j) += by;
    other.parameters.set_free_values(values);
    if (about.effect)
      other.numbers[*about.effect] = numbers_of(log_, other.parameters.effects[*about.effect]);
    return other;
  }

  // What belongs to one axis leaves the head, and so the forces, as they are.
  Eigen::VectorXd means_V(const Neighbour& model, std::size_t axis) const {
    return means_of_axis_V(log_, model.parameters, model.numbers, axis, a_g_);
  }
  Eigen::MatrixXd dwells_of_V(const Neighbour& model, std::size_t axis) const {
    return dwells_of_axis_V(log_, model.parameters, axis, a_g_, head_);
  }

  /// Of the means, where only one effect of the sensor differs.
  Eigen::VectorXd change_by_effect_V(std::size_t effect, const Neighbour& above,
                                     const Neighbour& below) const {
    const ActiveEffect& active = model_.parameters.effects[effect];
    Eigen::VectorXd change_V(std::ssize(a_g_));
    for (const TermInput& input : inputs_[active.axis])
      change_V(static_cast<Eigen::Index>(input.visit)) =
          term_V(above.parameters.effects[effect], above.numbers[effect], input) -
          term_V(below.parameters.effects[effect], below.numbers[effect], input);
    if (!active.effect->at_converter()) change_V.array() *= passed_on_[active.axis].array();
    return change_V;
  }

  /// Of the means, where only what comes before the converter differs.
  Eigen::VectorXd change_of_output_V(std::size_t axis, const Neighbour& above,
                                     const Neighbour& below) const {
    Eigen::VectorXd change_V(std::ssize(a_g_));
    for (Eigen::Index row = 0; row < change_V.size(); ++row) {
      const auto k = static_cast<std::size_t>(row);
      change_V(row) = term_input(log_, above.parameters, above.numbers, axis, a_g_, k).output_V -
                      term_input(log_, below.parameters, below.numbers, axis, a_g_, k).output_V;
    }
    return change_V.cwiseProduct(passed_on_[axis]);
  }

  void set_dwells(std::size_t axis, const Eigen::MatrixXd& change_V,
                  Eigen::Ref<Eigen::VectorXd> change) const {
    const Eigen::Index rows = change_V.size();
    change.segment(mean_rows(log_) + static_cast<Eigen::Index>(axis) * rows, rows) =
        change_V.reshaped();
  }

  void set_change_of_all(const Neighbour& above, const Neighbour& below,
                         Eigen::Ref<Eigen::VectorXd> change) const {
    const Eigen::Index n = std::ssize(a_g_);
    Forces above_g = a_g_, below_g = a_g_;
    std::vector<std::size_t> moved;
    for (std::size_t k = 0; k < a_g_.size(); ++k) {
      const HeadGeometry up = head_geometry(log_, above.parameters, above.numbers, k);
      const HeadGeometry down = head_geometry(log_, below.parameters, below.numbers, k);
      if (!remembers_ && up == down) continue;
      moved.push_back(k);
      above_g[k] = specific_force_g(up, log_.gamma);
      below_g[k] = specific_force_g(down, log_.gamma);
    }
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      for (const std::size_t k : moved)
        change(static_cast<Eigen::Index>(axis) * n + static_cast<Eigen::Index>(k)) =
            mean_V(log_, above.parameters, above.numbers, axis, above_g, k) -
            mean_V(log_, below.parameters, below.numbers, axis, below_g, k);
    if (!within_dwell_) return;
    const auto above_V = dwells_V(log_, above.parameters, above_g);
    const auto below_V = dwells_V(log_, below.parameters, below_g);
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      set_dwells(axis, above_V[axis] - below_V[axis], change);
  }

  const VisitLog& log_;
  const Forces& a_g_;
  const std::vector<HeadAtVisit>& head_;
  Neighbour model_;
  // Where an axis has effects, at each visit:
  PerAxis<std::vector<TermInput>> inputs_;
  PerAxis<Eigen::VectorXd> passed_on_;  ///< of a change of what the converter is given, as a ratio
  PerAxis<bool> asks_converter_{};      ///< whether terms of the axis hang on its output
  bool within_dwell_;
  bool remembers_ = false;  ///< whether a term hangs on the forces of other visits
};

/// Writes the columns of the twelve of an axis without effects of the sensor: the readings are
/// linear in them.
void set_linear_columns(const Forces& a_g, const std::vector<HeadAtVisit>& head,
                        Eigen::Index contrasts, std::size_t axis, Eigen::MatrixXd& jacobian) {
  const Eigen::Index n = std::ssize(a_g), i = static_cast<Eigen::Index>(axis);
  for (Eigen::Index component = 0; component < 4; ++component) {
    auto column = jacobian.col(4 * i + component);
    for (Eigen::Index k = 0; k < n; ++k)
      column(i * n + k) = component < 3 ? a_g[static_cast<std::size_t>(k)](component) : 1;
    if (head.empty()) continue;
    auto dwells = column.segment((kAxes + i * contrasts) * n, contrasts * n).reshaped(n, contrasts);
    for (const auto& [visit, course] : head)
      dwells.row(visit) += course.contrasts_V(Eigen::Vector4d::Unit(component));
  }
}

}  // namespace

bool shapes_differ(const EnlargedParameters& one, const EnlargedParameters& other) {
  for (std::size_t e = 0; e < one.effects.size(); ++e)
    for (const EstimatedParameter& shape : estimated_of(one, e))
      if (shape.info.role == ParameterRole::shape &&
          std::abs(shape.value - other.effects[e].p[shape.place]) >
              difference_step(shape.info, shape.value))
        return true;
  return false;
}

Eigen::VectorXd stacked_V(const Observations& observed) {
  return stacked(observed.mean_V, observed.dwell_V);
}

Eigen::VectorXd predict_stacked_V(const VisitLog& log, const EnlargedParameters& parameters) {
  const Forces a_g = specific_forces_g(log, parameters);
  return stacked(predict_means_V(log, parameters, a_g), dwells_V(log, parameters, a_g));
}

Eigen::MatrixXd prediction_jacobian(const VisitLog& log, const EnlargedParameters& parameters) {
  const std::vector<FreeParameter> free = free_parameters(parameters);
  const Forces a_g = specific_forces_g(log, parameters);
  const std::vector<HeadAtVisit> head = head_courses(log, parameters);
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(moved_rows(log, parameters), std::ssize(free));
  PerAxis<bool> is_linear;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    is_linear[axis] = !has_effect_on(parameters, axis);
    if (is_linear[axis]) set_linear_columns(a_g, head, log.dwell_contrasts(), axis, jacobian);
  }
  std::vector<std::size_t> others;
  for (std::size_t j = 0; j < free.size(); ++j)
    if (!free[j].axis || !is_linear[*free[j].axis]) others.push_back(j);
  const Differences differences(log, parameters, a_g, head);
  parallel_for(others.size(), [&](std::size_t c) {
    const auto j = static_cast<Eigen::Index>(others[c]);
    differences.set_column(j, free[others[c]], jacobian.col(j));
  });
  return jacobian;
}

}  // namespace plumbline
