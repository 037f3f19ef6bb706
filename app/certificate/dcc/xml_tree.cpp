#include "app/certificate/dcc/xml_tree.h"

#include <libxml/chvalid.h>

#include <algorithm>
#include <cassert>

namespace plumbline::app {
namespace {

const xmlChar* chars(const char* text) { return reinterpret_cast<const xmlChar*>(text); }

/// Length of the UTF-8 character at the beginning of `text`; 0 when there is none.
std::size_t character_length(std::string_view text) {
  int length = static_cast<int>(std::min<std::size_t>(text.size(), 4));
  const int code = xmlGetUTF8Char(reinterpret_cast<const unsigned char*>(text.data()), &length);
  return code < 0 || !xmlIsCharQ(static_cast<unsigned>(code)) ? 0
                                                              : static_cast<std::size_t>(length);
}

}  // namespace

std::string clean_text(std::string_view text) {
  std::string clean;
  bool space = false;
  while (!text.empty()) {
    const std::size_t length = character_length(text);
    const std::string_view character = text.substr(0, std::max<std::size_t>(length, 1));
    text.remove_prefix(character.size());
    if (length == 1 && static_cast<unsigned char>(character.front()) <= 0x20) {
      space = true;
      continue;
    }
    if (space && !clean.empty()) clean += ' ';
    space = false;
    if (length == 0) {
      clean += '?';
    } else {
      clean += character;
    }
  }
  return clean;
}

XmlElement XmlElement::add(const char* name) const {
  const std::string_view full = name;
  const std::size_t colon = full.find(':');
  assert(colon != std::string_view::npos);
  const std::string prefix(full.substr(0, colon));
  xmlNs* space = xmlSearchNs(node_->doc, node_, chars(prefix.c_str()));
  assert(space != nullptr);
  return XmlElement(xmlNewChild(node_, space, chars(name + colon + 1), nullptr));
}

XmlElement XmlElement::add(const char* name, std::string_view text) const {
  const XmlElement element = add(name);
  xmlNodeAddContent(element.node_, chars(clean_text(text).c_str()));
  return element;
}

const XmlElement& XmlElement::attribute(const char* name, std::string_view value) const {
  xmlNewProp(node_, chars(name), chars(clean_text(value).c_str()));
  return *this;
}

std::string serialised(xmlDoc* doc) {
  xmlChar* buffer = nullptr;
  int size = 0;
  xmlDocDumpFormatMemoryEnc(doc, &buffer, &size, "UTF-8", 1);
  std::string text(reinterpret_cast<const char*>(buffer), static_cast<std::size_t>(size));
  xmlFree(buffer);
  return text;
}

}  // namespace plumbline::app
