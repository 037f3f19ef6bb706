#include "estimator/diagnosis/structure_parts.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/diagnosis/enlarged_fit.h"
#include "estimator/effects/driver.h"
#include "estimator/effects/listed_drivers.h"
#include "estimator/effects/smooth_term.h"
#include "estimator/linear_algebra.h"

namespace plumbline {

namespace {

const SmoothTerm* term_of(const ActiveEffect& active) {
  assert(active.effect != nullptr);
  return dynamic_cast<const SmoothTerm*>(active.effect);
}

bool act_on_the_same(const ActiveEffect& one, const ActiveEffect& other) {
  return one.effect->subject() == other.effect->subject() &&
         (one.effect->subject() == Subject::head || one.axis == other.axis);
}

/// The driver that both, which act on the same, follow in the same form.
std::optional<std::string> common_driver(const ActiveEffect& named, const ActiveEffect& unnamed) {
  const auto of_named = drivers_of(*named.effect, named.axis);
  if (!of_named) return {};
  const SmoothTerm& term = *term_of(unnamed);
  const std::string column = recorded_column(term.driver());
  for (const std::string& driver : of_named->drivers) {
    if (driver != column) continue;
    // A scale that follows what it is the scale of is a function of that.
    const bool of_output = driver.starts_with("a_") || driver.starts_with("code_");
    if (term.form() == of_named->form || (of_output && term.form() == TermForm::scale))
      return driver;
  }
  return {};
}

/// How far an effect moves the whitened readings of a visit at most, beside the 12 parameters.
double most_moved(const EnlargedFit& fit, Eigen::Index visits, std::size_t effect) {
  const Eigen::MatrixXd twelve = orthonormal_basis(fit.whitened_jacobian.leftCols(4 * kAxisCount));
  const Eigen::VectorXd all = whitened_contribution(fit, effect);
  const Eigen::VectorXd own = all - twelve * (twelve.transpose() * all);
  Eigen::VectorXd square = Eigen::VectorXd::Zero(visits);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    square += own.segment(static_cast<Eigen::Index>(axis) * visits, visits).cwiseAbs2();
  return std::sqrt(square.maxCoeff());
}

/// The driver of structure `unnamed` of which effect `named` is a part; nothing where it is none.
std::optional<std::string> driver_of_whole(const SearchResult& found, Eigen::Index visits,
                                           std::size_t named, std::size_t unnamed) {
  constexpr double kRemnant = 0.2;  // of what it takes to see the name
  constexpr double kAsFar = 3;
  const std::vector<ActiveEffect>& effects = found.fit.parameters.effects;
  if (!act_on_the_same(effects[named], effects[unnamed])) return {};
  if (effects[named].effect->concerns_one_visit()) {
    if (most_moved(found.fit, visits, named) >= kAsFar * most_moved(found.fit, visits, unnamed))
      return {};
    return term_of(effects[unnamed])->driver();
  }
  if (found.evidence[unnamed].sigmas <= kRemnant * found.evidence[named].sigmas) return {};
  return common_driver(effects[named], effects[unnamed]);
}

/// What happens at one time and stays, where there are three of one axis (or the head) or more that
/// go to and fro: something switches.
void mark_what_switches(std::vector<ActiveEffect>& effects) {
  constexpr std::size_t kSeveral = 3;
  for (ActiveEffect& first : effects) {
    const std::string id = first.effect->id();
    if (first.part_of || (id != "sensor.bias_step" && id != "rig.index_slip")) continue;
    std::vector<ActiveEffect*> all;
    double least = 0, most = 0;
    for (ActiveEffect& other : effects) {
      if (other.effect != first.effect || !act_on_the_same(first, other)) continue;
      all.push_back(&other);
      least = std::min(least, other.p[0]);
      most = std::max(most, other.p[0]);
    }
    if (all.size() < kSeveral || !(least < 0 && most > 0)) continue;
    const ListedDrivers of_time = *drivers_of(*first.effect, first.axis);
    for (ActiveEffect* each : all)
      each->part_of = StructurePart{of_time.drivers.front(), to_string(of_time.form)};
  }
}

constexpr std::string_view kPartLike = "part that runs like ";

}  // namespace

std::optional<StructureName> structure_name(const ActiveEffect& active) {
  if (active.part_of)
    return StructureName{active.part_of->driver, active.part_of->form,
                         std::string(kPartLike) + active.effect->id()};
  const SmoothTerm* term = term_of(active);
  if (term == nullptr) return {};
  return StructureName{term->driver(), to_string(term->form()), term->shape()};
}

std::optional<std::string> part_like(const std::string& shape) {
  if (!shape.starts_with(kPartLike)) return {};
  return shape.substr(kPartLike.size());
}

void mark_parts_of_structures(const VisitLog& log, SearchResult& found) {
  std::vector<ActiveEffect>& effects = found.fit.parameters.effects;
  for (std::size_t k = 0; k < effects.size(); ++k) {
    if (term_of(effects[k]) != nullptr) continue;
    double most_sigmas = 0;
    for (std::size_t u = 0; u < effects.size(); ++u) {
      const SmoothTerm* term = term_of(effects[u]);
      if (term == nullptr || found.evidence[u].sigmas <= most_sigmas) continue;
      const auto driver = driver_of_whole(found, std::ssize(log.visits), k, u);
      if (!driver) continue;
      most_sigmas = found.evidence[u].sigmas;
      effects[k].part_of = StructurePart{*driver, to_string(term->form())};
    }
  }
  mark_what_switches(effects);
}

}  // namespace plumbline
