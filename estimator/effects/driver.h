// The variables that may drive a residual, at every visit of a log.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimator/effects/visit_log.h"

namespace plumbline {

/// One variable; a few (where an axis was before) differ from axis to axis.
struct Driver {
  std::string name;                    ///< as in result.json
  std::string past;                    ///< how its past enters, in words; empty: not at all
  PerAxis<std::vector<double>> value;  ///< per axis and visit
  bool angle = false;                  ///< periodic in 2π
  bool recorded = false;               ///< a column of the measurement file, or its rate
  bool two_valued = false;             ///< any function of it is a straight line
  bool in_the_twelve = false;          ///< a bias proportional to it is what K and U₀ describe
  std::optional<std::size_t> component = {};  ///< of the specific force, along this axis
  /// Where the values can lie; without it, where they do.
  std::optional<std::pair<double, double>> span = {};
  /// The output of this axis. On the axis itself the model's output stands for it: readings that
  /// explain themselves prove nothing.
  std::optional<std::size_t> output_of = {};
  /// At which U₀ and K are stated, where what a function of it adds to all visits would be theirs:
  /// the reference temperature, the mean of any other column, the start, a rate, a change or a
  /// component of zero. A matter of the driver, not of the visits: a model is read back for others.
  std::optional<double> reference = {};
  double scatter = 0;                ///< of single readings about the value that stands for a dwell
  std::vector<double> dwell_s = {};  ///< of a clock: how long each visit lasts
  /// The visit to which the head came from where nothing recorded says; 0 where that is the first.
  std::size_t begins_anew = 0;
  /// Of `value`: "rad", "s", "g", that in which a column's name ends ("V" of supply_V, K above the
  /// reference of temp_C, per hour of a rate); empty where it has none.
  std::string unit() const;
  bool varies() const;
  std::size_t fewest_values = 0;  ///< different ones on any axis at least; counted by shared()
  bool same_on_axes = false;      ///< seen by shared()
  bool way_begins(std::size_t visit) const { return visit == 0 || visit == begins_anew; }
  bool is_clock() const { return name == "t_s"; }
  bool is_rate() const { return name.ends_with(".rate"); }  ///< of a recorded column
  /// What has to be recorded for it; none of what the positions and the clock tell.
  std::vector<std::string> columns() const;
};
using DriverPointer = std::shared_ptr<const Driver>;

/// For the functions of it.
DriverPointer shared(Driver driver);

/// What a driver is of, if that was recorded: the name without what makes it a rate.
std::string recorded_column(const std::string& driver);

/// Time, angles, the specific force, what came before, and every recorded column with its rate of
/// change.
std::vector<Driver> instantaneous_drivers(const VisitLog& log);

/// What δ went since the first pose, turn upon turn, always the shorter way round; half turns
/// forwards or backwards, which is for the controller to say.
Driver turns_added_up(const VisitLog& log, bool forwards);

/// 1 at visits before which several times as long passed as such ways take, else 0.
Driver ends_of_pauses(const VisitLog& log);

/// By how much the components of the next axis and of the one after that changed on the way from
/// the previous pose, under the name of what came before.
std::vector<Driver> changes_of_others(const VisitLog& log);

/// How far the component of the own axis, δ and h went on the way from the previous pose, whichever
/// way, and how long that took, under the name of what came before.
std::vector<Driver> sizes_of_changes(const VisitLog& log);

/// The component of the own axis at the previous pose, under the name of what came before.
Driver component_before(const VisitLog& log);

/// The specific force of the own axis, under the name of what came before: for what follows it.
Driver load(const VisitLog& log);

/// The same of the next axis and of the one after that.
std::vector<Driver> loads_of_others(const VisitLog& log);

/// Its sign (where it is nothing, what it was before), and its size.
Driver sign_of_load(const VisitLog& log);
Driver size_of_load(const VisitLog& log);

/// How far δ and h turned on the way to each visit.
std::vector<Driver> lengths_of_ways(const VisitLog& log);

/// The cosine of h.
Driver weight_across(const VisitLog& log);

}  // namespace plumbline
