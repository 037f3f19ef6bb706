// The two halves of a digital certificate, and what they share. Used by write_dcc() only.
#pragma once

#include <string>
#include <vector>

#include "app/certificate/certificate.h"
#include "app/certificate/dcc/dcc_writer.h"
#include "app/certificate/dcc/xml_tree.h"

namespace plumbline::app::dcc {

inline constexpr const char* kCoverageFactor = "2";
inline constexpr const char* kCoverageProbability = "0.9545";
/// Stands in the file until the file is hashed; then the hash takes its place.
inline constexpr const char* kNoHash =
    "0000000000000000000000000000000000000000000000000000000000000000";

struct Context {
  const CertificateInput& input;
  const Document& document;
  const Siblings& siblings;
  const Translator& tr;

  /// dcc:content in the language of the certificate.
  void content(const XmlElement& parent, std::string_view text) const;
  /// <name><dcc:content>…: for dcc:name, dcc:description, dcc:declaration and the like.
  XmlElement text(const XmlElement& parent, const char* name, std::string_view text) const;
};

void add_administrative_data(const Context& context, const XmlElement& root);
void add_measurement_results(const Context& context, const XmlElement& root);

/// Shortest text that reads back as the same double.
std::string number(double value);
std::string numbers(const std::vector<double>& values);

}  // namespace plumbline::app::dcc
