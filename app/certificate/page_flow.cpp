#include "app/certificate/page_flow.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <span>

#include "app/certificate/table_columns.h"
#include "app/figure/cairo_canvas.h"

namespace plumbline::app {
namespace {

constexpr double kBodySize = 9.3, kTableSize = 8.2, kCaptionSize = 8.2;
constexpr double kLineGap = 1.28;  ///< line height over font size
constexpr double kCellPad = 3.2, kRowPad = 1.7;
constexpr double kPointsPerPixel = 0.72;  ///< of figures, so that 700 px are the text width
constexpr const char* kInk = "#222222";
constexpr const char* kSoftInk = "#444444";
constexpr const char* kRule = "#bbbbbb";
constexpr const char* kPlainMark = palette::kBlue;
constexpr const char* kWarningMark = palette::kOrange;

/// A layout that can be copied into drawings.
using SharedLayout = std::shared_ptr<PangoLayout>;

SharedLayout shared(LayoutPtr layout) {
  return SharedLayout(layout.release(), [](PangoLayout* p) { g_object_unref(p); });
}

Drawing horizontal_rule(double x0, double x1, double y, double width, const char* color) {
  return [=](cairo_t* cairo) {
    set_color(cairo, color);
    cairo_set_line_width(cairo, width);
    cairo_set_dash(cairo, nullptr, 0, 0);
    cairo_move_to(cairo, x0, y);
    cairo_line_to(cairo, x1, y);
    cairo_stroke(cairo);
  };
}

Drawing bar(double x, double y, double width, double height, const char* color) {
  return [=](cairo_t* cairo) {
    set_color(cairo, color);
    cairo_rectangle(cairo, x, y, width, height);
    cairo_fill(cairo);
  };
}

class Flow {
 public:
  Flow(const Document& document, const Typeface& typeface)
      : document_(document), typeface_(typeface) {
    result_.pages.emplace_back();
  }

  FlowedDocument run() {
    title();
    verdict();
    const std::vector<Block>& blocks = document_.blocks;
    for (auto it = blocks.begin(); it != blocks.end();) {
      const auto end = std::find_if(it + 1, blocks.end(), [](const Block& block) {
        return std::holds_alternative<Heading>(block);
      });
      section({it, end});
      it = end;
    }
    while (!waiting_.empty()) new_page();
    colophon();
    return std::move(result_);
  }

 private:
  // --- the pen ---

  double bottom() const { return paper::kHeight - paper::kBottom; }
  bool fits(double height) const { return y_ + height <= bottom(); }
  bool at_top() const { return y_ <= paper::kTop + 0.01; }
  /// Pictures that had to wait come first, in their order.
  void new_page() {
    result_.pages.emplace_back();
    y_ = paper::kTop;
    while (!waiting_.empty() && (at_top() || fits(height_of(*waiting_.front())))) {
      const Figure& figure = *waiting_.front();
      waiting_.pop_front();
      place(figure);
    }
  }
  void need(double height) {
    while (!fits(height) && !at_top()) new_page();
  }
  void space(double height) {
    if (!at_top()) y_ += height;
  }
  void draw(Drawing drawing) { result_.pages.back().drawings.push_back(std::move(drawing)); }

  SharedLayout set(std::string_view text, const TextSetting& setting) const {
    return shared(typeface_.layout(text, setting));
  }

  static int line_count(const SharedLayout& layout) {
    return pango_layout_get_line_count(layout.get());
  }

  /// One line of a layout with its top at `y`; lines keep the alignment inside the layout's width.
  void draw_line(const SharedLayout& layout, int index, double x, double y, double size,
                 const std::string& color) {
    draw([=](cairo_t* cairo) {
      PangoLayoutLine* line = pango_layout_get_line_readonly(layout.get(), index);
      PangoRectangle logical;
      pango_layout_line_get_extents(line, nullptr, &logical);
      const double width = static_cast<double>(logical.width) / PANGO_SCALE;
      const int box = pango_layout_get_width(layout.get());
      double shift = 0;
      if (box >= 0) {
        const double spare = static_cast<double>(box) / PANGO_SCALE - width;
        const PangoAlignment align = pango_layout_get_alignment(layout.get());
        shift = align == PANGO_ALIGN_LEFT ? 0 : align == PANGO_ALIGN_CENTER ? spare / 2 : spare;
      }
      cairo_move_to(cairo, x + shift, y + size);
      set_color(cairo, color);
      pango_cairo_show_layout_line(cairo, line);
    });
  }

