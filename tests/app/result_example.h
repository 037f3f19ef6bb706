// What of a result.json the station reads.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace plumbline::app {

/// Result of the run whose hash chain ends with `chain_head`; K_xx in V/g.
inline nlohmann::json example_result(const std::string& chain_head, double K_xx,
                                     const std::string& decision,
                                     const std::vector<std::string>& effects = {}) {
  using nlohmann::json;
  json found = json::array();
  for (const std::string& id : effects) found.push_back({{"id", id}});
  const json axis = {{"K_V_per_g", {K_xx, 0.001, 0.002}},
                     {"U0_V", -2.5},
                     {"u_K_V_per_g", {1e-5, 1e-5, 1e-5}},
                     {"u_U0_V", 2e-5}};
  const json errors = {{"heldout_pose_rms", {0.02, 0.01, 0.03}}};
  return {{"schema", "plumbline.result/1"},
          {"provenance", {{"chain_head", chain_head}, {"created_utc", "2026-01-02T05:00:00Z"}}},
          {"decision",
           {{"status", decision},
            {"limit_mps2", 0.2},
            {"max_abs_error_mps2", 0.03},
            {"u_mps2", 0.001}}},
          {"diagnosis",
           {{"verdict", effects.empty() ? "clean" : "partly_explained"},
            {"reason", ""},
            {"effects", found}}},
          {"error", {{"before", errors}, {"after", errors}}},
          {"final", {{"batch_ls", {{"x", axis}, {"y", axis}, {"z", axis}}}}}};
}

}  // namespace plumbline::app
