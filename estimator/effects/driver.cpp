#include "estimator/effects/driver.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <set>

#include "estimator/effects/effect.h"
#include "estimator/kinematics.h"
#include "estimator/median.h"

namespace plumbline {
namespace {

constexpr const char* kCosineOfH = "cosine of h";

using ValueAtVisit = std::function<double(std::size_t visit)>;

PerAxis<std::vector<double>> for_all_axes(const VisitLog& log, const ValueAtVisit& value) {
  std::vector<double> values(log.visits.size());
  for (std::size_t k = 0; k < values.size(); ++k) values[k] = value(k);
  return {values, values, values};
}

std::vector<double> specific_force_component_g(const VisitLog& log, std::size_t axis) {
  std::vector<double> a_g;
  for (const Visit& visit : log.visits)
    a_g.push_back(specific_force_g({visit.delta_rad, visit.h_rad},
                                   log.gamma)(static_cast<Eigen::Index>(axis)));
  return a_g;
}

/// What a component of the specific force changed by on the way to each visit: nothing after a long
/// rest, so that the 12 parameters are those of rest.
PerAxis<std::vector<double>> changes_g(const VisitLog& log) {
  PerAxis<std::vector<double>> change_g;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const std::vector<double> a_g = specific_force_component_g(log, i);
    for (std::size_t k = 0; k < a_g.size(); ++k)
      change_g[i].push_back(log.before(k) ? a_g[k] - a_g[k - 1] : 0.0);
  }
  return change_g;
}

/// What δ turned by on the way to a visit, the shorter way round; nothing after a long rest.
double turn_rad(const VisitLog& log, std::size_t visit) {
  const Visit* before = log.before(visit);
  if (before == nullptr) return 0;
  return shorter_turn_rad(*before, log.visits[visit]);
}

/// Between the dwells of two visits.
double time_between_s(const Visit& from, const Visit& to) {
  return to.t_arrival_s - from.t_arrival_s - from.duration_s();
}

// Slope between the neighbours of a visit, per hour.
std::vector<double> rate_per_h(const VisitLog& log, const std::vector<double>& value) {
  std::vector<double> rate(value.size());
  for (std::size_t k = 0; k < value.size(); ++k) {
    const std::size_t before = k == 0 ? 0 : k - 1;
    const std::size_t after = std::min(k + 1, value.size() - 1);
    const double span_s = log.visits[after].t_mean_s - log.visits[before].t_mean_s;
    rate[k] = span_s > 0 ? 3600 * (value[after] - value[before]) / span_s : 0;
  }
  return rate;
}

/// A range of which zero is the middle, where there is nothing.
std::pair<double, double> about_zero(const PerAxis<std::vector<double>>& values) {
  double most = 0;
  for (const auto& of_axis : values)
    for (const double value : of_axis) most = std::max(most, std::abs(value));
  return {-most, most};
}

/// What each axis has of its own, had from the next axis and from the one after that; their
/// component stands between `before` and `after`.
std::vector<Driver> of_other_axes(const Driver& own, const std::string& before,
                                  const std::string& after) {
  std::vector<Driver> drivers;
  for (std::size_t other = 1; other < kAxisCount; ++other) {
    Driver& driver = drivers.emplace_back(own);
    driver.past = before;
    driver.past +=
        other == 1 ? "component of the next axis" : "component of the axis after the next";
    driver.past += after;
    for (std::size_t i = 0; i < kAxisCount; ++i)
      driver.value[i] = own.value[(i + other) % kAxisCount];
  }
  return drivers;
}

double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

struct Column {
  std::string name;
  std::vector<double> value;
};

std::vector<Column> recorded_columns(const VisitLog& log) {
  std::vector<Column> columns;
  if (log.has_temperature) {
    Column& temperature = columns.emplace_back(Column{kTemperatureColumn, {}});
    for (const Visit& visit : log.visits) temperature.value.push_back(visit.temperature_K);
  }
  for (std::size_t c = 0; c < log.covariate_names.size(); ++c) {
    Column& column = columns.emplace_back(Column{log.covariate_names[c], {}});
    for (const Visit& visit : log.visits) column.value.push_back(visit.covariate[c]);
  }
  return columns;
}

}  // namespace

bool Driver::varies() const {
  return std::any_of(value.begin(), value.end(), [](const std::vector<double>& v) {
    const auto [low, high] = std::minmax_element(v.begin(), v.end());
    return low != v.end() && *high > *low;
  });
}

std::vector<std::string> Driver::columns() const {
  if (!recorded) return {};
  return {recorded_column(name)};
}

std::string recorded_column(const std::string& driver) {
  return driver.substr(0, driver.find(".rate"));
}

