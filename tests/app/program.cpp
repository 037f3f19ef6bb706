#include "tests/app/program.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <stdexcept>

#include "tests/app/temp_folder.h"

namespace plumbline::app {

long ProgramOutcome::error_lines() const { return std::count(err.begin(), err.end(), '\n'); }

ProgramOutcome run_plumbline(const std::vector<std::string>& arguments,
                             const ProgramOptions& options) {
  const TempFolder folder;
  const std::string out = folder / "out";
  const std::string err = folder / "err";
  const std::string program = std::string(PLUMBLINE_BINARY_DIR) + "/plumbline";
  std::vector<std::string> words = {program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  const pid_t child = ::fork();
  if (child < 0) throw std::runtime_error("fork failed");
  if (child == 0) {
    // Opened before the limit is set, and pipes are not subject to it anyway.
    const int out_file = ::open(out.c_str(), O_WRONLY | O_CREAT, 0600);
    const int err_file = ::open(err.c_str(), O_WRONLY | O_CREAT, 0600);
    ::dup2(out_file, STDOUT_FILENO);
    ::dup2(err_file, STDERR_FILENO);
    if (options.file_size_limit) {
      const rlimit limit{*options.file_size_limit, *options.file_size_limit};
      ::setrlimit(RLIMIT_FSIZE, &limit);
    }
    ::execv(program.c_str(), argv.data());
    ::_exit(127);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return {.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status),
          .out = text_of(out),
          .err = text_of(err)};
}

}  // namespace plumbline::app
