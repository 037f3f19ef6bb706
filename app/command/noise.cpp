#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>

#include "app/axis_columns.h"
#include "app/certificate/rounding.h"
#include "app/command/command.h"
#include "app/figure/allan_figure.h"
#include "app/io/csv.h"
#include "app/io/noise_json.h"
#include "app/io/output_folder.h"
#include "app/io/sha256.h"
#include "estimator/noise/identify.h"

namespace plumbline::app {

namespace {

struct NoiseOptions {
  std::string record;
  std::string out;
  std::string columns = "x=ux_V,y=uy_V,z=uz_V";
  double scale = 1;
  std::string unit;
  double rate_hz = 0;
};

/// Mean rate of a record; refuses gaps, because the curves of an uneven record mean nothing.
Result<double> rate_of(const std::string& name, const std::vector<double>& t_s) {
  if (t_s.size() < 2) return fail(ErrorCode::input, name + ": a record needs two samples or more");
  const double span_s = t_s.back() - t_s.front();
  const double step_s = span_s / static_cast<double>(t_s.size() - 1);
  for (std::size_t i = 1; i < t_s.size(); ++i) {
    if (t_s[i] - t_s[i - 1] > 2.5 * step_s) {
      return fail(ErrorCode::input,
                  fmt::format("{}: gap of {:.6g} s after t_s = {:.6g} in a record sampled every "
                              "{:.6g} s; the noise needs an even record",
                              name, t_s[i] - t_s[i - 1], t_s[i - 1], step_s));
    }
  }
  return 1 / step_s;
}

std::string summary_line(const NoiseChannel& channel) {
  std::string line = fmt::format("{} ({}):", channel.axis, channel.column);
  const NoiseModel& noise = channel.noise;
  if (noise.source == "none")
    return line + fmt::format(" the record cannot tell: {}\n", noise.remark);
  const auto terms = reported_terms(noise);
  for (std::size_t i = 0; i < kTermCount; ++i) {
    if (!terms[i].present) continue;
    line += fmt::format(" {} = {} ± {}", kTermName[i], significant(terms[i].value, 3),
                        significant(terms[i].u, 2));
  }
  const RecordTerms& record = noise.record;
  for (const MarkovTerm& term : record.markov) {
    line += fmt::format(" Gauss-Markov {} over {} s", significant(term.sigma, 3),
                        significant(term.tau_s, 2));
  }
  for (const SpectralLine& spectral : record.lines) {
    line += fmt::format("; {} at {:.6g} Hz, amplitude {} ± {}", line_name(spectral), spectral.f_hz,
                        significant(spectral.amplitude, 3), significant(spectral.u, 2));
  }
  line += record.adequate ? "; these terms describe the record"
                          : "; these terms do NOT describe the record";
  if (!record.remark.empty()) line += " (" + record.remark + ")";
  return line + "\n";
}

Result<ExitCode> run_noise(const NoiseOptions& options) {
  const auto columns = parse_axis_columns(options.columns);
  if (!columns) return fail(columns.error());
  std::vector<std::string> names;
  for (const AxisColumn& column : *columns) names.push_back(column.column);
  if (options.rate_hz == 0) names.insert(names.begin(), "t_s");
  auto record = read_columns(options.record, names);
  if (!record) return fail(record.error());

  NoiseReport report;
  report.rate_hz = options.rate_hz;
  report.samples = record->front().size();
  if (options.rate_hz == 0) {
    const auto rate = rate_of(options.record, record->front());
    if (!rate) return fail(rate.error());
    report.rate_hz = *rate;
    record->erase(record->begin());
  }
  auto folder = OutputFolder::prepare(options.out);
  if (!folder) return fail(folder.error());

  for (std::size_t i = 0; i < columns->size(); ++i) {
    std::vector<double>& values = (*record)[i];
    for (double& value : values) value *= options.scale;
    const AxisColumn& column = (*columns)[i];
    std::string unit = options.unit;
    if (unit.empty()) unit = options.scale == 1 ? unit_of_column(column.column) : "unit";
    NoiseChannel channel{.axis = column.axis,
                         .column = column.column,
                         .unit = unit,
                         .noise = identify_noise(values, report.rate_hz),
                         .deviations = {}};
    if (channel.noise.source != "none") channel.deviations = all_deviations(values, report.rate_hz);
    report.channels.push_back(std::move(channel));
  }
  std::vector<AllanSeries> series;
  for (const NoiseChannel& channel : report.channels) {
    series.push_back({channel.axis + " (" + channel.column + ")", &channel.noise});
  }
  auto hash = sha256_of_file(options.record);
  if (!hash) return fail(hash.error());
  const Provenance provenance{
      .dut = {}, .input_sha256 = {{options.record, *hash}}, .created_utc = utc_now()};
  if (auto done = folder->write("noise.json", file_text(noise_json(report, provenance))); !done) {
    return fail(done.error());
  }
  if (auto done = folder->write("noise.svg", allan_svg(series, report.channels.front().unit));
      !done) {
    return fail(done.error());
  }
  if (auto done = folder->publish(); !done) return fail(done.error());

  std::cout << fmt::format("{} samples at {:.6g} Hz\n", report.samples, report.rate_hz);
  for (const NoiseChannel& channel : report.channels) std::cout << summary_line(channel);
  return ExitCode::done;
}

}  // namespace

void add_noise(CLI::App& program, Invocation& invocation) {
  auto options = std::make_shared<NoiseOptions>();
  const auto above_zero = [](const std::string& text) -> std::string {
    double value = 0;
    return CLI::detail::lexical_cast(text, value) && value > 0 && std::isfinite(value)
               ? ""
               : "must be above 0";
  };
  CLI::App* sub =
      program.add_subcommand("noise", "Identify the noise of a record taken at one fixed pose");
  sub->add_option("--static", options->record, "The record (CSV, also compressed: .csv.gz)")
      ->required();
  sub->add_option("--out", options->out, "Folder for noise.json and noise.svg; created when absent")
      ->required();
  sub->add_option("--columns", options->columns,
                  "Which column is which axis (default x=ux_V,y=uy_V,z=uz_V); fewer than three "
                  "axes may be named");
  sub->add_option("--scale", options->scale, "Multiplies the columns: units per count (default 1)")
      ->check(above_zero);
  sub->add_option("--unit", options->unit,
                  "Unit of the scaled columns, for the report (default: from the column's name)");
  sub->add_option("--rate", options->rate_hz,
                  "Sample rate in Hz; without it the record needs the column t_s")
      ->check(above_zero);
  sub->callback(
      [&invocation, options] { invocation.action = [options] { return run_noise(*options); }; });
}

}  // namespace plumbline::app
