#include "app/io/output_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <system_error>
#include <utility>

#include "app/io/files.h"

namespace plumbline::app {

namespace fs = std::filesystem;

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
  auto done = write_file_atomically(staged(name), content);
  if (done) return done;
  // A person knows the file by where it would have gone.
  Error error = done.error();
  const std::string place = staged(name).string();
  if (error.message.starts_with(place)) {
    error.message.replace(0, place.size(), (folder_ / name).string());
  }
  return fail(std::move(error));
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