  /// All lines, going on over the page when they must. Returns nothing; the pen is below.
  void draw_lines(const SharedLayout& layout, double x, double size, const std::string& color) {
    for (int i = 0; i < line_count(layout); ++i) {
      need(size * kLineGap);
      draw_line(layout, i, x, y_, size, color);
      y_ += size * kLineGap;
    }
  }

  static double height_of(const SharedLayout& layout, double size) {
    return line_count(layout) * size * kLineGap;
  }

  // --- the head of the first page ---

  void title() {
    // The number may be long: it gets its own place and wraps there.
    draw_lines(set(document_.id, {.size = 8.5, .width = paper::kTextWidth, .anchor = Anchor::end}),
               paper::kLeft, 8.5, kSoftInk);
    y_ += 2;
    draw_lines(set(document_.title, {.size = 21, .bold = true, .width = paper::kTextWidth}),
               paper::kLeft, 21, kInk);
    draw_lines(set(document_.subtitle, {.size = 10, .width = paper::kTextWidth}), paper::kLeft, 10,
               kInk);
    y_ += 5;
    draw(horizontal_rule(paper::kLeft, paper::kWidth - paper::kRight, y_, 2, kInk));
    y_ += 12;
  }

  void verdict() {
    constexpr double kPad = 8, kMark = 6;
    const double x = paper::kLeft + kMark + kPad;
    const double width = paper::kTextWidth - kMark - 2 * kPad;
    const auto headline = set(document_.headline, {.size = 15, .bold = true, .width = width});
    std::vector<SharedLayout> sentences;
    double height = 2 * kPad + height_of(headline, 15);
    for (const std::string& sentence : document_.summary) {
      sentences.push_back(set(sentence, {.size = kBodySize, .width = width}));
      height += 3 + height_of(sentences.back(), kBodySize);
    }
    // Too long a box (many effects) is not drawn as a box: it goes on like any text.
    const bool boxed = fits(height);
    if (boxed) {
      draw(bar(paper::kLeft, y_, kMark, height,
               document_.tone == Tone::warning ? kWarningMark : kPlainMark));
      const double top = y_;
      draw([=](cairo_t* cairo) {
        set_color(cairo, kInk);
        cairo_set_line_width(cairo, 0.8);
        cairo_set_dash(cairo, nullptr, 0, 0);
        cairo_rectangle(cairo, paper::kLeft, top, paper::kTextWidth, height);
        cairo_stroke(cairo);
      });
    }
    y_ += kPad;
    draw_lines(headline, x, 15, kInk);
    for (const SharedLayout& sentence : sentences) {
      y_ += 3;
      draw_lines(sentence, x, kBodySize, kInk);
    }
    y_ += kPad + 8;
  }

  // --- blocks ---

  /// A heading and what it is over. A figure that does not fit this page lets what comes after it
  /// go first, and stands at the top of the next page, so that no half page stays empty.
  void section(std::span<const Block> blocks) {
    for (std::size_t i = 0; i < blocks.size(); ++i) {
      const std::span<const Block> rest = blocks.subspan(i + 1);
      if (const auto* heading = std::get_if<Heading>(&blocks[i])) {
        add(*heading, first_part(rest));
      } else if (const auto* figure = std::get_if<Figure>(&blocks[i])) {
        add(*figure);
      } else if (const auto* paragraph = std::get_if<Paragraph>(&blocks[i])) {
        add(*paragraph, paragraph->text.ends_with(':') ? first_part(rest) : 0);
      } else if (const auto* facts = std::get_if<Facts>(&blocks[i])) {
        add(*facts);
      } else {
        add(std::get<Table>(blocks[i]));
      }
    }
  }

  /// What must stand on the same page below a heading: a part of what comes first.
  double first_part(std::span<const Block> rest) const {
    if (rest.empty()) return 0;
    if (const auto* figure = std::get_if<Figure>(&rest.front())) return 4 + height_of(*figure);
    const auto* table = std::get_if<Table>(&rest.front());
    return table == nullptr ? 36 : 3 + least_part(lay_out(*table));
  }

  void add(const Heading& heading, double part_below) {
    space(12);
    need(26 + part_below);
    result_.outline.push_back({heading.text, result_.pages.size() - 1, y_});
    draw_lines(set(heading.text, {.size = 12.5, .bold = true, .width = paper::kTextWidth}),
               paper::kLeft, 12.5, kInk);
    draw(horizontal_rule(paper::kLeft, paper::kWidth - paper::kRight, y_ + 1, 0.7, kSoftInk));
    y_ += 7;
  }

