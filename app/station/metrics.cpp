#include "app/station/metrics.h"

#include <fmt/format.h>

#include <array>
#include <map>

namespace plumbline::app {

namespace {

constexpr std::array kStates = {"idle",     "homing",  "moving",     "settling",
                                "sampling", "paused",  "recovering", "stopping",
                                "finished", "stopped", "failed"};

class Text {
 public:
  void family(const char* name, const char* type, const char* help) {
    text_ += fmt::format("# HELP {} {}\n# TYPE {} {}\n", name, help, name, type);
  }
  void sample(const std::string& name, double value) {
    text_ += fmt::format("{} {}\n", name, value);
  }
  void single(const char* name, const char* type, const char* help, double value) {
    family(name, type, help);
    sample(name, value);
  }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

void session(Text& text, const Json& status) {
  text.family("plumbline_state", "gauge", "1 for the state that the running session is in.");
  for (const char* state : kStates) {
    text.sample(fmt::format("plumbline_state{{state=\"{}\"}}", state),
                status.value("state", "") == state ? 1 : 0);
  }
  text.single("plumbline_progress_ratio", "gauge", "Share of the plan that is done.",
              status.value("progress", 0.0));
  text.single("plumbline_samples_received", "gauge", "Samples received in this session.",
              status.value("samples_received", 0.0));
  const Json& newest = status.at("newest");
  if (newest.is_object() && newest.at("temp_C").is_number()) {
    text.single("plumbline_sensor_temperature_celsius", "gauge", "Temperature at the sensor.",
                newest.at("temp_C").get<double>());
  }
  text.family("plumbline_attention", "gauge", "How often what had to be done in this session.");
  for (const auto& [kind, count] : status.at("attention").items()) {
    text.sample(fmt::format("plumbline_attention{{kind=\"{}\"}}", kind), count.get<double>());
  }
}

}  // namespace

std::string metrics_text(const Json& status, const std::vector<HistoryRun>& runs, int viewers) {
  Text text;
  text.single("plumbline_session_running", "gauge", "Whether a run is being measured.",
              status.is_object() ? 1 : 0);
  if (status.is_object()) session(text, status);
  std::map<std::string, int> states;
  for (const char* state : {"running", "finished", "stopped", "failed"}) states[state] = 0;
  std::map<std::string, int> decisions;
  for (const char* decision : {"pass", "conditional_pass", "conditional_fail", "fail", "none"}) {
    decisions[decision] = 0;
  }
  for (const HistoryRun& entry : runs) {
    ++states[to_string(entry.run.state)];
    if (entry.result) ++decisions[entry.result->decision];
  }
  text.family("plumbline_runs", "gauge", "Runs in the database by how they ended.");
  for (const auto& [state, count] : states) {
    text.sample(fmt::format("plumbline_runs{{state=\"{}\"}}", state), count);
  }
  text.family("plumbline_results", "gauge", "Certified runs by decision.");
  for (const auto& [decision, count] : decisions) {
    text.sample(fmt::format("plumbline_results{{decision=\"{}\"}}", decision), count);
  }
  text.single("plumbline_viewers", "gauge", "Pages that follow the run at this moment.", viewers);
  return text.take();
}

}  // namespace plumbline::app
