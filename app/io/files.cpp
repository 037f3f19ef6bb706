#include "app/io/files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <array>
#include <cerrno>
#include <memory>
#include <system_error>

namespace plumbline::app {

namespace fs = std::filesystem;

namespace {

std::string reason_of(int error_number) { return std::generic_category().message(error_number); }

/// An errno value, 0 for success.
int write_all(int file, std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = ::write(file, content.data(), content.size());
    if (written >= 0) {
      content.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno != EINTR) {
      return errno;
    }
  }
  return 0;
}

/// Closing may be what reports a full disk (network file systems), so it counts.
int close_after(int file, int error) { return ::close(file) != 0 && error == 0 ? errno : error; }

int write_in_place(const fs::path& path, std::string_view content) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
  return file < 0 ? errno : close_after(file, write_all(file, content));
}

/// Makes the rename itself durable.
void sync_folder(const fs::path& folder) {
  const int directory = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (directory < 0) return;
  ::fsync(directory);
  ::close(directory);
}

}  // namespace

tl::unexpected<Error> cannot_write(const fs::path& path, int error_number) {
  return fail(ErrorCode::output,
              fmt::format("{}: cannot write: {}", path.string(), reason_of(error_number)));
}

Result<std::string> read_text(const fs::path& path) {
  const auto refuse = [&](const std::string& reason) {
    return fail(ErrorCode::input, path.string() + ": " + reason);
  };
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return refuse("is a folder, not a file");
  // zlib hands plain files through unchanged.
  const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(gzopen(path.c_str(), "rbe"), &gzclose_r);
  if (!file) return refuse(reason_of(errno));
  gzbuffer(file.get(), 1U << 17);
  std::string text;
  std::array<char, 1 << 16> block;
  int count = 0;
  while ((count = gzread(file.get(), block.data(), static_cast<unsigned>(block.size()))) > 0) {
    text.append(block.data(), static_cast<std::size_t>(count));
  }
  int code = Z_OK;
  const char* message = gzerror(file.get(), &code);
  if (code == Z_ERRNO) return refuse(reason_of(errno));
  if (code == Z_BUF_ERROR) return refuse("the gzip file is cut off");
  if (code != Z_OK) return refuse(fmt::format("damaged gzip file: {}", message));
  return text;
}

Result<void> write_file_atomically(const fs::path& path, std::string_view content) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::is_directory(status)) return cannot_write(path, EISDIR);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    const int code = write_in_place(path, content);
    return code == 0 ? Result<void>{} : cannot_write(path, code);
  }
  // A symbolic link stays a link: what it points to is replaced.
  const fs::path target = fs::exists(status) ? fs::canonical(path, error) : path;
  if (error && fs::exists(status)) return cannot_write(path, error.value());

  std::string temporary = target.string() + ".XXXXXX";
  const int file = ::mkostemp(temporary.data(), O_CLOEXEC);
  if (file < 0) return cannot_write(path, errno);
  int code = write_all(file, content);
  if (code == 0 && ::fchmod(file, 0644) != 0) code = errno;
  if (code == 0 && ::fsync(file) != 0) code = errno;
  code = close_after(file, code);
  if (code == 0 && ::rename(temporary.c_str(), target.c_str()) != 0) code = errno;
  if (code != 0) {
    ::unlink(temporary.c_str());
    return cannot_write(path, code);
  }
  sync_folder(target.has_parent_path() ? target.parent_path() : fs::path("."));
  return {};
}

}  // namespace plumbline::app
