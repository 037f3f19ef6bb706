#include "estimator/correct.h"

#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <memory>

#include "estimator/angle_units.h"
#include "estimator/diagnosis/restored_model.h"

namespace plumbline {
namespace {

/// Of an effect that a user described: what a reading alone does not tell.
bool needs_a_head(const std::string& definition) {
  for (const char* word : {"prev_", "pose", "delta_deg", "h_deg"})
    if (definition.find(word) != std::string::npos) return true;
  return false;
}

bool can_be_computed(const Effect& effect) {
  const std::string id = effect.id();
  // What came before a reading is not in the file: between two of them the triad may have been
  // anywhere.
  if (effect.remembers() || needs_a_head(effect.definition())) return false;
  // Of the two inputs that a stuck bit shows alike, one reading does not tell which it was.
  return effect.subject() == Subject::sensor && !effect.of_the_room() && id != "adc.quantization" &&
         id != "adc.stuck_bit" && id != "adc.mains_pickup";
}

/// Every reading as a visit of its own, at the angles under which a head would show its specific
/// force, so that effects can be evaluated.
MeasurementSet as_visits(const SampleTable& readings, const std::vector<Eigen::Vector3d>& a_g) {
  MeasurementSet set;
  set.samples = readings;
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const Eigen::Vector3d up = a_g[k].normalized();
    set.poses.push_back({static_cast<long long>(k), kDegPerRad * std::atan2(-up.y(), up.x()),
                         kDegPerRad * std::asin(std::clamp(up.z(), -1.0, 1.0)), k, 1});
  }
  return set;
}

void add_name(std::vector<std::string>& names, const std::string& name) {
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

}  // namespace

Corrected correct_readings(const CertifiedModel& model, const SampleTable& readings,
                           const RunDescription& description) {
  assert(readings.size() > 0);
  constexpr int kRepetitions = 6;
  Eigen::Matrix3d K_V_per_g;
  Eigen::Vector3d U0_V;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    K_V_per_g.row(static_cast<Eigen::Index>(i)) = model.final[i].value.head<3>().transpose();
    U0_V(static_cast<Eigen::Index>(i)) = model.final[i].value(3);
  }
  const Eigen::PartialPivLU<Eigen::Matrix3d> inverse(K_V_per_g);
  std::vector<Eigen::Vector3d> a_g(readings.size());
  for (std::size_t k = 0; k < a_g.size(); ++k) {
    const Eigen::Vector3d U_V(readings.u_V[0][k], readings.u_V[1][k], readings.u_V[2][k]);
    a_g[k] = inverse.solve(U_V - U0_V);
  }

  Corrected result;
  const VisitLog log = make_visit_log(as_visits(readings, a_g), description);
  const RestoredModel restored = restore_model(model, log);
  EnlargedParameters applied;
  for (std::size_t i = 0; i < kAxisCount; ++i) applied.twelve[i] = model.final[i].value;
  for (const ActiveEffect& active : restored.parameters.effects) {
    const bool good = can_be_computed(*active.effect);
    add_name(good ? result.applied : result.left_out, active.effect->id());
    if (good) applied.effects.push_back(active);
  }
  for (const std::string& name : restored.left_out) add_name(result.left_out, name);

  for (int pass = 0; pass < kRepetitions && !applied.effects.empty(); ++pass) {
    const PerAxis<Eigen::VectorXd> predicted_V = predict_means_V(log, applied, a_g);
    for (std::size_t k = 0; k < a_g.size(); ++k) {
      Eigen::Vector3d off_V;
      for (std::size_t i = 0; i < kAxisCount; ++i)
        off_V(static_cast<Eigen::Index>(i)) =
            readings.u_V[i][k] - predicted_V[i](static_cast<Eigen::Index>(k));
      a_g[k] += inverse.solve(off_V);
    }
  }
  result.lacking = restored.lacking;
  result.beyond = beyond(model.ranges, readings);
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const auto count = [](const auto& values, const auto& is_so) {
      return static_cast<std::size_t>(std::count_if(values.begin(), values.end(), is_so));
    };
    // A head shows ±1 g; what is a little more may be noise.
    constexpr double kMost_g = 1.1;
    const auto axis = static_cast<Eigen::Index>(i);
    result.beyond_1g[i] =
        count(a_g, [&](const Eigen::Vector3d& a) { return std::abs(a(axis)) > kMost_g; });
    if (!description.adc) continue;
    const Adc& adc = *description.adc;
    // The highest code stands a step below the end of the range; outputs are rounded.
    const double near_V = 1.5 * adc.lsb_V();
    result.at_rail[i] = count(readings.u_V[i], [&](double u_V) {
      return u_V <= adc.min_V + 0.5 * adc.lsb_V() || u_V >= adc.max_V - near_V;
    });
  }
  result.a_mps2.reserve(a_g.size());
  for (const Eigen::Vector3d& a : a_g) result.a_mps2.push_back(kStandardGravity_mps2 * a);
  return result;
}

}  // namespace plumbline
