#include "app/certificate/dcc/dcc_writer.h"

#include <fmt/format.h>

#include <cmath>

#include "app/certificate/dcc/dcc_parts.h"
#include "app/certificate/dcc/signature.h"
#include "app/io/sha256.h"

namespace plumbline::app {
namespace dcc {

void Context::content(const XmlElement& parent, std::string_view text) const {
  parent.add("dcc:content", text).attribute("lang", code_of(tr.language()));
}

XmlElement Context::text(const XmlElement& parent, const char* name, std::string_view text) const {
  const XmlElement element = parent.add(name);
  content(element, text);
  return element;
}

std::string number(double value) {
  // The schema has no infinity.
  return std::isfinite(value) ? fmt::format("{}", value) : "NaN";
}

std::string numbers(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : " ") + number(value);
  return text;
}

}  // namespace dcc

namespace {

constexpr std::string_view kHashPrefix = "sha256:";
constexpr std::size_t kHashDigits = 64;

/// Where the digits of the file's own hash begin; npos when there are none.
std::size_t own_hash_place(std::string_view xml) {
  const std::size_t mark = xml.find(dcc_ref::kSelf);
  if (mark == std::string_view::npos) return mark;
  const std::size_t place = xml.find(kHashPrefix, mark);
  if (place == std::string_view::npos || place + kHashPrefix.size() + kHashDigits > xml.size()) {
    return std::string_view::npos;
  }
  return place + kHashPrefix.size();
}

}  // namespace

std::string dcc_self_hash(std::string_view xml) {
  std::string blank = without_signature(xml);
  const std::size_t place = own_hash_place(blank);
  if (place == std::string_view::npos) return {};
  blank.replace(place, kHashDigits, dcc::kNoHash);
  return sha256(blank);
}

std::string write_dcc(const CertificateInput& input, const Document& document,
                      const Siblings& siblings) {
  const auto* version = reinterpret_cast<const xmlChar*>("1.0");
  const XmlDocPtr doc(xmlNewDoc(version));
  xmlNode* node =
      xmlNewNode(nullptr, reinterpret_cast<const xmlChar*>("digitalCalibrationCertificate"));
  xmlDocSetRootElement(doc.get(), node);
  const auto declare = [&](const char* uri, const char* prefix) {
    return xmlNewNs(node, reinterpret_cast<const xmlChar*>(uri),
                    reinterpret_cast<const xmlChar*>(prefix));
  };
  xmlSetNs(node, declare("https://ptb.de/dcc", "dcc"));
  declare("https://ptb.de/si", "si");
  const XmlElement root(node);
  root.attribute("schemaVersion", "3.3.0");

  const Translator tr(input.language);
  const dcc::Context context{input, document, siblings, tr};
  dcc::add_administrative_data(context, root);
  dcc::add_measurement_results(context, root);

  std::string xml = serialised(doc.get());
  xml.replace(own_hash_place(xml), kHashDigits, sha256(xml));
  return xml;
}

}  // namespace plumbline::app
