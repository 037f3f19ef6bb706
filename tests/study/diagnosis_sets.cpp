// Makes the sets of the diagnosis study: the unit, its noise, its room, effects scaled to a size.
#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <utility>

#include "estimator/error_figures.h"
#include "estimator/fit/generalised_fit.h"
#include "estimator/noise/covariance.h"
#include "estimator/pose_means.h"
#include "rig/sim/effects/effect.h"
#include "tests/study/diagnosis.h"

namespace plumbline::study {
namespace {

constexpr double kMilli = 1e-3;
constexpr double kRadPerArcsec = 4.84813681109536e-6;

sim::NoiseTerms noise_terms(NoiseKind kind, double rate_hz, sim::Random& random) {
  const double white = random.uniform(0.2, 0.3) * kMilli;  // of one sample
  const double level = random.uniform(0.85, 1.15) * kMilli;
  sim::NoiseTerms terms;
  terms.N = white / std::sqrt(rate_hz);
  switch (kind) {
    case NoiseKind::white:
      terms.relaxation = 0.004 * level;
      terms.relaxation_tau_s = {1, 30, 1000};
      break;
    case NoiseKind::examples:
      terms.relaxation = 0.042 * level;
      terms.relaxation_tau_s = {0.3, 3, 30, 300, 3000};
      terms.K = 1.1e-3 * level;
      break;
    case NoiseKind::coloured:
      terms.relaxation = 0.09 * level;
      terms.relaxation_tau_s = {1, 10, 100, 1000};
      terms.K = 6e-3 * level;
      break;
  }
  return terms;
}

/// A room in which everything that is recorded moves over the run.
sim::Room room(sim::Random& random) {
  sim::Room room;
  room.temperature_C = random.uniform(21, 23);
  room.cycle_C = random.uniform(1.5, 2.8);
  room.cycle_period_s = random.uniform(1000, 1700);
  room.cycle_phase_deg = random.uniform(0, 360);
  room.wander_C = 0.3;
  room.thermometer_noise_C = 0.0001;
  room.rh_cycle_pct = random.uniform(4, 6);
  room.rh_cycle_period_s = random.uniform(700, 1300);
  room.rh_wander_pct = 1.5;
  room.rh_noise_pct = 0.002;
  room.supply_wander_V = 0.002;
  room.supply_cycle_V = random.uniform(0.01, 0.016);
  room.supply_cycle_period_s = random.uniform(600, 1000);
  room.supply_noise_V = 0.00001;
  room.hold_A = 0.3;
  room.lift_A = 0.02;
  room.motor_wander_A = 0.11;
  room.motor_wander_tau_s = random.uniform(30, 120);
  room.motor_noise_A = 0.001;
  return room;
}

/// Noise variance of one sample that is not shared with its neighbours, V².
double white_variance_V2(const sim::NoiseTerms& terms, double rate_hz) {
  return terms.N * terms.N * rate_hz;
}

/// True covariance of the pose means of one axis, V².
Eigen::MatrixXd true_covariance_V2(const sim::World& world, std::size_t axis,
                                   const std::vector<SampleWindow>& windows) {
  const sim::NoiseTerms& terms = world.noise_V[axis];
  const auto n = std::ssize(windows);
  Eigen::MatrixXd V = Eigen::MatrixXd::Zero(n, n);
  const auto window = [&](Eigen::Index k) -> const SampleWindow& {
    return windows[static_cast<std::size_t>(k)];
  };
  for (const double tau_s : terms.relaxation_tau_s) {
    const double variance = terms.relaxation * terms.relaxation;
    for (Eigen::Index i = 0; i < n; ++i) {
      const SampleWindow& w = window(i);
      const double decay = std::exp(-w.step_s / tau_s);
      const auto m = static_cast<double>(w.count);
      double pairs = m;  // Σ over all pairs of samples of the window
      double mean_decay = 0;
      for (std::size_t k = 0; k < w.count; ++k) {
        const double share = std::pow(decay, static_cast<double>(k));
        if (k > 0) pairs += 2 * (m - static_cast<double>(k)) * share;
        mean_decay += share / m;
      }
      V(i, i) += variance * pairs / (m * m);
      const double end_s = w.first_s + w.step_s * (m - 1);
      for (Eigen::Index j = i + 1; j < n; ++j) {
        const double covariance =
            variance * mean_decay * mean_decay * std::exp(-(window(j).first_s - end_s) / tau_s);
        V(i, j) += covariance;
        V(j, i) += covariance;
      }
    }
  }
  const double white = white_variance_V2(terms, world.rate_hz);
  const double lsb = world.adc.lsb_V();
  const double shared = rounding_variance(lsb, std::sqrt(white));
  const double gain = world.triad.K_V_per_g[axis][axis] * kRadPerArcsec;
  for (Eigen::Index i = 0; i < n; ++i) {
    const SampleWindow& w = window(i);
    const auto m = static_cast<double>(w.count);
    V(i, i) += (white + lsb * lsb / 12 - shared) / m + shared +
               std::pow(gain * world.positioning.delta_arcsec, 2) +
               std::pow(gain * world.positioning.h_arcsec, 2);
    // A walk that starts at 0: covariance K²·min(t, t').
    const double walk = terms.K * terms.K;
    V(i, i) += walk * (w.first_s + w.step_s * (m - 1) * (2 * m - 1) / (6 * m));
    const double mean_s = w.first_s + 0.5 * w.step_s * (m - 1);
    for (Eigen::Index j = i + 1; j < n; ++j) {
      V(i, j) += walk * mean_s;
      V(j, i) += walk * mean_s;
    }
  }
  return V;
}

sim::RecordOptions record_options(const SetDesign& design) {
  sim::RecordOptions options;
  options.seed = design.seed;
  options.order = design.order;
  options.soak_s = 0;
  options.samples_per_pose = design.samples_per_pose;
  options.verification_poses = 24;
  if (design.noise == NoiseKind::examples) {
    options.settle_s = 6.4 - design.samples_per_pose / 100.0;
  }
  return options;
}

/// Pose noise, and the columns that the 12 parameters take up.
struct Yardstick {
  Eigen::MatrixXd A;
  Eigen::HouseholderQR<Eigen::MatrixXd> qr;
  PerAxis<double> noise_V{};

