// CSV rows and tables of the diagnosis study.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tests/study/diagnosis.h"

namespace plumbline::study {
namespace {

/// Ends of Wilson's interval: the shares whose own binomial distribution has k/n at ±z.
double wilson(const Share& share, double sign) {
  if (share.n == 0) return sign < 0 ? 0 : 1;
  constexpr double kZ = 1.959964;
  const double n = share.n;
  const double p = share.value();
  const double centre = p + kZ * kZ / (2 * n);
  const double half = kZ * std::sqrt(p * (1 - p) / n + kZ * kZ / (4 * n * n));
  return std::clamp((centre + sign * half) / (1 + kZ * kZ / n), 0.0, 1.0);
}

std::string reproduce(const SetDesign& d) {
  return fmt::format(
      "single --effects {} --sizes {} --orders {} --noises {} --bits {} --samples {} --static {} "
      "--sets 1 --seed {}",
      d.effects.empty() ? "none" : fmt::format("{}", fmt::join(d.effects, "+")), d.size,
      to_string(d.order), to_string(d.noise), d.bits, d.samples_per_pose, d.static_s, d.seed);
}

std::string numbers(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += fmt::format("{}{:.2f}", text.empty() ? "" : "+", value);
  return text;
}

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const auto at = static_cast<std::size_t>(q * static_cast<double>(values.size() - 1) + 0.5);
  return values[at];
}

std::string share_text(const Share& s) {
  if (s.n == 0) return fmt::format("{:>26}", "-");
  return fmt::format("{:>6.1f} % [{:>5.1f} {:>5.1f}] {:>4}", 100 * s.value(), 100 * s.lower(),
                     100 * s.upper(), s.n);
}

/// All that a group of sets shows.
struct Tally {
  Share named, stated, additional, wrong, unlisted_instead, driver, not_listed, coverage, K, U0,
      found_any, unexplained, worse;
  std::vector<double> fresh, heldout, seconds;
  int infeasible = 0, undetectable = 0;

  void add(const SetOutcome& o, double detectable_sigma) {
    if (!o.feasible) {
      ++infeasible;
      return;
    }
    const auto yes_no = [](Share& share, bool yes) {
      share.k += yes ? 1 : 0;
      ++share.n;
    };
    yes_no(additional, o.additional() > 0);
    yes_no(found_any, o.wrong + o.named_or_stated + o.driver_right > 0);
    yes_no(unexplained,
           o.verdict == Verdict::unexplained || o.verdict == Verdict::partly_explained);
    yes_no(worse,
           o.after.fresh > 1.02 * o.before.fresh || o.after.heldout > 1.02 * o.before.heldout);
    seconds.push_back(o.seconds);
    fresh.push_back(o.after.fresh / o.oracle.fresh);
    heldout.push_back(o.after.heldout / o.oracle.heldout);
    coverage.k += o.parameters_within;
    coverage.n += o.parameters;
    K.k += o.K_within;
    K.n += 9;
    U0.k += o.U0_within;
    U0.n += 3;
    if (o.effects == 0) return;
    const bool detectable = std::all_of(o.sigma.begin(), o.sigma.end(),
                                        [&](double s) { return s >= detectable_sigma; });
    if (!detectable) {
      ++undetectable;
      return;
    }
    yes_no(named, o.named == o.effects);
    yes_no(stated, o.named_or_stated + o.driver_right == o.effects);
    yes_no(wrong, o.wrong > 0);
    yes_no(unlisted_instead, o.missed() > 0 && o.unlisted > 0);
    const bool outside = std::all_of(
        o.design.effects.begin(), o.design.effects.end(),
        [](const std::string& name) { return !find_study_effect(name)->drivers.empty(); });
    if (!outside) return;
    yes_no(driver, o.driver_right > 0);
    yes_no(not_listed, o.listed_instead == 0);
  }
};

std::string joined_name(const SetDesign& d) {
  return d.effects.empty() ? "none" : fmt::format("{}", fmt::join(d.effects, "+"));
}

}  // namespace

double Share::lower() const { return wilson(*this, -1); }
double Share::upper() const { return wilson(*this, 1); }

std::string csv_header() {
  return "seed,effects,size,order,noise,bits,samples,static_s,feasible,sigma,verdict,p_value,"
         "named,named_or_stated,wrong,additional,unlisted,driver_right,listed_instead,"
         "heldout_gain,parameters,parameters_within,K_within,U0_within,worst_K,worst_U0,before_"
         "fresh_mps2,"
         "after_fresh_mps2,oracle_fresh_mps2,ordinary_oracle_fresh_mps2,before_heldout_mps2,"
         "after_heldout_mps2,oracle_heldout_mps2,seconds,truth,found,reproduce\n";
}

