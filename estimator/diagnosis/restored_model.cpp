#include "estimator/diagnosis/restored_model.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include "estimator/diagnosis/structure_parts.h"
#include "estimator/effects/catalogue.h"
#include "estimator/effects/covariate.h"
#include "estimator/effects/driver.h"
#include "estimator/effects/smooth_term.h"

namespace plumbline {

namespace {

/// The instances of an effect on one axis (or the head), one after the other: a parameter that was
/// there already begins the next. Without those that lack an index or a shape.
std::vector<ActiveEffect> instances(const Effect& effect, std::size_t axis,
                                    const std::vector<EffectParameter>& reported) {
  const auto infos = effect.parameters();
  std::vector<std::vector<std::optional<double>>> values;
  for (const EffectParameter& parameter : reported) {
    if (parameter.axis && *parameter.axis != axis) continue;
    const auto info = std::find_if(infos.begin(), infos.end(), [&](const ParameterInfo& i) {
      return i.name == parameter.name;
    });
    if (info == infos.end()) continue;
    const auto k = static_cast<std::size_t>(info - infos.begin());
    if (values.empty() || values.back()[k]) values.emplace_back(infos.size());
    values.back()[k] = parameter.value;
  }
  std::vector<ActiveEffect> found;
  for (const auto& value : values) {
    ActiveEffect active{&effect, axis, std::vector<double>(infos.size()),
                        std::vector<bool>(infos.size(), false)};
    bool whole = true;
    for (std::size_t k = 0; k < infos.size(); ++k) {
      active.p[k] = value[k].value_or(0);
      whole = whole && (value[k] || infos[k].role == ParameterRole::amplitude);
    }
    if (whole) found.push_back(std::move(active));
  }
  return found;
}

/// Whether the log has these columns; notes what it lacks.
bool has_columns(std::vector<std::string> columns, const VisitLog& log, RestoredModel& restored) {
  const std::vector<std::string> lacking = log.lacking(std::move(columns));
  for (const std::string& column : lacking) {
    auto& noted = restored.lacking;
    if (std::find(noted.begin(), noted.end(), column) == noted.end()) noted.push_back(column);
  }
  return lacking.empty();
}

/// The column behind a driver, if it is one that the calibration run recorded.
std::vector<std::string> columns_behind(const std::string& driver, const RunHistory& history) {
  const std::string column = recorded_column(driver);
  const auto& names = history.covariate_names;
  const bool recorded = column == kTemperatureColumn
                            ? history.has_temperature
                            : std::find(names.begin(), names.end(), column) != names.end();
  if (!recorded) return {};
  return {column};
}

void restore(const Effect& effect, const std::vector<std::size_t>& axes,
             const std::vector<EffectParameter>& reported, EnlargedParameters& model) {
  const bool head = effect.subject() == Subject::head;
  for (std::size_t axis : head ? std::vector<std::size_t>{0} : axes)
    for (ActiveEffect& active : instances(effect, axis, reported))
      model.effects.push_back(std::move(active));
}

}  // namespace

RestoredModel restore_model(const CertifiedModel& model, const VisitLog& log, RestoredFor use) {
  RestoredModel restored;
  EnlargedParameters& parameters = restored.parameters;
  for (std::size_t i = 0; i < kAxisCount; ++i) parameters.twelve[i] = model.final[i].value;
  std::vector<const Effect*> named = effect_catalogue();
  for (const auto& effect : model.own_effects) named.push_back(effect.get());
  for (auto& effect : covariate_effects(log)) restored.owned.push_back(std::move(effect));
  const std::vector<std::shared_ptr<const Effect>> columns = restored.owned;
  // Says whether anything is there by that id.
  const auto restore_named = [&](const std::string& id, const std::vector<std::size_t>& axes,
                                 const std::vector<EffectParameter>& reported) {
    const std::size_t before = parameters.effects.size();
    for (const Effect* effect : named)
      if (effect->id() == id && (effect->carries_over() || use == RestoredFor::its_run) &&
          has_columns(effect->columns(), log, restored))
        restore(*effect, axes, reported, parameters);
    // Bias and scale form of a column share the id; the unit of c tells them apart.
    for (const auto& effect : columns)
      if (effect->id() == id && !reported.empty() &&
          effect->parameters().front().unit == reported.front().unit)
        restore(*effect, axes, reported, parameters);
    if (parameters.effects.size() > before) return true;
    if (const auto column = covariate_column(id)) has_columns({*column}, log, restored);
    return false;
  };
  for (const FoundEffect& found : model.effects)
    if (!restore_named(found.id, found.axes, found.parameters))
      restored.left_out.push_back(found.id);
  std::vector<std::unique_ptr<SmoothTerm>> terms;
  if (!model.unlisted.empty()) terms = smooth_terms(log, SmoothTermSelection::any);
  for (const UnlistedStructure& found : model.unlisted) {
    if (found.is_of_noise()) continue;  // it is in no mean
    if (const auto id = part_like(found.shape)) {
      if (!restore_named(*id, found.axes, found.parameters)) restored.left_out.push_back(*id);
      continue;
    }
    const std::size_t before = parameters.effects.size();
    const SmoothTerm* term = find_term(terms, found.driver, found.form, found.shape);
    if (has_columns(columns_behind(found.driver, model.history), log, restored) && term != nullptr)
      restore(*term, found.axes, found.parameters, parameters);
    if (parameters.effects.size() == before)
      restored.left_out.push_back("unlisted: " + found.driver);
  }
  std::move(terms.begin(), terms.end(), std::back_inserter(restored.owned));
  return restored;
}

}  // namespace plumbline
