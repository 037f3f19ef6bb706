// What a verification found, check by check.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace plumbline::app {

enum class CheckState { good, bad, not_done };

struct Check {
  CheckState state = CheckState::good;
  std::string text;  ///< what was checked; for a bad one also what is wrong
};

struct VerifyReport {
  std::vector<Check> checks;

  void good(std::string text) { checks.push_back({CheckState::good, std::move(text)}); }
  void bad(std::string text) { checks.push_back({CheckState::bad, std::move(text)}); }
  void not_done(std::string text) { checks.push_back({CheckState::not_done, std::move(text)}); }
  /// `text` when `holds`, else `text: wrong`.
  void expect(bool holds, const std::string& text, const std::string& wrong) {
    if (holds) {
      good(text);
    } else {
      bad(text + ": " + wrong);
    }
  }
  bool any_bad() const {
    for (const Check& check : checks) {
      if (check.state == CheckState::bad) return true;
    }
    return false;
  }
};

}  // namespace plumbline::app
