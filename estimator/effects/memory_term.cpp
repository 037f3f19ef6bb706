#include "estimator/effects/memory_term.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <mutex>
#include <numeric>
#include <string>
#include <utility>

#include "estimator/effects/base_tilt.h"
#include "estimator/effects/function_of_driver.h"
#include "estimator/effects/turn_about_axes.h"

namespace plumbline {
namespace {

// What is forgotten sooner is settling after a move; what lasts longer than a run is a drift.
constexpr double kLeast_s = 4, kMost_s = 4800;
constexpr int kTimeConstants = 8;  // that a search starts from
constexpr int kParts = 8;          // into which the table divides the way between two of them

std::vector<double> time_constants_s() {
  return effect::geometric(kLeast_s, kMost_s, (kTimeConstants - 1) * kParts + 1);
}

/// How a value goes from one visit to the next: evenly, whatever the head does in between, or it
/// stays until the next, and at a rest has long been what it is there.
enum class InBetween { evenly, with_the_head };

/// The average of the past at every visit, which began at the first one as it was there.
std::vector<double> average_of_the_past(const VisitLog& log, const std::vector<double>& value,
                                        InBetween between, double tau_s) {
  std::vector<double> average(value.size());
  double state = value.empty() ? 0 : value.front();  // at the end of a visit
  double end_s = 0;
  for (std::size_t k = 0; k < value.size(); ++k) {
    const Visit& visit = log.visits[k];
    const double dwell_s = visit.duration_s();
    if (k > 0) {
      const double gap_s = visit.t_arrival_s - end_s;
      const double from = value[k - 1], to = between == InBetween::evenly ? value[k] : from;
      // Behind what changes evenly an average lags by what that changes in a time constant.
      const double lag = gap_s > 0 ? tau_s / gap_s * (to - from) : 0;
      state = to - lag + std::exp(-gap_s / tau_s) * (state - from + lag);
      if (between == InBetween::with_the_head && log.is_rest(k)) state = value[k];
    }
    average[k] =
        value[k] + (state - value[k]) * effect::mean_decay(visit, visit.t_arrival_s, tau_s);
    state = value[k] + (state - value[k]) * std::exp(-dwell_s / tau_s);
    end_s = visit.t_arrival_s + dwell_s;
  }
  return average;
}

/// What every visit adds to, and what fades from then on.
std::vector<double> fading_sum(const VisitLog& log, const std::vector<double>& added,
                               double tau_s) {
  std::vector<double> sums(added.size());
  double sum = 0, since_s = 0;
  for (std::size_t k = 0; k < added.size(); ++k) {
    const Visit& visit = log.visits[k];
    sum = sum * std::exp((since_s - visit.t_arrival_s) / tau_s) + added[k];
    since_s = visit.t_arrival_s;
    sums[k] = sum * effect::mean_decay(visit, since_s, tau_s);
  }
  return sums;
}

/// What the value was some time before, evenly between the visits; before the first it was what it
/// was there.
std::vector<double> value_before(const VisitLog& log, const std::vector<double>& value,
                                 double dead_s) {
  std::vector<double> before(value.size());
  std::size_t after = 0;  // the first visit that is not before
  for (std::size_t k = 0; k < value.size(); ++k) {
    const double t_s = log.visits[k].t_mean_s - dead_s;
    while (log.visits[after].t_mean_s < t_s) ++after;
    const double after_s = log.visits[after].t_mean_s;
    before[k] = value[after];
    if (after == 0) continue;
    const double from_s = log.visits[after - 1].t_mean_s;
    before[k] = std::lerp(value[after - 1], value[after], (t_s - from_s) / (after_s - from_s));
  }
  return before;
}

enum class MemoryOf { average, rest, square, sign, sum, dead_time };

/// One variable and its averages, what it is above them, the averages of its square or sign, its
/// fading sum, or what it was before.
class Memory {
 public:
  Memory(const DriverPointer& driver, MemoryOf of, const VisitLog& log)
      : driver_(of == MemoryOf::square ? squared(*driver)
                : of == MemoryOf::sign ? sign_of(*driver)
                                       : driver),
        name_(driver_->name + (of == MemoryOf::rest && driver_->recorded ? ".rate" : "")),
        of_(of),
        log_(log) {
    const auto [low, high] = std::minmax_element(driver->value[0].begin(), driver->value[0].end());
    // Of what has one sign the square runs like the variable itself.
    shows_square_ = std::min(-*low, *high) > 0.25 * std::max(-*low, *high);
  }

