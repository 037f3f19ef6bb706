#include "estimator/diagnosis/enlarged_parameters.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace plumbline {
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
    if (infos[k].role == ParameterRole::shape && !infos[k].direction) active.free[k] = free;
  return active;
}

}  // namespace

ActiveEffect with_shapes_held(ActiveEffect active) { return with_shapes(std::move(active), false); }

ActiveEffect with_shapes_free(ActiveEffect active) { return with_shapes(std::move(active), true); }

Eigen::Index ActiveEffect::free_count() const { return std::count(free.begin(), free.end(), true); }

Eigen::Index EnlargedParameters::free_count() const { return first_free(effects.size()); }

Eigen::Index EnlargedParameters::first_free(std::size_t effect) const {
  auto count = static_cast<Eigen::Index>(4 * kAxisCount);
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

std::vector<EstimatedParameter> estimated_of(const EnlargedParameters& model, std::size_t effect) {
  const ActiveEffect& active = model.effects[effect];
  std::vector<ParameterInfo> infos = active.effect->parameters();
  std::vector<EstimatedParameter> estimated;
  Eigen::Index row = model.first_free(effect);
  for (std::size_t k = 0; k < infos.size(); ++k)
    if (active.free[k]) estimated.push_back({std::move(infos[k]), active.p[k], k, row++});
  return estimated;
}

bool is_of_sensor(const ActiveEffect& active, std::size_t axis) {
  return active.effect->subject() == Subject::sensor && active.axis == axis;
}

EnlargedParameters with_effect(EnlargedParameters model, const ActiveEffect& active) {
  model.effects.push_back(active);
  return model;
}

EnlargedParameters without_effect(EnlargedParameters model, std::size_t effect) {
  model.effects.erase(model.effects.begin() + static_cast<std::ptrdiff_t>(effect));
  return model;
}

EnlargedParameters without_effects(EnlargedParameters model,
                                   const std::vector<std::size_t>& effects) {
  for (auto k = effects.rbegin(); k != effects.rend(); ++k)
    model = without_effect(std::move(model), *k);
  return model;
}

bool has_effect_within_dwell(const EnlargedParameters& parameters) {
  return std::any_of(parameters.effects.begin(), parameters.effects.end(),
                     [](const ActiveEffect& active) { return active.effect->within_dwell(); });
}

bool has_effect_on(const EnlargedParameters& parameters, std::size_t axis) {
  return std::any_of(parameters.effects.begin(), parameters.effects.end(),
                     [&](const ActiveEffect& active) { return is_of_sensor(active, axis); });
}

}  // namespace plumbline