std::string Driver::unit() const {
  if (is_clock()) return past.empty() ? "s" : "";
  if (angle || name == "h_deg") return "rad";
  if (recorded) {
    const std::string column = recorded_column(name);
    const std::size_t at = column.rfind('_');
    std::string of_column = at == std::string::npos ? "" : column.substr(at + 1);
    if (column == kTemperatureColumn) of_column = "K";
    return of_column.empty() || !is_rate() ? of_column : of_column + "/h";
  }
  if (two_valued || past == kCosineOfH) return "";
  if (past.find("time") != std::string::npos) return "s";
  if (past.find("of delta") != std::string::npos || past.find("of h") != std::string::npos)
    return "rad";
  return component || name == "previous_pose" ? "g" : "";
}

DriverPointer shared(Driver driver) {
  driver.fewest_values = std::numeric_limits<std::size_t>::max();
  for (const std::vector<double>& of_axis : driver.value)
    driver.fewest_values =
        std::min(driver.fewest_values, std::set<double>(of_axis.begin(), of_axis.end()).size());
  driver.same_on_axes = driver.value[0] == driver.value[1] && driver.value[0] == driver.value[2];
  return std::make_shared<const Driver>(std::move(driver));
}

std::vector<Driver> instantaneous_drivers(const VisitLog& log) {
  const auto& visits = log.visits;
  std::vector<Driver> drivers;
  const auto add = [&](std::string name, const ValueAtVisit& value) -> Driver& {
    return drivers.emplace_back(Driver{std::move(name), "", for_all_axes(log, value)});
  };
  Driver& clock = add("t_s", [&](std::size_t k) { return visits[k].t_mean_s; });
  clock.reference = 0;
  for (const Visit& visit : visits) clock.dwell_s.push_back(visit.duration_s());
  add("delta_deg", [&](std::size_t k) { return visits[k].delta_rad; }).angle = true;
  add("h_deg", [&](std::size_t k) { return visits[k].h_rad; });
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const std::vector<double> a_g = specific_force_component_g(log, i);
    drivers.push_back({std::string("a_") + kAxisName[i], "", {a_g, a_g, a_g}});
    drivers.back().in_the_twelve = true;
    drivers.back().component = i;
    drivers.back().reference = 0;
  }
  drivers.push_back({"previous_pose", "change of a_i since", changes_g(log)});
  drivers.back().span = about_zero(drivers.back().value);
  drivers.back().reference = 0;
  // What only a direction decides is the simpler where an order of visits tells no more.
  for (const std::size_t way : {std::size_t{0}, std::size_t{1}}) {
    Driver& direction = add("previous_pose", [&, way](std::size_t k) {
      const int sign = visits[k].delta_direction[way];
      return sign == 0 ? 1.0 : sign;
    });
    direction.past = way == 0 ? "direction of the last turn of delta"
                              : "direction of the last turn of delta within 360 degrees";
    direction.two_valued = true;
  }
  Driver& tilted = add("previous_pose", [&](std::size_t k) {
    return last_direction_of_h(log, k) < 0 ? -1.0 : 1.0;  // upwards before the first one
  });
  tilted.past = "direction of the last turn of h";
  tilted.two_valued = true;
  const auto add_way = [&](std::string past, const ValueAtVisit& value) {
    Driver& way = add("previous_pose",
                      [&](std::size_t k) { return log.before(k) == nullptr ? 0.0 : value(k); });
    way.past = std::move(past);
    way.span = about_zero(way.value);
    way.reference = 0;
  };
  add_way("turn of delta since", [&](std::size_t k) { return turn_rad(log, k); });
  add_way("turn of delta within 360 degrees since",
          [&](std::size_t k) { return commanded_turn_rad(*log.before(k), visits[k]); });
  add_way("change of h since",
          [&](std::size_t k) { return visits[k].h_rad - log.before(k)->h_rad; });
  for (const Column& column : recorded_columns(log)) {
    Driver& of_column = add(column.name, [&](std::size_t k) { return column.value[k]; });
    of_column.recorded = true;
    of_column.reference = column.name == kTemperatureColumn ? 0 : mean(column.value);
    const std::vector<double> rate = rate_per_h(log, column.value);
    Driver& of_rate = add(column.name + ".rate", [&](std::size_t k) { return rate[k]; });
    of_rate.recorded = true;
    of_rate.reference = 0;
  }
  return drivers;
}

std::vector<Driver> changes_of_others(const VisitLog& log) {
  Driver own{"previous_pose", "", changes_g(log)};
  own.span = about_zero(own.value);
  own.reference = 0;
  return of_other_axes(own, "change of the ", " since");
}

