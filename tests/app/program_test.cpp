// The program as others use it: exit codes, one line on stderr, all files or none.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <unistd.h>

#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/app/example_set.h"
#include "tests/app/json_schema.h"
#include "tests/app/program.h"
#include "tests/app/temp_folder.h"

namespace plumbline::app {
namespace {

namespace fs = std::filesystem;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

std::vector<std::string> calibrate_arguments(const fs::path& folder, const fs::path& out) {
  return {"calibrate",
          "--samples",
          folder / "samples.csv",
          "--static",
          folder / "static.csv",
          "--config",
          folder / "run.toml",
          "--out",
          out};
}

TEST(Program, HelpAndVersionAreNoErrors) {
  const auto version = run_plumbline({"--version"});
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_THAT(version.out, testing::MatchesRegex("plumbline [0-9]+\\.[0-9]+\\.[0-9]+\n"));
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"--help"}, {"help"}, {"help", "calibrate"}, {"noise", "--help"}}) {
    const auto help = run_plumbline(arguments);
    EXPECT_EQ(help.exit_code, 0) << arguments.back();
    EXPECT_THAT(help.out, HasSubstr("Usage: plumbline")) << arguments.back();
    EXPECT_EQ(help.err, "") << arguments.back();
  }
}

TEST(Program, WrongArgumentsAreOneLineAndCode2) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{}, "plumbline: no command given; see plumbline --help\n"},
      {{"calibrat"}, "plumbline: there is no command calibrat; did you mean calibrate?\n"},
      {{"help", "nois"}, "plumbline: there is no command nois; did you mean noise?\n"},
      {{"calibrate", "--out", "x", "--frobnicate"},
       "plumbline: The following argument was not expected: --frobnicate; see plumbline calibrate "
       "--help\n"},
      {{"calibrate"}, "plumbline: --out is required; see plumbline calibrate --help\n"},
      {{"calibrate", "--out", "x"},
       "plumbline: calibrate needs either --samples and --config, or --run and --db; see plumbline "
       "calibrate --help\n"},
      {{"calibrate", "--out", "x", "--run", "1", "--db", "y", "--samples", "z"},
       "plumbline: --samples excludes --run; see plumbline calibrate --help\n"},
  };
  for (const auto& [arguments, message] : cases) {
    const auto outcome = run_plumbline(arguments);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(outcome.err, message);
    EXPECT_EQ(outcome.out, "");
  }
}

TEST(Program, CalibratesASmallSet) {
  const TempFolder folder;
  ExampleSet{}.write(folder.path());
  const auto outcome = run_plumbline(calibrate_arguments(folder.path(), folder / "out"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, HasSubstr("Unit T-1"));
  EXPECT_TRUE(fs::exists(folder / "out/certificate.html"));
  const std::string text = text_of(folder / "out/result.json");
  EXPECT_EQ(schema_violations("result", text), "");

  // Within five times its uncertainty, every parameter is the one the set was made with.
  const auto json = nlohmann::json::parse(text);
  const ExampleSet truth;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const auto& x = json["final"]["batch_ls"][std::string(1, "xyz"[axis])];
    for (Eigen::Index i = 0; i < 3; ++i) {
      const auto at = static_cast<std::size_t>(i);
      EXPECT_NEAR(x["K_V_per_g"][at].get<double>(), truth.parameters(axis, i),
                  5 * x["u_K_V_per_g"][at].get<double>());
    }
    EXPECT_NEAR(x["U0_V"].get<double>(), truth.parameters(axis, 3), 5 * x["u_U0_V"].get<double>());
    EXPECT_LT(x["u_K_V_per_g"][0].get<double>(), truth.noise_V / 10);
    // 60 poses cannot exclude a slow process; it counts for the level.
    EXPECT_LT(x["u_U0_V"].get<double>(), truth.noise_V / 3);
  }
  EXPECT_EQ(json["data"]["poses"], 60);
  EXPECT_EQ(json["data"]["samples"], 1200);
  EXPECT_EQ(json["diagnosis"]["verdict"], "clean");
  EXPECT_EQ(json["decision"]["status"], "none");
}

