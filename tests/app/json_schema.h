// JSON Schema validation with an independent validator.
#pragma once

#include <string>

namespace plumbline::app {

/// What in `json` breaks app/io/schema/NAME.schema.json; empty when nothing does.
std::string schema_violations(const std::string& name, const std::string& json);

}  // namespace plumbline::app
