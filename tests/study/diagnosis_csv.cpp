// Rows of the diagnosis study: written one by one, read back to be summed up.
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <type_traits>

#include "tests/study/diagnosis.h"

namespace plumbline::study {
namespace {

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t to = std::min(text.find(separator, from), text.size());
    parts.push_back(text.substr(from, to - from));
    from = to + 1;
  }
  return parts;
}

std::string numbers(const std::vector<double>& values) {
  return fmt::format("{:.3f}", fmt::join(values, "+"));
}
std::vector<double> parse_numbers(const std::string& text) {
  std::vector<double> values;
  if (text.empty()) return values;
  for (const std::string& part : split(text, '+'))
    values.push_back(std::strtod(part.c_str(), nullptr));
  return values;
}

/// One column: how an outcome is written into it and taken from it. Quoted ones are text.
struct Column {
  const char* name;
  std::function<std::string(const SetOutcome&)> write;
  std::function<void(const std::string&, SetOutcome&)> read;
  bool quoted = false;
};

/// A number; `place` says where in an outcome it stands.
template <class Place>
Column number(const char* name, const char* format, Place place) {
  using Number = typename std::invoke_result_t<Place, SetOutcome&>::type;
  return {name,
          [=](const SetOutcome& o) { return fmt::format(fmt::runtime(format), place(o).get()); },
          [=](const std::string& cell, SetOutcome& o) {
            if constexpr (std::is_floating_point_v<Number>) {
              place(o).get() = std::strtod(cell.c_str(), nullptr);
            } else {
              place(o).get() = static_cast<Number>(std::strtoll(cell.c_str(), nullptr, 10));
            }
          }};
}
/// A text, likewise.
template <class Place>
Column words(const char* name, Place place) {
  return {name, [=](const SetOutcome& o) { return place(o).get(); },
          [=](const std::string& cell, SetOutcome& o) { place(o).get() = cell; }, true};
}

Verdict verdict_of(const std::string& name) {
  for (const Verdict v :
       {Verdict::clean, Verdict::explained, Verdict::partly_explained, Verdict::unexplained})
    if (name == to_string(v)) return v;
  return Verdict::undetermined;
}

const std::vector<Column>& columns() {
  static const std::vector<Column> all = {
      number("seed", "{}", [](auto& o) { return std::ref(o.design.seed); }),
      {"effects", [](const SetOutcome& o) { return joined_name(o.design); },
       [](const std::string& cell, SetOutcome& o) { o.design.effects = effect_parts(cell); }},
      number("size", "{}", [](auto& o) { return std::ref(o.design.size); }),
      {"order", [](const SetOutcome& o) { return std::string(to_string(o.design.order)); },
       [](const std::string& cell, SetOutcome& o) { o.design.order = order_of(cell); }},
      {"noise", [](const SetOutcome& o) { return std::string(to_string(o.design.noise)); },
       [](const std::string& cell, SetOutcome& o) { o.design.noise = noise_of(cell); }},
      number("bits", "{}", [](auto& o) { return std::ref(o.design.bits); }),
      number("samples", "{}", [](auto& o) { return std::ref(o.design.samples_per_pose); }),
      number("static_s", "{}", [](auto& o) { return std::ref(o.design.static_s); }),
      number("feasible", "{:d}", [](auto& o) { return std::ref(o.feasible); }),
      {"reached", [](const SetOutcome& o) { return numbers(o.size); },
       [](const std::string& cell, SetOutcome& o) { o.size = parse_numbers(cell); }},
      {"sigma", [](const SetOutcome& o) { return numbers(o.sigma); },
       [](const std::string& cell, SetOutcome& o) { o.sigma = parse_numbers(cell); }},
      {"verdict", [](const SetOutcome& o) { return std::string(to_string(o.verdict)); },
       [](const std::string& cell, SetOutcome& o) { o.verdict = verdict_of(cell); }},
      number("p_value", "{:.3g}", [](auto& o) { return std::ref(o.p_value); }),
      number("true_effects", "{}", [](auto& o) { return std::ref(o.effects); }),
      number("named", "{}", [](auto& o) { return std::ref(o.named); }),
      number("named_or_stated", "{}", [](auto& o) { return std::ref(o.named_or_stated); }),
      number("wrong", "{}", [](auto& o) { return std::ref(o.wrong); }),
      number("unlisted", "{}", [](auto& o) { return std::ref(o.unlisted); }),
      number("driver_right", "{}", [](auto& o) { return std::ref(o.driver_right); }),
      number("near_name", "{}", [](auto& o) { return std::ref(o.near_name); }),
      number("listed_instead", "{}", [](auto& o) { return std::ref(o.listed_instead); }),
      number("heldout_gain", "{:.4f}", [](auto& o) { return std::ref(o.heldout_gain); }),
      number("parameters", "{}", [](auto& o) { return std::ref(o.parameters); }),
      number("parameters_within", "{}", [](auto& o) { return std::ref(o.parameters_within); }),
      number("K_within", "{}", [](auto& o) { return std::ref(o.K_within); }),
      number("U0_within", "{}", [](auto& o) { return std::ref(o.U0_within); }),
      number("worst_K", "{:.2f}", [](auto& o) { return std::ref(o.worst_K); }),
      number("worst_U0", "{:.2f}", [](auto& o) { return std::ref(o.worst_U0); }),
      number("before_fresh_mps2", "{:.6f}", [](auto& o) { return std::ref(o.before.fresh); }),
      number("after_fresh_mps2", "{:.6f}", [](auto& o) { return std::ref(o.after.fresh); }),
      number("oracle_fresh_mps2", "{:.6f}", [](auto& o) { return std::ref(o.oracle.fresh); }),
      number("ordinary_oracle_fresh_mps2", "{:.6f}",
             [](auto& o) { return std::ref(o.plain_oracle_fresh); }),
      number("told_fresh_mps2", "{:.6f}", [](auto& o) { return std::ref(o.told_fresh); }),
      number("truth_ahead", "{:.1f}", [](auto& o) { return std::ref(o.truth_ahead); }),
      number("evaluated_fresh_mps2", "{:.6f}", [](auto& o) { return std::ref(o.evaluated_fresh); }),
      number("before_heldout_mps2", "{:.6f}", [](auto& o) { return std::ref(o.before.heldout); }),
      number("after_heldout_mps2", "{:.6f}", [](auto& o) { return std::ref(o.after.heldout); }),
      number("oracle_heldout_mps2", "{:.6f}", [](auto& o) { return std::ref(o.oracle.heldout); }),
      number("seconds", "{:.2f}", [](auto& o) { return std::ref(o.seconds); }),
      number("naive_named", "{}", [](auto& o) { return std::ref(o.naive.named); }),
      number("naive_named_or_stated", "{}",
             [](auto& o) { return std::ref(o.naive.named_or_stated); }),
      number("naive_wrong", "{}", [](auto& o) { return std::ref(o.naive.wrong); }),
      number("naive_unlisted", "{}", [](auto& o) { return std::ref(o.naive.unlisted); }),
      number("naive_driver_right", "{}", [](auto& o) { return std::ref(o.naive.driver_right); }),
      number("naive_near_name", "{}", [](auto& o) { return std::ref(o.naive.near_name); }),
      number("naive_listed_instead", "{}",
             [](auto& o) { return std::ref(o.naive.listed_instead); }),
      number("naive_fresh_mps2", "{:.6f}", [](auto& o) { return std::ref(o.naive_fresh); }),
      words("truth", [](auto& o) { return std::ref(o.truth); }),
      words("found", [](auto& o) { return std::ref(o.found); }),
      words("naive_found", [](auto& o) { return std::ref(o.naive.found); }),
      {"reproduce", [](const SetOutcome& o) { return reproduce(o.design); },
       [](const std::string&, SetOutcome&) {}, true},
  };
  return all;
}