  void add(const Paragraph& paragraph, double part_below) {
    const bool warning = paragraph.tone == Tone::warning;
    const double indent = warning ? 10 : 0;
    const double size = paragraph.tone == Tone::note ? 8.6 : kBodySize;
    const auto text = set(paragraph.text, {.size = size, .width = paper::kTextWidth - indent});
    const double height = height_of(text, size);
    if (line_count(text) <= 4) need(height + part_below);
    if (warning && fits(height)) draw(bar(paper::kLeft, y_, 3, height, kWarningMark));
    draw_lines(text, paper::kLeft + indent, size, paragraph.tone == Tone::note ? kSoftInk : kInk);
    y_ += 5;
  }

  void add(const Facts& facts) {
    constexpr double kLabel = 142, kGap = 10;
    for (const auto& [label, value] : facts.rows) {
      const auto left = set(label, {.size = kBodySize, .width = kLabel});
      const bool missing = value.empty();
      const auto right =
          set(missing ? document_.words.missing : value,
              {.size = kBodySize, .italic = missing, .width = paper::kTextWidth - kLabel - kGap});
      const double height = std::max(height_of(left, kBodySize), height_of(right, kBodySize));
      need(height);
      const double top = y_;
      for (int i = 0; i < line_count(left); ++i) {
        draw_line(left, i, paper::kLeft, top + i * kBodySize * kLineGap, kBodySize, kSoftInk);
      }
      draw_lines(right, paper::kLeft + kLabel + kGap, kBodySize, missing ? "#993333" : kInk);
      y_ = std::max(y_, top + height) + 1.5;
    }
    y_ += 5;
  }

  struct Row {
    std::vector<SharedLayout> cells;
    std::vector<double> left;  ///< from the left edge of the column
    double height = 0;
  };

  Row set_row(const Table& table, const std::vector<std::string>& cells,
              const std::vector<double>& widths, bool bold) const {
    Row row;
    int lines = 1;
    for (std::size_t c = 0; c < cells.size(); ++c) {
      row.left.push_back(kCellPad + column_indent(table, c));
      row.cells.push_back(set(cells[c], {.size = kTableSize,
                                         .bold = bold,
                                         .width = widths[c] - kCellPad - row.left.back(),
                                         .anchor = column_anchor(table, c)}));
      lines = std::max(lines, line_count(row.cells.back()));
    }
    row.height = lines * kTableSize * kLineGap + 2 * kRowPad;
    return row;
  }

  void draw_row(const Row& row, const std::vector<double>& widths) {
    const double line = kTableSize * kLineGap;
    if (row.height <= bottom() - paper::kTop) {
      double x = paper::kLeft;
      for (std::size_t c = 0; c < row.cells.size(); ++c) {
        for (int i = 0; i < line_count(row.cells[c]); ++i) {
          draw_line(row.cells[c], i, x + row.left[c], y_ + kRowPad + i * line, kTableSize, kInk);
        }
        x += widths[c];
      }
      y_ += row.height;
      return;
    }
    // Higher than a page: line by line.
    int lines = 0;
    for (const auto& cell : row.cells) lines = std::max(lines, line_count(cell));
    for (int i = 0; i < lines; ++i) {
      need(line);
      double x = paper::kLeft;
      for (std::size_t c = 0; c < row.cells.size(); ++c) {
        if (i < line_count(row.cells[c])) {
          draw_line(row.cells[c], i, x + row.left[c], y_, kTableSize, kInk);
        }
        x += widths[c];
      }
      y_ += line;
    }
    y_ += 2 * kRowPad;
  }

  struct LaidOut {
    std::vector<double> widths;
    SharedLayout caption;
    Row header;
    std::vector<Row> rows;
    /// Height from each row to the next one that says what it is about: such rows stay together.
    std::vector<double> group;
    double head = 0;  ///< height of caption and header
    double all = 0;
  };

  LaidOut lay_out(const Table& table) const {
    const auto text_width = [&](const std::string& text, bool bold) {
      return typeface_.width(text, {.size = kTableSize, .bold = bold}) + 2 * kCellPad + 0.5;
    };
    LaidOut out;
    out.widths = column_widths(table, paper::kTextWidth, text_width);
    out.caption = set(table.caption, {.size = 9, .bold = true, .width = paper::kTextWidth});
    out.header = set_row(table, table.header, out.widths, true);
    out.head = out.all = height_of(out.caption, 9) + 3 + out.header.height;
    for (const auto& cells : table.rows) {
      out.rows.push_back(set_row(table, cells, out.widths, false));
      out.all += out.rows.back().height;
    }
    out.group.resize(out.rows.size());
    for (std::size_t i = out.rows.size(); i-- > 0;) {
      const bool goes_on = i + 1 < out.rows.size() && table.rows[i + 1].front().empty();
      out.group[i] = out.rows[i].height + (goes_on ? out.group[i + 1] : 0);
    }
    return out;
  }

