#include "app/figure/allan_figure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace plumbline::app {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST(AllanFigure, DrawsCurveBandAndFittedTermsWithinTheDecades) {
  NoiseModel noise;
  noise.oadev = {.tau_s = {0.02, 0.2},
                 .n = {100, 10},
                 .value = {0.03, 0.003},
                 .lower = {0.02, 0.002},
                 .upper = {0.04, std::numeric_limits<double>::infinity()}};
  noise.fitted = {0.03, 0.003};
  const std::string svg = allan_svg({{"x <1>", &noise}}, "V");
  EXPECT_THAT(svg, HasSubstr("x &lt;1&gt;"));
  EXPECT_THAT(svg, HasSubstr("overlapping Allan deviation, V"));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  // τ from 0.01 to 1 s and σ from 0.001 to 0.1 V: both axes have two decades. The plot is 644 by
  // 408 from (62, 30); 0.02 s lies log10(2)/2 = 0.1505 along, 0.03 V log10(30)/2 = 0.7386 up.
  EXPECT_THAT(svg, HasSubstr("158.93"));
  EXPECT_THAT(svg, HasSubstr("136.67"));
}

TEST(AllanFigure, DrawsEmptyAxesForARecordThatCannotTell) {
  const NoiseModel nothing;
  const std::string svg = allan_svg({{"x", &nothing}}, "V");
  EXPECT_THAT(svg, HasSubstr("</svg>"));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace plumbline::app
