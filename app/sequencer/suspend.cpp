#include "app/sequencer/suspend.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace plumbline::app {

SuspendMonitor::SuspendMonitor(std::vector<SuspendCondition> conditions) {
  for (SuspendCondition& condition : conditions)
    watched_.push_back({std::move(condition), false, {}, 0});
}

void SuspendMonitor::add(const std::string& column, double t_s, double value) {
  for (Watched& watched : watched_) {
    const SuspendCondition& condition = watched.condition;
    if (condition.column != column) continue;
    const double margin = watched.suspended ? condition.hysteresis : 0;
    // A reading that is none (NaN) lies in no band.
    const bool inside = value >= condition.min + margin && value <= condition.max - margin;
    if (inside != watched.suspended) {  // speaks for the state as it is
      watched.changing_since_s.reset();
      continue;
    }
    if (!watched.changing_since_s) watched.changing_since_s = t_s;
    const double needed_s = watched.suspended ? condition.hold_s : condition.delay_s;
    if (t_s - *watched.changing_since_s < needed_s) continue;
    watched.suspended = !watched.suspended;
    watched.changing_since_s.reset();
    watched.worst = value;
  }
}

std::optional<std::string> SuspendMonitor::reason() const {
  for (const Watched& watched : watched_) {
    if (!watched.suspended) continue;
    const SuspendCondition& condition = watched.condition;
    return fmt::format("{} = {:.4g} is outside {:.4g} to {:.4g}", condition.column, watched.worst,
                       condition.min, condition.max);
  }
  return std::nullopt;
}

bool SuspendMonitor::watches(const std::string& column) const {
  return std::any_of(watched_.begin(), watched_.end(),
                     [&](const Watched& w) { return w.condition.column == column; });
}

}  // namespace plumbline::app
