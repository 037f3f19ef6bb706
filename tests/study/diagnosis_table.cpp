// Tables of the diagnosis study.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>

#include "estimator/noise/chi_squared.h"
#include "tests/study/diagnosis.h"

namespace plumbline::study {
namespace {

/// P(X ≥ k) of n trials that each succeed with probability p.
double at_least(int k, int n, double p) {
  double sum = 0;
  for (int j = k; j <= n; ++j) {
    sum += std::exp(log_gamma(n + 1.0) - log_gamma(j + 1.0) - log_gamma(n - j + 1.0) +
                    j * std::log(p) + (n - j) * std::log1p(-p));
  }
  return sum;
}

/// The p at which k or more of n have this probability.
double p_where(int k, int n, double probability) {
  double low = 0, high = 1;
  for (int step = 0; step < 50; ++step) {
    const double middle = 0.5 * (low + high);
    (at_least(k, n, middle) < probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const auto at = static_cast<std::size_t>(q * static_cast<double>(values.size() - 1) + 0.5);
  return values[at];
}

/// "19/20 [ 75  99]": count and 95 % limits in per cent.
std::string cell(const Share& s) {
  if (s.n == 0) return fmt::format("{:>18}", "-");
  return fmt::format("{:>4}/{:<4}[{:>3.0f} {:>3.0f}]", s.k, s.n, 100 * s.lower(), 100 * s.upper());
}
std::string long_cell(const Share& s) {
  if (s.n == 0) return fmt::format("{:>32}", "-");
  return fmt::format("{:>6.1f} % [{:>5.1f} {:>5.1f}] {:>4}/{:<4}", 100 * s.value(), 100 * s.lower(),
                     100 * s.upper(), s.k, s.n);
}
/// Median and worst of ratios.
std::string cell(const std::vector<double>& ratios) {
  return fmt::format("{:>6.3f} {:>6.3f}", quantile(ratios, 0.5), quantile(ratios, 1));
}

void count(Share& share, bool yes) {
  share.k += yes ? 1 : 0;
  ++share.n;
}

/// What one way of searching shows over a group of sets.
struct Score {
  Share any, named, stated, wrong, additional, unlisted_instead, driver, not_listed;
  std::vector<double> fresh;
  int near_name = 0;

  void add(const Claims& c, double fresh_to_oracle) {
    count(any, c.any());
    count(additional, c.additional() > 0);
    fresh.push_back(fresh_to_oracle);
  }
  void add_detectable(const Claims& c, bool outside) {
    count(named, c.named == c.effects);
    count(stated, c.named_or_stated + c.driver_right == c.effects);
    count(wrong, c.wrong > 0);
    count(unlisted_instead, c.missed() > 0 && c.unlisted > 0);
    if (!outside) return;
    count(driver, c.driver_right > 0);
    count(not_listed, c.listed_instead == 0);
    near_name += c.near_name;
  }
};

constexpr double kWorse = 1.02;  // of the error before
/// From one who is told the effect, where it is on the list and where it is not.
constexpr double kFar = 1.15, kFarOutside = 1.5;
/// What the readings of a run must favour the truth by to tell it from what was found: odds of 150
/// to 1 (Kass & Raftery, 1995: "very strong").
constexpr double kTold = 10;

/// All that a group of sets shows.
struct Tally {
  Score ours, naive;
  Share coverage, K, U0, unexplained, worse;
  /// Of one who is told the effect: error above 1.02 of that before; and how often ours is far from
  /// that, then too weak an effect, one that other names explain as well, or one that the readings
  /// of the run do not favour over what was found.
  Share told_worse, far_from_told, far_and_weak, far_and_stated, far_and_open;
  std::vector<double> heldout, evaluated, told, after_told, seconds;
  std::map<std::string, int> claims;  ///< how often what was reported, for effects outside the list
  int sets = 0, infeasible = 0, undetectable = 0;

  void add(const SetOutcome& o, double detectable_sigma) {
    ++sets;
    if (!o.feasible) {
      ++infeasible;
      return;
    }
    ours.add(o, o.after.fresh / o.oracle.fresh);
    naive.add(o.naive, o.naive_fresh / o.oracle.fresh);
    count(unexplained, o.verdict == Verdict::unexplained || o.verdict == Verdict::partly_explained);
    count(worse,
          o.after.fresh > kWorse * o.before.fresh || o.after.heldout > kWorse * o.before.heldout);
    seconds.push_back(o.seconds);
    heldout.push_back(o.after.heldout / o.oracle.heldout);
    evaluated.push_back(o.evaluated_fresh / o.oracle.fresh);
    const bool outside = kind_of(o.design) == SetKind::own;
    const bool is_weak =
        std::any_of(o.sigma.begin(), o.sigma.end(), [&](double s) { return s < detectable_sigma; });
    if (std::isfinite(o.told_fresh)) {
      told.push_back(o.told_fresh / o.oracle.fresh);
      after_told.push_back(o.after.fresh / o.told_fresh);
      count(told_worse, o.told_fresh > kWorse * o.before.fresh);
      const bool is_far = after_told.back() > (outside ? kFarOutside : kFar);
      count(far_from_told, is_far);
      if (is_far) {
        count(far_and_weak, is_weak);
        count(far_and_stated, !is_weak && o.named < o.effects && o.named_or_stated == o.effects);
        count(far_and_open, o.truth_ahead < kTold);
      }
    }
    coverage.k += o.parameters_within;
    coverage.n += o.parameters;
    K.k += o.K_within;
    K.n += 9;
    U0.k += o.U0_within;
    U0.n += 3;
    if (o.effects == 0) return;
    if (is_weak) {
      ++undetectable;
      return;
    }
    ours.add_detectable(o, outside);
    naive.add_detectable(o.naive, outside);
    if (outside) ++claims[claim(o.found)];
  }

 private:
  /// Ids and drivers without numbers.
  static std::string claim(const std::string& found) {
    std::string text;
    for (std::size_t from = 0; from < found.size();) {
      const std::size_t to = std::min(found.find("; ", from), found.size());
      const std::string one = found.substr(from, to - from);
      text += (text.empty() ? "" : "+") + one.substr(0, one.find('('));
      from = to + 2;
    }
    return text.empty() ? "nothing" : text;
  }
};

using Rows = std::vector<std::pair<std::string, Tally>>;  // in the order of first appearance
using Key = std::function<std::string(const SetDesign&)>;

Rows rows_by(const std::vector<SetOutcome>& outcomes, double detectable_sigma, const Key& key) {
  Rows rows;
  for (const SetOutcome& o : outcomes) {
    const std::string name = key(o.design);
    auto at = std::find_if(rows.begin(), rows.end(), [&](auto& r) { return r.first == name; });
    if (at == rows.end()) at = rows.insert(rows.end(), {name, {}});
    at->second.add(o, detectable_sigma);
  }
  return rows;
}

/// Rates with their 95 % limits in per cent; errors as median and worst ratio to the oracle's.
std::string table(const std::string& title, const Rows& rows) {
  std::string text = fmt::format(
      "\n{:<32}{:>4} {:>4} {:>4} |{:^18}{:^18}{:^18}|{:^13}|{:^13}|| naive:{:^18}{:^18}{:^13}\n",
      title, "sets", "inf.", "weak", "named", "or stated", "additional", "fresh", "left out",
      "named", "additional", "fresh");
  for (const auto& [name, t] : rows) {
    text += fmt::format("{:<32}{:>4} {:>4} {:>4} |{}{}{}|{}|{}||       {}{}{}\n", name, t.sets,
                        t.infeasible, t.undetectable, cell(t.ours.named), cell(t.ours.stated),
                        cell(t.ours.additional), cell(t.ours.fresh), cell(t.heldout),
                        cell(t.naive.named), cell(t.naive.additional), cell(t.naive.fresh));
  }
  return text;
}

/// Effects outside the list: rates, then how often what was reported.
std::string own_table(const std::string& title, const Rows& rows) {
  std::string text = fmt::format(
      "\n{:<32}{:>4} {:>4} {:>4} |{:^18}{:>5} {:^18}|{:^13}|{:^13}|| naive:{:^18}{:^18}{:^13}\n",
      title, "sets", "inf.", "weak", "right driver", "near", "none instead", "fresh", "left out",
      "right driver", "none instead", "fresh");
  for (const auto& [name, t] : rows) {
    text += fmt::format("{:<32}{:>4} {:>4} {:>4} |{}{:>5} {}|{}|{}||       {}{}{}\n", name, t.sets,
                        t.infeasible, t.undetectable, cell(t.ours.driver), t.ours.near_name,
                        cell(t.ours.not_listed), cell(t.ours.fresh), cell(t.heldout),
                        cell(t.naive.driver), cell(t.naive.not_listed), cell(t.naive.fresh));
    for (const auto& [claim, times] : t.claims) text += fmt::format("{:>10} x {}\n", times, claim);
  }
  return text;
}

std::string totals(const Tally& all, double detectable_sigma) {
  std::string text = fmt::format(
      "\n{} sets, {} not feasible, {} with an effect of less than {} sigma\n{:<52}{:^32}  {:^32}\n",
      all.sets, all.infeasible, all.undetectable, detectable_sigma, "share [95 % limits] sets",
      "ours", "naive");
  const auto both = [&](const char* name, Share Score::*share) {
    if ((all.ours.*share).n == 0) return;
    text += fmt::format("{:<52}{}  {}\n", name, long_cell(all.ours.*share),
                        long_cell(all.naive.*share));
  };
  const auto line = [&](const std::string& name, const Share& share) {
    if (share.n > 0) text += fmt::format("{:<52}{}\n", name, long_cell(share));
  };
  both("an effect or a structure claimed", &Score::any);
  both("named right (id and axes)", &Score::named);
  both("named right or among the stated, or driver right", &Score::stated);
  both("a wrong finding", &Score::wrong);
  both("findings beyond the true ones, all sets", &Score::additional);
  both("missed, unlisted structure instead", &Score::unlisted_instead);
  both("effects outside the list: a right driver", &Score::driver);
  both("effects outside the list: no listed name", &Score::not_listed);
  line("left unexplained, wholly or partly", all.unexplained);
  line("effect parameters within 1.96 u", all.coverage);
  line("K within 1.96 u", all.K);
  line("U0 within 1.96 u", all.U0);
  line(fmt::format("error after above {} of before", kWorse), all.worse);
  const auto errors = [&](const char* name, const std::vector<double>& ratios) {
    text += fmt::format("{:<52}median {:.3f}, 95 % {:.3f}, worst {:.3f}\n", name,
                        quantile(ratios, 0.5), quantile(ratios, 0.95), quantile(ratios, 1));
  };
  errors("error after / oracle: fresh poses", all.ours.fresh);
  errors("  left-out poses", all.heldout);
  errors("  fresh poses as a file of their own (evaluate)", all.evaluated);
  if (!all.told.empty()) {
    errors("  fresh poses, told the effect / oracle", all.told);
    errors("  fresh poses, error after / told the effect", all.after_told);
  }
  errors("  fresh poses, naive", all.naive.fresh);
  line(fmt::format("told the effect, above {} of before", kWorse), all.told_worse);
  line(fmt::format("after above {} of told (outside the list {})", kFar, kFarOutside),
       all.far_from_told);
  line("  of these an effect of less than the sigma above", all.far_and_weak);
  line("  of these right among the stated alternatives", all.far_and_stated);
  line(fmt::format("  of these the readings favour the truth by < {}", kTold), all.far_and_open);
  text += fmt::format("calibrate(): median {:.2f} s, longest {:.2f} s\n",
                      quantile(all.seconds, 0.5), quantile(all.seconds, 1));
  return text;
}

}  // namespace

double Share::lower() const { return k == 0 ? 0 : p_where(k, n, 0.025); }
double Share::upper() const { return k == n ? 1 : p_where(k + 1, n, 0.975); }

SetKind kind_of(const SetDesign& design) {
  if (design.effects.empty()) return SetKind::clean;
  for (const std::string& name : design.effects)
    if (!find_study_effect(name)->drivers.empty()) return SetKind::own;
  return design.effects.size() > 1 ? SetKind::multiple : SetKind::single;
}

std::string summary(const std::vector<SetOutcome>& outcomes, double detectable_sigma) {
  static constexpr std::pair<SetKind, const char*> kKinds[] = {
      {SetKind::clean, "No effect"},
      {SetKind::single, "One listed effect"},
      {SetKind::multiple, "Several listed effects"},
      {SetKind::own, "Effects outside the list"}};
  std::string text;
  for (const auto& each : kKinds) {
    const SetKind kind = each.first;
    std::vector<SetOutcome> these;
    std::copy_if(outcomes.begin(), outcomes.end(), std::back_inserter(these),
                 [kind](const SetOutcome& o) { return kind_of(o.design) == kind; });
    if (these.empty()) continue;
    text += fmt::format("\n== {} ==\n", each.second);
    const auto by = [&](const char* name, const Key& key) {
      const Rows rows = rows_by(these, detectable_sigma, key);
      text += kind == SetKind::own ? own_table(name, rows) : table(name, rows);
    };
    if (kind == SetKind::multiple) {
      by("by number of effects",
         [](const SetDesign& d) { return fmt::format("{} effects", d.effects.size()); });
    } else if (kind != SetKind::clean) {
      by("by effect", joined_name);
      by("by size", [](const SetDesign& d) { return fmt::format("x{}", d.size); });
    }
    if (kind == SetKind::single)
      by("by effect and size",
         [](const SetDesign& d) { return fmt::format("{} x{}", joined_name(d), d.size); });
    if (kind != SetKind::own) {
      by("by noise", [](const SetDesign& d) { return std::string(to_string(d.noise)); });
      by("by order", [](const SetDesign& d) { return std::string(to_string(d.order)); });
      by("by bits", [](const SetDesign& d) { return fmt::format("{} bits", d.bits); });
    }
    Tally all;
    for (const SetOutcome& o : these) all.add(o, detectable_sigma);
    text += totals(all, detectable_sigma);
  }
  return text;
}

}  // namespace plumbline::study
