#include "tests/study/paper_study.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <random>

#include "estimator/fit/eight_state_filter.h"
#include "estimator/fit/least_squares.h"
#include "estimator/fit/recursive_least_squares.h"
#include "estimator/kinematics.h"
#include "estimator/parallel_for.h"
#include "estimator/quantization/interval_fit.h"

namespace plumbline::study {
namespace {

constexpr Eigen::Index kPoses = 324;
constexpr Adc kAdc{12, -5.0, 0.0};
constexpr double kSigmaSteps = 0.1;
constexpr int kReadings = 100;
constexpr double kBetweenPoses_s = 5;
constexpr double kSettledWithin = 0.01;
constexpr double kDiffuse = 1e3;
constexpr double kWalkSteps = 0.1;

double step_V() { return kAdc.lsb_V(); }

/// Rows [a_x a_y a_z 1], δ quick within each h.
const Eigen::MatrixXd& design() {
  static const Eigen::MatrixXd A = [] {
    Eigen::MatrixXd rows(kPoses, 4);
    for (Eigen::Index k = 0; k < kPoses; ++k)
      rows.row(k) << specific_force(10.0 * static_cast<double>(k % 36),
                                    10.0 * static_cast<double>(k / 36), 1)
                         .a_g.transpose(),
          1;
    return rows;
  }();
  return A;
}

/// One axis of one unit.
struct AxisRun {
  Eigen::VectorXd one_V{kPoses};   ///< a single reading
  Eigen::VectorXd many_V{kPoses};  ///< mean of kReadings
  std::vector<CodeCounts> one, many;
};

CodeCounts counts_of(std::vector<double>& codes) {
  CodeCounts counts;
  std::sort(codes.begin(), codes.end());
  for (const double code : codes) {
    counts.mean += code / static_cast<double>(codes.size());
    if (!counts.count.empty() && counts.count.back().first == code)
      counts.count.back().second += 1;
    else
      counts.count.emplace_back(code, 1);
  }
  return counts;
}

/// `walk_V`: standard deviation of a random walk from position to position.
AxisRun measure(const Eigen::Vector4d& truth, double walk_V, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double middle_V = 0.5 * (kAdc.min_V + kAdc.max_V);
  AxisRun run;
  double drift_V = 0;
  for (Eigen::Index k = 0; k < kPoses; ++k) {
    const double exact = (design().row(k).dot(truth) + drift_V - middle_V) / step_V();
    std::vector<double> codes(kReadings);
    for (double& code : codes) code = std::round(exact + kSigmaSteps * normal(random));
    std::vector<double> first(codes.begin(), codes.begin() + 1);
    run.one.push_back(counts_of(first));
    run.many.push_back(counts_of(codes));
    run.one_V(k) = middle_V + step_V() * run.one.back().mean;
    run.many_V(k) = middle_V + step_V() * run.many.back().mean;
    drift_V += walk_V * normal(random);
  }
  return run;
}

Eigen::Vector4d from_intervals(const std::vector<CodeCounts>& codes) {
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(kPoses);
  const IntervalFit fit = fit_intervals(design(), codes, none, none);
  Eigen::Vector4d value = step_V() * fit.value;
  value(3) += 0.5 * (kAdc.min_V + kAdc.max_V);
  return value;
}

/// K_xx after each position by recursive least squares; `weight_V` the standard deviation that it
/// takes a reading to have.
std::vector<double> recursive_course(const Eigen::VectorXd& y, double prior_sd, double weight_V) {
  RecursiveLeastSquares recursive(prior_sd);
  std::vector<double> course;
  for (Eigen::Index k = 0; k < kPoses; ++k) {
    recursive.add(design().row(k).transpose() / weight_V, y(k) / weight_V);
    course.push_back(recursive.estimate().value(0));
  }
  return course;
}

double reading_sd_V() { return step_V() * std::sqrt(1.0 / 12 + kSigmaSteps * kSigmaSteps); }

struct FilterRun {
  std::vector<double> course;
  Eigen::Vector4d value;
};

FilterRun filter_run(const Eigen::VectorXd& y, double prior_sd, double walk_V, bool as_printed) {
  NoiseModel noise;
  if (walk_V > 0) noise.K = {walk_V / std::sqrt(kBetweenPoses_s), 0, true, 0};
  EightStateOptions options;
  options.prior_sd.setConstant(prior_sd);
  options.as_printed = as_printed;
  EightStateFilter filter(noise, options, 0);
  FilterRun run;
  for (Eigen::Index k = 0; k < kPoses; ++k) {
    filter.predict(kBetweenPoses_s * static_cast<double>(k));
    filter.update(design().row(k).head<3>(), y(k), reading_sd_V() * reading_sd_V());
    run.course.push_back(filter.state()(kStateKx));
  }
  run.value = filter.parameters().value;
  return run;
}

double settled_after(const std::vector<double>& course) {
  const double truth = paper_coefficients()[0](0);
  std::size_t n = course.size();
  while (n > 0 && std::abs(course[n - 1] - truth) <= kSettledWithin * std::abs(truth)) --n;
  return static_cast<double>(n + 1);
}

/// One way to start both.
struct Start {
  const char* recursive;
  const char* filter;
  const char* noise;
  double recursive_prior;
  double recursive_weight_V;
  double filter_prior;
  double walk_V;
};

std::vector<Start> starts() {
  const double sd_V = reading_sd_V();
  const char* const white = "white noise and rounding";
  const char* const walk = "random walk of 0.1 steps from position to position";
  return {
      {"nothing known (sd 1000), readings weighted", "nothing known (sd 1000)", white, kDiffuse,
       sd_V, kDiffuse, 0},
      {"sd 0.01, readings weighted", "sd 0.01", white, 0.01, sd_V, 0.01, 0},
      {"P₀ = 100·I, weight 1", "nothing known", white, 10, 1, kDiffuse, 0},
      {"P₀ = 15·I, weight 1", "nothing known", white, std::sqrt(15.0), 1, kDiffuse, 0},
      {"P₀ = 10·I, weight 1", "nothing known", white, std::sqrt(10.0), 1, kDiffuse, 0},
      {"P₀ = I, weight 1", "nothing known", white, 1, 1, kDiffuse, 0},
      {"nothing known, readings weighted", "nothing known, walk modelled", walk, kDiffuse, sd_V,
       kDiffuse, kWalkSteps * step_V()},
  };
}

/// What one unit leaves behind.
struct UnitResult {
  std::array<std::array<Eigen::Vector4d, kAxisCount>, 5> value;
  std::vector<double> one_errors, many_errors;  ///< a_x, signed
  std::vector<std::array<double, 2>> settled;
};

/// a_x at each position out of three voltages.
std::vector<double> measured_errors(const std::array<Eigen::Vector4d, kAxisCount>& estimate,
                                    const std::array<const Eigen::VectorXd*, kAxisCount>& U_V) {
  Eigen::Matrix3d K;
  Eigen::Vector3d U0;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    K.row(static_cast<Eigen::Index>(i)) = estimate[i].head<3>().transpose();
    U0(static_cast<Eigen::Index>(i)) = estimate[i](3);
  }
  const Eigen::Matrix3d inverse = K.inverse();
  std::vector<double> errors;
  for (Eigen::Index k = 0; k < kPoses; ++k) {
    const Eigen::Vector3d U((*U_V[0])(k), (*U_V[1])(k), (*U_V[2])(k));
    const Eigen::Vector3d a_g = inverse * (U - U0);
    errors.push_back(kStandardGravity_mps2 * (a_g(0) - design()(k, 0)));
  }
  return errors;
}

/// Offsets differ by up to half a step from unit to unit: rounding falls elsewhere.
Eigen::Vector4d truth_of(std::size_t axis, double shift_steps) {
  Eigen::Vector4d truth = paper_coefficients()[axis];
  truth(3) += shift_steps * step_V();
  return truth;
}

UnitResult one_unit(std::uint64_t seed, PaperStudy* courses) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> shift(-0.5, 0.5);
  UnitResult unit;
  std::array<AxisRun, kAxisCount> runs;
  std::array<double, kAxisCount> moved{};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    moved[i] = shift(random);
    runs[i] = measure(truth_of(i, moved[i]), 0, random);
    const AxisRun& run = runs[i];
    unit.value[0][i] = solve_least_squares(design(), run.one_V).x;
    unit.value[1][i] = filter_run(run.one_V, kDiffuse, 0, false).value;
    unit.value[2][i] = from_intervals(run.one);
    unit.value[3][i] = solve_least_squares(design(), run.many_V).x;
    unit.value[4][i] = from_intervals(run.many);
  }
  unit.one_errors =
      measured_errors(unit.value[0], {&runs[0].one_V, &runs[1].one_V, &runs[2].one_V});
  unit.many_errors =
      measured_errors(unit.value[4], {&runs[0].many_V, &runs[1].many_V, &runs[2].many_V});
  for (auto& values : unit.value)
    for (std::size_t i = 0; i < kAxisCount; ++i) values[i](3) -= moved[i] * step_V();

  const AxisRun drifting = measure(truth_of(0, moved[0]), kWalkSteps * step_V(), random);
  for (const Start& start : starts()) {
    const Eigen::VectorXd& y = start.walk_V > 0 ? drifting.one_V : runs[0].one_V;
    unit.settled.push_back(
        {settled_after(recursive_course(y, start.recursive_prior, start.recursive_weight_V)),
         settled_after(filter_run(y, start.filter_prior, start.walk_V, false).course)});
  }
  if (courses != nullptr) {
    courses->recursive_course = recursive_course(runs[0].one_V, std::sqrt(15.0), 1);
    courses->diffuse_course = recursive_course(runs[0].one_V, kDiffuse, reading_sd_V());
    courses->filter_course = filter_run(runs[0].one_V, kDiffuse, 0, false).course;
    courses->printed_course = filter_run(runs[0].one_V, kDiffuse, 0, true).course;
    for (const double e : unit.one_errors) courses->error_one.push_back(std::abs(e));
    for (const double e : unit.many_errors) courses->error_many.push_back(std::abs(e));
  }
  return unit;
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + std::ssize(values) / 2, values.end());
  return values[values.size() / 2];
}

