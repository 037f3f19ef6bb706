#include "app/io/uncertainty_json.h"

#include <cmath>

#include "estimator/parameter_name.h"

namespace plumbline::app {

namespace {

Json to_json(const ParameterUncertainty& parameter) {
  const ParameterBudget& budget = parameter.budget;
  return {{"budget",
           {{"noise", json_number(budget.noise)},
            {"positioning", json_number(std::hypot(budget.delta, budget.h))},
            {"rounding", json_number(budget.rounding)},
            {"gravity", json_number(budget.gravity)},
            {"alternatives", json_number(budget.alternatives)},
            {"combined", json_number(budget.combined)}}},
          {"gum", json_numbers({parameter.gum_low, parameter.gum_high})},
          {"monte_carlo",
           {{"mean", json_number(parameter.mc_mean)},
            {"u", json_number(parameter.mc_u)},
            {"interval", json_numbers({parameter.mc_low, parameter.mc_high})}}},
          {"difference", json_numbers({parameter.difference_low, parameter.difference_high})},
          {"tolerance", json_number(parameter.tolerance)},
          {"validated", parameter.validated}};
}

}  // namespace

Json uncertainty_json(const UncertaintyReport& report) {
  Json json = {{"of", "final.batch_ls"},
               {"coverage", 0.95},
               {"trials", report.trials},
               {"stabilised", report.stabilised},
               {"validated", report.validated}};
  json.update(json_per_axis([&](std::size_t axis) -> Json {
    const auto& p = report.parameter[axis];
    Json of_axis = Json::object();
    for (std::size_t k = 0; k < p.size(); ++k)
      of_axis[parameter_name(axis, static_cast<Eigen::Index>(k))] = to_json(p[k]);
    return of_axis;
  }));
  return json;
}

}  // namespace plumbline::app
