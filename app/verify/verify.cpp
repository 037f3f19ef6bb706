#include "app/verify/verify.h"

#include <fmt/format.h>
#include <libxml/parser.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "app/certificate/dcc/dcc_units.h"
#include "app/certificate/dcc/dcc_writer.h"
#include "app/certificate/dcc/signature.h"
#include "app/certificate/fingerprint.h"
#include "app/certificate/pdf_file.h"
#include "app/certificate/rounding.h"
#include "app/io/json.h"
#include "app/io/read_file.h"
#include "app/io/sha256.h"
#include "app/verify/dcc_reader.h"

namespace plumbline::app {

namespace fs = std::filesystem;

namespace {

std::string_view name_of(const xmlNode* node) { return reinterpret_cast<const char*>(node->name); }

void collect_words(const xmlNode* node, std::vector<std::string>& words) {
  for (; node != nullptr; node = node->next) {
    if (node->type == XML_TEXT_NODE || node->type == XML_CDATA_SECTION_NODE) {
      append_words(reinterpret_cast<const char*>(node->content), words);
    } else if (node->type == XML_ELEMENT_NODE) {
      const std::string_view name = name_of(node);
      if (name == "head" || name == "svg" || name == "footer") continue;
      collect_words(node->children, words);
    }
  }
}

/// What is being verified, as far as it is there.
struct Files {
  std::string xml;
  std::string xml_name;
  std::optional<std::string> html, result;
  std::optional<OpenedPdf> pdf;
  bool is_folder = false;
};

const Attachment* attached_xml(const OpenedPdf& pdf) {
  const auto it = std::find_if(pdf.attachments.begin(), pdf.attachments.end(),
                               [](const Attachment& a) { return a.name == "certificate.xml"; });
  return it == pdf.attachments.end() ? nullptr : &*it;
}

Result<Files> read_pdf(const fs::path& path) {
  const auto bytes = read_file(path);
  if (!bytes) return fail(bytes.error());
  auto pdf = open_pdf(*bytes, path.string());
  if (!pdf) return fail(pdf.error());
  const Attachment* xml = attached_xml(*pdf);
  if (xml == nullptr) {
    return fail(ErrorCode::input, path.string() + ": no certificate.xml is attached to it");
  }
  Files files;
  files.xml = xml->content;
  files.xml_name = path.string() + ", attached certificate.xml";
  files.pdf = *std::move(pdf);
  return files;
}

Result<Files> read_folder(const fs::path& folder) {
  Files files;
  files.is_folder = true;
  files.xml_name = (folder / "certificate.xml").string();
  const auto xml = read_file(folder / "certificate.xml");
  if (!xml) return fail(xml.error());
  files.xml = *xml;
  for (const auto& [name, text] :
       {std::pair("certificate.html", &files.html), std::pair("result.json", &files.result)}) {
    auto content = read_file(folder / name);
    if (!content) return fail(content.error());
    *text = *std::move(content);
  }
  auto pdf = read_pdf(folder / "certificate.pdf");
  if (!pdf) return fail(pdf.error());
  files.pdf = std::move(pdf->pdf);
  return files;
}

Result<Files> read_files(const fs::path& target) {
  std::error_code ignored;
  if (fs::is_directory(target, ignored)) return read_folder(target);
  const auto bytes = read_file(target);
  if (!bytes) return fail(bytes.error());
  if (bytes->starts_with("%PDF-")) return read_pdf(target);
  Files files;
  files.xml = *bytes;
  files.xml_name = target.string();
  return files;
}

void compare_hash(VerifyReport& report, const std::string& what, const std::string& stated,
                  const std::string& found) {
  if (stated.empty()) {
    report.bad(what + ": certificate.xml states no hash of it");
    return;
  }
  report.expect(stated == found, what + ": the hash is that in certificate.xml",
                "it is " + found + ", stated is " + stated);
}

void check_html(const Files& files, const ReadDcc& dcc, VerifyReport& report) {
  compare_hash(report, "certificate.html", dcc.hash(dcc_ref::kHtml), sha256(*files.html));
  const auto words = html_words(*files.html, "certificate.html");
  if (!words) {
    report.bad(words.error().message);
    return;
  }
  compare_hash(report, "the text of certificate.html", dcc.hash(dcc_ref::kWords),
               fingerprint(*words));
  report.expect(!words->empty() && words->front() == dcc.id, "HTML and XML have the same number",
                fmt::format("{} and {}", words->empty() ? "none" : words->front(), dcc.id));
}

/// Calibrated parameters of result.json, in the unit and the order of one list of the XML.
struct Parameters {
  std::vector<double> values;
  std::vector<double> u;
  double printed = 1e3;  ///< the HTML prints them times this
};

void compare_parameters(const Parameters& stated, const XmlList* list, const std::string& name,
                        const std::vector<std::string>* words, VerifyReport& report) {
  const std::string what = "XML and result.json agree in " + name;
  if (list == nullptr) {
    report.bad(what + ": the XML has no such list");
    return;
  }
  std::vector<double> doubled = stated.u;
  for (double& u : doubled) u *= 2;
  report.expect(list->values == stated.values && list->expanded == doubled, what,
                "the numbers differ");
  if (words == nullptr) return;
  for (std::size_t k = 0; k < list->values.size() && k < list->expanded.size(); ++k) {
    const RoundedResult printed =
        round_result(stated.printed * list->values[k], stated.printed * list->expanded[k]);
    const bool found = std::find(words->begin(), words->end(), printed.value) != words->end();
    if (!found) report.bad(fmt::format("HTML prints {} of {}: not found", printed.value, name));
  }
}

void check_twelve(const Json& fit, const ReadDcc& dcc, const std::vector<std::string>* words,
                  VerifyReport& report) {
  Parameters offsets;
  for (const char* axis : kAxisName) {
    const Json& row = fit.at(axis);
    compare_parameters({row.at("K_V_per_g").get<std::vector<double>>(),
                        row.at("u_K_V_per_g").get<std::vector<double>>()},
                       dcc.list(fmt::format("K_{}x", axis), dsi::kVoltPerG),
                       fmt::format("K_{0}x, K_{0}y, K_{0}z", axis), words, report);
    offsets.values.push_back(row.at("U0_V").get<double>());
    offsets.u.push_back(row.at("u_U0_V").get<double>());
  }
  compare_parameters(offsets, dcc.list("U_x0", dsi::kVolt), "U_x0, U_y0, U_z0", words, report);
}

/// Of a calibration without angles.
void check_nine(const Json& scalar, const ReadDcc& dcc, const std::vector<std::string>* words,
                VerifyReport& report) {
  const Json& fit = scalar.contains("with_effects") ? scalar.at("with_effects") : scalar;
  const ReadingUnits units = reading_units(scalar.at("reading_unit").get<std::string>());
  const auto times = [](std::vector<double> values, double factor) {
    for (double& value : values) value *= factor;
    return values;
  };
  const auto compare = [&](const char* name, double factor, const std::string& unit) {
    compare_parameters(
        {times(fit.at(name).get<std::vector<double>>(), factor),
         times(fit.at(fmt::format("u_{}", name)).get<std::vector<double>>(), factor), 1 / factor},
        dcc.list(fmt::format("{}_x", name), unit), name, words, report);
  };
  compare("bias", units.factor, units.bias);
  compare("scale", 1 / units.factor, units.scale);
  Parameters angles;
  for (const char* name : {"yz", "zy", "zx"}) {
    angles.values.push_back(fit.at("nonorthogonality_rad").at(name).get<double>());
    angles.u.push_back(fit.at("u_nonorthogonality_rad").at(name).get<double>());
  }
  compare_parameters(angles, dcc.list("angle_yz", "\\radian"), "nonorthogonality", words, report);
}

/// Parameters of the added effects, in the order in which both state them.
void check_effects(const Json& diagnosis, const ReadDcc& dcc, VerifyReport& report) {
  std::vector<std::pair<double, double>> stated, found;
  for (const char* kind : {"effects", "unlisted"}) {
    for (const Json& effect : diagnosis.at(kind)) {
      for (const Json& p : effect.at("parameters")) {
        // Units that the D-SI does not know are stated in words.
        const auto unit = dsi_unit(p.at("unit").get<std::string>());
        if (!unit) continue;
        stated.emplace_back(unit->factor * p.at("value").get<double>(),
                            2 * (unit->factor * p.at("u").get<double>()));
      }
    }
  }
  for (const XmlReal& real : dcc.reals) {
    if (real.ref_type == dcc_ref::kEffect) found.emplace_back(real.value, real.expanded);
  }
  report.expect(stated == found, "XML and result.json agree in the added effects",
                "the numbers differ");
}

void check_errors(const Json& error, const ReadDcc& dcc, VerifyReport& report) {
  const auto compare = [&](const std::string& ref_type, const Json& stated) {
    const XmlList* list = dcc.list_of("plumbline_" + ref_type);
    report.expect(list != nullptr && list->values == stated.get<std::vector<double>>(),
                  "XML and result.json agree in " + ref_type, "the numbers differ");
  };
  for (const auto& [phase, suffix] : {std::pair("before", "Before"), std::pair("after", "After")}) {
    compare(fmt::format("heldoutRms{}", suffix), error.at(phase).at("heldout_pose_rms"));
    compare(fmt::format("heldoutMax{}", suffix), error.at(phase).at("heldout_pose_max_abs"));
  }
}

/// "conditional_pass" → "conditionalPass", as the schema has it.
std::string camel_case(const std::string& text) {
  std::string camel;
  for (std::size_t k = 0; k < text.size(); ++k) {
    if (text[k] == '_') continue;
    const bool first = k > 0 && text[k - 1] == '_';
    camel += first ? static_cast<char>(std::toupper(static_cast<unsigned char>(text[k]))) : text[k];
  }
  return camel;
}

void check_decision(const Json& decision, const ReadDcc& dcc, VerifyReport& report) {
  const std::string status = decision.at("status").get<std::string>();
  const std::string stated = status == "none" ? "" : camel_case(status);
  report.expect(dcc.conformity == stated, "XML and result.json agree in the decision",
                fmt::format("“{}” and “{}”", dcc.conformity, stated));
}

void check_numbers(const Files& files, const ReadDcc& dcc, VerifyReport& report) {
  std::optional<std::vector<std::string>> words;
  if (const auto parsed = html_words(*files.html, "certificate.html")) words = *parsed;
  const std::vector<std::string>* const printed = words ? &*words : nullptr;
  try {
    const Json json = Json::parse(*files.result);
    if (json.contains("scalar")) {
      check_nine(json.at("scalar"), dcc, printed, report);
    } else {
      check_twelve(json.at("final").at("batch_ls"), dcc, printed, report);
    }
    check_effects(json.at("diagnosis"), dcc, report);
    check_errors(json.at("error"), dcc, report);
    check_decision(json.at("decision"), dcc, report);
  } catch (const std::exception& error) {
    report.bad(fmt::format("result.json: not usable: {}", error.what()));
  }
}

void check_siblings(const Files& files, const ReadDcc& dcc, VerifyReport& report) {
  if (files.pdf) {
    compare_hash(report, "the pages of certificate.pdf", dcc.hash(dcc_ref::kPdf),
                 files.pdf->pages_sha256);
  }
  if (!files.is_folder) return;
  report.expect(attached_xml(*files.pdf)->content == files.xml,
                "the XML attached to certificate.pdf is certificate.xml", "they differ");
  check_html(files, dcc, report);
  compare_hash(report, "result.json", dcc.hash(dcc_ref::kResult), sha256(*files.result));
  check_numbers(files, dcc, report);
}

Result<void> check_signer(const Files& files, const ReadDcc& dcc,
                          const std::optional<fs::path>& signer, VerifyReport& report) {
  std::string trusted;
  if (signer) {
    auto pem = read_file(*signer);
    if (!pem) return fail(pem.error());
    trusted = *std::move(pem);
    if (trusted.empty()) return fail(ErrorCode::input, signer->string() + ": empty");
  }
  const auto found = check_signature(files.xml, trusted);
  if (!found) {
    return fail(found.error().code,
                (signer ? signer->string() + ": " : "") + found.error().message);
  }
  const std::string stated = dcc.hash(dcc_ref::kSigner);
  if (!found->present) {
    if (signer || !stated.empty()) {
      report.bad("signature: there is none, but one was expected");
    } else {
      report.not_done("signature: the XML has none");
    }
    return {};
  }
  report.expect(found->wrong.empty(),
                found->subject.empty()
                    ? "signature of the whole XML"
                    : fmt::format("signature of the whole XML by {} (certificate valid {}, SHA-256 "
                                  "{})",
                                  found->subject, found->valid, found->certificate_sha256),
                found->wrong);
  report.expect(stated == found->certificate_sha256, "the signer is the one that the XML states",
                stated.empty() ? "it states none" : "stated is " + stated);
  if (found->trusted) {
    report.expect(*found->trusted, "the signer is known by " + signer->string(),
                  "the certificate is another one");
  } else {
    report.not_done("who signed: not checked; name the laboratory's certificate with --signer");
  }
  return {};
}

}  // namespace

Result<std::vector<std::string>> html_words(std::string_view html, const std::string& name) {
  const XmlDocPtr tree(xmlReadMemory(html.data(), static_cast<int>(html.size()), name.c_str(),
                                     "UTF-8",
                                     XML_PARSE_NONET | XML_PARSE_NOERROR | XML_PARSE_NOWARNING));
  if (!tree) return fail(ErrorCode::input, name + ": not well-formed");
  std::vector<std::string> words;
  collect_words(xmlDocGetRootElement(tree.get()), words);
  return words;
}

Result<VerifyReport> verify_certificate(const fs::path& target,
                                        const std::optional<fs::path>& schema,
                                        const std::optional<fs::path>& signer) {
  const auto files = read_files(target);
  if (!files) return fail(files.error());
  const auto dcc = read_dcc(files->xml, files->xml_name);
  if (!dcc) return fail(dcc.error());
  VerifyReport report;
  if (schema) {
    if (auto done = check_schema(*dcc, *schema, report); !done) return fail(done.error());
  } else {
    report.not_done("schema: not checked; name a folder with --schema or PLUMBLINE_DCC_SCHEMA");
  }
  check_rules(*dcc, report);
  compare_hash(report, "certificate.xml", dcc->hash(dcc_ref::kSelf), dcc_self_hash(files->xml));
  check_siblings(*files, *dcc, report);
  if (auto done = check_signer(*files, *dcc, signer, report); !done) return fail(done.error());
  return report;
}

}  // namespace plumbline::app
