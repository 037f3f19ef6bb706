#include "app/io/read_file.h"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <system_error>

namespace plumbline::app {

Result<std::string> read_file(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    return fail(ErrorCode::input, path.string() + ": is a folder, not a file");
  }
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  std::string text;
  std::array<char, 1 << 16> block;
  while (stream.read(block.data(), std::ssize(block)), stream.gcount() > 0)
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
  if (!stream.is_open() || stream.bad()) {
    return fail(ErrorCode::input,
                fmt::format("{}: {}", path.string(), std::generic_category().message(errno)));
  }
  return text;
}

}  // namespace plumbline::app
