#include "app/io/json.h"

#include <cmath>

namespace plumbline::app {

Json json_number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json json_numbers(const std::vector<double>& values) {
  Json array = Json::array();
  for (const double value : values) array.push_back(json_number(value));
  return array;
}

Json json_array(const PerAxis<double>& values) {
  return json_numbers({values.begin(), values.end()});
}

Json json_axis_names(const std::vector<std::size_t>& axes) {
  Json array = Json::array();
  for (const std::size_t axis : axes) array.push_back(kAxisName.at(axis));
  return array;
}

Json json_provenance(const Provenance& provenance) {
  Json hashes = Json::object();
  for (const auto& [name, hash] : provenance.input_sha256) hashes[name] = hash;
  Json json = {{"program_version", program_version()},
               {"input_sha256", hashes},
               {"created_utc", provenance.created_utc},
               {"seed", provenance.seed},
               {"dut", {{"serial", provenance.dut.serial}, {"model", provenance.dut.model}}}};
  if (!provenance.chain_head.empty()) json["chain_head"] = provenance.chain_head;
  return json;
}

Json json_noise_terms(const NoiseModel& noise, const std::string& unit) {
  const auto term = [](const NoiseTerm& value, const std::string& term_unit) -> Json {
    return {{"value", json_number(value.value)},
            {"u", json_number(value.u)},
            {"unit", term_unit},
            {"present", value.present},
            {"upper_limit", json_number(value.upper_limit)}};
  };
  const auto shown = reported_terms(noise);
  return {{"Q", term(shown[kTermQ], unit + "*s")},
          {"N", term(shown[kTermN], unit + "*sqrt(s)")},
          {"B", term(shown[kTermB], unit)},
          {"K", term(shown[kTermK], unit + "/sqrt(s)")},
          {"R", term(shown[kTermR], unit + "/s")}};
}

std::string file_text(const Json& json) { return json.dump(2) + "\n"; }

}  // namespace plumbline::app
