// When a document is issued.
#pragma once

#include <string>

namespace plumbline::app {

/// Now, or what SOURCE_DATE_EPOCH in the environment says (reproducible-builds.org), so that the
/// same input can give the same bytes; as "2026-01-31T12:34:56Z".
std::string issue_time_utc();

}  // namespace plumbline::app
