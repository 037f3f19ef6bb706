#include "app/certificate/certificate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <regex>

#include "app/certificate/rounding.h"
#include "app/figure/plot.h"
#include "app/figure/svg_canvas.h"
#include "tests/app/certificate_example.h"

namespace plumbline::app {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

// --- numbers as they are printed ---

TEST(Rounding, UncertaintyHasTwoDigitsAndTheValueTheSamePlace) {
  const RoundedResult r = round_result(32.002134, 0.001249);
  EXPECT_EQ(r.value, "32.0021");
  EXPECT_EQ(r.uncertainty, "0.0012");
}

TEST(Rounding, UncertaintyThatRoundsUpToTheNextPower) {
  const RoundedResult r = round_result(-1.23456, 0.0996);
  EXPECT_EQ(r.value, "−1.23");
  EXPECT_EQ(r.uncertainty, "0.10");
}

TEST(Rounding, LargeUncertaintyKeepsNoDecimals) {
  const RoundedResult r = round_result(-2586.49, 123.0);
  EXPECT_EQ(r.value, "−2590");
  EXPECT_EQ(r.uncertainty, "120");
}

TEST(Rounding, ValueThatRoundsToZeroHasNoSign) {
  EXPECT_EQ(round_result(-0.00001, 0.012).value, "0.000");
}

TEST(Rounding, WithoutUncertaintyNothingIsInvented) {
  EXPECT_EQ(round_result(1.23456789, 0).uncertainty, "–");
  EXPECT_EQ(round_result(1.23456789, std::nan("")).value, "1.23457");
}

TEST(Rounding, SignificantDigits) {
  EXPECT_EQ(significant(0.0279653, 3), "0.0280");
  EXPECT_EQ(significant(-12345.6, 3), "−12346");
  EXPECT_EQ(significant(1.5e-9, 2), "1.5·10⁻⁹");
  EXPECT_EQ(significant(0, 3), "0");
}

TEST(Rounding, WhatWasChosenHasNoZerosAtTheEnd) {
  EXPECT_EQ(chosen(0.5, 6), "0.5");
  EXPECT_EQ(chosen(120.25, 6), "120.25");
  EXPECT_EQ(chosen(1200, 3), "1200");
  EXPECT_EQ(chosen(2.5e-7, 6), "2.5·10⁻⁷");
  EXPECT_EQ(chosen(-2, 6), "−2");
}

TEST(Rounding, DifferencesEndWhereTheyStopToMatter) {
  EXPECT_EQ(difference_beside(1.2e-14, 0.024), "0.00000");
  EXPECT_EQ(difference_beside(-0.00063, 0.11), "−0.0006");
  EXPECT_EQ(difference_beside(0.5, 0), "0.50");
}

// --- axes of figures ---

TEST(Plot, TicksAreRoundNumbers) {
  EXPECT_THAT(tick_positions({"", 0, 1}), ElementsAre(0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0));
  PlotAxis decades{"", 0.02, 50, ScaleKind::logarithmic};
  const auto ticks = tick_positions(decades);
  EXPECT_THAT(tick_texts(decades, ticks), ElementsAre("10⁻¹", "10⁰", "10¹"));
  PlotAxis signed_axis{"", -0.1, 0.1};
  signed_axis.ticks = 4;
  EXPECT_THAT(tick_texts(signed_axis, tick_positions(signed_axis)),
              ElementsAre("−0.10", "−0.05", "0", "0.05", "0.10"));
}

TEST(Plot, DataCoordinatesFallWhereTheyShould) {
  SvgCanvas canvas(100, 100);
  const Plot plot(canvas, {10, 20}, 80, 60, {"", 0, 8}, {"", 1, 100, ScaleKind::logarithmic});
  EXPECT_DOUBLE_EQ(plot.at(0, 100).x, 10);
  EXPECT_DOUBLE_EQ(plot.at(0, 100).y, 20);
  EXPECT_DOUBLE_EQ(plot.at(4, 10).x, 50);
  EXPECT_DOUBLE_EQ(plot.at(4, 10).y, 50);
}

TEST(SvgCanvas, EscapesTextAndNumbersClips) {
  SvgCanvas canvas(10, 10);
  canvas.push_clip({0, 0}, 5, 5);
  canvas.text({1, 2}, "a<b & \"c\"", {});
  canvas.pop_clip();
  const std::string svg = canvas.svg("p", "x");
  EXPECT_THAT(svg, HasSubstr("a&lt;b &amp; &quot;c&quot;"));
  EXPECT_THAT(svg, HasSubstr("clipPath id=\"pc1\""));
  EXPECT_THAT(svg, HasSubstr("clip-path=\"url(#pc1)\""));
}

// --- the certificate ---

TEST(Certificate, SaysWhatWasMeasured) {
  const std::string html = CertificateExample().html();
  EXPECT_THAT(html, HasSubstr("PL-A-&lt;17&gt;-20260131-01234567"));
  EXPECT_THAT(html, HasSubstr("<td>32.0021</td><td>0.0020</td>"));  // K_xx, U at k = 2
  EXPECT_THAT(html, HasSubstr("The residual is what the noise leaves."));
  EXPECT_THAT(html, HasSubstr("<td>31.3</td>"));  // verification RMS, mm/s²
  EXPECT_THAT(html, HasSubstr("0123456789abcdef"));
  EXPECT_THAT(html, HasSubstr("g = (9.810100 ± 0.000040) m/s²"));
}

TEST(Certificate, PrintsWhatIsMissingAsMissing) {
  const std::string html = CertificateExample().html();
  EXPECT_THAT(html, HasSubstr("<dt>Laboratory</dt><dd class=\"missing\">not stated</dd>"));
  EXPECT_THAT(html, HasSubstr("<dt>Authorised by</dt><dd class=\"missing\">not stated</dd>"));
}

TEST(Certificate, IsSelfContainedAndCarriesNoScript) {
  const std::string html = CertificateExample().html();
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("src=")));
  EXPECT_THAT(html, Not(HasSubstr("@import")));
  EXPECT_THAT(html, Not(HasSubstr("A-<17>")));
  // Six figures: map, histogram, course, convergence, budget, Allan curve.
  const std::regex svg("<svg ");
  EXPECT_EQ(std::distance(std::sregex_iterator(html.begin(), html.end(), svg), {}), 6);
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

TEST(Certificate, SameInputSameBytes) {
  EXPECT_EQ(CertificateExample().html(), CertificateExample().html());
}

TEST(Certificate, LimitsAndSuspicionChangeTheHeadline) {
  CertificateExample example;
  EXPECT_THAT(example.html(), HasSubstr("verdict plain\"><strong>Calibrated<"));
  example.calibration.diagnosis.verdict = Verdict::unexplained;
  EXPECT_THAT(example.html(),
              HasSubstr("verdict warning\"><strong>Calibrated, residual too large"));
  example.calibration.decision.status = DecisionStatus::fail;
  EXPECT_THAT(example.html(), HasSubstr("<strong>FAIL<"));
}

TEST(Certificate, DrawsWithoutStaticRecordAndWithoutTemperature) {
  CertificateExample example;
  for (auto& noise : example.calibration.noise) noise.oadev = {};
  for (auto& pose : example.calibration.pose_results) pose.temp_C = std::nan("");
  const std::string html = example.html();
  EXPECT_THAT(html, HasSubstr("no static record long enough"));
  EXPECT_THAT(html, HasSubstr("<dt>Temperature during the run</dt><dd class=\"missing\">"));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace plumbline::app
