#include "app/certificate/table_columns.h"

#include <algorithm>
#include <numeric>

namespace plumbline::app {
namespace {

/// A word longer than this is broken rather than widening its column.
constexpr double kWidestWord = 96;

struct Need {
  double least = 0;    ///< the longest word
  double natural = 0;  ///< the longest cell in one line
};

double longest_word(const std::string& text, const std::function<double(const std::string&)>& f) {
  double widest = 0;
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t to = std::min(text.find(' ', from), text.size());
    widest = std::max(widest, f(text.substr(from, to - from)));
    from = to + 1;
  }
  return std::min(widest, kWidestWord);
}

}  // namespace

Anchor column_anchor(const Table& table, std::size_t column) {
  const bool words = column == 0 || std::find(table.word_columns.begin(), table.word_columns.end(),
                                              column) != table.word_columns.end();
  return words ? Anchor::start : Anchor::end;
}

double column_indent(const Table& table, std::size_t column) {
  constexpr double kIndent = 8;
  return column > 0 && column_anchor(table, column) == Anchor::start &&
                 column_anchor(table, column - 1) == Anchor::end
             ? kIndent
             : 0;
}

std::vector<double> column_widths(
    const Table& table, double total,
    const std::function<double(const std::string& text, bool bold)>& text_width) {
  std::vector<Need> needs(table.header.size());
  const auto measure = [&](const std::vector<std::string>& cells, bool bold) {
    const auto width = [&](const std::string& text) { return text_width(text, bold); };
    for (std::size_t c = 0; c < cells.size(); ++c) {
      // A number stays with its unit; only headings and words wrap.
      const bool wraps = bold || column_anchor(table, c) == Anchor::start;
      const double least =
          wraps ? longest_word(cells[c], width) : std::min(width(cells[c]), kWidestWord);
      needs[c].least = std::max(needs[c].least, least);
      needs[c].natural = std::max(needs[c].natural, width(cells[c]));
    }
  };
  measure(table.header, true);
  for (const auto& row : table.rows) measure(row, false);

  for (std::size_t c = 0; c < needs.size(); ++c) {
    needs[c].least += column_indent(table, c);
    needs[c].natural += column_indent(table, c);
  }
  std::vector<double> widths(needs.size());
  const auto sum = [&](double Need::*part) {
    return std::accumulate(needs.begin(), needs.end(), 0.0,
                           [&](double s, const Need& n) { return s + n.*part; });
  };
  const double natural = sum(&Need::natural);
  const double least = sum(&Need::least);
  for (std::size_t c = 0; c < needs.size(); ++c) {
    if (natural <= total) {
      widths[c] = needs[c].natural + (total - natural) / static_cast<double>(needs.size());
    } else if (least < total) {
      const double share = (needs[c].natural - needs[c].least) / (natural - least);
      widths[c] = needs[c].least + share * (total - least);
    } else {
      widths[c] = needs[c].least * total / least;
    }
  }
  return widths;
}

}  // namespace plumbline::app
