// Where the twelve parameters are stated beside a structure that has no name: as beside listed
// effects.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "estimator/calibrate.h"
#include "tests/estimator/synthetic_run.h"

namespace plumbline {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

void expect_true_twelve(const SyntheticRun& data, const Calibration& result, std::size_t axis) {
  const AxisEstimate& estimate = result.final.batch_ls[axis];
  for (Eigen::Index k = 0; k < 4; ++k)
    EXPECT_LT(std::abs(estimate.value(k) - data.truth[axis][static_cast<std::size_t>(k)]),
              4 * std::sqrt(estimate.covariance(k, k)))
        << k;
}

// The run was warmer than the reference temperature: they had been those of its mean temperature.
TEST(TwelveBesideAStructure, AreThoseAtTheReferenceTemperature) {
  const auto above_reference_K = [](double t_s) { return 4 + std::sin(t_s / 20); };
  SyntheticOptions options;
  options.more_V[0] = [&](const auto& a_g, double t_s) {
    return 6e-4 * above_reference_K(t_s) * a_g[1];
  };
  SyntheticRun data = synthetic_run(7, kSixteenBits, options);
  for (const double t_s : data.run.samples.t_s)
    data.run.samples.temp_C.push_back(data.description.reference_C + above_reference_K(t_s));
  const Calibration result = calibrated(data);
  SCOPED_TRACE(result.diagnosis.reason);
  ASSERT_THAT(result.diagnosis.unlisted, SizeIs(1));
  EXPECT_EQ(result.diagnosis.unlisted.front().driver, "temp_C");
  EXPECT_EQ(result.diagnosis.unlisted.front().form, "scale");
  expect_true_twelve(data, result, 0);
  // A degree's worth.
  EXPECT_LT(std::sqrt(result.final.batch_ls[0].covariance(1, 1)), 6e-4);
}

// Of a power series the twelve parameters hold the first two terms, whatever polynomial fits it.
TEST(TwelveBesideAStructure, OfFourthAndFifthOrderAreThoseAtZero) {
  SyntheticOptions options;
  options.delta_step_deg = 10;
  options.more_V[1] = [](const auto& a_g, double) {
    return 2e-3 * std::pow(a_g[1], 4) + 1e-3 * std::pow(a_g[1], 5);
  };
  const SyntheticRun data = synthetic_run(7, kSixteenBits, options);
  const Calibration result = calibrated(data);
  SCOPED_TRACE(result.diagnosis.reason);
  ASSERT_THAT(result.diagnosis.unlisted, SizeIs(1));
  EXPECT_EQ(result.diagnosis.unlisted.front().driver, "a_y");
  EXPECT_THAT(result.diagnosis.effects, IsEmpty());
  expect_true_twelve(data, result, 1);
  EXPECT_LT(std::sqrt(result.final.batch_ls[1].covariance(1, 1)),
            0.01 * data.truth[1][1]);  // it is known all the same
}

}  // namespace
}  // namespace plumbline
