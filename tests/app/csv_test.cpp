#include "app/io/csv.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <unistd.h>
#include <zlib.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "app/io/csv_writer.h"
#include "tests/app/temp_folder.h"

namespace plumbline::app {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;

constexpr const char* kHeader = "t_s,pose,delta_deg,h_deg,ux_V,uy_V,uz_V\n";

class Csv : public testing::Test {
 protected:
  fs::path file(const std::string& content, const std::string& name = "samples.csv") {
    const fs::path path = folder_.path() / name;
    std::ofstream(path, std::ios::binary) << content;
    return path;
  }
  /// The error message without the folder, "read" when there is none.
  std::string refusal(const std::string& content, const CsvOptions& options = {}) {
    const auto set = read_samples(file(content), options);
    if (set) return "read";
    EXPECT_EQ(set.error().code, ErrorCode::input);
    std::string message = set.error().message;
    const std::string prefix = folder_.path().string() + "/";
    EXPECT_TRUE(message.starts_with(prefix)) << message;
    return message.substr(prefix.size());
  }
  TempFolder folder_;
};

TEST_F(Csv, ReadsPosesAndAllColumnsInAnyOrder) {
  const auto set = read_samples(
      file("\xef\xbb\xbf# a comment\r\n"
           "uz_V,\"rh_pct\",t_s, pose ,h_deg,delta_deg,uy_V,ux_V,temp_C,delta_enc_deg,h_enc_deg\r\n"
           "-3,40,0.5,0,0,10,-2,-1,20.5,10.001,0.002\r\n"
           "\r\n"
           "# between\r\n"
           "-3.5,41,0.75,0,0,10,-2.5,+1e-1,20.5,10.001,0.002\r\n"
           "6,42,1,7,20,350,5,4,21,350.5,20.5"));
  ASSERT_TRUE(set) << set.error().message;
  EXPECT_TRUE(set->has_angles);
  EXPECT_EQ(set->skipped_rows, 0u);
  EXPECT_THAT(set->samples.t_s, ElementsAre(0.5, 0.75, 1));
  EXPECT_THAT(set->samples.u_V[0], ElementsAre(-1, 0.1, 4));
  EXPECT_THAT(set->samples.u_V[1], ElementsAre(-2, -2.5, 5));
  EXPECT_THAT(set->samples.u_V[2], ElementsAre(-3, -3.5, 6));
  EXPECT_THAT(set->samples.temp_C, ElementsAre(20.5, 20.5, 21));
  EXPECT_THAT(set->samples.delta_enc_deg, ElementsAre(10.001, 10.001, 350.5));
  EXPECT_THAT(set->samples.h_enc_deg, ElementsAre(0.002, 0.002, 20.5));
  ASSERT_EQ(set->samples.covariates.size(), 1u);
  EXPECT_EQ(set->samples.covariates[0].name, "rh_pct");
  EXPECT_THAT(set->samples.covariates[0].value, ElementsAre(40, 41, 42));
  ASSERT_EQ(set->poses.size(), 2u);
  EXPECT_EQ(set->poses[0].number, 0);
  EXPECT_EQ(set->poses[0].delta_deg, 10);
  EXPECT_EQ(set->poses[0].first, 0u);
  EXPECT_EQ(set->poses[0].count, 2u);
  EXPECT_EQ(set->poses[1].number, 7);
  EXPECT_EQ(set->poses[1].h_deg, 20);
  EXPECT_EQ(set->poses[1].first, 2u);
  EXPECT_EQ(set->poses[1].count, 1u);
}

TEST_F(Csv, ABadRowIsRefusedWithLineAndField) {
  const std::string h = kHeader;
  const std::string good = "0,0,0,0,1,2,3\n";
  EXPECT_EQ(refusal(h + good + "1,0,0,0,abc,2,3\n"),
            "samples.csv:3:5 (ux_V): 'abc' is not a number");
  EXPECT_EQ(refusal("# note\n" + h + "0,0,0,0,1,,3\n"),
            "samples.csv:3:6 (uy_V): a number is missing");
  EXPECT_EQ(refusal(h + "0,0,0,0,1,2,nan\n"), "samples.csv:2:7 (uz_V): 'nan' is not finite");
  EXPECT_EQ(refusal(h + "0,0,0,0,1,2,-inf\n"), "samples.csv:2:7 (uz_V): '-inf' is not finite");
  EXPECT_EQ(refusal(h + "0,0,0,0,1,2,1e999\n"),
            "samples.csv:2:7 (uz_V): '1e999' is beyond the range of a number");
  EXPECT_EQ(refusal(h + "0,0,0,0,1,2,0x10\n"), "samples.csv:2:7 (uz_V): '0x10' is not a number");
  EXPECT_EQ(refusal(h + "0,0,0,0,1,2,+-1\n"), "samples.csv:2:7 (uz_V): '+-1' is not a number");
  EXPECT_EQ(refusal(h + "0,0,0,0,1,2,\"3\n"), "samples.csv:2:7 (uz_V): '\"3' is not a number");
  EXPECT_EQ(refusal(h + good + "0,0,0,0,1,2,3\n"),
            "samples.csv:3:1 (t_s): time 0 s does not come after 0 s");
  EXPECT_EQ(refusal(h + "0,0.5,0,0,1,2,3\n"),
            "samples.csv:2:2 (pose): pose 0.5 is not a whole number");
  EXPECT_EQ(refusal(h + good + "1,0,10,0,1,2,3\n"),
            "samples.csv:3:3 (delta_deg): the angle changes from 0 to 10 within pose 0");
  EXPECT_EQ(refusal(h + good + "1,0,0,10,1,2,3\n"),
            "samples.csv:3:4 (h_deg): the angle changes from 0 to 10 within pose 0");
  EXPECT_EQ(refusal(h + good + "1,1,0,0,1,2,3\n2,0,0,0,1,2,3\n"),
            "samples.csv:4:2 (pose): pose 0 comes back after another pose; a position visited "
            "twice needs two numbers");
  EXPECT_EQ(refusal(h + "0,0,0,0,1,2\n"),
            "samples.csv:2:6 (uy_V): the row has 6 fields and the header 7");
  EXPECT_EQ(refusal(h + "0,0,0,0,1,2,3,4\n"),
            "samples.csv:2:7 (uz_V): the row has 8 fields and the header 7");
}

TEST_F(Csv, ATextColumnIsRefused) {
  EXPECT_EQ(refusal("t_s,pose,delta_deg,h_deg,ux_V,uy_V,uz_V,operator\n0,0,0,0,1,2,3,Ann\n"),
            "samples.csv:2:8 (operator): 'Ann' is not a number");
}

TEST_F(Csv, ABadHeaderIsRefused) {
  EXPECT_EQ(refusal(""), "samples.csv: the file is empty");
  EXPECT_EQ(refusal("# only a comment\n\n"), "samples.csv: the file is empty");
  EXPECT_EQ(refusal(kHeader), "samples.csv: no row of data follows the header");
  EXPECT_EQ(refusal("t_s,pose,delta_deg,h_deg,ux_v,uy_V,uz_V\n0,0,0,0,1,2,3\n"),
            "samples.csv:1: the column ux_V is missing (required: t_s, pose, delta_deg, h_deg, "
            "ux_V, uy_V, uz_V); is it the one called 'ux_v'?");
  EXPECT_THAT(refusal("t_s;pose;delta_deg\n0;0;0\n"), EndsWith("fields are separated by commas"));
  EXPECT_EQ(refusal("t_s,pose,t_s\n"),
            "samples.csv:1:3 (t_s): a column of this name stands there twice");
  EXPECT_EQ(refusal("t_s,,pose\n"), "samples.csv:1:2: this column has no name");
  EXPECT_EQ(refusal("t_s,pose,\n"), "samples.csv:1:3: this column has no name");
}

TEST_F(Csv, AFileThatCannotBeReadIsRefused) {
  const auto absent = read_samples(folder_.path() / "none.csv");
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, ErrorCode::input);
  EXPECT_THAT(absent.error().message, EndsWith("none.csv: No such file or directory"));
  const auto folder = read_samples(folder_.path());
  ASSERT_FALSE(folder);
  EXPECT_THAT(folder.error().message, EndsWith("is a folder, not a file"));
}