TEST(Program, SameInputGivesTheSameBytes) {
  const TempFolder folder;
  ExampleSet{}.write(folder.path());
  ASSERT_EQ(run_plumbline(calibrate_arguments(folder.path(), folder / "a")).exit_code, 0);
  ASSERT_EQ(run_plumbline(calibrate_arguments(folder.path(), folder / "b")).exit_code, 0);
  EXPECT_EQ(without_provenance(folder / "a/result.json"),
            without_provenance(folder / "b/result.json"));
}

TEST(Program, ExceededLimitsAreCode1AndAllFilesAreThere) {
  const TempFolder folder;
  ExampleSet{}.write(folder.path());
  write_text(folder / "run.toml", example_run_toml() + "[limits]\nmax_abs_error_mps2 = 0.001\n");
  const auto outcome = run_plumbline(calibrate_arguments(folder.path(), folder / "out"));
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, HasSubstr("FAIL"));
  const std::string text = text_of(folder / "out/result.json");
  EXPECT_EQ(schema_violations("result", text), "");
  EXPECT_EQ(nlohmann::json::parse(text)["decision"]["status"], "fail");

  write_text(folder / "run.toml", example_run_toml() + "[limits]\nmax_abs_error_mps2 = 0.5\n");
  EXPECT_EQ(run_plumbline(calibrate_arguments(folder.path(), folder / "out")).exit_code, 0);
  EXPECT_EQ(nlohmann::json::parse(text_of(folder / "out/result.json"))["decision"]["status"],
            "pass");
}

TEST(Program, ReportsAnEffectThatTheModelLacks) {
  const TempFolder folder;
  ExampleSet{.quadratic_g_per_g2 = 0.02}.write(folder.path());
  ASSERT_EQ(run_plumbline(calibrate_arguments(folder.path(), folder / "out")).exit_code, 0);
  const auto json = nlohmann::json::parse(text_of(folder / "out/result.json"));
  EXPECT_NE(json["diagnosis"]["verdict"], "clean");
  EXPECT_GT(json["error"]["before"]["heldout_pose_rms"][0].get<double>(),
            3 * json["error"]["floor"]["pose_rms"][0].get<double>());
}

TEST(Program, EvaluatesAnotherSet) {
  const TempFolder folder;
  ExampleSet{}.write(folder.path());
  ASSERT_EQ(run_plumbline(calibrate_arguments(folder.path(), folder / "out")).exit_code, 0);
  fs::create_directory(folder / "other");
  ExampleSet{.delta_step_deg = 45, .h_step_deg = 40, .seed = 2}.write(folder / "other");
  const auto evaluate = [&](const fs::path& config) {
    return run_plumbline({"evaluate", "--calibration", folder / "out/result.json", "--samples",
                          folder / "other/samples.csv", "--config", config, "--out",
                          folder / "evaluated"});
  };
  const auto outcome = evaluate(folder / "run.toml");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const std::string text = text_of(folder / "evaluated/evaluation.json");
  EXPECT_EQ(schema_violations("evaluation", text), "");
  const auto json = nlohmann::json::parse(text);
  EXPECT_EQ(json["data"]["poses"], 24);
  // 0.3 mV a sample over 32 mV/g is 0.092 m/s²; 20 samples a pose leave 0.021.
  EXPECT_NEAR(json["error"]["after"]["pose_rms"][0].get<double>(), 0.021, 0.010);
  EXPECT_NEAR(json["error"]["after"]["sample_rms"][0].get<double>(), 0.092, 0.015);

  write_text(folder / "strict.toml", example_run_toml() + "[limits]\nmax_abs_error_mps2 = 0.001\n");
  EXPECT_EQ(evaluate(folder / "strict.toml").exit_code, 1);
  write_text(folder / "foreign.toml", "[dut]\nserial = \"T-2\"\n[gravity]\nlocal_mps2 = 9.81\n");
  const auto foreign = evaluate(folder / "foreign.toml");
  EXPECT_EQ(foreign.exit_code, 2);
  EXPECT_THAT(foreign.err, HasSubstr("of unit T-1, the set of unit T-2"));
}

