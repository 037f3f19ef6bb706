#include "estimator/diagnosis/noise_drivers.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "estimator/diagnosis/heldout.h"
#include "estimator/diagnosis/screening.h"
#include "estimator/effects/driver.h"

namespace plumbline {
namespace {

constexpr std::size_t kFewestReadings = 16;
constexpr double kDriverFalseAlarm = 1e-4;
constexpr double kLeastChange = 1.16;  // ratio of standard deviations
constexpr const char* kNoise = "noise, ";

/// ψ and ψ' for x of more than a few (Abramowitz & Stegun 6.3.18, 6.4.12).
double digamma(double x) { return std::log(x) - 1 / (2 * x) - 1 / (12 * x * x); }
double trigamma(double x) { return 1 / x + 1 / (2 * x * x) + 1 / (6 * x * x * x); }

/// The readings of one axis, dwell by dwell.
struct Scatter {
  Eigen::VectorXd log_variance;  ///< of each dwell, unbiased, ln V²
  Eigen::VectorXd variance;      ///< of each of those for Gaussian noise
  Eigen::VectorXd count;         ///< readings
  /// Variance of the first quarter less that of the rest, in each dwell; their means, V².
  Eigen::VectorXd early_less_late_V2;
  double early_V2 = 0, late_V2 = 0;
};

Eigen::VectorXd vector_of(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values));
}

/// What one unit of anything may be worth to an axis at each visit: of bias, of any of its scale
/// factors, of an angle of the head. What δ turns is a component, too.
Eigen::MatrixXd worth_of_unit(const VisitLog& log, std::size_t axis) {
  constexpr double kStep_rad = 1e-4;
  const auto i = static_cast<Eigen::Index>(axis);
  Eigen::MatrixXd worth(std::ssize(log.visits), 1 + static_cast<int>(kAxisCount) + 2);
  for (Eigen::Index k = 0; k < worth.rows(); ++k) {
    const Visit& visit = log.visits[static_cast<std::size_t>(k)];
    const HeadGeometry head{.delta_rad = visit.delta_rad, .h_rad = visit.h_rad};
    const Eigen::Vector3d a_g = specific_force_g(head, log.gamma);
    const auto by_angle = [&](double HeadGeometry::*angle) {
      HeadGeometry moved = head;
      moved.*angle += kStep_rad;
      return (specific_force_g(moved, log.gamma)(i) - a_g(i)) / kStep_rad;
    };
    worth.row(k) << 1, a_g.transpose(), by_angle(&HeadGeometry::h_rad),
        by_angle(&HeadGeometry::roll_rad);
  }
  return worth;
}

/// What the readings of an axis do within the dwells but for what changes slowly or is a line
/// there, less what they do with the recorded columns, to first order and with their squares: a
/// current that is not steady makes them scatter more where what it does is large, and that is no
/// noise.
Eigen::VectorXd left_within_dwells_V(const VisitLog& log, const MeasurementSet& set,
                                     std::size_t axis) {
  const SampleTable& samples = set.samples;
  std::vector<Eigen::ArrayXd> columns;
  if (!samples.temp_C.empty()) columns.emplace_back(vector_of(samples.temp_C));
  for (const Covariate& covariate : samples.covariates)
    columns.emplace_back(vector_of(covariate.value));
  for (Eigen::ArrayXd& column : columns) column -= column.mean();

  const Eigen::VectorXd u_V = vector_of(samples.u_V[axis]);
  const Eigen::MatrixXd worth = worth_of_unit(log, axis);
  const Eigen::Index forms = worth.cols() + 1;
  Eigen::MatrixXd left = Eigen::MatrixXd::Zero(u_V.size(), 1 + forms * std::ssize(columns));
  for (std::size_t k = 0; k < set.poses.size(); ++k) {
    const Pose& pose = set.poses[k];
    const auto first = static_cast<Eigen::Index>(pose.first);
    const auto n = static_cast<Eigen::Index>(pose.count);
    Eigen::MatrixXd of_dwell(n, left.cols());
    of_dwell.col(0) = u_V.segment(first, n);
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const Eigen::VectorXd value = columns[c].segment(first, n);
      of_dwell.middleCols(1 + forms * static_cast<Eigen::Index>(c), forms)
          << value * worth.row(static_cast<Eigen::Index>(k)),
          value.cwiseAbs2();
    }
    const Eigen::MatrixXd& slow = log.contrasts.at(pose.count);
    of_dwell.rowwise() -= of_dwell.colwise().mean().eval();
    left.middleRows(first, n) = of_dwell - slow * (slow.transpose() * of_dwell);
  }
  if (columns.empty()) return left;
  const auto design = left.rightCols(left.cols() - 1);
  const Eigen::VectorXd scale = design.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const Eigen::MatrixXd gram =
      scale.asDiagonal() * (design.transpose() * design) * scale.asDiagonal();
  const Eigen::VectorXd seen = scale.cwiseProduct(design.transpose() * left.col(0));
  const Eigen::VectorXd slopes = gram.completeOrthogonalDecomposition().solve(seen);
  return left.col(0) - design * scale.cwiseProduct(slopes);
}

