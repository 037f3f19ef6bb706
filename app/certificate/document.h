// What a certificate says, independent of how it is written: blocks in reading order.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "app/figure/canvas.h"

namespace plumbline::app {

struct Heading {
  std::string text;
};

enum class Tone { plain, note, warning };
struct Paragraph {
  std::string text;
  Tone tone = Tone::plain;
};

/// Label and value side by side. An empty value is printed as missing, never left out.
struct Facts {
  std::vector<std::pair<std::string, std::string>> rows;
};

struct Table {
  std::string caption;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;  ///< the first column is a label
  std::vector<std::size_t> word_columns = {};  ///< further columns that hold words, not numbers
};

struct Figure {
  std::string caption;
  std::string description;  ///< what the picture shows, for those who cannot see it
  double width = 700;
  double height = 300;
  std::function<void(Canvas&)> draw;
};

using Block = std::variant<Heading, Paragraph, Facts, Table, Figure>;

/// What the writers themselves say, in the language of the document.
struct DocumentWords {
  std::string missing = "not stated";
  std::string page_of = "page {} of {}";  ///< page number, number of pages
  std::string end;                        ///< the end mark
  std::string fingerprint;                ///< the line that states Document::fingerprint
};

struct Document {
  std::string language = "en";  ///< ISO 639-1
  DocumentWords words;
  std::string title;
  std::string subtitle;
  std::string id;                    ///< unique, printed on every page
  std::string headline;              ///< the verdict in a few words
  std::vector<std::string> summary;  ///< sentences under the headline
  Tone tone = Tone::plain;           ///< of the headline: warning when something is out of order
  std::vector<Block> blocks;
  std::string colophon;     ///< last line, before the end mark
  std::string fingerprint;  ///< SHA-256 of the words from `id` to the last block (fingerprint.h)
};

}  // namespace plumbline::app