  const std::string& name() const { return name_; }
  bool is_of_column() const { return driver_->recorded; }
  bool same_on_axes() const { return sources() == 1 || driver_->same_on_axes; }
  std::string unit() const {
    if (of_ == MemoryOf::sign) return "";
    return driver_->unit() + (of_ == MemoryOf::square ? "^2" : "");
  }
  std::string words() const {
    const std::string& past = driver_->past;
    if (of_ == MemoryOf::dead_time) return "the value a dead time before";
    return std::string(vanishes_at_rest() ? "the change from " : "") +
           (of_ == MemoryOf::sum ? "the fading sum" : "the average of the past") +
           (of_ == MemoryOf::square ? " of its square"
            : of_ == MemoryOf::sign ? " of its sign"
                                    : "") +
           (past.empty() ? "" : " of the " + past);
  }
  /// How much of what was before t0_s, which nobody saw, a visit still shows.
  double share_of_beginning(const Visit& visit, double t0_s, double tau_s) const {
    if (of_ == MemoryOf::dead_time) return visit.t_mean_s - tau_s < t0_s ? 1 : 0;
    return effect::mean_decay(visit, t0_s, tau_s);
  }
  bool is_shown() const { return of_ != MemoryOf::square || shows_square_; }
  std::vector<std::string> columns() const { return driver_->columns(); }
  /// At which U₀ and K are stated.
  double reference() const { return of_ == MemoryOf::rest ? 0 : driver_->reference.value_or(0); }
  /// Of an attitude, nothing when the head has long been at rest: the 12 parameters are those of
  /// rest then.
  bool vanishes_at_rest() const { return of_ == MemoryOf::rest && !driver_->recorded; }
  /// For the time constants that time_constants_s() lists, and by interpolation in between.
  double at(double tau_s, std::size_t axis, std::size_t visit) const {
    std::call_once(once_, [this] { make_table(); });
    const double steps = std::log(tau_s / kLeast_s) / std::log(kMost_s / kLeast_s) *
                         static_cast<double>(table_.size() - 1);
    const double position = std::clamp(steps, 0.0, static_cast<double>(table_.size() - 1));
    const auto below = std::min(static_cast<std::size_t>(position), table_.size() - 2);
    const std::size_t source = axis % sources();
    const double average = std::lerp(table_[below][source][visit], table_[below + 1][source][visit],
                                     position - static_cast<double>(below));
    return of_ == MemoryOf::rest ? driver_->value[source][visit] - average : average;
  }
  /// Over all axes and visits.
  std::pair<double, double> range(double tau_s) const {
    std::pair<double, double> range{at(tau_s, 0, 0), at(tau_s, 0, 0)};
    for (std::size_t axis = 0; axis < sources(); ++axis)
      for (std::size_t k = 0; k < log_.visits.size(); ++k) {
        const double value = at(tau_s, axis, k);
        range = {std::min(range.first, value), std::max(range.second, value)};
      }
    if (!vanishes_at_rest()) return range;
    const double most = std::max(-range.first, range.second);
    return {-most, most};
  }

