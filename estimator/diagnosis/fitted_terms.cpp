#include "estimator/diagnosis/fitted_terms.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>

#include "estimator/angle_units.h"
#include "estimator/diagnosis/structure_parts.h"
#include "estimator/effects/driver.h"
#include "estimator/effects/smooth_term.h"

namespace plumbline {

namespace {

/// Mean square of successive differences in the order of `at`, over twice the variance: about 1
/// where nothing depends on it, near 0 for a smooth function. Equal places count as one place with
/// all that is seen there.
double roughness(const std::vector<double>& at, const Eigen::VectorXd& term) {
  std::vector<std::size_t> order(at.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return at[a] < at[b]; });
  if (!(at[order.back()] > at[order.front()])) return std::numeric_limits<double>::infinity();
  const auto value = [&](std::size_t k) { return term(static_cast<Eigen::Index>(order[k])); };
  double steps = 0;
  for (std::size_t k = 1; k < order.size(); ++k)
    steps += (value(k) - value(k - 1)) * (value(k) - value(k - 1));
  return steps / (2 * (term.array() - term.mean()).square().sum());
}

/// What a smooth term names, then the component of the own axis, then all others, the time last.
std::vector<const Driver*> likeliest_first(const std::vector<Driver>& drivers, std::size_t axis,
                                           const SmoothTerm* smooth) {
  const auto rank = [&](const Driver& driver) {
    if (smooth != nullptr && driver.name == smooth->driver()) return 0;
    if (driver.component == axis) return 1;
    return driver.is_clock() ? 3 : 2;
  };
  std::vector<const Driver*> order;
  order.reserve(drivers.size());
  for (const Driver& driver : drivers) order.push_back(&driver);
  std::stable_sort(order.begin(), order.end(),
                   [&](const Driver* a, const Driver* b) { return rank(*a) < rank(*b); });
  return order;
}

}  // namespace

std::vector<FittedTerm> fitted_terms(const VisitLog& log, const EnlargedParameters& model,
                                     const PerAxis<Eigen::VectorXd>& predicted_V,
                                     const PerAxis<double>& expected_mps2) {
  const std::vector<Driver> drivers = instantaneous_drivers(log);
  std::multimap<double, FittedTerm, std::greater<>> by_size;  // equal ones stay in order
  for (std::size_t e = 0; e < model.effects.size(); ++e) {
    const auto without_V = predict_means_V(log, without_effect(model, e));
    FittedTerm term;
    Eigen::VectorXd course_mps2;
    double largest = 0;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const Eigen::VectorXd of_axis = model.mps2_per_V(i) * (predicted_V[i] - without_V[i]);
      const double share = of_axis.norm() / std::max(1e-300, expected_mps2[i]);
      if (!(share > largest)) continue;
      largest = share;
      term.axis = i;
      course_mps2 = of_axis;
    }
    if (!(largest > 0)) continue;
    const Effect& effect = *model.effects[e].effect;
    const auto* smooth = dynamic_cast<const SmoothTerm*>(&effect);
    const Driver* best = nullptr;
    double least = std::numeric_limits<double>::infinity();
    // In an order of poses like this one several may show it alike: the likelier cause first.
    constexpr double kClearly = 0.7;
    for (const Driver* driver : likeliest_first(drivers, term.axis, smooth)) {
      // What it names shows it, even where something else decides, too.
      if (best != nullptr && smooth != nullptr && best->name == smooth->driver() &&
          driver->name != smooth->driver())
        break;
      const double rough = roughness(driver->value[term.axis], course_mps2);
      if (!(rough < kClearly * least)) continue;
      least = rough;
      best = driver;
    }
    if (best == nullptr) continue;
    const auto structure = structure_name(model.effects[e]);
    term.name = structure ? structure->driver + ": " + structure->shape : effect.id();
    term.driver = best->past.empty() ? best->name : best->past;
    term.at = best->value[term.axis];
    if (best->unit() == "rad")
      for (double& at : term.at) at *= kDegPerRad;
    if (term.driver == kTemperatureColumn)
      for (double& at : term.at) at += log.reference_C;
    term.term_mps2.assign(course_mps2.begin(), course_mps2.end());
    by_size.emplace(largest, std::move(term));
  }
  std::vector<FittedTerm> terms;
  for (auto& [size, term] : by_size) terms.push_back(std::move(term));
  return terms;
}

}  // namespace plumbline