Scatter scatter_of(const VisitLog& log, const MeasurementSet& set, std::size_t axis) {
  const auto visits = std::ssize(set.poses);
  const Eigen::VectorXd all_left_V = left_within_dwells_V(log, set, axis);
  Scatter scatter{Eigen::VectorXd(visits),
                  Eigen::VectorXd(visits),
                  Eigen::VectorXd(visits),
                  Eigen::VectorXd(visits),
                  0,
                  0};
  for (Eigen::Index k = 0; k < visits; ++k) {
    const Pose& pose = set.poses[static_cast<std::size_t>(k)];
    const auto n = static_cast<Eigen::Index>(pose.count);
    const Eigen::MatrixXd& slow = log.contrasts.at(pose.count);
    const auto left_V = all_left_V.segment(static_cast<Eigen::Index>(pose.first), n);
    // What white noise leaves of each reading.
    const Eigen::VectorXd share =
        (1 - 1 / static_cast<double>(n) - slow.rowwise().squaredNorm().array()).matrix();
    const double dof = share.sum();
    scatter.count(k) = static_cast<double>(n);
    scatter.variance(k) = trigamma(0.5 * dof);
    scatter.log_variance(k) =
        std::log(left_V.squaredNorm() / dof) - digamma(0.5 * dof) + std::log(0.5 * dof);
    const Eigen::Index quarter = n / 4;
    const double early_V2 = left_V.head(quarter).squaredNorm() / share.head(quarter).sum();
    const double late_V2 = left_V.tail(n - quarter).squaredNorm() / share.tail(n - quarter).sum();
    scatter.early_less_late_V2(k) = early_V2 - late_V2;
    scatter.early_V2 += early_V2 / static_cast<double>(visits);
    scatter.late_V2 += late_V2 / static_cast<double>(visits);
  }
  return scatter;
}

/// Functions of one variable at the visits, and what to call them.
struct Shape {
  std::string driver, words;
  Eigen::MatrixXd columns;
};

/// Scaled to [−1, 1]; empty when it never varied.
std::optional<Eigen::VectorXd> scaled(const Eigen::VectorXd& values) {
  const double low = values.minCoeff(), high = values.maxCoeff();
  if (!(high > low)) return {};
  return Eigen::VectorXd((2 * values.array() - low - high) / (high - low));
}

void add_powers(const std::string& driver, const std::string& of, const Eigen::VectorXd& values,
                bool straight_only, std::vector<Shape>& shapes) {
  const auto x = scaled(values);
  if (!x) return;
  shapes.push_back({driver, "straight line" + of, *x});
  if (straight_only) return;
  Eigen::MatrixXd both(x->size(), 2);
  both << *x, x->array().square().matrix();
  shapes.push_back({driver, "parabola" + of, std::move(both)});
}

/// From one of so many values on, the same number of visits between one and the next.
void add_steps(const Driver& driver, const Eigen::VectorXd& values, Eigen::Index places,
               std::vector<Shape>& shapes) {
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  const Eigen::Index n = values.size();
  for (Eigen::Index k = 1; k < places; ++k) {
    const double at = sorted[static_cast<std::size_t>(n * k / places)];
    if (!(at > sorted.front())) continue;
    shapes.push_back({driver.name, "step", (values.array() >= at).cast<double>().matrix()});
  }
}

/// From one of so many values to another.
void add_windows(const Driver& driver, const Eigen::VectorXd& values, int places,
                 std::vector<Shape>& shapes) {
  const double low = values.minCoeff(), part = (values.maxCoeff() - low) / places;
  for (int from = 1; from < places; ++from)
    for (int to = from + 1; to < places; ++to)
      shapes.push_back({driver.name, "window",
                        (values.array() >= low + part * from && values.array() < low + part * to)
                            .cast<double>()
                            .matrix()});
}