 private:
  /// A column is the same for all axes, an attitude is each axis's own.
  std::size_t sources() const { return driver_->recorded ? 1 : kAxisCount; }
  void make_table() const {
    const InBetween between = driver_->recorded ? InBetween::evenly : InBetween::with_the_head;
    for (const double tau_s : time_constants_s()) {
      auto& averages = table_.emplace_back();
      for (std::size_t source = 0; source < sources(); ++source)
        averages.push_back(at_time_constant(driver_->value[source], between, tau_s));
    }
  }
  std::vector<double> at_time_constant(const std::vector<double>& value, InBetween between,
                                       double tau_s) const {
    if (of_ == MemoryOf::sum) return fading_sum(log_, value, tau_s);
    if (of_ == MemoryOf::dead_time) return value_before(log_, value, tau_s);
    return average_of_the_past(log_, value, between, tau_s);
  }

  static DriverPointer squared(Driver driver) {
    for (auto& of_axis : driver.value)
      for (double& value : of_axis) value *= value;
    const std::vector<double>& value = driver.value[0];
    driver.reference =
        std::accumulate(value.begin(), value.end(), 0.0) / static_cast<double>(value.size());
    return shared(std::move(driver));
  }
  static DriverPointer sign_of(Driver driver) {
    for (auto& of_axis : driver.value)
      for (double& value : of_axis)
        value = effect::is_nearly_zero(value) ? 0 : std::copysign(1, value);
    return shared(std::move(driver));
  }

  DriverPointer driver_;
  std::string name_;
  MemoryOf of_;
  bool shows_square_ = false;
  const VisitLog& log_;
  // Made when it is first asked for: a log of many visits may need none.
  mutable std::once_flag once_;
  mutable std::vector<std::vector<std::vector<double>>> table_;  // by time constant
};

class MemoryTerm final : public SmoothTerm {
 public:
  MemoryTerm(std::shared_ptr<const Memory> memory, Target target, double longest_s)
      : memory_(std::move(memory)), target_(target), longest_s_(longest_s) {}

  std::string id() const override {
    return "unlisted:" + memory_->name() + ":" + to_string(target_.form);
  }
  const std::string& driver() const override { return memory_->name(); }
  TermForm form() const override { return target_.form; }
  std::string shape() const override {
    return "straight line in " + memory_->words() + target_.words();
  }
  Subject subject() const override {
    return target_.form == TermForm::geometry ? Subject::head : Subject::sensor;
  }
  bool remembers() const override { return true; }
  std::vector<std::string> columns() const override { return memory_->columns(); }
  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos = {
        {"low", memory_->unit(), ParameterRole::index},
        {"high", memory_->unit(), ParameterRole::index},
        {"t0", "s", ParameterRole::index},
        {"tau", "s", ParameterRole::shape},
        {"start", target_.unit(), ParameterRole::amplitude},
        {.name = "p1", .unit = target_.unit(), .role = ParameterRole::amplitude, .needed = true},
        {"ref", memory_->unit(), ParameterRole::index}};
    if (!target_.mean_in_the_twelve())
      infos.push_back({"p0", target_.unit(), ParameterRole::amplitude});
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    const double span_s = log.last_s() - log.first_s();
    const double step_s = span_s / std::max<double>(1, static_cast<double>(log.visits.size()) - 1);
    const double size = target_.typical_size();
    std::vector<Hypothesis> starts;
    if (!memory_->is_shown()) return starts;
    for (const double tau_s : effect::geometric(kLeast_s, kMost_s, kTimeConstants)) {
      if (tau_s < step_s || tau_s > span_s / 2) continue;
      const auto [low, high] = memory_->range(tau_s);
      if (!(high > low)) continue;  // what never varied drives nothing
      for (const double start : {0.0, size}) {
        std::vector<double> p = {low,   high, log.first_s(),       tau_s,
                                 start, size, memory_->reference()};
        if (!target_.mean_in_the_twelve()) p.push_back(size);
        starts.push_back({std::move(p)});
      }
    }
    return starts;
  }
  double term_g(const TermInput& input, const double* p) const override {
    return term_of_number_g(input, of_visit(input.log, input.axis, input.visit, p));
  }
  ForceFactor factor() const override { return target_.factor(); }
  bool same_numbers_on_axes() const override { return memory_->same_on_axes(); }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    displace_by_number(log, visit, of_visit(log, 0, visit, p), p, head);
  }
  void displace_by_number(const VisitLog&, std::size_t, double f, const double*,
                          HeadGeometry& head) const override {
    head.*target_.angle += f * kRadPerDeg;
  }
  std::vector<double> numbers_of_visits(const VisitLog& log, std::size_t axis,
                                        const double* p) const override {
    std::vector<double> f;
    for (std::size_t visit = 0; visit < log.visits.size(); ++visit)
      f.push_back(of_visit(log, axis, visit, p));
    return f;
  }

