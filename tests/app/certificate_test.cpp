#include "app/certificate/certificate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <regex>

#include "app/certificate/rounding.h"
#include "app/figure/plot.h"
#include "app/figure/svg_canvas.h"

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
  EXPECT_EQ(significant(1.5e-9, 2), "1.5·10^-9");
  EXPECT_EQ(significant(0, 3), "0");
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

// A unit with invented numbers: what is tested is that they are printed, not what they are.
struct Example {
  RunDescription description;
  Calibration calibration;
  Provenance provenance;
  Evaluation verification;

  Example() {
    description.dut = {"A-<17>", "triad"};
    description.gravity = {9.8101, 0.00002};
    description.adc = Adc{16, -5, 0};
    provenance.dut = description.dut;
    provenance.created_utc = "2026-01-31T12:34:56Z";
    provenance.input_sha256 = {{"samples.csv", "0123456789abcdef"}};
    calibration.poses = 324;
    calibration.samples = 12960;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      AxisEstimate estimate;
      estimate.value = {0.001, 0.002, 0.0003, -2.5};
      estimate.value(static_cast<Eigen::Index>(i)) = 0.032002134;
      estimate.covariance = Eigen::Vector4d(1e-12, 1e-12, 4e-12, 1e-12).asDiagonal();
      calibration.estimates.batch_ls[i] = calibration.estimates.ekf[i] = estimate;
      calibration.floor_pose_rms_mps2[i] = 0.028;
      calibration.after.heldout_pose_rms_mps2[i] = 0.0291;
      verification.after.pose_rms_mps2[i] = 0.0313;
      verification.after.pose_max_abs_mps2[i] = 0.0777;
      calibration.noise[i].source = "static record";
      calibration.noise[i].adequate = true;
      calibration.noise[i].oadev = {{1, 2, 4}, {9, 8, 7}, {3e-4, 2e-4, 1e-4}, {}, {}};
    }
    calibration.final = calibration.estimates;
    verification.poses = 24;
    for (int k = 0; k < 324; ++k) {
      PoseResult pose;
      pose.pose = {k, 10.0 * (k % 36), 10.0 * (k / 36), 0, 40};
      pose.t_mean_s = 6.4 * k;
      pose.temp_C = 20 + 0.01 * k;
      for (std::size_t i = 0; i < kAxisCount; ++i) {
        pose.residual_after_mps2[i] = 0.028 * std::sin(1.7 * k + static_cast<double>(i));
      }
      calibration.pose_results.push_back(pose);
      calibration.convergence.ekf.push_back(calibration.estimates.ekf);
      calibration.convergence.rls.push_back(calibration.estimates.ekf);
      calibration.convergence.batch_ls.push_back(calibration.estimates.ekf);
    }
    calibration.diagnosis.verdict = Verdict::clean;
    calibration.diagnosis.reason = "The residual is what the noise leaves.";
  }

  CertificateInput input() const {
    return {description, calibration, provenance, &verification, {}};
  }
  std::string html() const { return write_html(make_certificate(input())); }
};

TEST(Certificate, SaysWhatWasMeasured) {
  const std::string html = Example().html();
  EXPECT_THAT(html, HasSubstr("PL-A-&lt;17&gt;-20260131-01234567"));
  EXPECT_THAT(html, HasSubstr("<td>32.0021</td><td>0.0020</td>"));  // K_xx, U at k = 2
  EXPECT_THAT(html, HasSubstr("The residual is what the noise leaves."));
  EXPECT_THAT(html, HasSubstr("<td>31.3</td>"));  // verification RMS, mm/s²
  EXPECT_THAT(html, HasSubstr("0123456789abcdef"));
  EXPECT_THAT(html, HasSubstr("g = (9.810100 ± 0.000040) m/s²"));
}

TEST(Certificate, PrintsWhatIsMissingAsMissing) {
  const std::string html = Example().html();
  EXPECT_THAT(html, HasSubstr("<dt>Laboratory</dt><dd class=\"missing\">not stated</dd>"));
  EXPECT_THAT(html, HasSubstr("<dt>Authorised by</dt><dd class=\"missing\">not stated</dd>"));
}

TEST(Certificate, IsSelfContainedAndCarriesNoScript) {
  const std::string html = Example().html();
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("src=")));
  EXPECT_THAT(html, Not(HasSubstr("@import")));
  EXPECT_THAT(html, Not(HasSubstr("A-<17>")));
  // Five figures: map, histogram, course, convergence, Allan curve.
  const std::regex svg("<svg ");
  EXPECT_EQ(std::distance(std::sregex_iterator(html.begin(), html.end(), svg), {}), 5);
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

TEST(Certificate, SameInputSameBytes) { EXPECT_EQ(Example().html(), Example().html()); }

TEST(Certificate, LimitsAndSuspicionChangeTheHeadline) {
  Example example;
  EXPECT_THAT(example.html(), HasSubstr("verdict plain\"><strong>Calibrated<"));
  example.calibration.diagnosis.verdict = Verdict::unexplained;
  EXPECT_THAT(example.html(),
              HasSubstr("verdict warning\"><strong>Calibrated, residual too large"));
  example.calibration.decision.status = DecisionStatus::fail;
  EXPECT_THAT(example.html(), HasSubstr("<strong>FAIL<"));
}

TEST(Certificate, DrawsWithoutStaticRecordAndWithoutTemperature) {
  Example example;
  for (auto& noise : example.calibration.noise) noise.oadev = {};
  for (auto& pose : example.calibration.pose_results) pose.temp_C = std::nan("");
  const std::string html = example.html();
  EXPECT_THAT(html, HasSubstr("no static record long enough"));
  EXPECT_THAT(html, HasSubstr("<dt>Temperature during the run</dt><dd class=\"missing\">"));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace plumbline::app
