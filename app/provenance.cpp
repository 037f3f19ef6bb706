#include "app/provenance.h"

#include <fmt/chrono.h>

#include <ctime>

namespace plumbline::app {

std::string program_version() { return PLUMBLINE_VERSION; }

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(now));
}

}  // namespace plumbline::app
