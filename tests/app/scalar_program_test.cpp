// `calibrate --scalar` as others use it.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/app/dcc_numbers.h"
#include "tests/app/example_set.h"
#include "tests/app/json_schema.h"
#include "tests/app/program.h"
#include "tests/app/temp_folder.h"

namespace plumbline::app {
namespace {

using testing::HasSubstr;

constexpr double kG = 9.81;

/// Counts of a triad with offset 32000 and 0.0024 m/s² per count, 40 attitudes, `columns` named;
/// `k2_g_per_g2` of axis x is what the nine parameters lack.
std::string rows(bool with_pose, const std::string& header, double k2_g_per_g2 = 0) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  std::string text = header + "\n";
  int row = 0;
  for (int k = 0; k < 40; ++k) {
    const double z = 2 * (k + 0.5) / 40 - 1, r = std::sqrt(1 - z * z), turn = 2.4 * k;
    double a[] = {kG * r * std::cos(turn), kG * r * std::sin(turn), kG * z};
    a[0] += k2_g_per_g2 * a[0] * a[0] / 9.80665;
    for (int i = 0; i < (with_pose ? 200 : 400); ++i, ++row) {
      text += fmt::format("{:.2f},", 0.01 * row);
      if (with_pose) text += fmt::format("{},", k);
      for (int axis = 0; axis < 3; ++axis) {
        // Between rests without pose numbers the triad is shaken.
        const double shake = !with_pose && i < 100 ? 2 * std::sin(0.9 * i + axis) : 0;
        text += fmt::format("{:.0f}{}", 32000 + (a[axis] + shake) / 0.0024 + 4 * normal(random),
                            axis < 2 ? "," : "\n");
      }
    }
  }
  return text;
}

std::vector<std::string> arguments(const TempFolder& folder, std::vector<std::string> more) {
  write_text(folder / "run.toml", "[dut]\nserial = \"T-1\"\n[gravity]\nlocal_mps2 = 9.81\n");
  std::vector<std::string> all = {"calibrate", "--scalar",          "--samples", folder / "s.csv",
                                  "--config",  folder / "run.toml", "--out",     folder / "out"};
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

void expect_good(const TempFolder& folder, const ProgramOutcome& outcome, double intervals) {
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const std::string text = text_of(folder / "out" / "result.json");
  EXPECT_EQ(schema_violations("result", text), "");
  const auto json = nlohmann::json::parse(text);
  EXPECT_FALSE(json.contains("estimates"));
  const auto& scalar = json.at("scalar");
  EXPECT_EQ(scalar.at("intervals"), intervals);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(scalar.at("bias").at(i).get<double>(), 32000, 1);
    EXPECT_NEAR(scalar.at("scale").at(i).get<double>(), 0.0024, 1e-6);
  }
  EXPECT_THAT(text_of(folder / "out" / "certificate.html"), HasSubstr("scalar calibration"));
}

TEST(ScalarProgram, PosesWithNamedColumns) {
  const TempFolder folder;
  write_text(folder / "s.csv", rows(true, "t_s,pose,ax_raw,ay_raw,az_raw"));
  const auto more = arguments(folder, {"--columns", "x=ax_raw,y=ay_raw,z=az_raw"});
  expect_good(folder, run_plumbline(more), 40);
  // Deterministic: the same bytes but for the provenance.
  const std::string first = without_provenance(folder / "out/result.json");
  ASSERT_EQ(run_plumbline(more).exit_code, 0);
  EXPECT_EQ(without_provenance(folder / "out/result.json"), first);
}

// The certificate has the three forms of any other, and says what lab.toml does.
TEST(ScalarProgram, CertificateOfALaboratory) {
  const TempFolder folder;
  write_text(folder / "s.csv", rows(true, "t_s,pose,ax_raw,ay_raw,az_raw"));
  write_text(
      folder / "lab.toml",
      "[laboratory]\nname = \"Lab 7\"\ncountry = \"UA\"\n[authorised_by]\nname = \"A. Boss\"\n");
  const auto more =
      arguments(folder, {"--columns", "x=ax_raw,y=ay_raw,z=az_raw", "--lab", folder / "lab.toml"});
  const auto outcome = run_plumbline(more);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const std::string html = text_of(folder / "out" / "certificate.html");
  for (const char* text : {"Lab 7", "A. Boss", "Accreditation", "Calibrated without angles"}) {
    EXPECT_THAT(html, HasSubstr(text));
  }
  const auto verify = [&] { return run_plumbline({"verify", folder / "out"}); };
  const auto good = verify();
  EXPECT_EQ(good.exit_code, 0) << good.out << good.err;
  for (const char* list : {"bias", "scale", "nonorthogonality"}) {
    EXPECT_THAT(good.out, HasSubstr(fmt::format("XML and result.json agree in {}", list)));
  }
  // Another number in result.json is noticed as such, not only by its hash.
  std::string result = text_of(folder / "out" / "result.json");
  const std::size_t at = result.find("\"bias\": [");
  ASSERT_NE(at, std::string::npos);
  result.replace(result.find("3", at), 1, "4");
  write_text(folder / "out" / "result.json", result);
  const auto bad = verify();
  EXPECT_EQ(bad.exit_code, 1);
  EXPECT_THAT(bad.out, HasSubstr("FAILED XML and result.json agree in bias"));
}

TEST(ScalarProgram, XmlHasTheNumbersOfResultJson) {
  for (const double k2 : {0.0, 0.02}) {
    const TempFolder folder;
    write_text(folder / "s.csv", rows(true, "t_s,pose,ax_raw,ay_raw,az_raw", k2));
    const auto all = arguments(folder, {"--columns", "x=ax_raw,y=ay_raw,z=az_raw"});
    write_text(folder / "run.toml", text_of(folder / "run.toml") +
                                        "u_mps2 = 0.0001\n[limits]\nmax_abs_error_mps2 = 0.5\n");
    ASSERT_EQ(run_plumbline(all).exit_code, 0);
    const std::string result = text_of(folder / "out" / "result.json");
    const auto diagnosis = nlohmann::json::parse(result).at("diagnosis");
    EXPECT_EQ(diagnosis.at("effects").size(), k2 > 0 ? 1U : 0U) << diagnosis.dump(1);
    EXPECT_GT(diagnosis.at("detection_limits").size(), 10U);
    expect_numbers_of_result(text_of(folder / "out" / "certificate.xml"), result);
    EXPECT_THAT(text_of(folder / "out" / "certificate.html"),
                HasSubstr("Looked for and not found"));
  }
}

TEST(ScalarProgram, ContinuousRecordIsCutIntoRests) {
  const TempFolder folder;
  write_text(folder / "s.csv", rows(false, "t_s,ux_V,uy_V,uz_V"));
  const auto uncut = run_plumbline(arguments(folder, {}));
  EXPECT_EQ(uncut.exit_code, 2);
  EXPECT_THAT(uncut.err, HasSubstr("add --detect-static"));
  expect_good(folder, run_plumbline(arguments(folder, {"--detect-static"})), 40);

  std::string restless = "t_s,ux_V,uy_V,uz_V\n";
  for (int i = 0; i < 1000; ++i) {
    const double u = std::exp(0.01 * i);
    restless += fmt::format("{:.2f},{},{},{}\n", 0.01 * i, u, 2 * u, 3 * u);
  }
  write_text(folder / "s.csv", restless);
  const auto none = run_plumbline(arguments(folder, {"--detect-static"}));
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, testing::AnyOf(HasSubstr("no interval at rest found"),
                                       HasSubstr("cannot determine nine parameters")));
}

TEST(ScalarProgram, BadInputIsOneLineAndCode2) {
  const TempFolder folder;
  std::string text = rows(true, "t_s,pose,ux_V,uy_V,uz_V");
  write_text(folder / "s.csv", text.substr(0, text.find("\n16.00")) + "\n");
  auto outcome = run_plumbline(arguments(folder, {}));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(outcome.error_lines(), 1);
  EXPECT_THAT(outcome.err, HasSubstr("8 intervals at rest cannot determine nine parameters"));

  text.replace(text.find("\n0.05,0,") + 8, 5, "nan");
  write_text(folder / "s.csv", text);
  outcome = run_plumbline(arguments(folder, {}));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("s.csv:7:3 (ux_V): 'nan' is not finite"));
  EXPECT_EQ(run_plumbline(arguments(folder, {"--skip-bad-rows"})).exit_code, 0);

  // Not used without angles, and not ignored without a word.
  outcome = run_plumbline(arguments(folder, {"--static", folder / "s.csv"}));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--static"));
  EXPECT_EQ(outcome.error_lines(), 1);

  outcome = run_plumbline(arguments(folder, {"--columns", "x=ux_V,y=uy_V"}));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("needs all three axes"));
}

}  // namespace
}  // namespace plumbline::app
