#include "app/config/laboratory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/app/certificate_example.h"

namespace plumbline::app {
namespace {

using testing::HasSubstr;

std::string refusal(const std::string& text) {
  const auto lab = parse_laboratory(text, "lab.toml");
  EXPECT_FALSE(lab) << text;
  return lab ? "" : lab.error().message;
}

TEST(Laboratory, EveryKeyIsOptional) {
  const auto lab = parse_laboratory("", "lab.toml");
  ASSERT_TRUE(lab) << lab.error().message;
  EXPECT_EQ(lab->laboratory.place(), "");
  EXPECT_EQ(lab->location, "");
}

TEST(Laboratory, ExampleIsReadAndPrinted) {
  const auto lab =
      read_laboratory(std::filesystem::path(PLUMBLINE_SOURCE_DIR) / "app/examples/lab.toml");
  ASSERT_TRUE(lab) << lab.error().message;
  EXPECT_EQ(lab->laboratory.place(), "Example street 1, 01001 Kyiv, UA");
  CertificateExample example;
  example.laboratory = *lab;
  const std::string html = example.html();
  EXPECT_THAT(html, HasSubstr("<dt>Customer</dt><dd>Example customer, Lviv, UA</dd>"));
  EXPECT_THAT(html, HasSubstr("<dd>A. Example, head of the laboratory</dd>"));
  EXPECT_THAT(html, HasSubstr("calibrated against an angle standard, certificate EX-A-7</dd>"));
  EXPECT_THAT(html, HasSubstr("<dt>Received</dt><dd class=\"missing\">not stated</dd>"));
}

TEST(Laboratory, RefusesWithPlaceAndReason) {
  EXPECT_THAT(refusal("[laboratory]\nnam = \"x\"\n"), HasSubstr("name"));
  EXPECT_THAT(refusal("[laboratory]\ncountry = \"Ukraine\"\n"), HasSubstr("lab.toml:2"));
  EXPECT_THAT(refusal("[dates]\nreceived = \"31.01.2026\"\n"), HasSubstr("2026-01-31"));
  EXPECT_THAT(refusal("[dates]\nreceived = \"2026-02-29\"\n"), HasSubstr("2026-02-29"));
  EXPECT_THAT(refusal("[dates]\nperformed_from = \"2026-02-02\"\nperformed_to = \"2026-02-01\"\n"),
              HasSubstr("before"));
  EXPECT_THAT(refusal("[signature]\nkey = \"lab.key\"\n"), HasSubstr("go together"));
  EXPECT_THAT(refusal("[laboratory]\nlocation = \"labratory\"\n"), HasSubstr("laboratory"));
}

TEST(Laboratory, DatesOfAStoredRunFillWhatIsNotStated) {
  CertificateExample example;
  CertificateInput input = example.input();
  EXPECT_EQ(performance_dates(input).from, "");
  input.started_utc = "2026-01-30T22:00:00Z";
  input.finished_utc = "2026-01-31T02:00:00Z";
  EXPECT_EQ(performance_dates(input).from, "2026-01-30");
  EXPECT_EQ(performance_dates(input).to, "2026-01-31");
  input.laboratory.performed_from = "2026-01-29";
  EXPECT_EQ(performance_dates(input).from, "2026-01-29");
}

}  // namespace
}  // namespace plumbline::app