// The quadratic that the calibration found is taken off: without that, 8 mg would be left at the
// top, of which the twelve parameters take up only a part.
TEST(Program, CorrectsReadings) {
  const TempFolder temp;
  const fs::path folder = temp.path();
  ExampleSet set;
  set.quadratic_g_per_g2 = 0.05;
  set.write(folder);
  ASSERT_EQ(run_plumbline(calibrate_arguments(folder, folder / "out")).exit_code, 0);
  const auto correct = [&](const std::string& calibration) {
    return run_plumbline({"correct", "--calibration", folder / calibration, "--samples",
                          folder / "samples.csv", "--config", folder / "run.toml", "--out",
                          folder / "corrected.csv"});
  };
  const auto outcome = correct("out/result.json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("effects applied: sensor.quadratic; left out: none"));
  std::istringstream lines(text_of(folder / "corrected.csv"));
  std::string line;
  std::getline(lines, line);
  EXPECT_THAT(line, StartsWith("# specific force"));
  std::getline(lines, line);
  EXPECT_EQ(line, "t_s,ax_mps2,ay_mps2,az_mps2");
  // The first pose, x up: 20 readings of noise 0.3 mV, 0.09 m/s².
  double sum[3] = {};
  for (int i = 0; i < 20; ++i) {
    double t_s = 0, a[3] = {};
    std::getline(lines, line);
    ASSERT_EQ(std::sscanf(line.c_str(), "%lf,%lf,%lf,%lf", &t_s, &a[0], &a[1], &a[2]), 4) << line;
    for (int axis = 0; axis < 3; ++axis) sum[axis] += a[axis] / 20;
  }
  EXPECT_NEAR(sum[0], 9.81, 0.12);
  EXPECT_NEAR(sum[1], 0, 0.12);
  EXPECT_NEAR(sum[2], 0, 0.12);
  EXPECT_EQ(correct("nothing.json").exit_code, 2);
}

// Readings at an end of the converter and beyond 1 g: what comes out may mean nothing, and says so.
TEST(Program, CorrectsWithCautions) {
  const TempFolder temp;
  const fs::path folder = temp.path();
  ExampleSet{}.write(folder);
  ASSERT_EQ(run_plumbline(calibrate_arguments(folder, folder / "out")).exit_code, 0);
  write_text(folder / "run.toml",
             example_run_toml() + "[adc]\nbits = 16\nmin_V = -5.0\nmax_V = 0.0\n");
  // The rest of the first pose, and one that no head could have shown.
  std::istringstream samples(text_of(folder / "samples.csv"));
  std::string header, row;
  std::getline(samples, header);
  ASSERT_EQ(header, "t_s,pose,delta_deg,h_deg,ux_V,uy_V,uz_V");
  std::getline(samples, row);
  write_text(folder / "readings.csv", header + '\n' + row + "\n100,0,0,0,-5,-2.4,-2.3\n");
  const auto correct = [&](const std::string& columns) {
    return run_plumbline({"correct", "--calibration", folder / "out/result.json", "--samples",
                          folder / "readings.csv", "--config", folder / "run.toml", "--out",
                          folder / "corrected.csv", "--columns", columns});
  };
  const auto outcome = correct("x=ux_V,y=uy_V,z=uz_V");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const std::string& text : {outcome.out, text_of(folder / "corrected.csv")}) {
    EXPECT_THAT(text, HasSubstr("caution: x axis: 1 reading at an end of the converter's range"));
    EXPECT_THAT(text, HasSubstr("caution: x axis: 1 reading beyond ±1 g"));
  }
  EXPECT_THAT(correct("x=ux_V,y=ux_V,z=uz_V").err, HasSubstr("ux_V cannot be two axes"));
}