std::vector<Shape> shapes_for(const std::vector<Driver>& drivers, std::size_t axis) {
  std::vector<Shape> shapes;
  for (const Driver& driver : drivers) {
    const Eigen::Map<const Eigen::VectorXd> values(driver.value[axis].data(),
                                                   std::ssize(driver.value[axis]));
    if (driver.angle) {
      Eigen::MatrixXd waves(values.size(), 4);
      waves << values.array().cos().matrix(), values.array().sin().matrix(),
          (2 * values).array().cos().matrix(), (2 * values).array().sin().matrix();
      if (driver.varies()) shapes.push_back({driver.name, "harmonic series of order 2", waves});
      continue;
    }
    const std::string of = driver.past.empty() ? "" : " in the " + driver.past;
    if (driver.component == axis)
      add_powers(driver.name, " in its size", values.cwiseAbs(), true, shapes);
    add_powers(driver.name, of, values, driver.two_valued, shapes);
    // Something that was switched on, of itself or by what was recorded.
    constexpr Eigen::Index kInstants = 80, kLevels = 24;
    constexpr int kEdges = 20;
    if (driver.is_clock()) {
      add_steps(driver, values, std::min(kInstants, values.size()), shapes);
      add_windows(driver, values, kEdges, shapes);
    }
    if (driver.recorded) add_steps(driver, values, std::min(kLevels, values.size()), shapes);
  }
  return shapes;
}

/// Least squares of the logarithms, each with its own weight, about their mean.
struct LogFit {
  Eigen::VectorXd fitted;
  double square_left = 0;  ///< in units of Gaussian scatter
};
class LogFitter {
 public:
  LogFitter(const Scatter& scatter, const Eigen::MatrixXd& columns)
      : design_(columns.rows(), columns.cols() + 1),
        root_weight_(scatter.variance.cwiseSqrt().cwiseInverse()),
        y_(scatter.log_variance) {
    design_ << Eigen::VectorXd::Ones(columns.rows()), columns;
  }
  LogFit fit() const { return judge(solve(root_weight_)); }
  /// Prediction of the visits of each block from the others.
  LogFit left_out(const Blocks& blocks) const {
    LogFit result{Eigen::VectorXd::Zero(y_.size()), 0};
    for (const auto& block : blocks) {
      Eigen::VectorXd weight = root_weight_;
      weight(block).setZero();
      const Eigen::VectorXd fitted = design_ * solve(weight);
      result.fitted(block) = fitted(block);
    }
    result.square_left = (root_weight_.cwiseProduct(y_ - result.fitted)).squaredNorm();
    return result;
  }

 private:
  Eigen::VectorXd solve(const Eigen::VectorXd& root_weight) const {
    return (root_weight.asDiagonal() * design_)
        .colPivHouseholderQr()
        .solve(root_weight.cwiseProduct(y_));
  }
  LogFit judge(const Eigen::VectorXd& coefficients) const {
    const Eigen::VectorXd fitted = design_ * coefficients;
    return {fitted, (root_weight_.cwiseProduct(y_ - fitted)).squaredNorm()};
  }

  Eigen::MatrixXd design_;
  Eigen::VectorXd root_weight_, y_;
};

/// The first quarter of the dwells against the rest.
std::optional<NoiseDriver> within_dwells(const Scatter& scatter, std::size_t axis, double looks) {
  const auto n = static_cast<double>(scatter.count.size());
  const Eigen::VectorXd& each_V2 = scatter.early_less_late_V2;
  const double mean_V2 = each_V2.mean();
  const double u_V2 = std::sqrt((each_V2.array() - mean_V2).square().sum() / (n * (n - 1)));
  NoiseDriver found{axis, "t_in_pose", std::string(kNoise) + "first quarter against the rest"};
  found.sigmas = std::abs(mean_V2) / u_V2;
  const double square = found.sigmas * found.sigmas;
  found.p_value = p_of_search(log_chi_squared_tail(square, 1), looks);
  found.ratio = std::sqrt(scatter.early_V2 / scatter.late_V2);
  found.u_ratio = 0.5 * u_V2 / std::sqrt(scatter.early_V2 * scatter.late_V2);
  const double change = std::max(found.ratio, 1 / found.ratio);
  if (!(found.p_value < kDriverFalseAlarm) || change < kLeastChange) return {};
  found.heldout_gain = std::max(0.0, 1 - 1 / square);
  // Of the readings that share which the noisier part has.
  const double noisier = scatter.early_V2 > scatter.late_V2 ? 0.25 : 0.75;
  found.excess_V2 =
      noisier * std::abs(scatter.early_V2 - scatter.late_V2) * scatter.count.cwiseInverse();
  return found;
}