TEST_F(Csv, BadRowsAreSkippedAndCountedOnRequest) {
  const CsvOptions options{.skip_bad_rows = true};
  const auto set = read_samples(file(std::string(kHeader) + "0,0,0,0,1,2,3\n"
                                                            "x,0,0,0,1,2,3\n"   // not a number
                                                            "1,0,0,0,1,2\n"     // too short
                                                            "-1,0,0,0,1,2,3\n"  // time backwards
                                                            "2,0,9,0,1,2,3\n"   // angle changes
                                                            "3,1,10,0,4,5,6\n"
                                                            "4,0,0,0,1,2,3\n"  // pose comes back
                                                            "5,1,10,0,7,8,9\n"),
                                options);
  ASSERT_TRUE(set) << set.error().message;
  EXPECT_EQ(set->skipped_rows, 5u);
  EXPECT_THAT(set->samples.t_s, ElementsAre(0, 3, 5));
  ASSERT_EQ(set->poses.size(), 2u);
  EXPECT_EQ(set->poses[1].count, 2u);
  EXPECT_EQ(refusal(std::string(kHeader) + "x,0,0,0,1,2,3\n", options),
            "samples.csv: none of its 1 rows can be used");
}

TEST_F(Csv, AScalarSetNeedsNeitherAnglesNorPoses) {
  const CsvOptions options{.axis_columns = {"ax_raw", "ay_raw", "az_raw"}, .angle_free = true};
  const auto set = read_samples(file("t_s,ax_raw,ay_raw,az_raw\n0.1,1,2,3\n0.2,4,5,6\n"), options);
  ASSERT_TRUE(set) << set.error().message;
  EXPECT_FALSE(set->has_angles);
  EXPECT_TRUE(set->poses.empty());
  EXPECT_THAT(set->samples.u_V[2], ElementsAre(3, 6));
  const CsvOptions timed{
      .axis_columns = {"ax_g", "ay_g", "az_g"}, .angle_free = true, .rate_hz = 4};
  const auto posed = read_samples(file("pose,ax_g,ay_g,az_g\n1,1,2,3\n1,1,2,3\n2,4,5,6\n"), timed);
  ASSERT_TRUE(posed) << posed.error().message;
  EXPECT_FALSE(posed->has_angles);
  EXPECT_EQ(posed->poses.size(), 2u);
  EXPECT_THAT(posed->samples.t_s, ElementsAre(0, 0.25, 0.5));
}

