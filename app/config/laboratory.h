// Reads lab.toml: what a certificate says about people and papers, and no measurement knows.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "estimator/measurement.h"

namespace plumbline::app {

/// An empty text was not stated; it is printed as missing.
struct Address {
  std::string name;
  std::string street;
  std::string city;
  std::string post_code;
  std::string country;  ///< ISO 3166-1, two capital letters
  std::string email;
  std::string phone;

  /// "Street 1, 01001 Kyiv, UA": what is known of the place; empty when nothing is.
  std::string place() const;
};

/// What a quantity is traced to: the certificate that says so.
struct TraceabilitySource {
  std::string statement;    ///< in words
  std::string certificate;  ///< its number
};

/// Where the calibration was done, as the DCC spells it.
inline constexpr const char* kPerformanceLocations[] = {
    "laboratory", "customer", "laboratoryBranch", "customerBranch", "other"};

struct Laboratory {
  Address laboratory;
  std::string accreditation;  ///< number of the laboratory's accreditation
  std::string location;
  std::string number;  ///< of the certificate in the laboratory's own books
  Address customer;
  std::string order;           ///< the customer's order
  std::string manufacturer;    ///< of the item
  std::string item_condition;  ///< as received
  std::string customer_item;   ///< the customer's own number of the item
  std::string received;        ///< dates as 2026-01-31
  std::string performed_from;
  std::string performed_to;
  TraceabilitySource head;     ///< angles
  TraceabilitySource gravity;  ///< local g
  std::string procedure;
  std::string deviations;  ///< from the procedure
  std::string ambient;     ///< conditions in the room, in words: humidity, pressure
  std::string authorised_by;
  std::string authorised_role;
  std::filesystem::path signing_key;  ///< PEM; empty: certificate.xml is not signed
  std::filesystem::path signing_certificate;
};

/// Every key is optional. Refused with file, line and column: unknown keys, countries that are not
/// two capital letters, dates that are none or in the wrong order, a key without certificate. Paths
/// are relative to the folder of the file.
Result<Laboratory> read_laboratory(const std::filesystem::path& path);
Result<Laboratory> parse_laboratory(std::string_view text, const std::string& name);

}  // namespace plumbline::app
