#include "tests/app/json_schema.h"

#include <nlohmann/json.hpp>
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validation_results.hpp>
#include <valijson/validator.hpp>

#include "tests/app/temp_folder.h"

namespace plumbline::app {

std::string schema_violations(const std::string& name, const std::string& json) {
  const auto schema_json = nlohmann::json::parse(
      text_of(std::string(PLUMBLINE_SOURCE_DIR) + "/app/io/schema/" + name + ".schema.json"));
  const auto document = nlohmann::json::parse(json);
  valijson::Schema schema;
  valijson::SchemaParser parser(valijson::SchemaParser::kDraft7);
  parser.populateSchema(valijson::adapters::NlohmannJsonAdapter(schema_json), schema);
  valijson::Validator validator(valijson::Validator::kStrongTypes);
  valijson::ValidationResults results;
  validator.validate(schema, valijson::adapters::NlohmannJsonAdapter(document), &results);
  std::string violations;
  for (const auto& error : results) {
    for (const std::string& step : error.context) violations += step;
    violations += ": " + error.description + "\n";
  }
  return violations;
}

}  // namespace plumbline::app
