#include "app/certificate/language.h"

namespace plumbline::app {

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

}  // namespace plumbline::app
