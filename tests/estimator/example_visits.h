// Visits that show every effect, and a unit that makes them.
#pragma once

#include <algorithm>
#include <cmath>

#include "estimator/diagnosis/enlarged_model.h"
#include "estimator/effects/visit_log.h"

namespace plumbline {

// 12 × 5 positions visited in a snake, with a temperature and a humidity that move; visits `from`
// to `to` alone.
inline VisitLog example_log(int from = 0, int to = 60) {
  MeasurementSet set;
  set.samples.covariates.push_back({"rh_pct", {}});
  RunDescription description;
  description.gravity.local_mps2 = 9.81;
  description.adc = Adc{16, -5, 0};
  for (int k = from; k < to; ++k) {
    const int ring = k / 12, step = ring % 2 == 0 ? k % 12 : 11 - k % 12;
    set.poses.push_back({k, 30.0 * step, 20.0 * ring, set.samples.size(), 8});
    for (int i = 0; i < 8; ++i) {
      const double t_s = 6.0 * k + 0.01 * i;
      set.samples.t_s.push_back(t_s);
      for (auto& u : set.samples.u_V) u.push_back(-2.5 + 0.03 * std::sin(0.3 * k) + 1e-4 * (i % 3));
      set.samples.temp_C.push_back(21 + 2 * std::sin(t_s / 100));
      set.samples.covariates[0].value.push_back(45 + std::cos(t_s / 70));
    }
  }
  return make_visit_log(set, description);
}

inline EnlargedParameters twelve() {
  EnlargedParameters parameters;
  parameters.twelve = {Eigen::Vector4d(0.032, -0.0017, 0.0001, -2.58),
                       Eigen::Vector4d(0.0022, 0.0314, 0.0002, -2.44),
                       Eigen::Vector4d(-0.0003, -0.0017, -0.0328, -2.34)};
  return parameters;
}

inline double largest_change(const VisitLog& log, const ActiveEffect& active) {
  EnlargedParameters with = twelve();
  with.effects.push_back(active);
  const auto before = predict_means_V(log, twelve()), after = predict_means_V(log, with);
  double largest = 0;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    largest = std::max(largest, (after[i] - before[i]).cwiseAbs().maxCoeff());
  }
  return largest;
}

}  // namespace plumbline
