#include "app/io/noise_json.h"

namespace plumbline::app {

namespace {

Json to_json(const DeviationCurve& curve) {
  return {{"tau_s", json_numbers(curve.tau_s)},
          {"n", curve.n},
          {"value", json_numbers(curve.value)},
          {"lower", json_numbers(curve.lower)},
          {"upper", json_numbers(curve.upper)}};
}

}  // namespace

Json noise_json(const NoiseReport& report, const Provenance& provenance) {
  Json axes = Json::object();
  for (const NoiseChannel& channel : report.channels) {
    const NoiseModel& noise = channel.noise;
    axes[channel.axis] = {{"column", channel.column},
                          {"unit", channel.unit},
                          {"deviations", {{"oadev", to_json(noise.oadev)}}},
                          {"terms", json_noise_terms(noise, channel.unit)},
                          {"fit",
                           {{"source", noise.source},
                            {"chi2", json_number(noise.chi2)},
                            {"dof", json_number(noise.dof)},
                            {"p_value", json_number(noise.p_value)},
                            {"adequate", noise.adequate},
                            {"fitted", json_numbers(noise.fitted)}}}};
  }
  return {{"schema", "plumbline.noise/1"},
          {"provenance", json_provenance(provenance)},
          {"rate_hz", json_number(report.rate_hz)},
          {"samples", report.samples},
          {"axes", axes}};
}

}  // namespace plumbline::app