std::vector<Driver> sizes_of_changes(const VisitLog& log) {
  PerAxis<std::vector<double>> size_g = changes_g(log);
  for (std::vector<double>& of_axis : size_g)
    for (double& value : of_axis) value = std::abs(value);
  std::vector<Driver> ways = lengths_of_ways(log);
  const auto plain_size_rad = for_all_axes(log, [&](std::size_t k) {
    const Visit* before = log.before(k);
    return before ? std::abs(commanded_turn_rad(*before, log.visits[k])) : 0;
  });
  const auto way_s = for_all_axes(log, [&](std::size_t k) {
    const Visit* before = log.before(k);
    return before ? time_between_s(*before, log.visits[k]) : 0;
  });
  std::vector<Driver> drivers = {
      {"previous_pose", "size of the change of a_i since", std::move(size_g)},
      {"previous_pose", "size of the turn of delta since", std::move(ways[0].value)},
      {"previous_pose", "size of the turn of delta within 360 degrees since", plain_size_rad},
      {"previous_pose", "size of the change of h since", std::move(ways[1].value)},
      {"previous_pose", "time on the way", way_s}};
  for (Driver& driver : drivers) driver.span = about_zero(driver.value);
  return drivers;
}

Driver component_before(const VisitLog& log) {
  Driver driver{"previous_pose", "component of a_i before", {}};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const std::vector<double> a_g = specific_force_component_g(log, i);
    for (std::size_t k = 0; k < a_g.size(); ++k)
      driver.value[i].push_back(log.before(k) ? a_g[k - 1] : a_g[k]);  // as if it had not moved
  }
  driver.span = about_zero(driver.value);
  driver.reference = 0;
  return driver;
}

Driver load(const VisitLog& log) {
  Driver driver{"previous_pose", "", {}};
  if (log.moved_since) driver.begins_anew = log.earlier;
  for (std::size_t i = 0; i < kAxisCount; ++i) driver.value[i] = specific_force_component_g(log, i);
  return driver;
}

std::vector<Driver> loads_of_others(const VisitLog& log) {
  return of_other_axes(load(log), "", "");
}

Driver sign_of_load(const VisitLog& log) {
  Driver driver = load(log);
  driver.past = "sign of a_i";
  driver.two_valued = true;
  for (std::vector<double>& of_axis : driver.value) {
    double before = 1;
    for (double& value : of_axis)
      before = value = effect::is_nearly_zero(value) ? before : std::copysign(1, value);
  }
  return driver;
}

Driver size_of_load(const VisitLog& log) {
  Driver driver = load(log);
  driver.past = "size of a_i";
  for (std::vector<double>& of_axis : driver.value)
    for (double& value : of_axis) value = std::abs(value);
  return driver;
}

std::vector<Driver> lengths_of_ways(const VisitLog& log) {
  const auto of_delta = [&](std::size_t k) { return std::abs(turn_rad(log, k)); };
  const auto of_h = [&](std::size_t k) {
    const Visit* before = log.before(k);
    return before ? std::abs(log.visits[k].h_rad - before->h_rad) : 0;
  };
  return {{"previous_pose", "turns of delta", for_all_axes(log, of_delta)},
          {"previous_pose", "turns of h", for_all_axes(log, of_h)}};
}

Driver turns_added_up(const VisitLog& log, bool forwards) {
  constexpr double kNearly_rad = 1e-6;
  double sum_rad = 0;
  const auto added_up = [&](std::size_t k) {
    const double turned_rad = turn_rad(log, k);
    const bool is_half = std::abs(std::abs(turned_rad) - effect::kTurn_rad / 2) < kNearly_rad;
    return sum_rad += is_half ? std::copysign(turned_rad, forwards ? 1 : -1) : turned_rad;
  };
  Driver driver{"previous_pose", "sum of the turns of delta", for_all_axes(log, added_up)};
  if (!forwards) driver.past += ", half turns backwards";
  driver.reference = 0;
  return driver;
}

Driver ends_of_pauses(const VisitLog& log) {
  constexpr double kLong = 4;  // times the median
  std::vector<double> way_s, way_rad, pace_s;
  for (std::size_t k = 1; k < log.visits.size(); ++k) {
    const Visit &from = log.visits[k - 1], &to = log.visits[k];
    way_s.push_back(time_between_s(from, to));
    way_rad.push_back(
        std::max(std::abs(commanded_turn_rad(from, to)), std::abs(to.h_rad - from.h_rad)));
    if (way_rad.back() > 0) pace_s.push_back(way_s.back() / way_rad.back());
  }
  const double typical_s = way_s.empty() ? 0 : median(way_s);
  const double typical_pace_s = pace_s.empty() ? 0 : median(pace_s);
  return {"t_s", "pauses", for_all_axes(log, [&](std::size_t k) {
            if (k == 0 || !(typical_s > 0)) return 0.0;
            const double typical = std::max(typical_s, typical_pace_s * way_rad[k - 1]);
            return way_s[k - 1] > kLong * typical ? 1.0 : 0.0;
          })};
}

Driver weight_across(const VisitLog& log) {
  return {"previous_pose", kCosineOfH,
          for_all_axes(log, [&](std::size_t k) { return std::cos(log.visits[k].h_rad); })};
}

}  // namespace plumbline