/// Cells of a line; text in quotes holds none.
std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  bool quoted = false;
  for (const char c : line) {
    if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      cells.emplace_back();
    } else {
      cells.back() += c;
    }
  }
  return cells;
}

}  // namespace

std::vector<std::string> effect_parts(const std::string& names) {
  return names == "none" ? std::vector<std::string>{} : split(names, '+');
}

std::string joined_name(const SetDesign& d) {
  return d.effects.empty() ? "none" : fmt::format("{}", fmt::join(d.effects, "+"));
}

std::string reproduce(const SetDesign& d) {
  return fmt::format(
      "single --effects {} --sizes {} --orders {} --noises {} --bits {} --samples {} --static {} "
      "--sets 1 --seed {}",
      joined_name(d), d.size, to_string(d.order), to_string(d.noise), d.bits, d.samples_per_pose,
      d.static_s, d.seed);
}

std::string csv_header() {
  std::string line;
  for (const Column& column : columns())
    line += (line.empty() ? "" : ",") + std::string(column.name);
  return line + "\n";
}

std::string csv_row(const SetOutcome& outcome) {
  std::string line;
  for (const Column& column : columns()) {
    const char* quote = column.quoted ? "\"" : "";
    line += (line.empty() ? "" : ",") + (quote + column.write(outcome) + quote);
  }
  return line + "\n";
}

Result<std::vector<SetOutcome>> read_csv(const std::string& text, const std::string& name) {
  std::vector<SetOutcome> outcomes;
  std::vector<std::string> lines = split(text, '\n');
  lines.pop_back();  // nothing, or a line that was cut short
  if (lines.empty()) return outcomes;
  if (lines.front() + "\n" != csv_header())
    return fail(ErrorCode::input, name + ": not rows of this version of the study");
  for (std::size_t row = 1; row < lines.size(); ++row) {
    const std::vector<std::string> cells = cells_of(lines[row]);
    if (cells.size() != columns().size())
      return fail(ErrorCode::input, fmt::format("{}:{}: {} cells instead of {}", name, row + 1,
                                                cells.size(), columns().size()));
    SetOutcome& outcome = outcomes.emplace_back();
    for (std::size_t k = 0; k < cells.size(); ++k) columns()[k].read(cells[k], outcome);
    outcome.naive.effects = outcome.effects;
  }
  return outcomes;
}

}  // namespace plumbline::study
