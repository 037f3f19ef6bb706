// The numbers of a certificate.xml beside those of the result.json that it was made from.
#pragma once

#include <string>

namespace plumbline::app {

/// Every value of every dcc:result equals that of result.json, with twice its standard uncertainty;
/// what differs, what only one of them says, and results that are not known here fail the test.
void expect_numbers_of_result(const std::string& xml, const std::string& result_json);

}  // namespace plumbline::app