ReadingError reading_error(std::vector<double> errors) {
  ReadingError result;
  for (double& e : errors) {
    result.rms += e * e;
    e = std::abs(e);
  }
  result.rms = std::sqrt(result.rms / static_cast<double>(errors.size()));
  std::sort(errors.begin(), errors.end());
  result.p95 = errors[static_cast<std::size_t>(0.95 * static_cast<double>(errors.size() - 1))];
  result.largest = errors.back();
  return result;
}

}  // namespace

const std::array<Eigen::Vector4d, kAxisCount>& paper_coefficients() {
  static const std::array<Eigen::Vector4d, kAxisCount> all = {
      Eigen::Vector4d(0.032002, -0.0017435, 7.4811e-5, -2.5865),
      Eigen::Vector4d(0.0022174, 0.031399, 0.00016485, -2.4363),
      Eigen::Vector4d(-0.00033471, -0.0017407, -0.032812, -2.3423)};
  return all;
}

PaperStudy study_paper(int units, std::uint64_t first_seed) {
  PaperStudy study;
  study.units = units;
  study.sigma_steps = kSigmaSteps;
  std::vector<UnitResult> all(static_cast<std::size_t>(units));
  parallel_for(all.size(), [&](std::size_t u) {
    all[u] = one_unit(first_seed + u, u == 0 ? &study : nullptr);
  });
  const double share = 1.0 / units;
  const std::array<CoefficientSpread*, 5> spreads = {&study.least_squares, &study.filter,
                                                     &study.intervals, &study.many_least_squares,
                                                     &study.many_intervals};
  for (std::size_t method = 0; method < 5; ++method) {
    double square = 0;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const Eigen::Vector4d& truth = paper_coefficients()[i];
      const double mps2_per_V = kStandardGravity_mps2 / truth(static_cast<Eigen::Index>(i));
      for (std::size_t j = 0; j < 4; ++j) {
        const auto column = static_cast<Eigen::Index>(j);
        Spread& spread = (*spreads[method])[i][j];
        for (const UnitResult& unit : all) spread.mean += share * unit.value[method][i](column);
        for (const UnitResult& unit : all)
          spread.sd += share * std::pow(unit.value[method][i](column) - spread.mean, 2);
        spread.sd = std::sqrt(spread.sd);
      }
      for (const UnitResult& unit : all) {
        const Eigen::Vector4d e = mps2_per_V * (unit.value[method][i] - truth);
        square += share / kAxisCount * (e.head<3>().squaredNorm() / 3 + e(3) * e(3));
      }
    }
    study.parameter_error_mps2[method] = std::sqrt(square);
  }
  std::vector<double> one, many;
  for (const UnitResult& unit : all) {
    one.insert(one.end(), unit.one_errors.begin(), unit.one_errors.end());
    many.insert(many.end(), unit.many_errors.begin(), unit.many_errors.end());
  }
  study.one_reading = reading_error(std::move(one));
  study.many_readings = reading_error(std::move(many));
  const std::vector<Start> all_starts = starts();
  for (std::size_t s = 0; s < all_starts.size(); ++s) {
    std::vector<double> recursive, filter;
    for (const UnitResult& unit : all) {
      recursive.push_back(unit.settled[s][0]);
      filter.push_back(unit.settled[s][1]);
    }
    study.settling.push_back({all_starts[s].recursive, all_starts[s].filter, all_starts[s].noise,
                              median(std::move(recursive)), median(std::move(filter))});
  }
  return study;
}

}  // namespace plumbline::study
