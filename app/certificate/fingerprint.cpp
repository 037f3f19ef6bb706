#include "app/certificate/fingerprint.h"

#include "app/io/sha256.h"

namespace plumbline::app {
namespace {

struct Collector {
  const Document& document;
  std::vector<std::string>& words;

  void add(std::string_view text) const { append_words(text, words); }
  void operator()(const Heading& heading) const { add(heading.text); }
  void operator()(const Paragraph& paragraph) const { add(paragraph.text); }
  void operator()(const Facts& facts) const {
    for (const auto& [label, value] : facts.rows) {
      add(label);
      add(value.empty() ? document.words.missing : value);
    }
  }
  void operator()(const Table& table) const {
    add(table.caption);
    for (const auto& cell : table.header) add(cell);
    for (const auto& row : table.rows) {
      for (const auto& cell : row) add(cell);
    }
  }
  void operator()(const Figure& figure) const { add(figure.caption); }
};

}  // namespace

void append_words(std::string_view text, std::vector<std::string>& words) {
  constexpr std::string_view kSpace = " \t\r\n\f";
  for (std::size_t from = text.find_first_not_of(kSpace); from != std::string_view::npos;) {
    const std::size_t to = std::min(text.find_first_of(kSpace, from), text.size());
    words.emplace_back(text.substr(from, to - from));
    from = text.find_first_not_of(kSpace, to);
  }
}

std::vector<std::string> words_of(const Document& document) {
  std::vector<std::string> words;
  const Collector collect{document, words};
  for (const std::string* text :
       {&document.id, &document.title, &document.subtitle, &document.headline}) {
    collect.add(*text);
  }
  for (const std::string& sentence : document.summary) collect.add(sentence);
  for (const Block& block : document.blocks) std::visit(collect, block);
  return words;
}

std::string fingerprint(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return sha256(text);
}

std::string fingerprint(const Document& document) { return fingerprint(words_of(document)); }

}  // namespace plumbline::app
