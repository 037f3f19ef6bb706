#include "app/certificate/language.h"

#include <fmt/args.h>

#include <algorithm>
#include <optional>
#include <vector>

namespace plumbline::app {
namespace {

constexpr std::string_view kHole = "{}";

/// What stands in the holes of the pattern when the text is one of its kind.
std::optional<std::vector<std::string_view>> holes(std::string_view pattern,
                                                   std::string_view text) {
  std::vector<std::string_view> found;
  std::size_t hole = pattern.find(kHole);
  if (hole == std::string_view::npos) {
    return pattern == text ? std::optional(found) : std::nullopt;
  }
  if (!text.starts_with(pattern.substr(0, hole))) return std::nullopt;
  text.remove_prefix(hole);
  while (hole != std::string_view::npos) {
    pattern.remove_prefix(hole + kHole.size());
    hole = pattern.find(kHole);
    const std::string_view literal = pattern.substr(0, hole);
    std::size_t end = text.size();
    if (hole == std::string_view::npos) {
      if (!text.ends_with(literal)) return std::nullopt;
      end -= literal.size();
    } else if (!literal.empty()) {
      end = text.find(literal);
      if (end == std::string_view::npos) return std::nullopt;
    } else {
      end = 0;
    }
    found.push_back(text.substr(0, end));
    text.remove_prefix(std::min(text.size(), end + literal.size()));
  }
  return found;
}

}  // namespace

const char* code_of(Language language) { return language == Language::uk ? "uk" : "en"; }

Translator::Translator(Language language)
    : language_(language), missing_(std::make_shared<std::set<std::string>>()) {}

std::string Translator::operator()(std::string_view english) const {
  if (language_ == Language::en) return std::string(english);
  const std::string_view found = ukrainian(english);
  if (!found.empty()) return std::string(found);
  missing_->emplace(english);
  return std::string(english);
}

std::string Translator::phrase(std::string_view english) const {
  if (language_ == Language::en) return std::string(english);
  constexpr std::string_view kBetween = "; ";
  const std::size_t end = english.find(kBetween);
  for (const auto& phrases : {ukrainian_phrases(), ukrainian_event_phrases()}) {
    for (const auto& [pattern, own] : phrases) {
      // A clause is a unit; only what is known to be longer is taken together.
      if (end != std::string_view::npos && pattern.find(kBetween) == std::string_view::npos) {
        continue;
      }
      const auto values = holes(pattern, english);
      if (!values) continue;
      fmt::dynamic_format_arg_store<fmt::format_context> store;
      for (const std::string_view value : *values) store.push_back(phrase(value));
      return fmt::vformat(own, store);
    }
  }
  if (end == std::string_view::npos) return std::string(english);
  return phrase(english.substr(0, end)) + std::string(kBetween) +
         phrase(english.substr(end + kBetween.size()));
}

}  // namespace plumbline::app
