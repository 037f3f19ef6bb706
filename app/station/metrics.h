// The station in Prometheus' text format (exposition format 0.0.4).
#pragma once

#include <string>
#include <vector>

#include "app/io/json.h"
#include "app/station/history.h"

namespace plumbline::app {

/// `status` is a STATUS of app/sequencer/control_socket.h, or null when no session is on.
std::string metrics_text(const Json& status, const std::vector<HistoryRun>& runs, int viewers);

}  // namespace plumbline::app