  /// What an ordinary fit leaves of pose means.
  Eigen::VectorXd freed(const Eigen::VectorXd& means) const { return means - A * qr.solve(means); }
};

/// Size of an effect, see diagnosis.h: `with` and `without` are the same unit.
double size_of(const MeasurementSet& with, const MeasurementSet& without, const Yardstick& yard,
               bool in_samples) {
  double size = 0;
  const auto means_with = pose_means(with);
  const auto means_without = pose_means(without);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    double change_V = 0;
    if (in_samples) {
      const auto& a = with.samples.u_V[axis];
      const auto& b = without.samples.u_V[axis];
      for (std::size_t k = 0; k < a.size(); ++k) change_V += (a[k] - b[k]) * (a[k] - b[k]);
      change_V = std::sqrt(change_V / static_cast<double>(a.size()));
    } else {
      change_V =
          rms(yard.freed(mean_voltages(means_with, axis) - mean_voltages(means_without, axis)));
    }
    size = std::max(size, change_V / yard.noise_V[axis]);
  }
  return size;
}

/// One effect with parameters for amplitude 1; `scaled` gives it another.
struct Template {
  const StudyEffect* effect = nullptr;
  sim::EffectSetting setting;

  sim::EffectSetting scaled(double amplitude) const {
    sim::EffectSetting result = setting;
    for (const std::string& name : effect->scaled) {
      const auto found = result.parameters.find(name);
      if (found == result.parameters.end()) continue;
      if (setting.id == "sensor.saturation") {
        found->second = 1 - amplitude;
      } else {
        found->second *= amplitude;
      }
    }
    return result;
  }
};

Template make_template(const std::string& name, const SetDesign& design, const sim::World& world,
                       double run_s) {
  Template result;
  result.effect = find_study_effect(name);
  assert(result.effect != nullptr);
  sim::Random random(design.seed, "study." + name);
  sim::EffectSetting& setting = result.setting;
  setting.id = name;
  setting.axes = {0, 1, 2};
  for (const char* form : {"bias", "scale"}) {
    const std::string ending = std::string(":") + form;
    if (!setting.id.starts_with("covariate:") || !setting.id.ends_with(ending)) continue;
    setting.id.resize(setting.id.size() - ending.size());
    setting.form = form;
  }
  const std::string axes = result.effect->axes;
  if (!axes.empty())
    setting.axes = {static_cast<std::size_t>(axes[random.index(axes.size())] - 'x')};
  const sim::EffectInfo* info = sim::find_effect(setting.id);
  assert(info != nullptr);
  for (const sim::ParameterInfo& p : info->parameters)
    if (!p.required) setting.parameters[p.name] = p.fallback;
  const auto drawn = result.effect->draw(
      {random, world, setting.axes.front(), run_s, design.samples_per_pose / world.rate_hz});
  for (const auto& [key, value] : drawn) setting.parameters[key] = value;
  if (setting.id == "rig.pose_outlier") {
    for (std::size_t count = 1 + random.index(3); count > 0; --count)
      setting.poses.push_back(static_cast<long long>(5 + random.index(315)));
  }
  return result;
}

/// What follows a column does so about the mean of the run.
void refer_to_mean(const SampleTable& samples, sim::EffectSetting& effect) {
  for (const Covariate& column : samples.covariates)
    if (effect.id == "covariate:" + column.name)
      effect.parameters["mean"] = mean_of_column(samples, column.name);
}

/// √(Δχ²) that the change of the pose means is worth under the true noise, all axes together.
double detectability(const MeasurementSet& with, const MeasurementSet& without,
                     const Yardstick& yard, const PerAxis<Eigen::MatrixXd>& V) {
  double chi2 = 0;
  const auto means_with = pose_means(with);
  const auto means_without = pose_means(without);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const Eigen::VectorXd change =
        mean_voltages(means_with, axis) - mean_voltages(means_without, axis);
    const auto fit = fit_generalised(yard.A, change, V[axis]);
    assert(fit);
    chi2 += fit->whitened_residual.squaredNorm();
  }
  return std::sqrt(chi2);
}