TEST_F(Csv, AStaticRecordIsTakenAtOnePose) {
  const auto record = read_static(file("t_s,ux_V,uy_V,uz_V,temp_C\n0,1,2,3,20\n1,1,2,3,20\n"));
  ASSERT_TRUE(record) << record.error().message;
  EXPECT_EQ(record->samples.size(), 2u);
  EXPECT_TRUE(record->samples.covariates.empty());
  const auto moved = read_static(file("t_s,pose,ux_V,uy_V,uz_V\n0,0,1,2,3\n1,1,1,2,3\n"));
  ASSERT_FALSE(moved);
  EXPECT_THAT(moved.error().message,
              HasSubstr(":3:2 (pose): changes from 0 to 1, but a static record"));
}

TEST_F(Csv, ReadsNamedColumnsOfAForeignFileAlsoCompressed) {
  const fs::path path = folder_.path() / "record.csv.gz";
  const std::string text = "section,ax_lsb,note,ay_lsb\nrest,1,a,2\n,3,,4\n";
  gzFile gz = gzopen(path.c_str(), "wb");
  ASSERT_EQ(gzwrite(gz, text.data(), static_cast<unsigned>(text.size())),
            static_cast<int>(text.size()));
  ASSERT_EQ(gzclose(gz), Z_OK);
  const auto columns = read_columns(path, {"ay_lsb", "ax_lsb"});
  ASSERT_TRUE(columns) << columns.error().message;
  EXPECT_THAT(*columns, ElementsAre(ElementsAre(2, 4), ElementsAre(1, 3)));

  fs::resize_file(path, fs::file_size(path) - 12);
  const auto cut = read_columns(path, {"ay_lsb"});
  ASSERT_FALSE(cut);
  EXPECT_THAT(cut.error().message, EndsWith("the gzip file is cut off"));
}

