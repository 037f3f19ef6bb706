// A thin hand on libxml2's tree: elements are added in document order, text is cleaned and escaped.
#pragma once

#include <libxml/tree.h>

#include <memory>
#include <string>
#include <string_view>

namespace plumbline::app {

struct XmlDocFree {
  void operator()(xmlDoc* doc) const { xmlFreeDoc(doc); }
};
using XmlDocPtr = std::unique_ptr<xmlDoc, XmlDocFree>;

/// The text with control characters and what is not UTF-8 replaced, runs of spaces made one and
/// none at the ends: what xs:string patterns of the DCC accept.
std::string clean_text(std::string_view text);

/// An element of a tree that outlives it; cheap to copy.
class XmlElement {
 public:
  explicit XmlElement(xmlNode* node) : node_(node) {}

  /// Appends an element; "dcc:name" and "si:real" carry the prefix of a declared namespace.
  XmlElement add(const char* name) const;
  /// Appends an element with text.
  XmlElement add(const char* name, std::string_view text) const;
  const XmlElement& attribute(const char* name, std::string_view value) const;
  xmlNode* node() const { return node_; }

 private:
  xmlNode* node_;
};

/// UTF-8, indented.
std::string serialised(xmlDoc* doc);

}  // namespace plumbline::app
