#include "rig/sim/ready_file.h"

#include <fmt/format.h>

#include <unistd.h>

#include <fstream>
#include <system_error>

#include "rig/toml.h"

namespace plumbline::sim {

Result<void> write_ready_file(const std::filesystem::path& path, const std::string& modbus,
                              const std::string& can) {
  std::filesystem::path draft = path;
  draft += fmt::format(".{}", ::getpid());
  std::ofstream file(draft);
  const toml::table endpoints{{"modbus", modbus}, {"can", can}};
  // Plain double quotes, for readers that are simpler than a TOML parser.
  file << toml::toml_formatter(endpoints, toml::toml_formatter::default_flags &
                                              ~toml::format_flags::allow_literal_strings)
       << '\n';
  file.close();
  std::error_code error;
  if (file) {
    std::filesystem::rename(draft, path, error);
    if (!error) return {};
  }
  std::error_code ignored;
  std::filesystem::remove(draft, ignored);
  return fail(ErrorCode::output,
              fmt::format("{}: the ready file cannot be written; is its folder there and writable?",
                          path.string()));
}

}  // namespace plumbline::sim
