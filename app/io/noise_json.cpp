#include "app/io/noise_json.h"

#include <fmt/format.h>

#include <cmath>

namespace plumbline::app {

namespace {

Json to_json(const DeviationCurve& curve) {
  return {{"tau_s", json_numbers(curve.tau_s)},
          {"n", curve.n},
          {"value", json_numbers(curve.value)},
          {"lower", json_numbers(curve.lower)},
          {"upper", json_numbers(curve.upper)}};
}

Json to_json(const SpectralLine& line, const std::string& unit) {
  Json json = {{"f_hz", json_number(line.f_hz)},
               {"amplitude", json_number(line.amplitude)},
               {"u", json_number(line.u)},
               {"unit", unit},
               {"u_f_hz", json_number(line.u_f_hz)},
               {"width_hz", json_number(line.width_hz)},
               {"p_value", json_number(line.p_value)},
               {"name", line_name(line)}};
  if (line.harmonic > 1) {
    json["harmonic"] = line.harmonic;
    json["fundamental_hz"] = json_number(line.fundamental_hz);
  }
  return json;
}

Json terms_json(const NoiseModel& noise, const std::string& unit) {
  Json terms = json_noise_terms(noise, unit);
  if (noise.source == "none") {
    for (Json& term : terms)
      for (const char* key : {"value", "u", "upper_limit"}) term[key] = nullptr;
  }
  Json markov = Json::array();
  for (const MarkovTerm& term : noise.record.markov) {
    markov.push_back({{"value", json_number(term.sigma)},
                      {"u", json_number(term.u)},
                      {"unit", unit},
                      {"tau_s", json_number(term.tau_s)},
                      {"u_tau_s", json_number(term.u_tau_s)},
                      {"present", true}});
  }
  Json lines = Json::array();
  for (const SpectralLine& line : noise.record.lines) lines.push_back(to_json(line, unit));
  terms["markov"] = std::move(markov);
  terms["lines"] = std::move(lines);
  return terms;
}

Json correlation_json(const NoisePowerMatrix& correlation) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < correlation.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < correlation.cols(); ++j)
      row.push_back(json_number(correlation(i, j)));
    rows.push_back(std::move(row));
  }
  return rows;
}

Json fit_json(const NoiseModel& noise) {
  const RecordTerms& record = noise.record;
  Json fit = {{"source", noise.source},
              {"chi2", json_number(record.chi2)},
              {"dof", json_number(record.dof)},
              {"p_value", json_number(record.p_value)},
              {"adequate", record.adequate},
              {"without_lines",
               {{"p_value", json_number(record.p_value_without_lines)},
                {"adequate", record.adequate_without_lines}}},
              {"band_hz", json_number(record.band_hz)}};
  if (record.flicker_low_hz > 0 || std::isfinite(record.flicker_high_hz)) {
    fit["flicker_band_hz"] = {
        record.flicker_low_hz > 0 ? Json(record.flicker_low_hz) : Json(nullptr),
        json_number(record.flicker_high_hz)};
  }
  fit["step"] = json_number(record.step);
  fit["remark"] = noise.source == "none" ? noise.remark : record.remark;
  fit["fitted"] = json_numbers(noise.fitted);
  return fit;
}

}  // namespace

std::string line_name(const SpectralLine& line) {
  if (line.harmonic > 1)
    return fmt::format("harmonic {} of {:.4g} Hz", line.harmonic, line.fundamental_hz);
  return line.width_hz > 0 ? "line that wanders" : "line";
}

Json noise_json(const NoiseReport& report, const Provenance& provenance) {
  Json axes = Json::object();
  for (const NoiseChannel& channel : report.channels) {
    const NoiseModel& noise = channel.noise;
    axes[channel.axis] = {{"column", channel.column},
                          {"unit", channel.unit},
                          {"deviations",
                           {{"adev", to_json(channel.deviations.adev)},
                            {"oadev", to_json(channel.deviations.oadev)},
                            {"mdev", to_json(channel.deviations.mdev)},
                            {"hdev", to_json(channel.deviations.hdev)},
                            {"totdev", to_json(channel.deviations.totdev)}}},
                          {"terms", terms_json(noise, channel.unit)},
                          {"correlation", correlation_json(noise.record.correlation)},
                          {"fit", fit_json(noise)}};
  }
  return {{"schema", "plumbline.noise/1"},
          {"provenance", json_provenance(provenance)},
          {"rate_hz", json_number(report.rate_hz)},
          {"samples", report.samples},
          {"axes", axes}};
}

}  // namespace plumbline::app