struct ScaledEffect {
  sim::EffectSetting setting;
  double size = 0;
  double sigma = 0;  ///< detectability
  bool feasible = false;
};

/// Nothing but the unit, the head and their effects.
sim::World without_noise(sim::World world) {
  world.noise_V = {};
  world.adc.bits = 24;
  return world;
}

/// Scales one effect to the size.
ScaledEffect scale_to_size(const Template& shape, const SetDesign& design, const sim::World& world,
                           const Yardstick& yard, const PerAxis<Eigen::MatrixXd>& V) {
  ScaledEffect result;
  const std::string& id = shape.setting.id;
  const bool converter = id.starts_with("adc.") && id != "adc.mains_pickup";
  sim::World quiet = converter ? world : without_noise(world);
  sim::RecordOptions options = record_options(design);
  options.verification_poses = 0;
  const MeasurementSet without = sim::record_set(quiet, options).run;
  MeasurementSet with;
  const auto try_out = [&](double amplitude) {
    result.setting = shape.scaled(amplitude);
    quiet.effects = {result.setting};
    with = sim::record_set(quiet, options).run;
    return size_of(with, without, yard, id == "adc.mains_pickup");
  };
  if (id == "adc.stuck_bit") {  // the bit whose size is nearest
    const auto distance = [&](double bit) {
      return std::abs(std::log(std::max(try_out(bit), 1e-9) / design.size));
    };
    int nearest = 0;
    for (int bit = 1; bit < world.adc.bits - 1; ++bit)
      if (distance(bit) < distance(nearest)) nearest = bit;
    result.size = try_out(nearest);
    result.feasible = std::abs(std::log(std::max(result.size, 1e-9) / design.size)) < std::log(3.0);
  } else {
    const double largest = shape.effect->largest;
    double amplitude = largest / 50;
    for (int step = 0; step < 25 && !result.feasible; ++step) {
      result.size = try_out(amplitude);
      const double ratio = design.size / std::max(result.size, 1e-12);
      result.feasible = std::abs(ratio - 1) < (step < 12 ? 0.02 : 0.1);
      if (result.feasible || (amplitude >= largest && ratio > 1)) break;
      // Most effects are linear; those that start at a threshold need shorter steps.
      const double power = step < 2 ? 1 : 0.6;
      amplitude = std::min(largest, amplitude * std::clamp(std::pow(ratio, power), 1e-3, 10.0));
    }
  }
  result.sigma = detectability(with, without, yard, V);
  return result;
}

}  // namespace

const char* to_string(NoiseKind kind) {
  switch (kind) {
    case NoiseKind::white:
      return "white";
    case NoiseKind::examples:
      return "examples";
    case NoiseKind::coloured:
      break;
  }
  return "coloured";
}

const char* to_string(sim::RecordOrder order) {
  switch (order) {
    case sim::RecordOrder::raster:
      return "raster";
    case sim::RecordOrder::snake:
      return "serpentine";
    case sim::RecordOrder::spiral:
      return "spiral";
    case sim::RecordOrder::random:
      break;
  }
  return "random";
}

