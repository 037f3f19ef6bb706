// dcc:administrativeData: who, what, when, and the hashes that tie the documents together.
#include <fmt/format.h>

#include <filesystem>

#include "app/certificate/dcc/dcc_parts.h"
#include "app/certificate/dcc/signature.h"

namespace plumbline::app::dcc {
namespace {

std::string or_not_stated(const Context& c, const std::string& text) {
  return text.empty() ? c.document.words.missing : text;
}

void add_software(const XmlElement& parent) {
  const XmlElement software = parent.add("dcc:software");
  software.add("dcc:name").add("dcc:content", "plumbline");
  software.add("dcc:release", program_version());
  software.add("dcc:type", "application");
}

void add_identification(const Context& c, const XmlElement& list, const char* ref_type,
                        const char* issuer, const std::string& value, const std::string& name) {
  const XmlElement identification = list.add("dcc:identification");
  identification.attribute("refType", ref_type);
  identification.add("dcc:issuer", issuer);
  identification.add("dcc:value", value);
  c.text(identification, "dcc:name", name);
}

void add_hashes(const Context& c, const XmlElement& core) {
  const XmlElement list = core.add("dcc:identifications");
  const auto hash = [&](const char* ref_type, const std::string& value, const std::string& name) {
    if (value.empty()) return;
    add_identification(c, list, ref_type, "calibrationLaboratory", "sha256:" + value, name);
  };
  hash(dcc_ref::kSelf, kNoHash, c.tr("this file, with zeros in this place"));
  hash(dcc_ref::kWords, c.document.fingerprint, c.tr("words of the certificate"));
  hash(dcc_ref::kResult, c.input.result_sha256, "result.json");
  hash(dcc_ref::kHtml, c.siblings.html_sha256, "certificate.html");
  hash(dcc_ref::kPdf, c.siblings.pdf_pages_sha256, c.tr("pages of certificate.pdf"));
  for (const auto& [name, value] : c.input.provenance.input_sha256) {
    hash(dcc_ref::kInput, value, std::filesystem::path(name).filename().string());
  }
  hash(dcc_ref::kChain, c.input.provenance.chain_head, c.tr("Last link of the run's hash chain"));
  if (c.input.signing != nullptr) {
    hash(dcc_ref::kSigner, c.input.signing->certificate_sha256,
         c.tr("certificate of the key that signs this file"));
  }
  const Laboratory& lab = c.input.laboratory;
  if (!lab.number.empty()) {
    add_identification(c, list, dcc_ref::kNumber, "calibrationLaboratory", lab.number,
                       c.tr("Number of the certificate"));
  }
  if (!lab.order.empty()) {
    add_identification(c, list, dcc_ref::kOrder, "customer", lab.order, c.tr("Customer's order"));
  }
}

void add_core_data(const Context& c, const XmlElement& parent) {
  const Laboratory& lab = c.input.laboratory;
  const XmlElement core = parent.add("dcc:coreData");
  core.add("dcc:countryCodeISO3166_1",
           lab.laboratory.country.empty() ? kUnknownCountry : lab.laboratory.country);
  core.add("dcc:usedLangCodeISO639_1", code_of(c.tr.language()));
  core.add("dcc:mandatoryLangCodeISO639_1", code_of(c.tr.language()));
  core.add("dcc:uniqueIdentifier", c.document.id);
  add_hashes(c, core);
  if (!lab.received.empty()) core.add("dcc:receiptDate", lab.received);
  // The schema wants dates of performance. Unknown ones are the day of evaluation, and a statement
  // says so.
  PerformanceDates dates = performance_dates(c.input);
  const std::string issued = c.input.provenance.created_utc.substr(0, 10);
  if (dates.from.empty()) dates = {issued, issued};
  core.add("dcc:beginPerformanceDate", dates.from);
  core.add("dcc:endPerformanceDate", dates.to);
  core.add("dcc:performanceLocation", lab.location.empty() ? "other" : lab.location);
  core.add("dcc:issueDate", issued);
}

void add_items(const Context& c, const XmlElement& parent) {
  const RunDescription& run = c.input.description;
  const Laboratory& lab = c.input.laboratory;
  const XmlElement item = parent.add("dcc:items").add("dcc:item");
  c.text(item, "dcc:name", c.tr("accelerometer triad"));
  if (!lab.item_condition.empty()) {
    c.text(item, "dcc:description", c.tr("Condition of the item") + ": " + lab.item_condition);
  }
  if (!lab.manufacturer.empty()) {
    c.text(item.add("dcc:manufacturer"), "dcc:name", lab.manufacturer);
  }
  if (!run.dut.model.empty()) item.add("dcc:model", run.dut.model);
  const XmlElement list = item.add("dcc:identifications");
  add_identification(c, list, "basic_serialNumber", "manufacturer",
                     or_not_stated(c, run.dut.serial), c.tr("Serial number"));
  if (!lab.customer_item.empty()) {
    add_identification(c, list, "basic_customerAsset", "customer", lab.customer_item,
                       c.tr("Customer's number of the item"));
  }
}

void add_contact(const Context& c, const XmlElement& contact, const Address& address) {
  c.text(contact, "dcc:name", or_not_stated(c, address.name));
  if (!address.email.empty()) contact.add("dcc:eMail", address.email);
  if (!address.phone.empty()) contact.add("dcc:phone", address.phone);
  const XmlElement location = contact.add("dcc:location");
  if (address.place().empty()) {
    c.text(location, "dcc:further", c.document.words.missing);
    return;
  }
  if (!address.street.empty()) location.add("dcc:street", address.street);
  if (!address.post_code.empty()) location.add("dcc:postCode", address.post_code);
  if (!address.city.empty()) location.add("dcc:city", address.city);
  if (!address.country.empty()) location.add("dcc:countryCode", address.country);
}

void add_statement(const Context& c, const XmlElement& list, const char* ref_type,
                   const std::string& text) {
  const XmlElement statement = list.add("dcc:statement");
  statement.attribute("refType", ref_type);
  c.text(statement, "dcc:declaration", text);
}

void add_traceability(const Context& c, const XmlElement& list, const std::string& what,
                      const TraceabilitySource& source) {
  const bool stated = !source.statement.empty() || !source.certificate.empty();
  const XmlElement statement = list.add("dcc:statement");
  statement.attribute("refType", "basic_metrologicallyTraceableToSI");
  if (!source.certificate.empty()) statement.add("dcc:reference", source.certificate);
  std::string text = what + ": " + or_not_stated(c, source.statement);
  if (stated && !source.certificate.empty()) {
    text += ", " + c.tr("certificate {}", source.certificate);
  }
  c.text(statement, "dcc:declaration", text);
}

void add_statements(const Context& c, const XmlElement& parent) {
  const Laboratory& lab = c.input.laboratory;
  const XmlElement list = parent.add("dcc:statements");
  add_statement(c, list, "plumbline_verdict", c.document.headline);
  for (const std::string& sentence : c.document.summary) {
    add_statement(c, list, "plumbline_summary", sentence);
  }
  if (c.input.scalar == nullptr) {
    add_traceability(c, list, c.tr("Traceability of the angles"), lab.head);
  }
  add_traceability(c, list, c.tr("Traceability of gravity"), lab.gravity);
  if (!lab.ambient.empty()) {
    add_statement(c, list, "plumbline_ambientConditions",
                  c.tr("Conditions in the room") + ": " + lab.ambient);
  }
  add_statement(c, list, "plumbline_relatesToItemOnly", c.document.colophon);
  if (performance_dates(c.input).from.empty()) {
    add_statement(c, list, "plumbline_datesNotStated",
                  c.tr("The dates of performance were not stated; the day of the evaluation stands "
                       "in their place."));
  }
  if (lab.location.empty()) {
    add_statement(c, list, "plumbline_locationNotStated",
                  c.tr("The place of calibration was not stated; “other” stands in its place."));
  }
  if (lab.laboratory.country.empty()) {
    add_statement(c, list, "plumbline_countryNotStated",
                  c.tr("The country of the laboratory was not stated; {} stands in its place.",
                       kUnknownCountry));
  }
}

}  // namespace

void add_administrative_data(const Context& c, const XmlElement& root) {
  const Laboratory& lab = c.input.laboratory;
  const XmlElement data = root.add("dcc:administrativeData");
  add_software(data.add("dcc:dccSoftware"));
  add_core_data(c, data);
  add_items(c, data);
  const XmlElement laboratory = data.add("dcc:calibrationLaboratory");
  if (!lab.accreditation.empty()) {
    laboratory.add("dcc:calibrationLaboratoryCode", lab.accreditation);
  }
  add_contact(c, laboratory.add("dcc:contact"), lab.laboratory);
  const XmlElement person = data.add("dcc:respPersons").add("dcc:respPerson");
  c.text(person.add("dcc:person"), "dcc:name", or_not_stated(c, lab.authorised_by));
  if (!lab.authorised_role.empty()) person.add("dcc:role", lab.authorised_role);
  person.add("dcc:mainSigner", "true");
  if (c.input.signing != nullptr) person.add("dcc:cryptElectronicSeal", "true");
  add_contact(c, data.add("dcc:customer"), lab.customer);
  add_statements(c, data);
}

}  // namespace plumbline::app::dcc
