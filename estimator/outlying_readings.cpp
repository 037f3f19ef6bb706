#include "estimator/outlying_readings.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>

#include "estimator/effects/code_evidence.h"
#include "estimator/median.h"

namespace plumbline {
namespace {

constexpr std::size_t kFewestReadings = 8;
constexpr double kFar = 8;           // standard deviations
constexpr double kFewestSteps = 4;   // of the converter
constexpr double kMostShare = 0.02;  // of all readings

/// Neighbouring readings that are alike but for their noise.
struct Group {
  std::size_t first = 0;  ///< row
  std::span<const double> reading;
  double median = 0;
  double sd = 0;  ///< from the median deviation, on which what stands out has no influence
};

Group group_of(const std::vector<double>& readings, std::size_t first, std::size_t count) {
  constexpr double kOfMedianDeviation = 1.4826;  // of Gaussian noise
  Group group{first, std::span(readings).subspan(first, count)};
  group.median = median({group.reading.begin(), group.reading.end()});
  std::vector<double> deviation;
  for (const double reading : group.reading) deviation.push_back(std::abs(reading - group.median));
  group.sd = kOfMedianDeviation * median(std::move(deviation));
  return group;
}

struct Suspect {
  OutlyingReading reading;
  std::size_t after_first = 0, before_last = 0;  ///< readings of its group
  double from = 0;                               ///< the median of its group
  bool is_above = false;
};

/// What stands out of a group by more than `far`, its neighbours by less than half as much.
void add_suspects(const Group& group, double far, std::vector<Suspect>& suspects) {
  const std::size_t last = group.reading.size() - 1;
  const auto off = [&](std::size_t k) { return std::abs(group.reading[k] - group.median); };
  for (std::size_t k = 0; k <= last; ++k) {
    if (off(k) <= far) continue;
    if ((k > 0 && off(k - 1) > 0.5 * off(k)) || (k < last && off(k + 1) > 0.5 * off(k))) continue;
    suspects.push_back({{group.first + k, group.first + (k > 0 ? k - 1 : k + 1)},
                        k,
                        last - k,
                        group.median,
                        group.reading[k] > group.median});
  }
}

/// What happens so long after arrival, or before the head leaves, again and again, happens there
/// for a reason.
void leave_what_belongs_to_dwells(std::vector<Suspect>& suspects) {
  for (const auto place : {&Suspect::after_first, &Suspect::before_last}) {
    std::map<std::size_t, std::size_t> count;
    for (const Suspect& suspect : suspects) ++count[suspect.*place];
    const std::size_t all = suspects.size();
    std::erase_if(suspects, [&](const Suspect& suspect) {
      const std::size_t here = count[suspect.*place];
      const std::size_t by_chance = suspect.*place == 0 ? 1 : 2;
      return here > by_chance + (all - here) / 4;
    });
  }
}

/// Whether most of those to one side begin within so little of one voltage: noise carries readings
/// over an edge there.
bool begin_at_one_voltage(const std::vector<Suspect>& suspects, double within) {
  constexpr std::size_t kFewest = 3;
  for (const bool above : {true, false}) {
    std::vector<double> from;
    for (const Suspect& suspect : suspects)
      if (suspect.is_above == above) from.push_back(suspect.from);
    if (from.size() < kFewest) continue;
    std::sort(from.begin(), from.end());
    const std::size_t most = from.size() / 2;
    for (std::size_t k = 0; k + most < from.size(); ++k)
      if (from[k + most] - from[k] < within) return true;
  }
  return false;
}

std::vector<OutlyingReading> readings_of(const std::vector<Suspect>& suspects) {
  std::vector<OutlyingReading> readings;
  readings.reserve(suspects.size());
  for (const Suspect& suspect : suspects) readings.push_back(suspect.reading);
  return readings;
}

}  // namespace

std::vector<OutlyingReading> outlying_readings(const MeasurementSet& set, std::size_t axis,
                                               const std::optional<Adc>& adc) {
  constexpr double kNearEdge = 6;  // standard deviations
  const std::vector<double>& readings = set.samples.u_V[axis];
  std::vector<Group> dwells;
  std::vector<double> sds;
  for (const Pose& pose : set.poses) {
    if (pose.count < kFewestReadings) continue;
    dwells.push_back(group_of(readings, pose.first, pose.count));
    sds.push_back(dwells.back().sd);
  }
  if (dwells.empty()) return {};
  const double step_V = adc ? adc->lsb_V() : smallest_step(readings);
  const double sd_V = std::max(median(sds), kFewestSteps / kFar * step_V);
  std::vector<Suspect> suspects;
  for (const Group& dwell : dwells) add_suspects(dwell, kFar * std::max(dwell.sd, sd_V), suspects);
  leave_what_belongs_to_dwells(suspects);
  if (suspects.empty() ||
      static_cast<double>(suspects.size()) > kMostShare * static_cast<double>(readings.size()) ||
      begin_at_one_voltage(suspects, kNearEdge * sd_V) ||
      (adc && code_faults(set, axis, *adc).any()))
    return {};
  return readings_of(suspects);
}

std::vector<OutlyingReading> outlying_readings(const std::vector<double>& record) {
  constexpr std::size_t kGroup = 50;
  std::vector<Group> groups;
  std::vector<double> sds;
  for (std::size_t first = 0; first + kGroup <= record.size(); first += kGroup) {
    groups.push_back(group_of(record, first, kGroup));
    sds.push_back(groups.back().sd);
  }
  if (groups.empty()) return {};
  double sd = median(std::move(sds));
  // Otherwise it is more than that: deviations of rounded readings are whole steps.
  if (sd == 0) sd = kFewestSteps / kFar * smallest_step(record);
  std::vector<Suspect> suspects;
  for (const Group& group : groups) add_suspects(group, kFar * std::max(group.sd, sd), suspects);
  if (static_cast<double>(suspects.size()) > kMostShare * static_cast<double>(record.size()))
    return {};
  return readings_of(suspects);
}

void replace(std::vector<double>& readings, const std::vector<OutlyingReading>& outlying) {
  for (const OutlyingReading& one : outlying) readings[one.row] = readings[one.like];
}

PerAxis<std::size_t> replace_outlying(MeasurementSet& set, const std::optional<Adc>& adc) {
  PerAxis<std::size_t> count{};
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const std::vector<OutlyingReading> outlying = outlying_readings(set, axis, adc);
    replace(set.samples.u_V[axis], outlying);
    count[axis] = outlying.size();
  }
  return count;
}

}  // namespace plumbline
