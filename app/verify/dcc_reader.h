// A certificate.xml read back: its tree, the values that are compared, the rules it must keep.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "app/certificate/dcc/xml_tree.h"
#include "app/verify/report.h"
#include "estimator/measurement.h"

namespace plumbline::app {

struct XmlList {
  std::string ref_type;  ///< of the dcc:quantity that holds it
  std::vector<std::string> labels;
  std::vector<double> values;
  std::vector<double> expanded;  ///< expanded uncertainties; empty when there are none
  std::string unit;
};

/// One si:real of the results.
struct XmlReal {
  std::string ref_type;  ///< of the dcc:quantity that holds it
  double value = 0;
  double expanded = 0;  ///< expanded uncertainty; 0 when none is stated
};

struct ReadDcc {
  XmlDocPtr tree;
  std::string id;
  /// refType of the identification → digits of its "sha256:" value, in document order.
  std::vector<std::pair<std::string, std::string>> hashes;
  std::vector<XmlList> lists;  ///< every si:realListXMLList, in document order
  std::vector<XmlReal> reals;  ///< every si:real of a dcc:quantity, likewise
  std::string conformity;      ///< what dcc:conformity says; empty when it states none

  /// Empty when there is none.
  std::string hash(std::string_view ref_type) const;
  /// The list whose first label and unit are these; null when there is none.
  const XmlList* list(std::string_view first_label, std::string_view unit) const;
  /// The first list of the quantities of this refType; null when there is none.
  const XmlList* list_of(std::string_view ref_type) const;
};

/// Well-formed XML with the root of a DCC; nothing is fetched from anywhere, no entity is expanded.
/// Fails (input) with `name`, line and reason.
Result<ReadDcc> read_dcc(std::string_view xml, const std::string& name);

/// Against FOLDER/v3.3.0/dcc.xsd (or the file itself when `schema` is one). Fails (input) when the
/// schema cannot be used; violations are bad checks with their line.
Result<void> check_schema(const ReadDcc& dcc, const std::filesystem::path& schema,
                          VerifyReport& report);

/// What the schema does not see: lists of equal length, units of the D-SI without spaces, at least
/// one SI unit in a hybrid, languages declared once and none other used, a method for every result,
/// no deprecated form of uncertainty.
void check_rules(const ReadDcc& dcc, VerifyReport& report);

}  // namespace plumbline::app
