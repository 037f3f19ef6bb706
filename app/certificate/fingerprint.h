// One number for everything a certificate says, so that its three forms can be compared and a
// printed copy can be checked.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "app/certificate/document.h"

namespace plumbline::app {

/// The words of the document in reading order, from its number to the last block; captions belong
/// to it, what stands inside pictures does not. Words end at white space.
std::vector<std::string> words_of(const Document& document);
void append_words(std::string_view text, std::vector<std::string>& words);

/// SHA-256 of the words joined by single spaces, hexadecimal.
std::string fingerprint(const std::vector<std::string>& words);
std::string fingerprint(const Document& document);

}  // namespace plumbline::app