TEST(Program, IdentifiesNoise) {
  const TempFolder folder;
  ExampleSet{.static_samples = 20000}.write(folder.path());
  const auto outcome =
      run_plumbline({"noise", "--static", folder / "static.csv", "--out", folder / "out"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const std::string text = text_of(folder / "out/noise.json");
  EXPECT_EQ(schema_violations("noise", text), "");
  const auto json = nlohmann::json::parse(text);
  EXPECT_EQ(json["samples"], 20000);
  EXPECT_NEAR(json["rate_hz"].get<double>(), 100, 1e-6);
  // White noise: N = σ·√τ₀.
  EXPECT_NEAR(json["axes"]["x"]["terms"]["N"]["value"].get<double>(), 3e-5, 1e-6);
  EXPECT_THAT(text_of(folder / "out/noise.svg"), StartsWith("<?xml"));
}

TEST(Program, NoiseTakesOtherColumnsAndCounts) {
  const TempFolder folder;
  std::string csv = "ax_lsb,az_lsb\n";
  for (int i = 0; i < 4000; ++i) csv += fmt::format("{},{}\n", (i * 7919) % 13, (i * 104729) % 11);
  write_text(folder / "record.csv", csv);
  const auto outcome =
      run_plumbline({"noise", "--static", folder / "record.csv", "--columns", "x=ax_lsb,z=az_lsb",
                     "--scale", "0.5", "--rate", "100", "--out", folder / "out"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(text_of(folder / "out/noise.json"));
  EXPECT_TRUE(json["axes"].contains("x"));
  EXPECT_FALSE(json["axes"].contains("y"));
  EXPECT_EQ(json["axes"]["z"]["column"], "az_lsb");
}

// --- bad input -----------------------------------------------------------------------------------

struct BadInput {
  const char* name;
  std::function<void(const TempFolder&)> spoil;  ///< changes a good set
  const char* message;                           ///< part of the line

  friend std::ostream& operator<<(std::ostream& stream, const BadInput& input) {
    return stream << input.name;
  }
};

void replace_in(const fs::path& file, const std::string& from, const std::string& to) {
  std::string text = text_of(file);
  const auto at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from;
  write_text(file, text.replace(at, from.size(), to));
}

/// samples.csv with `poses` visits of the angles given by `angles(pose)`.
std::string samples_at(int poses, const std::function<std::string(int)>& angles,
                       double start_s = 0) {
  std::string csv = "t_s,pose,delta_deg,h_deg,ux_V,uy_V,uz_V\n";
  for (int pose = 0; pose < poses; ++pose) {
    for (int i = 0; i < 4; ++i) {
      csv += fmt::format("{:.2f},{},{},-2.53{},-2.43{},-2.34{}\n", start_s + pose + 0.01 * i, pose,
                         angles(pose), i, (i * 3) % 7, (i * 5) % 9);
    }
  }
  return csv;
}

class RefusedInput : public testing::TestWithParam<BadInput> {};

TEST_P(RefusedInput, IsOneLineAndCode2AndLeavesNothing) {
  const TempFolder folder;
  ExampleSet{.static_samples = 500}.write(folder.path());
  GetParam().spoil(folder);
  const auto outcome = run_plumbline(calibrate_arguments(folder.path(), folder / "new/out"));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(outcome.error_lines(), 1) << outcome.err;
  EXPECT_THAT(outcome.err, StartsWith("plumbline: "));
  EXPECT_THAT(outcome.err, HasSubstr(GetParam().message));
  EXPECT_EQ(outcome.out, "");
  EXPECT_FALSE(fs::exists(folder / "new"));
}

constexpr const char* kSecondRow = "\n2.0100,0,0,0,";

INSTANTIATE_TEST_SUITE_P(
    All, RefusedInput,
    testing::Values(
        BadInput{"NoSamplesFile", [](const TempFolder& f) { fs::remove(f / "samples.csv"); },
                 "samples.csv: No such file or directory"},
        BadInput{"NoStaticFile", [](const TempFolder& f) { fs::remove(f / "static.csv"); },
                 "static.csv: No such file or directory"},
        BadInput{"NoConfigFile", [](const TempFolder& f) { fs::remove(f / "run.toml"); },
                 "run.toml: No such file or directory"},
        BadInput{"EmptySamplesFile", [](const TempFolder& f) { write_text(f / "samples.csv", ""); },
                 "samples.csv"},
        BadInput{"EmptyConfigFile", [](const TempFolder& f) { write_text(f / "run.toml", ""); },
                 "run.toml: [gravity] lacks the key local_mps2"},
        BadInput{"HeaderOnly",
                 [](const TempFolder& f) {
                   write_text(f / "samples.csv", "t_s,pose,delta_deg,h_deg,ux_V,uy_V,uz_V\n");
                 },
                 "samples.csv"},
        BadInput{"MissingColumn",
                 [](const TempFolder& f) { replace_in(f / "samples.csv", "uy_V", "uy_mV"); },
                 "uy_V"},
        BadInput{"TextInANumber",
                 [](const TempFolder& f) {
                   replace_in(f / "samples.csv", kSecondRow, "\n2.0100,0,zero,0,");
                 },
                 "samples.csv:3"},
        BadInput{"NotANumber",
                 [](const TempFolder& f) {
                   replace_in(f / "samples.csv", kSecondRow, "\n2.0100,0,nan,0,");
                 },
                 "samples.csv:3"},
        BadInput{"TimeBackwards",
                 [](const TempFolder& f) {
                   replace_in(f / "samples.csv", kSecondRow, "\n1.0100,0,0,0,");
                 },
                 "samples.csv:3"},
        BadInput{"OnePoseAtTwoAngles",
                 [](const TempFolder& f) {
                   replace_in(f / "samples.csv", kSecondRow, "\n2.0100,0,5,0,");
                 },
                 "samples.csv:3"},
        BadInput{"OnePose",
                 [](const TempFolder& f) {
                   write_text(f / "samples.csv", samples_at(1, [](int) { return "10,20"; }));
                 },
                 "not observable"},
        BadInput{"AllPosesEqual",
                 [](const TempFolder& f) {
                   write_text(f / "samples.csv", samples_at(20, [](int) { return "10,20"; }));
                 },
                 "not observable"},
        BadInput{"OneTiltOnly",
                 [](const TempFolder& f) {
                   write_text(f / "samples.csv", samples_at(36, [](int pose) {
                                return fmt::format("{},0", 10 * pose);
                              }));
                 },
                 "K_z"},
        BadInput{"ClockOfADate",
                 [](const TempFolder& f) {
                   write_text(f / "samples.csv", samples_at(
                                                     20,
                                                     [](int pose) {
                                                       return fmt::format("{},{}", 90 * (pose % 4),
                                                                          20 * (pose / 4));
                                                     },
                                                     1.7e9));
                 },
                 "samples.csv: t_s begins at 1700000000 s"},
        BadInput{"DeadAxis",
                 [](const TempFolder& f) {
                   ExampleSet dead;
                   dead.parameters.row(1) << 0, 0, 0, -2.4363;
                   dead.write(f.path());
                 },
                 "output y does not follow the acceleration"},
        BadInput{"AxisAtTheEndOfItsConverter",
                 [](const TempFolder& f) {
                   ExampleSet off_scale;
                   off_scale.parameters.row(2) << 0, 0, 0, -5.01;
                   off_scale.write(f.path());
                   write_text(f / "run.toml",
                              example_run_toml() + "[adc]\nbits = 16\nmin_V = -5\nmax_V = 0\n");
                 },
                 "output z is at the end of the converter's range at "},
        BadInput{"ContradictoryConfig",
                 [](const TempFolder& f) {
                   write_text(f / "run.toml",
                              example_run_toml() + "[adc]\nbits = 12\nmin_V = 1\nmax_V = -1\n");
                 },
                 "adc.min_V: 1 is not below max_V = -1"},
        BadInput{"UnknownKey",
                 [](const TempFolder& f) {
                   write_text(f / "run.toml", example_run_toml() + "[limits]\nmax_error = 1\n");
                 },
                 "unknown key limits.max_error"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(Program, RefusesAnOutputFolderThatCannotBe) {
  const TempFolder folder;
  ExampleSet{}.write(folder.path());
  for (const fs::path& out :
       {fs::path("/proc/plumbline"), folder / "samples.csv", folder / "samples.csv/out"}) {
    const auto outcome = run_plumbline(calibrate_arguments(folder.path(), out));
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(outcome.error_lines(), 1);
    EXPECT_THAT(outcome.err, StartsWith("plumbline: " + out.string() + ": cannot write: "));
  }
}

TEST(Program, RefusesAFolderWithoutWritePermission) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write everywhere";
  const TempFolder folder;
  ExampleSet{}.write(folder.path());
  fs::create_directory(folder / "out");
  fs::permissions(folder / "out", fs::perms::owner_read | fs::perms::owner_exec);
  const auto outcome = run_plumbline(calibrate_arguments(folder.path(), folder / "out"));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, EndsWith("cannot write: Permission denied\n"));
}

TEST(Program, FileSizeLimitLeavesNothing) {
  const TempFolder folder;
  ExampleSet{}.write(folder.path());
  const auto outcome =
      run_plumbline(calibrate_arguments(folder.path(), folder / "out"), {.file_size_limit = 4096});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, EndsWith("cannot write: File too large\n"));
  EXPECT_EQ(outcome.error_lines(), 1);
  EXPECT_FALSE(fs::exists(folder / "out"));
}

/// A file system of 64 KiB, where this process may mount one.
class TinyFileSystem {
 public:
  explicit TinyFileSystem(fs::path at) : at_(std::move(at)) {
    fs::create_directory(at_);
    mounted_ = ::mount("plumbline-test", at_.c_str(), "tmpfs", 0, "size=64k") == 0;
  }
  ~TinyFileSystem() {
    if (mounted_) ::umount2(at_.c_str(), MNT_DETACH);
  }
  TinyFileSystem(const TinyFileSystem&) = delete;
  TinyFileSystem& operator=(const TinyFileSystem&) = delete;
  bool mounted() const { return mounted_; }

 private:
  fs::path at_;
  bool mounted_ = false;
};

TEST(Program, FullDiskLeavesNothing) {
  const TempFolder folder;
  ExampleSet{}.write(folder.path());
  const TinyFileSystem disk(folder / "disk");
  if (!disk.mounted()) GTEST_SKIP() << "mounting a file system needs root";
  write_text(folder / "disk/ballast", std::string(56 << 10, 'x'));
  const auto outcome = run_plumbline(calibrate_arguments(folder.path(), folder / "disk/out"));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, EndsWith("cannot write: No space left on device\n"));
  EXPECT_EQ(outcome.error_lines(), 1);
  EXPECT_FALSE(fs::exists(folder / "disk/out"));
}

// --- the example sets that may lie beside the project --------------------------------------------

class SharedExample : public testing::TestWithParam<const char*> {};

TEST_P(SharedExample, CalibratesAndIsJudgedRightly) {
  const fs::path set = fs::path(PLUMBLINE_SHARED_DIR) / "data/examples" / GetParam();
  if (!fs::exists(set / "samples.csv")) GTEST_SKIP() << set << " is not here";
  const TempFolder folder;
  const auto outcome = run_plumbline(calibrate_arguments(set, folder / "out"));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const std::string text = text_of(folder / "out/result.json");
  EXPECT_EQ(schema_violations("result", text), "");
  const auto json = nlohmann::json::parse(text);
  EXPECT_EQ(json["diagnosis"]["verdict"] == "clean", std::string(GetParam()) == "clean")
      << json["diagnosis"]["reason"];

  const auto evaluated = run_plumbline({"evaluate", "--calibration", folder / "out/result.json",
                                        "--samples", set / "confirm.csv", "--config",
                                        set / "run.toml", "--out", folder / "confirmed"});
  ASSERT_EQ(evaluated.exit_code, 0) << evaluated.err;
  const std::string evaluation = text_of(folder / "confirmed/evaluation.json");
  EXPECT_EQ(schema_violations("evaluation", evaluation), "");
}

INSTANTIATE_TEST_SUITE_P(All, SharedExample,
                         testing::Values("clean", "quadratic", "base-roll",
                                         "temperature-and-backlash"),
                         [](const auto& test) {
                           std::string name = test.param;
                           for (char& c : name) c = c == '-' ? '_' : c;
                           return name;
                         });

}  // namespace
}  // namespace plumbline::app
