// The folder that receives the results of a command: all of them, or none.
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "estimator/measurement.h"

namespace plumbline::app {

/// Files are written into a staging folder inside the output folder (so that moving them is a
/// rename within one file system) and moved out together by publish(). Without publish() nothing
/// new remains: neither files nor folders created for them. Failures are ErrorCode::output.
class OutputFolder {
 public:
  /// Creates the folder when absent. Do this before the long computation: an unwritable place is
  /// then refused at once.
  static Result<OutputFolder> prepare(const std::filesystem::path& folder);

  OutputFolder(OutputFolder&& other) noexcept;
  OutputFolder& operator=(OutputFolder&&) = delete;
  ~OutputFolder();

  /// Where a writer may put a file of its own until publish().
  std::filesystem::path staged(std::string_view name) const { return staging_ / name; }
  /// Writes a whole file and makes sure that it reached the disk.
  Result<void> write(std::string_view name, std::string_view content) const;
  /// Moves every staged file into the folder, replacing files of the same name.
  Result<void> publish();

 private:
  OutputFolder() = default;
  void discard() noexcept;

  std::filesystem::path folder_;
  std::filesystem::path staging_;               ///< empty once published or moved from
  std::vector<std::filesystem::path> created_;  ///< folders made by prepare(), innermost last
};

}  // namespace plumbline::app
