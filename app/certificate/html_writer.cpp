#include <fmt/format.h>

#include <algorithm>

#include "app/certificate/certificate.h"
#include "app/certificate/table_columns.h"
#include "app/figure/svg_canvas.h"

namespace plumbline::app {
namespace {

constexpr const char* kStyle = R"css(
@page { size: A4; margin: 16mm 15mm 18mm 15mm;
  @bottom-left { content: "%ID%"; font: 8pt Helvetica, Arial, sans-serif; color: #444; }
  @bottom-right { content: %PAGE%;
                  font: 8pt Helvetica, Arial, sans-serif; color: #444; } }
* { box-sizing: border-box; }
body { font: 14px/1.45 Helvetica, Arial, "Liberation Sans", sans-serif; color: #222;
       max-width: 780px; margin: 32px auto; padding: 0 24px; background: #fff; }
header { border-bottom: 3px solid #222; padding-bottom: 10px; margin-bottom: 18px; }
h1 { font-size: 27px; margin: 0; letter-spacing: .01em; }
header p { margin: 3px 0 0; }
.id { float: right; font-size: 12px; color: #444; padding-top: 12px; }
h2 { font-size: 17px; margin: 30px 0 8px; border-bottom: 1px solid #999; padding-bottom: 3px;
     break-after: avoid; }
.verdict { border: 1.5px solid #222; border-left-width: 9px; padding: 10px 16px; margin: 16px 0; }
.verdict strong { font-size: 21px; }
.verdict p { margin: 5px 0 0; }
.verdict.plain { border-left-color: #0072b2; }
.verdict.warning { border-left-color: #d55e00; }
p.warning { border-left: 5px solid #d55e00; padding-left: 10px; }
p.note { color: #555; font-size: 13px; }
table { border-collapse: collapse; width: 100%; margin: 10px 0 16px; font-size: 12.5px; }
tr, table:not(:has(tr:nth-child(9))) { break-inside: avoid; }
caption { text-align: left; font-weight: bold; padding: 4px 0; }
th, td { padding: 3px 6px; border-bottom: 1px solid #ddd; text-align: right;
         font-variant-numeric: tabular-nums; }
td { white-space: nowrap; }
td:first-child, td.words { white-space: normal; }
td.long { white-space: normal; overflow-wrap: anywhere; }
thead th { border-bottom: 1.5px solid #222; vertical-align: bottom; }
th:first-child, td:first-child, td.words, th.words { text-align: left; }
td.words, th.words { padding-left: 14px; }
dl { display: grid; grid-template-columns: 200px minmax(0, 1fr); gap: 3px 14px; margin: 8px 0 14px; }
dt { color: #444; overflow-wrap: anywhere; }
dd { margin: 0; overflow-wrap: anywhere; }
.missing { color: #a33; font-style: italic; }
p:has(+ figure), p:has(+ table), p:has(+ dl) { break-after: avoid; }
figure { margin: 16px 0 20px; break-inside: avoid; }
figure svg { max-width: 100%; height: auto; display: block; }
figcaption { font-size: 12.5px; color: #444; margin-top: 4px; }
footer { border-top: 1px solid #999; margin-top: 28px; padding-top: 8px; font-size: 12.5px; }
p.fingerprint { color: #555; overflow-wrap: anywhere; }
.end { text-align: center; letter-spacing: .12em; margin-top: 10px; }
@media screen and (max-width: 760px) {
  body { margin: 12px auto; padding: 0 12px; }
  table { display: block; overflow-x: auto; }
  dl { grid-template-columns: minmax(0, 2fr) minmax(0, 3fr); }
}
h1, h2, p, caption, figcaption, .id, .verdict, .end { overflow-wrap: anywhere; }
@media print {
  body { margin: 0; padding: 0; max-width: none; font-size: 10pt; }
  table { font-size: 8.3pt; }
  th, td { padding: 2px 4px; }
  td.words, th.words { padding-left: 9px; }
}
)css";

/// Inside a CSS string, so quotes and backslashes of a serial number must not end it.
std::string css_safe(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if (c == '"' || c == '\\' || c == '<' || c == '&' || c == '\n') {
      safe += '_';
    } else {
      safe += c;
    }
  }
  return safe;
}

/// "page {} of {}" as a CSS content value.
std::string page_counter(const std::string& words) {
  const std::size_t first = words.find("{}"), second = words.find("{}", first + 2);
  return fmt::format(
      "\"{}\" counter(page) \"{}\" counter(pages) \"{}\"", css_safe(words.substr(0, first)),
      css_safe(words.substr(first + 2, second - first - 2)), css_safe(words.substr(second + 2)));
}

std::string style(const Document& document) {
  std::string text = kStyle;
  text.replace(text.find("%ID%"), 4, css_safe(document.id));
  return text.replace(text.find("%PAGE%"), 6, page_counter(document.words.page_of));
}

const char* tone_class(Tone tone) {
  switch (tone) {
    case Tone::note:
      return "note";
    case Tone::warning:
      return "warning";
    case Tone::plain:
      break;
  }
  return "plain";
}

struct HtmlWriter {
  const DocumentWords& words;
  std::string text = {};
  int figures = 0;

  /// Numbers stand on the right; the first column is left by the style.
  static const char* side(const Table& table, std::size_t column) {
    return column > 0 && column_anchor(table, column) == Anchor::start ? " class=\"words\"" : "";
  }
  /// Only a word that would push the table off the page may be broken.
  static std::string cell_class(const Table& table, std::size_t column, const std::string& cell) {
    constexpr std::size_t kLongWord = 40;
    std::size_t length = 0, longest = 0;
    for (const char c : cell) {
      length = c == ' ' ? 0 : length + 1;
      longest = std::max(longest, length);
    }
    if (longest <= kLongWord) return side(table, column);
    return *side(table, column) == '\0' ? " class=\"long\"" : " class=\"words long\"";
  }

  void operator()(const Heading& heading) {
    text += fmt::format("<h2>{}</h2>\n", escape_xml(heading.text));
  }
  void operator()(const Paragraph& paragraph) {
    text += fmt::format("<p class=\"{}\">{}</p>\n", tone_class(paragraph.tone),
                        escape_xml(paragraph.text));
  }
  void operator()(const Facts& facts) {
    text += "<dl>\n";
    for (const auto& [label, value] : facts.rows) {
      text += fmt::format("<dt>{}</dt>", escape_xml(label));
      text += value.empty()
                  ? fmt::format("<dd class=\"missing\">{}</dd>\n", escape_xml(words.missing))
                  : fmt::format("<dd>{}</dd>\n", escape_xml(value));
    }
    text += "</dl>\n";
  }
  void operator()(const Table& table) {
    text += fmt::format("<table>\n<caption>{}</caption>\n<thead><tr>", escape_xml(table.caption));
    for (std::size_t c = 0; c < table.header.size(); ++c) {
      text +=
          fmt::format("<th scope=\"col\"{}>{}</th>", side(table, c), escape_xml(table.header[c]));
    }
    text += "</tr></thead>\n<tbody>\n";
    for (const auto& row : table.rows) {
      text += "<tr>";
      for (std::size_t c = 0; c < row.size(); ++c) {
        text += fmt::format("<td{}>{}</td>", cell_class(table, c, row[c]), escape_xml(row[c]));
      }
      text += "</tr>\n";
    }
    text += "</tbody>\n</table>\n";
  }
  void operator()(const Figure& figure) {
    SvgCanvas canvas(figure.width, figure.height);
    figure.draw(canvas);
    text += fmt::format("<figure>\n{}<figcaption>{}</figcaption>\n</figure>\n",
                        canvas.svg(fmt::format("f{}", ++figures), figure.description),
                        escape_xml(figure.caption));
  }
};

}  // namespace

std::string write_html(const Document& document) {
  HtmlWriter writer{document.words};
  writer.text = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"{4}\">\n<head>\n<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n"
      "<title>{0} {1}</title>\n<style>{2}</style>\n</head>\n<body>\n<header>\n"
      "<span class=\"id\">{1}</span>\n<h1>{0}</h1>\n<p>{3}</p>\n</header>\n",
      escape_xml(document.title), escape_xml(document.id), style(document),
      escape_xml(document.subtitle), document.language);
  writer.text += fmt::format("<section class=\"verdict {}\"><strong>{}</strong>\n",
                             tone_class(document.tone), escape_xml(document.headline));
  for (const auto& sentence : document.summary) {
    writer.text += fmt::format("<p>{}</p>\n", escape_xml(sentence));
  }
  writer.text += "</section>\n";
  for (const Block& block : document.blocks) std::visit(writer, block);
  writer.text += fmt::format(
      "<footer><p>{}</p><p class=\"fingerprint\">{}</p><p class=\"end\">{}</p></footer>\n"
      "</body>\n</html>\n",
      escape_xml(document.colophon), escape_xml(document.words.fingerprint),
      escape_xml(document.words.end));
  return writer.text;
}

}  // namespace plumbline::app
