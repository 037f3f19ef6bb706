#include "estimator/diagnosis/separation.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>
#include <span>
#include <utility>

#include "estimator/diagnosis/separating_design.h"

namespace plumbline {
namespace {

using Stop = SeparatingPlan::Stop;

std::string format(const char* pattern, double a, double b = 0, double c = 0) {
  char text[160];
  std::snprintf(text, sizeof text, pattern, a, b, c);
  return text;
}

/// For the words: " (h from 0° to 80°)".
std::string heights(const std::vector<Stop>& stops) {
  const auto [low, high] = std::minmax_element(
      stops.begin(), stops.end(), [](const Stop& a, const Stop& b) { return a.h_deg < b.h_deg; });
  return low->h_deg == high->h_deg ? format(" (h = %.0f°)", low->h_deg)
                                   : format(" (h from %.0f° to %.0f°)", low->h_deg, high->h_deg);
}

std::string joined(const std::vector<std::string>& parts, const char* between) {
  std::string text;
  for (const std::string& part : parts) text += (text.empty() ? "" : between) + part;
  return text;
}

/// Recorded columns that any of them follows.
std::set<std::string> columns_of(const ActiveEffect& found, std::span<const ActiveEffect> others) {
  std::set<std::string> columns;
  const auto add = [&](const ActiveEffect& active) {
    for (std::string& column : active.effect->columns()) columns.insert(std::move(column));
  };
  add(found);
  for (const ActiveEffect& other : others) add(other);
  return columns;
}

/// The remedy where no pose of this head and mounting decides: what turns along with what, or what
/// else was recorded.
std::string by_other_means(const ActiveEffect& found, std::span<const ActiveEffect> others) {
  bool other_field = false, other_head = false, other_sensor = false;
  for (const ActiveEffect& other : others) {
    other_field |= other.effect->of_the_room();
    other_head |= other.effect->subject() == Subject::head;
    other_sensor |= other.effect->subject() == Subject::sensor && !other.effect->of_the_room();
  }
  const bool field = found.effect->of_the_room(), head = found.effect->subject() == Subject::head;
  if ((head && other_field) || (field && other_head))
    return "turn the base by 180° in azimuth and measure again: a field of the room stays, the "
           "head turns along";
  if ((head && other_sensor) || (!head && other_head))
    return "mount the triad turned by 90° about its z axis, then tipped over, and measure again: "
           "what belongs to the sensor turns along, what belongs to the head does not";
  if (field || other_field)
    return "turn the base by 180° in azimuth and measure again: a field of the room stays";
  if (const std::set<std::string> columns = columns_of(found, others); !columns.empty())
    return "measure again while " +
           joined(std::vector<std::string>(columns.begin(), columns.end()), ", ") +
           (columns.size() == 1 ? " takes another course" : " take other courses");
  return "mount the triad so that this axis covers the whole range from -1 g to +1 g, and measure "
         "again";
}

/// Whether a field of the room stands against a displaced head: what is left between them hangs on
/// how the field enters by the cross sensitivities, of which the model knows nothing.
bool is_same_to_gravity(const ActiveEffect& found, std::span<const ActiveEffect> others) {
  return found.effect->subject() == Subject::head &&
         std::all_of(others.begin(), others.end(),
                     [](const ActiveEffect& other) { return other.effect->of_the_room(); });
}

}  // namespace

HeadReach reach_of(const VisitLog& log) {
  HeadReach reach{1e9, -1e9, 1e9, -1e9, false};
  for (const Visit& visit : log.visits) {
    reach.delta_min_deg = std::min(reach.delta_min_deg, visit.delta_rad / kRadPerDeg);
    reach.delta_max_deg = std::max(reach.delta_max_deg, visit.delta_rad / kRadPerDeg);
    reach.h_min_deg = std::min(reach.h_min_deg, visit.h_rad / kRadPerDeg);
    reach.h_max_deg = std::max(reach.h_max_deg, visit.h_rad / kRadPerDeg);
  }
  return reach;
}

Separation separate(const SearchInput& input, const SearchResult& result, std::size_t index,
                    const std::vector<Alternative>& all, const HeadReach& reach) {
  Separation separation;
  const ActiveEffect& found = result.fit.parameters.effects[index];
  // A rival's own effects stand behind those that the model keeps.
  const auto others_of = [&](const Alternative& rival) {
    return std::span(rival.fit.parameters.effects)
        .subspan(result.fit.parameters.effects.size() - 1);
  };
  const auto undecided = [&](const Alternative& rival, const std::string& how_far) {
    return "no poses of this head tell it from " + rival.name + how_far + ": " +
           by_other_means(found, others_of(rival));
  };
  std::vector<Alternative> rivals;
  std::vector<std::string> clauses;
  for (const Alternative& rival : all) {
    if (is_same_to_gravity(found, others_of(rival)))
      clauses.push_back(undecided(rival, ""));
    else
      rivals.push_back(rival);
  }
  separation.words = joined(clauses, "; ");
  if (rivals.empty()) return separation;
  Proposal proposal = best_proposal(input, result, rivals, reach);
  std::string condition;
  if (proposal.decided() < rivals.size() && reach.h_min_deg > -60 && !reach.is_limit) {
    HeadReach below = reach;
    below.h_min_deg = -80;
    Proposal wider = best_proposal(input, result, rivals, below);
    // Poses that the head was not asked to reach are proposed only where the others are no use.
    if (proposal.decided() == 0 && wider.decided() > 0) {
      proposal = std::move(wider);
      condition = ", where the head can go there";
    }
  }
  std::vector<std::string> decided;
  double least = 1e300;
  for (std::size_t r = 0; r < rivals.size(); ++r) {
    if (proposal.distance[r] < kDecided) continue;
    decided.push_back(rivals[r].name);
    least = std::min(least, proposal.distance[r]);
  }
  if (!decided.empty()) {
    const bool one = proposal.stops.size() == 1;
    clauses.insert(clauses.begin(), format(one ? "%.0f further pose " : "%.0f further poses ",
                                           static_cast<double>(proposal.stops.size())) +
                                        proposal.how + heights(proposal.stops) + condition +
                                        (one ? " tells it from " : " tell it from ") +
                                        joined(decided, ", ") +
                                        format(" by %.1f standard deviations", std::sqrt(least)));
    separation.plan = {proposal.stops, proposal.samples_factor, std::sqrt(least)};
  }
  for (std::size_t r = 0; r < rivals.size(); ++r) {
    if (proposal.distance[r] >= kDecided) continue;
    clauses.push_back(undecided(
        rivals[r], format(" (%.1f standard deviations at most)", std::sqrt(proposal.most[r]))));
  }
  separation.words = joined(clauses, "; ");
  return separation;
}

}  // namespace plumbline