TEST_F(Csv, WhatIsWrittenReadsBackToTheSameBits) {
  rc::check([&] {
    const auto number =
        rc::gen::suchThat(rc::gen::arbitrary<double>(), [](double x) { return std::isfinite(x); });
    MeasurementSet set;
    const auto poses = *rc::gen::inRange<std::size_t>(1, 5);
    double t_s = *rc::gen::map(rc::gen::inRange(0, 1000000), [](int i) { return i / 7.0; });
    set.samples.covariates = {{"rh_pct", {}}, {"motor A", {}}};
    for (std::size_t p = 0; p < poses; ++p) {
      const auto count = *rc::gen::inRange<std::size_t>(1, 4);
      set.poses.push_back({static_cast<long long>(p), *number, *number, set.samples.size(), count});
      for (std::size_t i = 0; i < count; ++i) {
        t_s = std::nextafter(t_s + 1 / 3.0, 1e300);
        set.samples.t_s.push_back(t_s);
        for (auto& axis : set.samples.u_V) axis.push_back(*number);
        set.samples.temp_C.push_back(*number);
        for (auto& covariate : set.samples.covariates) covariate.value.push_back(*number);
      }
    }
    const fs::path path = folder_.path() / "written.csv";
    RC_ASSERT(write_samples(path, set).has_value());
    const auto back = read_samples(path);
    RC_ASSERT(back.has_value());
    RC_ASSERT(back->samples.t_s == set.samples.t_s);
    RC_ASSERT(back->samples.u_V == set.samples.u_V);
    RC_ASSERT(back->samples.temp_C == set.samples.temp_C);
    RC_ASSERT(back->samples.covariates.size() == 2u);
    for (std::size_t c = 0; c < 2; ++c) {
      RC_ASSERT(back->samples.covariates[c].name == set.samples.covariates[c].name);
      RC_ASSERT(back->samples.covariates[c].value == set.samples.covariates[c].value);
    }
    RC_ASSERT(back->poses.size() == set.poses.size());
    for (std::size_t p = 0; p < set.poses.size(); ++p) {
      RC_ASSERT(back->poses[p].number == set.poses[p].number);
      RC_ASSERT(back->poses[p].delta_deg == set.poses[p].delta_deg);
      RC_ASSERT(back->poses[p].h_deg == set.poses[p].h_deg);
      RC_ASSERT(back->poses[p].first == set.poses[p].first);
      RC_ASSERT(back->poses[p].count == set.poses[p].count);
    }
  });
}

TEST_F(Csv, DamagedBytesAreReadOrRefusedInOneLine) {
  std::string whole = kHeader;
  for (int i = 0; i < 8; ++i) whole += std::to_string(i) + ",0,10,20,-2.5,-2.4,-2.3\n";
  rc::check([&] {
    std::string text = whole;
    const auto edits = *rc::gen::inRange(1, 6);
    for (int i = 0; i < edits; ++i) {
      const auto at = *rc::gen::inRange<std::size_t>(0, text.size());
      const auto byte = *rc::gen::oneOf(rc::gen::arbitrary<char>(),
                                        rc::gen::element(',', '\n', '"', '#', '\r', '-', 'e'));
      text[at] = byte;
    }
    const fs::path path = file(text, "damaged.csv");
    const auto strict = read_samples(path);
    if (!strict) RC_ASSERT(strict.error().message.find('\n') == std::string::npos);
    const auto lenient = read_samples(path, {.skip_bad_rows = true});
    if (lenient) {
      RC_ASSERT(lenient->samples.size() + lenient->skipped_rows <= 8u + 6u);
      std::size_t in_poses = 0;
      for (const Pose& pose : lenient->poses) in_poses += pose.count;
      RC_ASSERT(in_poses == lenient->samples.size());
    }
    if (strict) RC_ASSERT(lenient.has_value() && lenient->skipped_rows == 0u);
  });
}

TEST_F(Csv, TheWriterRefusesWhatItCannotWrite) {
  MeasurementSet set;
  set.samples.t_s = {0};
  for (auto& axis : set.samples.u_V) axis = {1};
  set.poses = {{0, 0, 0, 0, 1}};
  const auto nowhere = write_samples(folder_.path() / "no" / "samples.csv", set);
  ASSERT_FALSE(nowhere);
  EXPECT_EQ(nowhere.error().code, ErrorCode::output);
  EXPECT_THAT(nowhere.error().message,
              EndsWith("no/samples.csv: cannot write: No such file or directory"));
  const auto full = write_samples("/dev/full", set);
  ASSERT_FALSE(full);
  EXPECT_EQ(full.error().message, "/dev/full: cannot write: No space left on device");
  set.samples.covariates = {{"a,b", {1}}};
  const auto name = write_samples(folder_.path() / "samples.csv", set);
  ASSERT_FALSE(name);
  EXPECT_THAT(name.error().message, EndsWith("a column cannot be called 'a,b'"));
  EXPECT_TRUE(fs::is_empty(folder_.path()));
}

TEST_F(Csv, TheExampleSetsAreReadWhole) {
  const fs::path example = fs::path(PLUMBLINE_SHARED_DIR) / "data/examples/clean";
  if (!fs::exists(example)) GTEST_SKIP() << "skipped: the example data are not here";
  const auto set = read_samples(example / "samples.csv");
  ASSERT_TRUE(set) << set.error().message;
  EXPECT_EQ(set->poses.size(), 324u);
  EXPECT_EQ(set->samples.covariates.size(), 3u);
  const auto record = read_static(example / "static.csv");
  ASSERT_TRUE(record) << record.error().message;
  EXPECT_GT(record->samples.size(), 1000u);
}

}  // namespace
}  // namespace plumbline::app
