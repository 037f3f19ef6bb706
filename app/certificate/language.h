// The languages of a certificate. English is what the sources say; other languages are looked up by
// the English text.
#pragma once

#include <fmt/format.h>

#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace plumbline::app {

enum class Language { en, uk };

/// "en" or "uk".
const char* code_of(Language language);

/// Cheap to copy; copies share the record of what was missing.
class Translator {
 public:
  explicit Translator(Language language = Language::en);

  Language language() const { return language_; }
  /// The text in the language; English where the catalogue lacks it.
  std::string operator()(std::string_view english) const;
  /// The same with `{}` filled in.
  template <class... Values>
  std::string operator()(std::string_view english, const Values&... values) const {
    return fmt::format(fmt::runtime((*this)(english)), values...);
  }
  /// What the core, the sequencer and the rig say of their own accord (reasons, remarks, events),
  /// clause by clause, with their values in place; English where no phrase fits.
  std::string phrase(std::string_view english) const;
  /// English texts that were asked for and not found so far, for a test.
  const std::set<std::string>& missing() const { return *missing_; }

 private:
  Language language_;
  std::shared_ptr<std::set<std::string>> missing_;
};

/// The Ukrainian text for an English one; empty when there is none.
std::string_view ukrainian(std::string_view english);
/// Clauses with `{}` for their values, in the order in which they are to be tried: of the core, and
/// then of the events of a run.
std::span<const std::pair<std::string_view, std::string_view>> ukrainian_phrases();
std::span<const std::pair<std::string_view, std::string_view>> ukrainian_event_phrases();

}  // namespace plumbline::app