std::string csv_row(const SetOutcome& o) {
  const SetDesign& d = o.design;
  return fmt::format(
      "{},{},{},{},{},{},{},{},{},{},{},{:.3g},{},{},{},{},{},{},{},{:.4f},{},{},{},{},{:.2f},{:."
      "2f},{:.6f},"
      "{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.2f},\"{}\",\"{}\",\"{}\"\n",
      d.seed, joined_name(d), d.size, to_string(d.order), to_string(d.noise), d.bits,
      d.samples_per_pose, d.static_s, o.feasible ? 1 : 0, numbers(o.sigma), to_string(o.verdict),
      o.p_value, o.named, o.named_or_stated, o.wrong, o.additional(), o.unlisted, o.driver_right,
      o.listed_instead, o.heldout_gain, o.parameters, o.parameters_within, o.K_within, o.U0_within,
      o.worst_K, o.worst_U0, o.before.fresh, o.after.fresh, o.oracle.fresh, o.plain_oracle_fresh,
      o.before.heldout, o.after.heldout, o.oracle.heldout, o.seconds, o.truth, o.found,
      reproduce(d));
}

std::string summary(const std::vector<SetOutcome>& outcomes, double detectable_sigma) {
  const auto row = [](const std::string& name, const Tally& t) {
    return fmt::format(
        "{:<28}{:>5}{:>5}{:>5} | {:>3}/{:<3} {:>3}/{:<3} {:>4} {:>4} {:>4} | {:>5.3f} {:>5.3f} | "
        "{:>5.3f} {:>5.3f}\n",
        name, t.found_any.n, t.infeasible, t.undetectable, t.named.k, t.named.n, t.stated.k,
        t.stated.n, t.wrong.k, t.additional.k, t.unlisted_instead.k, quantile(t.fresh, 0.5),
        quantile(t.fresh, 1), quantile(t.heldout, 0.5), quantile(t.heldout, 1));
  };
  const auto table = [&](const std::string& title, auto key) {
    std::vector<std::pair<std::string, Tally>> rows;  // in the order of first appearance
    for (const SetOutcome& o : outcomes) {
      const std::string name = key(o.design);
      auto at = std::find_if(rows.begin(), rows.end(), [&](auto& r) { return r.first == name; });
      if (at == rows.end()) at = rows.insert(rows.end(), {name, {}});
      at->second.add(o, detectable_sigma);
    }
    std::string text = "\n" + title + "\n";
    text += fmt::format("{:<28}{:>5}{:>5}{:>5} | {:<7} {:<7} {:>4} {:>4} {:>4} | {:<11} | {:<11}\n",
                        "", "sets", "inf.", "weak", "named", "stated", "wrng", "add.", "unl.",
                        "fresh med/max", "heldout med/max");
    for (const auto& [name, tally] : rows) text += row(name, tally);
    return text;
  };
  std::string text = table("by effect", [](const SetDesign& d) { return joined_name(d); });
  text += table("by effect and size",
                [](const SetDesign& d) { return fmt::format("{} x{}", joined_name(d), d.size); });
  text += table("by noise", [](const SetDesign& d) { return std::string(to_string(d.noise)); });
  text += table("by order", [](const SetDesign& d) { return std::string(to_string(d.order)); });
  text += table("by bits", [](const SetDesign& d) { return fmt::format("{} bits", d.bits); });

  Tally all;
  for (const SetOutcome& o : outcomes) all.add(o, detectable_sigma);
  const auto line = [&](const char* name, const Share& share) {
    text += fmt::format("{:<52}{}\n", name, share_text(share));
  };
  text += fmt::format(
      "\n{} sets, {} not feasible, {} with an effect of less than {} sigma       "
      "share  [95 % limits]    n\n",
      outcomes.size(), all.infeasible, all.undetectable, detectable_sigma);
  line("an effect or a structure claimed", all.found_any);
  line("left unexplained, wholly or partly", all.unexplained);
  line("named right (id and axes)", all.named);
  line("named right or among the stated, or driver right", all.stated);
  line("a wrong finding", all.wrong);
  line("findings beyond the true ones, all sets", all.additional);
  line("missed, unlisted structure instead", all.unlisted_instead);
  line("effects outside the list: a right driver", all.driver);
  line("effects outside the list: no listed name", all.not_listed);
  line("effect parameters within 1.96 u", all.coverage);
  line("K within 1.96 u", all.K);
  line("U0 within 1.96 u", all.U0);
  line("error after above 1.02 of before", all.worse);
  text += fmt::format(
      "error after / oracle: fresh median {:.3f}, 95 % {:.3f}, worst {:.3f}; left-out median "
      "{:.3f}, 95 % {:.3f}, worst {:.3f}\n",
      quantile(all.fresh, 0.5), quantile(all.fresh, 0.95), quantile(all.fresh, 1),
      quantile(all.heldout, 0.5), quantile(all.heldout, 0.95), quantile(all.heldout, 1));
  text += fmt::format("calibrate(): median {:.2f} s, longest {:.2f} s\n",
                      quantile(all.seconds, 0.5), quantile(all.seconds, 1));
  return text;
}

}  // namespace plumbline::study
