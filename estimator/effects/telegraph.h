// What switches to and fro between two levels at times that follow no rule: random telegraph noise
// of a semiconductor, somebody who stands now here, now there.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "estimator/effects/driven_term.h"

namespace plumbline {

/// So many times; one time and two are a step and a window. Parameters: the times, ascending, at
/// the first of which the size is added, and the size. Of a dwell in which it switches it is there
/// for a part. No search could go through all times: hypotheses() has one that stands for them.
class Telegraph final : public DrivenTerm {
 public:
  static constexpr int kFewest = 3, kMost = 24;

  Telegraph(DriverPointer clock, const Target& target, int switches);

  int switches() const { return switches_; }
  /// Whether the other does the same to the same but for the number of switches.
  bool is_like(const Telegraph& other) const;
  std::vector<ParameterInfo> parameters() const override;
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override;
  /// Each time lies somewhere between two of the visits.
  double log_choices() const override;

 private:
  std::string function() const override;
  double of_visit(std::size_t axis, std::size_t visit, const double* p) const override;

  int switches_;
};

}  // namespace plumbline