 private:
  double of_visit(const VisitLog& log, std::size_t axis, std::size_t visit, const double* p) const {
    const double t0_s = p[2], tau_s = p[3];
    if (!(tau_s > 0) || tau_s > longest_s_) return 0;
    double sum = target_.mean_in_the_twelve() ? 0 : p[7];
    if (p[4] != 0) sum += p[4] * memory_->share_of_beginning(log.visits[visit], t0_s, tau_s);
    if (p[5] != 0) sum += 2 * p[5] / (p[1] - p[0]) * (memory_->at(tau_s, axis, visit) - p[6]);
    return sum;
  }

  std::shared_ptr<const Memory> memory_;
  Target target_;
  double longest_s_;
};

}  // namespace

std::vector<std::unique_ptr<SmoothTerm>> memory_terms(const VisitLog& log, double longest_s,
                                                      const DriverPointer& attitude,
                                                      const std::vector<DriverPointer>& columns) {
  std::vector<std::shared_ptr<const Memory>> memories = {
      std::make_shared<const Memory>(attitude, MemoryOf::rest, log)};
  for (const DriverPointer& column : columns)
    for (const MemoryOf of : {MemoryOf::average, MemoryOf::rest})
      memories.push_back(std::make_shared<const Memory>(column, of, log));
  std::vector<std::unique_ptr<SmoothTerm>> terms;
  for (const auto& memory : memories)
    for (const TermForm form : {TermForm::bias, TermForm::scale})
      terms.push_back(std::make_unique<MemoryTerm>(memory, Target{form}, longest_s));
  for (const auto& memory : memories) {
    if (!memory->is_of_column()) continue;
    const auto of = [&](const Target& target) {
      return std::make_unique<MemoryTerm>(memory, target, longest_s);
    };
    for (const Target& target : {kDelta, kH, kRoll}) terms.push_back(of(target));
    terms.push_back(towards_a_direction(of(kTilt)));
    terms.push_back(about_some_axis(of(kSeat)));
  }
  const auto add = [&](const DriverPointer& driver, MemoryOf of,
                       std::initializer_list<Target> targets) {
    const auto memory = std::make_shared<const Memory>(driver, of, log);
    for (const Target& target : targets)
      terms.push_back(std::make_unique<MemoryTerm>(memory, target, longest_s));
  };
  for (const DriverPointer& column : columns) {
    add(column, MemoryOf::square, {kBias});
    add(column, MemoryOf::dead_time, {kBias, kScale, kH});  // what flows arrives later
  }
  // What it draws heats; where it rests, charges gather; what it warms on one side bends.
  for (const MemoryOf of : {MemoryOf::square, MemoryOf::sign}) add(attitude, of, {kBias});
  for (Driver& other : loads_of_others(log)) add(shared(std::move(other)), MemoryOf::rest, {kBias});
  for (Driver& ways : lengths_of_ways(log))
    add(shared(std::move(ways)), MemoryOf::sum, {kBias, kDelta, kH});
  add(shared(ends_of_pauses(log)), MemoryOf::sum, {kBias, kScale});
  add(shared(weight_across(log)), MemoryOf::average, {kH});
  return terms;
}

}  // namespace plumbline
