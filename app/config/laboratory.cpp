#include "app/config/laboratory.h"

#include <fmt/format.h>

#include <array>
#include <cctype>
#include <cstdio>

#include "rig/strict_toml.h"

namespace plumbline::app {
namespace {

using rig::StrictTable;

/// One line without spaces at the ends, as the schema of the digital certificate wants its texts.
std::string line_or_nothing(StrictTable& table, const char* key) {
  std::string text = table.text_or(key, "");
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20) c = ' ';
  }
  const std::size_t first = text.find_first_not_of(' ');
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(' ') - first + 1);
}

Address read_address(StrictTable& table) {
  Address address{.name = line_or_nothing(table, "name"),
                  .street = line_or_nothing(table, "street"),
                  .city = line_or_nothing(table, "city"),
                  .post_code = line_or_nothing(table, "post_code"),
                  .country = line_or_nothing(table, "country"),
                  .email = line_or_nothing(table, "email"),
                  .phone = line_or_nothing(table, "phone")};
  const std::string& code = address.country;
  const bool good =
      code.empty() || (code.size() == 2 && std::isupper(static_cast<unsigned char>(code[0])) != 0 &&
                       std::isupper(static_cast<unsigned char>(code[1])) != 0);
  if (!good) {
    table.refuse("country", fmt::format("\"{}\" is not a country code of two capital letters "
                                        "(ISO 3166-1, \"UA\" for instance)",
                                        code));
  }
  return address;
}

bool is_date(const std::string& text) {
  int year = 0, month = 0, day = 0, used = 0;
  if (text.size() != 10 ||
      std::sscanf(text.c_str(), "%4d-%2d-%2d%n", &year, &month, &day, &used) != 3 || used != 10) {
    return false;
  }
  constexpr std::array kDays = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  if (year < 1 || month < 1 || month > 12 || day < 1) return false;
  const bool leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
  return day <= kDays[static_cast<std::size_t>(month - 1)] + (leap && month == 2 ? 1 : 0);
}

std::string read_date(StrictTable& table, const char* key) {
  std::string text = line_or_nothing(table, key);
  if (!text.empty() && !is_date(text)) {
    table.refuse(key, fmt::format("\"{}\" is not a date like \"2026-01-31\"", text));
  }
  return text;
}

TraceabilitySource read_source(StrictTable table) {
  return {line_or_nothing(table, "statement"), line_or_nothing(table, "certificate")};
}

}  // namespace

std::string Address::place() const {
  std::string town = post_code;
  if (!city.empty()) town += (town.empty() ? "" : " ") + city;
  std::string text;
  for (const std::string& part : {street, town, country}) {
    if (!part.empty()) text += (text.empty() ? "" : ", ") + part;
  }
  return text;
}

Result<Laboratory> parse_laboratory(std::string_view text, const std::string& name) {
  auto file = rig::StrictFile::parse(text, name);
  if (!file) return fail(file.error());
  StrictTable root = file->root();
  Laboratory lab;
  StrictTable laboratory = root.table("laboratory");
  lab.laboratory = read_address(laboratory);
  lab.accreditation = line_or_nothing(laboratory, "accreditation");
  lab.location =
      laboratory.choice_or("location", lab.location,
                           {std::begin(kPerformanceLocations), std::end(kPerformanceLocations)});
  StrictTable certificate = root.table("certificate");
  lab.number = line_or_nothing(certificate, "number");
  StrictTable customer = root.table("customer");
  lab.customer = read_address(customer);
  lab.order = line_or_nothing(customer, "order");
  StrictTable item = root.table("item");
  lab.manufacturer = line_or_nothing(item, "manufacturer");
  lab.item_condition = line_or_nothing(item, "condition");
  lab.customer_item = line_or_nothing(item, "customer_number");
  StrictTable dates = root.table("dates");
  lab.received = read_date(dates, "received");
  lab.performed_from = read_date(dates, "performed_from");
  lab.performed_to = read_date(dates, "performed_to");
  if (!lab.performed_from.empty() && !lab.performed_to.empty() &&
      lab.performed_to < lab.performed_from) {
    dates.refuse("performed_to", fmt::format("{} is before performed_from = {}", lab.performed_to,
                                             lab.performed_from));
  }
  StrictTable traceability = root.table("traceability");
  lab.head = read_source(traceability.table("head"));
  lab.gravity = read_source(traceability.table("gravity"));
  StrictTable procedure = root.table("procedure");
  lab.procedure = line_or_nothing(procedure, "name");
  lab.deviations = line_or_nothing(procedure, "deviations");
  StrictTable conditions = root.table("conditions");
  lab.ambient = line_or_nothing(conditions, "ambient");
  StrictTable authorised = root.table("authorised_by");
  lab.authorised_by = line_or_nothing(authorised, "name");
  lab.authorised_role = line_or_nothing(authorised, "role");
  StrictTable signature = root.table("signature");
  lab.signing_key = signature.text_or("key", "");
  lab.signing_certificate = signature.text_or("certificate", "");
  if (lab.signing_key.empty() != lab.signing_certificate.empty()) {
    signature.refuse(lab.signing_key.empty() ? "certificate" : "key",
                     "key and certificate go together");
  }
  if (auto done = file->finish(); !done) return fail(done.error());
  return lab;
}

Result<Laboratory> read_laboratory(const std::filesystem::path& path) {
  const auto file = rig::StrictFile::read(path);
  if (!file) return fail(file.error());
  auto lab = parse_laboratory(file->source(), path.string());
  if (lab && !lab->signing_key.empty()) {
    lab->signing_key = path.parent_path() / lab->signing_key;
    lab->signing_certificate = path.parent_path() / lab->signing_certificate;
  }
  return lab;
}

}  // namespace plumbline::app
