#include "estimator/noise/longest_stretch.h"

#include <utility>

#include "estimator/median.h"

namespace plumbline {

Stretch longest_stretch(const std::vector<double>& t_s) {
  constexpr double kGap = 1.5;  // steps
  Stretch longest{0, t_s.size(), 0, 0};
  if (t_s.size() < 2) return longest;
  std::vector<double> steps_s;
  steps_s.reserve(t_s.size() - 1);
  for (std::size_t i = 1; i < t_s.size(); ++i) steps_s.push_back(t_s[i] - t_s[i - 1]);
  const double longest_step_s = kGap * median(std::move(steps_s));

  longest.count = 0;
  std::size_t first = 0;
  for (std::size_t i = 1; i <= t_s.size(); ++i) {
    const bool gap = i < t_s.size() && t_s[i] - t_s[i - 1] > longest_step_s;
    if (!gap && i < t_s.size()) continue;
    if (i - first > longest.count) {
      longest.first = first;
      longest.count = i - first;
    }
    longest.gaps += gap ? 1 : 0;
    first = i;
  }
  if (longest.count > 1)
    longest.step_s = (t_s[longest.first + longest.count - 1] - t_s[longest.first]) /
                     static_cast<double>(longest.count - 1);
  return longest;
}

}  // namespace plumbline
