// Makes the pages on recorded data. Exit code: 0 done, 2 wrong use or data not there.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <functional>

#include "app/io/csv.h"
#include "app/io/files.h"
#include "estimator/scalar/rest_detector.h"
#include "tests/study/recorded.h"

namespace plumbline::study {

std::string html_page(const std::string& title, const std::string& body) {
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>{0}</title>\n"
      "<style>body{{font:15px sans-serif;max-width:1000px;margin:2em auto;padding:0 1em}}"
      "table{{border-collapse:collapse;margin:1em 0}}td,th{{border:1px solid #ccc;padding:.25em "
      ".6em;text-align:left;font-weight:normal}}th{{font-weight:bold}}figure{{margin:1em 0}}"
      "figcaption{{color:#555}}</style>\n<h1>{0}</h1>\n{1}</html>\n",
      title, body);
}

std::string mm(double value_mps2) { return fmt::format("{:.2f}", kMilli * value_mps2); }

std::string html_table(const std::vector<std::vector<std::string>>& rows) {
  std::string html = "<table>";
  for (std::size_t row = 0; row < rows.size(); ++row) {
    html += "<tr>";
    const char* cell = row == 0 ? "th" : "td";
    for (const std::string& text : rows[row]) html += fmt::format("<{0}>{1}</{0}>", cell, text);
    html += "</tr>\n";
  }
  return html + "</table>\n";
}

namespace {

namespace fs = std::filesystem;

Result<std::string> xsens(const fs::path& data) {
  app::CsvOptions options;
  options.axis_columns = {"ax_raw", "ay_raw", "az_raw"};
  options.angle_free = true;
  auto set = app::read_samples(data / "multiposition" / "xsens_mti_raw_acc.csv", options);
  if (!set) return fail(set.error());
  set->poses = find_rests(set->samples);
  set->has_angles = false;
  return rest_page(
      {"Xsens MTi, turned by hand",
       "Raw output of the accelerometers of an Xsens MTi (Tedaldi, Pretto, Menegatti, ICRA 2014), "
       "100 Hz, 512 s; the rests were found by plumbline.",
       *std::move(set), 9.81744});
}

Result<std::string> poses160(const fs::path& data) {
  app::CsvOptions options;
  options.axis_columns = {"ax_g", "ay_g", "az_g"};
  options.angle_free = true;
  options.rate_hz = 1;
  auto set = app::read_samples(data / "multiposition" / "poses160_acc_g.csv", options);
  if (!set) return fail(set.error());
  set->has_angles = false;
  return rest_page(
      {"160 positions of a MEMS accelerometer",
       "MEMS accelerometer, 160 positions of 100 readings each; neither the rate nor "
       "the temperature nor local gravity was recorded (gravity goes into the scales).",
       *std::move(set), kStandardGravity_mps2});
}

Result<std::string> adis16405(const fs::path& data) {
  constexpr double kLsb_mps2 = 0.0326561;
  StillRecords records;
  records.title = "ADIS16405 at rest: a periodic disturbance";
  records.source =
      "Two records of 10 000 s of the accelerometers of an Analog Devices ADIS16405 at rest, "
      "100 Hz, one code = 32.7 mm/s².";
  records.rate_hz = 100;
  for (int run = 1; run <= 2; ++run) {
    auto columns =
        app::read_columns(data / "static_long" / fmt::format("adis16405_run{}_acc_lsb.csv.gz", run),
                          {"ax_lsb", "ay_lsb", "az_lsb"});
    if (!columns) return fail(columns.error());
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      for (double& value : (*columns)[i]) value *= kLsb_mps2;
      (run == 1 ? records.fitted_mps2 : records.left_out_mps2)[i] = std::move((*columns)[i]);
    }
  }
  return still_page(records);
}

int run(const fs::path& data, const fs::path& out) {
  const std::pair<const char*, Result<std::string> (*)(const fs::path&)> pages[] = {
      {"xsens.html", xsens}, {"poses160.html", poses160}, {"adis16405.html", adis16405}};
  std::error_code ignored;
  fs::create_directories(out, ignored);
  for (const auto& [name, make] : pages) {
    const auto page = make(data);
    if (!page) {
      fmt::print(stderr, "{}\n", page.error().message);
      return 2;
    }
    if (auto done = app::write_file_atomically(out / name, *page); !done) {
      fmt::print(stderr, "{}\n", done.error().message);
      return 2;
    }
    fmt::print("{}\n", (out / name).string());
  }
  return 0;
}

}  // namespace
}  // namespace plumbline::study

int main(int argc, char** argv) {
  std::string data, out = "build/recorded-data";
  CLI::App program{"Pages on recorded data: residual, what drives it, before and after"};
  program.add_option("data", data, "folder with multiposition/ and static_long/")
      ->required()
      ->check(CLI::ExistingDirectory);
  program.add_option("--out", out, "folder for the pages")->capture_default_str();
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  }
  return plumbline::study::run(data, out);
}
