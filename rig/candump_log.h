// log:FILE, frames recorded by `candump -l`.
#pragma once

#include <fstream>
#include <string>
#include <string_view>

#include "rig/carrier.h"

namespace plumbline::rig {

/// One line, "(1436509052.249713) can0 1A0#0102": the frame, or why it is none.
tl::expected<CanFrame, std::string> parse_candump_line(std::string_view line);

class CandumpLog : public Carrier {
 public:
  explicit CandumpLog(std::string file);

  Result<void> open() override;
  /// Fails with file and line where the log is damaged.
  Result<std::optional<CanFrame>> receive(std::chrono::milliseconds timeout) override;
  bool recorded() const override { return true; }
  bool ended() const override { return ended_; }
  const std::string& address() const override { return address_; }

 private:
  std::string file_;
  std::string address_;
  std::ifstream stream_;
  long long line_ = 0;
  bool ended_ = false;
};

}  // namespace plumbline::rig
