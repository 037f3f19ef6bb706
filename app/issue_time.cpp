#include "app/issue_time.h"

#include <fmt/chrono.h>

#include <charconv>
#include <cstdlib>
#include <ctime>
#include <string_view>

#include "app/provenance.h"

namespace plumbline::app {

std::string issue_time_utc() {
  const char* fixed = std::getenv("SOURCE_DATE_EPOCH");
  if (fixed == nullptr) return utc_now();
  std::int64_t seconds = 0;
  const char* end = fixed + std::string_view(fixed).size();
  const auto [stop, error] = std::from_chars(fixed, end, seconds);
  // Anything but a whole number in the range of four-digit years is not a date.
  constexpr std::int64_t kYear10000 = 253402300800;
  if (error != std::errc{} || stop != end || seconds < 0 || seconds >= kYear10000) return utc_now();
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(static_cast<std::time_t>(seconds)));
}

}  // namespace plumbline::app
