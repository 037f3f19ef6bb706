// What effects are made of: those without memory are one function each.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "rig/sim/effects/effect.h"

namespace plumbline::sim {

inline constexpr double kTurn_rad = 2 * std::numbers::pi;

inline double sin_deg(double angle_deg) { return std::sin(angle_deg * kTurn_rad / 360); }
inline double cos_deg(double angle_deg) { return std::cos(angle_deg * kTurn_rad / 360); }

/// A time constant.
inline const ParameterInfo kTau{.name = "tau", .unit = "s", .min = 1e-6};

/// Which of the three axes a setting names.
inline std::array<bool, 3> axis_mask(const EffectSetting& setting) {
  std::array<bool, 3> mask{};
  for (const std::size_t axis : setting.axes) mask[axis] = true;
  return mask;
}

/// An effect with a memory, a class of its own.
template <class T>
std::unique_ptr<Effect> make(const EffectContext& context) {
  return std::make_unique<T>(context);
}

/// Input-referred term `f(moment, axis)` in g, on the axes of the setting.
template <class F>
std::unique_ptr<Effect> sensor_term(const EffectContext& context, F f) {
  class Term final : public Effect {
   public:
    Term(std::array<bool, 3> mask, F function) : mask_(mask), function_(std::move(function)) {}
    double sensor_g(const Moment& now, std::size_t axis) override {
      return mask_[axis] ? function_(now, axis) : 0.0;
    }

   private:
    std::array<bool, 3> mask_;
    F function_;
  };
  return std::make_unique<Term>(axis_mask(context.setting), std::move(f));
}

/// Errors of the head: `f(moment, errors)` adds to them.
template <class F>
std::unique_ptr<Effect> head_term(F f) {
  class Term final : public Effect {
   public:
    explicit Term(F function) : function_(std::move(function)) {}
    void bend_head(const Moment& now, HeadErrors& errors) override { function_(now, errors); }

   private:
    F function_;
  };
  return std::make_unique<Term>(std::move(f));
}

/// Voltage at the converter: `f(moment, axis, u_V)`, on the axes of the setting.
template <class F>
std::unique_ptr<Effect> converter_term(const EffectContext& context, F f) {
  class Term final : public Effect {
   public:
    Term(std::array<bool, 3> mask, F function) : mask_(mask), function_(std::move(function)) {}
    double convert_V(const Moment& now, std::size_t axis, double u_V) override {
      return mask_[axis] ? function_(now, axis, u_V) : u_V;
    }

   private:
    std::array<bool, 3> mask_;
    F function_;
  };
  return std::make_unique<Term>(axis_mask(context.setting), std::move(f));
}

/// First-order lag, exact for an input that is constant over each step.
class Lag {
 public:
  explicit Lag(double tau_s) : tau_s_(tau_s) {}
  /// Starts at the first input.
  double next(double input, double dt_s) {
    if (!started_) value_ = input;
    started_ = true;
    value_ += (input - value_) * -std::expm1(-dt_s / tau_s_);
    return value_;
  }
  double value() const { return value_; }

 private:
  double tau_s_;
  double value_ = 0;
  bool started_ = false;
};

/// Backlash of a drive or of a hysteretic material: the output follows the input once the play of
/// ±half_width is used up.
class Play {
 public:
  explicit Play(double half_width) : half_width_(half_width) {}
  /// Starts at the first input, in the middle of the play.
  double next(double input) {
    if (!started_) value_ = input;
    started_ = true;
    value_ = std::clamp(value_, input - half_width_, input + half_width_);
    return value_;
  }

 private:
  double half_width_;
  double value_ = 0;
  bool started_ = false;
};

}  // namespace plumbline::sim
