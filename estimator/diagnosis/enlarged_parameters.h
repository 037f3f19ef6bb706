// The parameters of the 12-parameter model enlarged by effects.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "estimator/effects/effect.h"
#include "estimator/measurement.h"

namespace plumbline {

/// A structure that has no name, of which something that has one is a part.
struct StructurePart {
  std::string driver, form;  ///< of the structure
};

/// An effect that takes part in the model.
struct ActiveEffect {
  const Effect* effect = nullptr;
  std::size_t axis = 0;                       ///< of a sensor effect
  std::vector<double> p;                      ///< values, in the order of effect->parameters()
  std::vector<bool> free;                     ///< which of them are estimated
  std::optional<StructurePart> part_of = {};  ///< so it is reported, not by its name

  Eigen::Index free_count() const;
};

/// Axes whose readings the effect changes: one for a sensor effect, all three for the head.
std::vector<std::size_t> axes_of(const ActiveEffect& active);
/// Free are the amplitudes that are not zero and the shapes; indices stay.
ActiveEffect activate(const Effect& effect, std::size_t axis, const Hypothesis& hypothesis);
/// The same with its shapes as they are; with all of them free.
ActiveEffect with_shapes_held(ActiveEffect active);
ActiveEffect with_shapes_free(ActiveEffect active);

/// All parameters of the enlarged model.
struct EnlargedParameters {
  PerAxis<Eigen::Vector4d> twelve{};  ///< [K_ix K_iy K_iz U_i0], V/g and V
  std::vector<ActiveEffect> effects;

  /// 12 + free effect parameters.
  Eigen::Index free_count() const;
  /// Place of the first free parameter of an effect among all of them.
  Eigen::Index first_free(std::size_t effect) const;
  Eigen::VectorXd free_values() const;
  void set_free_values(const Eigen::VectorXd& values);
  /// m/s² per volt of residual: g_n / K_ii, signed.
  double mps2_per_V(std::size_t axis) const;
};

/// A parameter of an effect that is estimated.
struct EstimatedParameter {
  ParameterInfo info;
  double value = 0;
  std::size_t place = 0;  ///< among the parameters of its effect
  Eigen::Index row = 0;   ///< among all free ones of the model, as in a covariance
};

/// Those of one of the effects, in their order.
std::vector<EstimatedParameter> estimated_of(const EnlargedParameters& model, std::size_t effect);

/// Whether it is an effect of the sensor of that axis.
bool is_of_sensor(const ActiveEffect& active, std::size_t axis);

/// The model with one more effect; without that of an index; without those of several (ascending).
EnlargedParameters with_effect(EnlargedParameters model, const ActiveEffect& active);
EnlargedParameters without_effect(EnlargedParameters model, std::size_t effect);
EnlargedParameters without_effects(EnlargedParameters model,
                                   const std::vector<std::size_t>& effects);

/// Whether the model has effects that change while the head rests: only then are the rows of the
/// dwells anything but zero.
bool has_effect_within_dwell(const EnlargedParameters& parameters);

/// Whether the sensor of an axis has effects; without them its readings are linear in the twelve.
bool has_effect_on(const EnlargedParameters& parameters, std::size_t axis);

}  // namespace plumbline