std::optional<NoiseDriver> from_visit_to_visit(const Scatter& scatter,
                                               const std::vector<Shape>& shapes, std::size_t axis,
                                               double looks,
                                               const std::vector<Blocks>& partitions) {
  const Eigen::Index n = scatter.count.size();
  const LogFitter constant(scatter, Eigen::MatrixXd(n, 0));
  const double without = constant.fit().square_left;
  std::optional<std::size_t> best;
  double best_log_p = 0;
  for (std::size_t s = 0; s < shapes.size(); ++s) {
    const auto columns = static_cast<double>(shapes[s].columns.cols());
    const double left = LogFitter(scatter, shapes[s].columns).fit().square_left;
    // Heavier tails than a Gaussian's scatter the logarithms more.
    const double scale = std::max(1.0, left / (static_cast<double>(n) - 1 - columns));
    const double log_p = log_chi_squared_tail((without - left) / scale, columns);
    if (log_p < best_log_p) {
      best = s;
      best_log_p = log_p;
    }
  }
  if (!best) return {};
  const Shape& shape = shapes[*best];
  const LogFitter fitter(scatter, shape.columns);
  const LogFit fit = fitter.fit();
  NoiseDriver found{axis, shape.driver, kNoise + shape.words};
  found.p_value = p_of_search(best_log_p, looks);
  found.sigmas = sigmas_of(best_log_p);
  const double least = fit.fitted.minCoeff();
  const double log_ratio = 0.5 * (fit.fitted.maxCoeff() - least);
  found.ratio = std::exp(log_ratio);
  if (!(found.p_value < kDriverFalseAlarm) || found.ratio < kLeastChange) return {};
  const double scale = std::max(1.0, fit.square_left / static_cast<double>(n));
  found.u_ratio = found.ratio * log_ratio * std::sqrt(scale / (without - fit.square_left));
  double power_without = 0, power_with = 0;
  for (const Blocks& blocks : partitions) {
    power_without += constant.left_out(blocks).square_left;
    power_with += fitter.left_out(blocks).square_left;
  }
  const double expected = static_cast<double>(partitions.size()) * static_cast<double>(n) * scale;
  found.heldout_gain = share_removed(power_without, power_with, expected);
  found.excess_V2 = ((fit.fitted.array().exp() - std::exp(least)) / scatter.count.array()).matrix();
  return found;
}

/// Whether the codes follow the noise.
bool shows_noise(const VisitLog& log, std::size_t axis) {
  constexpr double kSeen = 0.6;  // of a step
  return !log.codes[axis].any() && (!log.adc || log.input_sd_V[axis] > kSeen * log.adc->lsb_V());
}

}  // namespace

std::vector<NoiseDriver> noise_drivers(const VisitLog& log, const MeasurementSet& set,
                                       const std::vector<Blocks>& partitions) {
  std::vector<NoiseDriver> found;
  if (std::any_of(set.poses.begin(), set.poses.end(),
                  [](const Pose& pose) { return pose.count < kFewestReadings; }))
    return found;
  const std::vector<Driver> drivers = instantaneous_drivers(log);
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    if (!shows_noise(log, axis)) continue;
    const Scatter scatter = scatter_of(log, set, axis);
    if (!scatter.log_variance.allFinite()) continue;
    const std::vector<Shape> shapes = shapes_for(drivers, axis);
    const double looks = static_cast<double>(kAxisCount) * (static_cast<double>(shapes.size()) + 1);
    auto of_axis = from_visit_to_visit(scatter, shapes, axis, looks, partitions);
    auto of_dwell = within_dwells(scatter, axis, looks);
    if (of_axis) found.push_back(std::move(*of_axis));
    if (of_dwell) found.push_back(std::move(*of_dwell));
  }
  // What helps nowhere but where it was found is no cause.
  std::erase_if(found, [](const NoiseDriver& driver) { return !(driver.heldout_gain > 0); });
  return found;
}

}  // namespace plumbline
