#include "app/sequencer/progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace plumbline::app {

namespace {

constexpr std::chrono::milliseconds kRedraw{100};

double share(const Progress& progress) {
  return progress.planned_total_s > 0 ? progress.planned_done_s / progress.planned_total_s : 0;
}

std::string remaining(const Progress& progress, double elapsed_s) {
  const double done = share(progress);
  if (done < kPaceKnown) return "";
  const auto left_s = std::lround(elapsed_s * std::max(0.0, 1 - done) / done);
  return fmt::format("  {}:{:02} to go", left_s / 60, left_s % 60);
}

}  // namespace

std::string progress_line(const Progress& progress, double elapsed_s) {
  const double rate =
      elapsed_s > 0 ? static_cast<double>(progress.samples_received) / elapsed_s : 0;
  return fmt::format("pose {}/{}  {:<10}  δ {:.2f}° h {:.2f}°  {:.0f} samples/s{}",
                     std::min(progress.step + 1, progress.steps), progress.steps,
                     to_string(progress.state), progress.target.delta_deg, progress.target.h_deg,
                     rate, remaining(progress, elapsed_s));
}

ProgressDisplay::ProgressDisplay(std::FILE* stream, bool is_terminal)
    : stream_(stream), is_terminal_(is_terminal) {}

ProgressDisplay::~ProgressDisplay() {
  if (line_open_) std::fputc('\n', stream_);
}

void ProgressDisplay::show(const Progress& progress) {
  const Clock::time_point now = Clock::now();
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  if (is_terminal_) {
    if (now < next_) return;
    next_ = now + kRedraw;
    fmt::print(stream_, "\r\033[K{}", progress_line(progress, elapsed_s));
    line_open_ = true;
  } else {
    const int tenths = static_cast<int>(share(progress) * 10);
    if (tenths <= tenths_) return;
    tenths_ = tenths;
    fmt::print(stream_, "{:3} %  {}\n", tenths * 10, progress_line(progress, elapsed_s));
  }
  std::fflush(stream_);
}

}  // namespace plumbline::app
