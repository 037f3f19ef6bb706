#include "app/io/output_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <system_error>
#include <utility>

namespace plumbline::app {

namespace fs = std::filesystem;

namespace {

tl::unexpected<Error> cannot_write(const fs::path& path, int error_number) {
  return fail(ErrorCode::output, fmt::format("{}: cannot write: {}", path.string(),
                                             std::generic_category().message(error_number)));
}

/// Writes and syncs; an errno value, 0 for success. The sync matters: a full disk may show only
/// there.
int write_file(const fs::path& path, std::string_view content) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) return errno;
  int error = 0;
  while (error == 0 && !content.empty()) {
    const ssize_t written = ::write(file, content.data(), content.size());
    if (written < 0) {
      if (errno != EINTR) error = errno;
    } else {
      content.remove_prefix(static_cast<std::size_t>(written));
    }
  }
  if (error == 0 && ::fsync(file) != 0) error = errno;
  if (::close(file) != 0 && error == 0) error = errno;
  return error;
}

}  // namespace

OutputFolder::OutputFolder(OutputFolder&& other) noexcept
    : folder_(std::move(other.folder_)),
      staging_(std::exchange(other.staging_, {})),
      created_(std::exchange(other.created_, {})) {}

OutputFolder::~OutputFolder() { discard(); }

void OutputFolder::discard() noexcept {
  std::error_code ignored;
  if (!staging_.empty()) fs::remove_all(staging_, ignored);
  staging_.clear();
  for (auto folder = created_.rbegin(); folder != created_.rend(); ++folder) {
    fs::remove(*folder, ignored);
  }
  created_.clear();
}

Result<OutputFolder> OutputFolder::prepare(const fs::path& folder) {
  OutputFolder output;
  output.folder_ = folder.has_filename() ? folder : folder.parent_path();
  std::error_code error;
  std::vector<fs::path> absent;
  for (fs::path path = output.folder_; !path.empty() && !fs::exists(path, error);
       path = path.parent_path()) {
    if (error) return cannot_write(folder, error.value());
    absent.push_back(path);
  }
  for (auto path = absent.rbegin(); path != absent.rend(); ++path) {
    if (!fs::create_directory(*path, error) && error) return cannot_write(folder, error.value());
    output.created_.push_back(*path);
  }
  if (!fs::is_directory(output.folder_, error)) return cannot_write(folder, ENOTDIR);
  std::string pattern = (output.folder_ / ".plumbline-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr) return cannot_write(folder, errno);
  output.staging_ = pattern;
  return output;
}

Result<void> OutputFolder::write(std::string_view name, std::string_view content) const {
  if (const int error = write_file(staged(name), content); error != 0) {
    return cannot_write(folder_ / name, error);
  }
  return {};
}

Result<void> OutputFolder::publish() {
  std::error_code error;
  std::vector<fs::path> names;
  for (const auto& entry : fs::directory_iterator(staging_, error)) {
    const fs::path name = entry.path().filename();
    if (fs::is_directory(folder_ / name)) return cannot_write(folder_ / name, EISDIR);
    names.push_back(name);
  }
  if (error) return cannot_write(folder_, error.value());
  for (const fs::path& name : names) {
    fs::rename(staging_ / name, folder_ / name, error);
    if (error) return cannot_write(folder_ / name, error.value());
  }
  created_.clear();
  discard();
  return {};
}

}  // namespace plumbline::app