NoiseKind noise_of(const std::string& name) {
  if (name == "white") return NoiseKind::white;
  return name == "coloured" ? NoiseKind::coloured : NoiseKind::examples;
}
sim::RecordOrder order_of(const std::string& name) {
  if (name == "raster") return sim::RecordOrder::raster;
  return name == "random" ? sim::RecordOrder::random : sim::RecordOrder::snake;
}

sim::World study_world(const SetDesign& design) {
  sim::World world;
  world.serial = fmt::format("STUDY-{}", design.seed);
  world.model = "triad";
  world.scatter.random = true;
  world.triad = sim::draw_triad(world, design.seed);
  world.scatter.random = false;
  world.adc.bits = design.bits;
  world.positioning = {2, 2};
  sim::Random noise(design.seed, "study.noise");
  for (auto& terms : world.noise_V) terms = noise_terms(design.noise, world.rate_hz, noise);
  sim::Random air(design.seed, "study.room");
  world.room = room(air);
  if (design.noise == NoiseKind::examples) {
    // A move takes no time of its own, so that a pose comes every 6.4 s whatever the order.
    for (auto& axis : world.drive.axis) axis.speed_deg_s = axis.acceleration_deg_s2 = 1e9;
  }
  return world;
}

double mean_of_column(const SampleTable& samples, const std::string& name) {
  const auto column = std::find_if(samples.covariates.begin(), samples.covariates.end(),
                                   [&](const Covariate& c) { return c.name == name; });
  assert(column != samples.covariates.end());
  return std::accumulate(column->value.begin(), column->value.end(), 0.0) /
         static_cast<double>(column->value.size());
}

StudySet make_set(const SetDesign& design) {
  StudySet result;
  result.world = study_world(design);
  const sim::RecordOptions options = record_options(design);
  result.plain = sim::record_set(result.world, options);

  const auto poses = pose_means(result.plain.run);
  const auto windows = pose_windows(result.plain.run.samples, result.plain.run.poses, 0.01);
  Yardstick yard;
  yard.A = design_matrix(poses, result.plain.description.gravity);
  yard.qr.compute(yard.A);
  const Eigen::MatrixXd gain =
      yard.qr.solve(Eigen::MatrixXd::Identity(yard.A.rows(), yard.A.rows()));
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    result.covariance_V2[axis] = true_covariance_V2(result.world, axis, windows);
    yard.noise_V[axis] =
        std::sqrt(expected_mean_square_V2(yard.A, gain, result.covariance_V2[axis]));
    result.noise_mps2[axis] = yard.noise_V[axis] /
                              std::abs(result.world.triad.K_V_per_g[axis][axis]) *
                              kStandardGravity_mps2;
  }

  const double run_s = result.plain.run.samples.t_s.back();
  for (const std::string& name : design.effects) {
    const ScaledEffect scaled = scale_to_size(make_template(name, design, result.world, run_s),
                                              design, result.world, yard, result.covariance_V2);
    result.effects.push_back(scaled.setting);
    refer_to_mean(result.plain.run.samples, result.effects.back());
    result.size.push_back(scaled.size);
    result.sigma.push_back(scaled.sigma);
    result.feasible = result.feasible && scaled.feasible;
  }
  result.world.effects = result.effects;
  result.set = result.effects.empty() ? result.plain : sim::record_set(result.world, options);

  sim::RecordOptions still = options;
  still.seed = design.seed ^ 0x5741544943ULL;
  const int samples = static_cast<int>(std::lround(design.static_s * result.world.rate_hz));
  still.plan = {{sim::VisitKind::soak, 0, 0, samples, std::nullopt}};
  sim::World other_day = result.world;
  std::erase_if(other_day.effects, [](const sim::EffectSetting& effect) {
    return effect.id == "sensor.bias_step" || effect.id == "sensor.warmup" ||
           effect.id == "own.floor_tilt" || effect.id == "own.compressor";  // of this run only
  });
  result.static_record = sim::record_set(other_day, still).soak;
  return result;
}

sim::RecordedSet record_without_noise(const SetDesign& design, const sim::World& world) {
  return sim::record_set(without_noise(world), record_options(design));
}

Result<void> dump(const StudySet& set, const std::string& folder) {
  sim::RecordedSet files = set.set;
  files.soak = set.static_record;
  return sim::write_set(files, folder);
}

}  // namespace plumbline::study
