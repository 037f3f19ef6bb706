#include "app/verify/dcc_reader.h"

#include <fmt/format.h>
#include <libxml/parser.h>
#include <libxml/xmlschemas.h>

#include <algorithm>
#include <charconv>
#include <functional>
#include <set>

#include "app/certificate/dcc/dcc_units.h"
#include "app/certificate/fingerprint.h"

namespace plumbline::app {
namespace {

constexpr const char* kDcc = "https://ptb.de/dcc";
constexpr const char* kSi = "https://ptb.de/si";

std::string_view view(const xmlChar* text) {
  return text == nullptr ? std::string_view{} : reinterpret_cast<const char*>(text);
}

bool is(const xmlNode* node, const char* space, std::string_view name) {
  return node->type == XML_ELEMENT_NODE && node->ns != nullptr && view(node->ns->href) == space &&
         view(node->name) == name;
}

std::string text_of(const xmlNode* node) {
  const std::unique_ptr<xmlChar, void (*)(void*)> text(xmlNodeGetContent(node), xmlFree);
  return std::string(view(text.get()));
}

std::string attribute(const xmlNode* node, const char* name) {
  const std::unique_ptr<xmlChar, void (*)(void*)> text(
      xmlGetNoNsProp(node, reinterpret_cast<const xmlChar*>(name)), xmlFree);
  return std::string(view(text.get()));
}

const xmlNode* child(const xmlNode* node, const char* space, std::string_view name) {
  for (const xmlNode* c = node->children; c != nullptr; c = c->next) {
    if (is(c, space, name)) return c;
  }
  return nullptr;
}

void walk(const xmlNode* node, const std::function<void(const xmlNode*)>& visit) {
  for (; node != nullptr; node = node->next) {
    if (node->type != XML_ELEMENT_NODE) continue;
    visit(node);
    walk(node->children, visit);
  }
}

void walk(const ReadDcc& dcc, const std::function<void(const xmlNode*)>& visit) {
  walk(xmlDocGetRootElement(dcc.tree.get()), visit);
}

std::vector<std::string> words(const xmlNode* node) {
  std::vector<std::string> list;
  if (node != nullptr) append_words(text_of(node), list);
  return list;
}

std::vector<double> values(const xmlNode* node) {
  std::vector<double> list;
  for (const std::string& word : words(node)) {
    double value = std::numeric_limits<double>::quiet_NaN();
    std::from_chars(word.data(), word.data() + word.size(), value);
    list.push_back(value);
  }
  return list;
}

/// Of the dcc:quantity that a value stands in.
std::string ref_type_above(const xmlNode* node) {
  while (node != nullptr && !is(node, kDcc, "quantity")) node = node->parent;
  return node == nullptr ? std::string{} : attribute(node, "refType");
}

double first_value(const xmlNode* node) {
  const std::vector<double> list = values(node);
  return list.empty() ? std::numeric_limits<double>::quiet_NaN() : list.front();
}

XmlReal read_real(const xmlNode* node) {
  XmlReal real{ref_type_above(node), first_value(child(node, kSi, "value")), 0};
  walk(node->children, [&](const xmlNode* n) {
    if (is(n, kSi, "valueExpandedMU")) real.expanded = first_value(n);
  });
  return real;
}

XmlList read_list(const xmlNode* node) {
  XmlList list;
  list.ref_type = ref_type_above(node);
  list.labels = words(child(node, kSi, "labelXMLList"));
  list.values = values(child(node, kSi, "valueXMLList"));
  if (const xmlNode* unit = child(node, kSi, "unitXMLList")) list.unit = text_of(unit);
  walk(node->children, [&](const xmlNode* n) {
    if (is(n, kSi, "valueExpandedMUXMLList")) list.expanded = values(n);
  });
  return list;
}

/// Collects "line 12: …".
void collect(void* closure, xmlErrorPtr error) {
  std::string message = error->message == nullptr ? "" : error->message;
  while (!message.empty() && message.back() == '\n') message.pop_back();
  static_cast<std::vector<std::string>*>(closure)->push_back(
      fmt::format("line {}: {}", error->line, message));
}

std::string place(const xmlNode* node) {
  return fmt::format("line {}, {}", xmlGetLineNo(node), view(node->name));
}

}  // namespace

std::string ReadDcc::hash(std::string_view ref_type) const {
  const auto it = std::find_if(hashes.begin(), hashes.end(),
                               [&](const auto& entry) { return entry.first == ref_type; });
  return it == hashes.end() ? std::string{} : it->second;
}

const XmlList* ReadDcc::list(std::string_view first_label, std::string_view unit) const {
  const auto it = std::find_if(lists.begin(), lists.end(), [&](const XmlList& l) {
    return !l.labels.empty() && l.labels.front() == first_label && l.unit == unit;
  });
  return it == lists.end() ? nullptr : &*it;
}

const XmlList* ReadDcc::list_of(std::string_view ref_type) const {
  const auto it = std::find_if(lists.begin(), lists.end(),
                               [&](const XmlList& l) { return l.ref_type == ref_type; });
  return it == lists.end() ? nullptr : &*it;
}

Result<ReadDcc> read_dcc(std::string_view xml, const std::string& name) {
  ReadDcc dcc;
  const std::unique_ptr<xmlParserCtxt, void (*)(xmlParserCtxt*)> parser(xmlNewParserCtxt(),
                                                                        xmlFreeParserCtxt);
  dcc.tree.reset(xmlCtxtReadMemory(parser.get(), xml.data(), static_cast<int>(xml.size()),
                                   name.c_str(), nullptr,
                                   XML_PARSE_NONET | XML_PARSE_NOERROR | XML_PARSE_NOWARNING));
  if (!dcc.tree) {
    std::vector<std::string> errors;
    if (xmlErrorPtr error = xmlCtxtGetLastError(parser.get())) collect(&errors, error);
    return fail(ErrorCode::input, fmt::format("{}: not well-formed XML: {}", name,
                                              errors.empty() ? "empty" : errors.front()));
  }
  const xmlNode* root = xmlDocGetRootElement(dcc.tree.get());
  if (root == nullptr || !is(root, kDcc, "digitalCalibrationCertificate")) {
    return fail(ErrorCode::input, name + ": is not a digital calibration certificate (DCC)");
  }
  constexpr std::string_view kPrefix = "sha256:";
  walk(dcc, [&](const xmlNode* node) {
    if (is(node, kDcc, "uniqueIdentifier")) dcc.id = text_of(node);
    if (is(node, kSi, "realListXMLList")) dcc.lists.push_back(read_list(node));
    if (is(node, kSi, "real")) dcc.reals.push_back(read_real(node));
    if (is(node, kDcc, "conformity")) dcc.conformity = text_of(node);
    if (!is(node, kDcc, "identification")) return;
    const xmlNode* value = child(node, kDcc, "value");
    const std::string text = value == nullptr ? "" : text_of(value);
    if (text.starts_with(kPrefix)) {
      dcc.hashes.emplace_back(attribute(node, "refType"), text.substr(kPrefix.size()));
    }
  });
  return dcc;
}

Result<void> check_schema(const ReadDcc& dcc, const std::filesystem::path& schema,
                          VerifyReport& report) {
  std::error_code ignored;
  const std::filesystem::path file =
      std::filesystem::is_directory(schema, ignored) ? schema / "v3.3.0" / "dcc.xsd" : schema;
  if (!std::filesystem::exists(file, ignored)) {
    return fail(ErrorCode::input, file.string() +
                                      ": there is no such schema; see scripts/setup "
                                      "for where it is published");
  }
  std::vector<std::string> errors;
  // A schema that refers to the network instead of its neighbours is refused, not fetched.
  xmlSetExternalEntityLoader(xmlNoNetExternalEntityLoader);
  const std::unique_ptr<xmlSchemaParserCtxt, void (*)(xmlSchemaParserCtxt*)> parser(
      xmlSchemaNewParserCtxt(file.c_str()), xmlSchemaFreeParserCtxt);
  xmlSchemaSetParserStructuredErrors(parser.get(), collect, &errors);
  const std::unique_ptr<xmlSchema, void (*)(xmlSchema*)> parsed(xmlSchemaParse(parser.get()),
                                                                xmlSchemaFree);
  if (!parsed) {
    return fail(ErrorCode::input, fmt::format("{}: not a usable schema: {}", file.string(),
                                              errors.empty() ? "unknown reason" : errors.front()));
  }
  errors.clear();
  const std::unique_ptr<xmlSchemaValidCtxt, void (*)(xmlSchemaValidCtxt*)> validator(
      xmlSchemaNewValidCtxt(parsed.get()), xmlSchemaFreeValidCtxt);
  xmlSchemaSetValidStructuredErrors(validator.get(), collect, &errors);
  const int outcome = xmlSchemaValidateDoc(validator.get(), dcc.tree.get());
  if (outcome == 0) {
    report.good("valid against the schema " + file.string());
    return {};
  }
  if (errors.empty()) errors.push_back("the validator gave up");
  for (const std::string& error : errors) {
    report.bad("valid against the schema " + file.string() + ": " + error);
  }
  return {};
}

namespace {

void check_lists(const ReadDcc& dcc, std::vector<std::string>& wrong) {
  walk(dcc, [&](const xmlNode* node) {
    if (!is(node, kSi, "realListXMLList")) return;
    const XmlList list = read_list(node);
    const std::size_t n = list.values.size();
    const auto fits = [&](std::size_t size, bool may_be_one) {
      return size == n || size == 0 || (may_be_one && size == 1);
    };
    if (n == 0) wrong.push_back(place(node) + ": holds no values");
    if (!fits(list.labels.size(), false)) {
      wrong.push_back(
          fmt::format("{}: {} labels for {} values", place(node), list.labels.size(), n));
    }
    if (!fits(words(child(node, kSi, "unitXMLList")).size(), true)) {
      wrong.push_back(place(node) + ": as many units as values, or one");
    }
    walk(node->children, [&](const xmlNode* part) {
      const std::string_view name = view(part->name);
      if (name == "valueExpandedMUXMLList" || name == "valueStandardMUXMLList" ||
          name == "coverageFactorXMLList" || name == "coverageProbabilityXMLList" ||
          name == "distributionXMLList") {
        const bool may_be_one = !name.starts_with("value");
        if (!fits(words(part).size(), may_be_one)) {
          wrong.push_back(
              fmt::format("{}: {} entries for {} values", place(part), words(part).size(), n));
        }
      }
    });
  });
}

/// Units below `node`, one word each.
std::vector<std::string> units_below(const xmlNode* node) {
  std::vector<std::string> units;
  walk(node->children, [&](const xmlNode* n) {
    if (is(n, kSi, "unitXMLList")) {
      for (std::string& unit : words(n)) units.push_back(std::move(unit));
    } else if (is(n, kSi, "unit")) {
      units.push_back(text_of(n));
    }
  });
  return units;
}

bool inside(const xmlNode* node, const char* space, std::string_view name) {
  for (const xmlNode* n = node->parent; n != nullptr; n = n->parent) {
    if (is(n, space, name)) return true;
  }
  return false;
}

void check_units(const ReadDcc& dcc, std::vector<std::string>& wrong) {
  walk(dcc, [&](const xmlNode* node) {
    if (is(node, kSi, "hybrid")) {
      const auto units = units_below(node);
      if (std::none_of(units.begin(), units.end(), is_dsi_unit)) {
        wrong.push_back(place(node) + ": no form in SI units");
      }
      return;
    }
    const bool list = is(node, kSi, "realListXMLList");
    if ((!list && !is(node, kSi, "real")) || inside(node, kSi, "hybrid")) return;
    for (const std::string& unit : units_below(node)) {
      if (!is_dsi_unit(unit)) {
        wrong.push_back(fmt::format("{}: \"{}\" is not a unit of the D-SI", place(node), unit));
      }
    }
  });
}

void check_languages(const ReadDcc& dcc, std::vector<std::string>& wrong) {
  std::set<std::string> declared;
  walk(dcc, [&](const xmlNode* node) {
    if (is(node, kDcc, "usedLangCodeISO639_1") && !declared.insert(text_of(node)).second) {
      wrong.push_back(fmt::format("{}: {} is declared twice", place(node), text_of(node)));
    }
  });
  walk(dcc, [&](const xmlNode* node) {
    const std::string language = attribute(node, "lang");
    if (!language.empty() && declared.count(language) == 0) {
      wrong.push_back(fmt::format("{}: language {} is not declared", place(node), language));
    }
    // The same text cannot stand twice in one language.
    std::set<std::string> seen;
    for (const xmlNode* c = node->children; c != nullptr; c = c->next) {
      if (!is(c, kDcc, "content") || attribute(c, "lang").empty()) continue;
      if (!seen.insert(attribute(c, "lang")).second) {
        wrong.push_back(place(c) + ": a second text in the same language");
      }
    }
  });
}

void check_methods(const ReadDcc& dcc, std::vector<std::string>& wrong) {
  walk(dcc, [&](const xmlNode* node) {
    if (!is(node, kDcc, "quantity") || !inside(node, kDcc, "results")) return;
    // Limits and the like are data about a result, not results.
    if (inside(node, kDcc, "measurementMetaData")) return;
    if (child(node, kDcc, "usedMethods") == nullptr) {
      wrong.push_back(place(node) + ": without usedMethods");
    }
  });
}

void check_uncertainties(const ReadDcc& dcc, std::vector<std::string>& wrong) {
  static const std::set<std::string_view> kDeprecated = {"expandedUnc",
                                                         "coverageInterval",
                                                         "expandedUncXMLList",
                                                         "coverageIntervalXMLList",
                                                         "ellipsoidalRegionXMLList",
                                                         "rectangularRegionXMLList"};
  walk(dcc, [&](const xmlNode* node) {
    if (node->ns != nullptr && view(node->ns->href) == kSi &&
        kDeprecated.count(view(node->name)) > 0) {
      wrong.push_back(place(node) + ": a deprecated form of uncertainty");
    }
    if (is(node, kSi, "expandedMU") && !is(node->parent, kSi, "measurementUncertaintyUnivariate")) {
      wrong.push_back(place(node) + ": stands outside measurementUncertaintyUnivariate");
    }
  });
}

}  // namespace

void check_rules(const ReadDcc& dcc, VerifyReport& report) {
  using Rule = void (*)(const ReadDcc&, std::vector<std::string>&);
  constexpr std::pair<const char*, Rule> kRules[] = {
      {"lists have equal lengths", check_lists},
      {"units are those of the D-SI", check_units},
      {"languages are declared once", check_languages},
      {"every result names its method", check_methods},
      {"uncertainties have their present form", check_uncertainties}};
  for (const auto& [text, rule] : kRules) {
    std::vector<std::string> wrong;
    rule(dcc, wrong);
    if (wrong.empty()) report.good(text);
    for (const std::string& line : wrong) report.bad(std::string(text) + ": " + line);
  }
}

}  // namespace plumbline::app
