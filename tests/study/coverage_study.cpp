// How often do the 12 parameters lie within their 95 % interval? Simulated units with white noise
// and nothing undeclared, each calibrated like a measured one.
//
//   coverage_study [UNITS [FIRST_SEED]]     200 units from seed 1 by default
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "estimator/calibrate.h"
#include "rig/sim/record.h"
#include "rig/sim/world.h"

namespace {

using plumbline::Adc;
using plumbline::kAxisCount;

struct Setting {
  std::string name;
  Adc adc;
  double sigma_V = 0;  ///< of one sample
};

struct Count {
  int inside = 0;
  int all = 0;
  double percent() const { return 100.0 * inside / all; }
};

plumbline::sim::World white_world(const Setting& setting) {
  plumbline::sim::World world;
  world.adc = setting.adc;
  world.scatter.random = true;
  for (plumbline::sim::NoiseTerms& noise : world.noise_V)
    noise.N = setting.sigma_V / std::sqrt(world.rate_hz);
  return world;
}

void study(const Setting& setting, int units, std::uint64_t first_seed) {
  const plumbline::sim::World world = white_world(setting);
  std::vector<Count> parameter(4 * kAxisCount);
  Count all;
  Count filter;
  double largest_en = 0;
  int alarms = 0;
  for (int unit = 0; unit < units; ++unit) {
    plumbline::sim::RecordOptions options;
    options.seed = first_seed + static_cast<std::uint64_t>(unit);
    options.verification_poses = 0;
    const plumbline::sim::RecordedSet set = plumbline::sim::record_set(world, options);
    const plumbline::Calibration result =
        plumbline::calibrate({set.run, &set.soak, set.description}, {});
    alarms += result.diagnosis.verdict != plumbline::Verdict::clean;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const auto& K = set.truth.triad.K_V_per_g[axis];
      const Eigen::Vector4d truth(K[0], K[1], K[2], set.truth.triad.U0_V[axis]);
      const auto within = [&](const plumbline::AxisEstimate& estimate, Eigen::Index j) {
        return std::abs(estimate.value(j) - truth(j)) <=
               1.96 * std::sqrt(estimate.covariance(j, j));
      };
      for (Eigen::Index j = 0; j < 4; ++j) {
        const bool inside = within(result.estimates.batch_ls[axis], j);
        for (Count* count : {&parameter[4 * axis + static_cast<std::size_t>(j)], &all}) {
          count->inside += inside;
          ++count->all;
        }
        filter.inside += within(result.estimates.ekf[axis], j);
        ++filter.all;
      }
      largest_en = std::max(largest_en, result.estimates.agreement_en[axis]);
    }
  }
  std::printf("\n%s, %d units\n", setting.name.c_str(), units);
  std::printf("  axis      K_ix     K_iy     K_iz     U_i0\n");
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    std::printf("  %s   ", plumbline::kAxisName[axis]);
    for (std::size_t j = 0; j < 4; ++j) std::printf("%7.1f %%", parameter[4 * axis + j].percent());
    std::printf("\n");
  }
  std::printf("  all 12: batch %.2f %%, filter %.2f %% (wanted 93 to 97)\n", all.percent(),
              filter.percent());
  std::printf("  largest E_n between filter and batch %.3f; verdict other than clean: %d\n",
              largest_en, alarms);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const int units = argc > 1 ? std::atoi(argv[1]) : 200;
  const std::uint64_t first_seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  if (units < 1) {
    std::fprintf(stderr, "usage: coverage_study [UNITS [FIRST_SEED]]\n");
    return 2;
  }
  const Adc sixteen{16, -5.0, 0.0};
  const Adc twelve{12, -5.0, 0.0};
  std::printf("Coverage of 95 %% intervals: 324 poses x 40 samples, 300 s static, white noise\n");
  study({"16 bits, noise 0.3 mV", sixteen, 3e-4}, units, first_seed);
  study({"12 bits, noise half a step", twelve, 0.5 * twelve.lsb_V()}, units, first_seed);
  study({"12 bits, noise of one step", twelve, twelve.lsb_V()}, units, first_seed);
  return 0;
}