  /// What of a table must stand together on its first page: a small one whole.
  static double least_part(const LaidOut& table) {
    constexpr double kSmall = 150, kPart = 60;
    if (table.all <= kSmall || table.group.empty()) return table.all;
    return table.head + std::max(table.group.front(), kPart);
  }

  void add(const Table& given) {
    const LaidOut table = lay_out(given);
    space(3);
    need(least_part(table));
    draw_lines(table.caption, paper::kLeft, 9, kInk);
    y_ += 3;
    const auto draw_head = [&] {
      draw_row(table.header, table.widths);
      draw(horizontal_rule(paper::kLeft, paper::kWidth - paper::kRight, y_, 1, kInk));
    };
    draw_head();
    const double room = bottom() - paper::kTop - table.header.height;
    for (std::size_t i = 0; i < table.rows.size(); ++i) {
      const bool begins = i == 0 || table.group[i - 1] == table.rows[i - 1].height;
      const double together =
          begins && table.group[i] <= room ? table.group[i] : table.rows[i].height;
      if (!fits(together) && together <= room) {
        need(table.header.height + together);
        draw_head();
      }
      draw_row(table.rows[i], table.widths);
      draw(horizontal_rule(paper::kLeft, paper::kWidth - paper::kRight, y_, 0.5, kRule));
    }
    y_ += 9;
  }

  double scale_of(const Figure& figure) const {
    constexpr double kRoomForCaption = 60;
    return std::min({kPointsPerPixel, paper::kTextWidth / figure.width,
                     (bottom() - paper::kTop - kRoomForCaption) / figure.height});
  }
  SharedLayout caption_of(const Figure& figure) const {
    return set(figure.caption, {.size = kCaptionSize, .width = paper::kTextWidth});
  }
  double height_of(const Figure& figure) const {
    return figure.height * scale_of(figure) + 4 + height_of(caption_of(figure), kCaptionSize);
  }

  void add(const Figure& figure) {
    if (waiting_.empty() && (at_top() || fits(4 + height_of(figure)))) {
      place(figure);
    } else {
      waiting_.push_back(&figure);
    }
  }

  void place(const Figure& figure) {
    const double scale = scale_of(figure);
    space(4);
    const double top = y_;
    draw([top, scale, draw_figure = figure.draw, typeface = &typeface_](cairo_t* cairo) {
      cairo_save(cairo);
      cairo_translate(cairo, paper::kLeft, top);
      cairo_scale(cairo, scale, scale);
      CairoCanvas canvas(cairo, *typeface);
      draw_figure(canvas);
      cairo_restore(cairo);
    });
    y_ += figure.height * scale + 4;
    draw_lines(caption_of(figure), paper::kLeft, kCaptionSize, kSoftInk);
    y_ += 8;
  }

  void colophon() {
    space(10);
    const auto text = set(document_.colophon, {.size = 8.6, .width = paper::kTextWidth});
    const auto end = set(document_.words.end,
                         {.size = 8.6, .width = paper::kTextWidth, .anchor = Anchor::middle});
    const auto print = set(document_.words.fingerprint, {.size = 7.6, .width = paper::kTextWidth});
    need(height_of(text, 8.6) + height_of(print, 7.6) + height_of(end, 8.6) + 20);
    draw(horizontal_rule(paper::kLeft, paper::kWidth - paper::kRight, y_, 0.7, kSoftInk));
    y_ += 6;
    draw_lines(text, paper::kLeft, 8.6, kInk);
    y_ += 2;
    draw_lines(print, paper::kLeft, 7.6, kSoftInk);
    y_ += 5;
    draw_lines(end, paper::kLeft, 8.6, kInk);
  }

  const Document& document_;
  const Typeface& typeface_;
  FlowedDocument result_;
  std::deque<const Figure*> waiting_;
  double y_ = paper::kTop;
};

}  // namespace

FlowedDocument flow(const Document& document, const Typeface& typeface) {
  return Flow(document, typeface).run();
}

}  // namespace plumbline::app
