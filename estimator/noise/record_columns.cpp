#include "estimator/noise/record_columns.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include "estimator/noise/noise_processes.h"
#include "estimator/noise/reml.h"

namespace plumbline {
namespace {

constexpr Eigen::Index kFewestSpans = 40;
constexpr Eigen::Index kMostSpans = 160;
constexpr std::size_t kFewestOfSpan = 8;  // of a span
// Of −2 ln L: one column in a thousand that has nothing to do with the record.
constexpr double kClearly = 11;
// What an answer must gain besides that is one of many.
constexpr double kPriceOfShape = 13;
constexpr std::size_t kMostTaken = 4;
constexpr std::size_t kShapesRefined = 6;

using Values = Eigen::Map<const Eigen::VectorXd>;

/// How an output may answer to a column: its values, at an even step, in; the answer out.
using Answer = std::function<Eigen::VectorXd(const Eigen::VectorXd&)>;

/// An answer to a column at the record's samples.
struct Column {
  std::string name;
  Answer answer;
  double price = 0;
  Values value;          ///< of the column, at the samples
  Eigen::VectorXd mean;  ///< of the answer over each span, about its own mean

  Eigen::VectorXd at_samples() const { return answer(value); }
};

/// Spans of equal length that cover the record but for a rest of less than one.
struct Spans {
  Eigen::Index count = 0;
  Eigen::Index samples = 0;  ///< of each
  Eigen::VectorXd means(const Values& of) const {
    return of.head(count * samples).reshaped(samples, count).colwise().mean();
  }
};

Eigen::VectorXd line(const Eigen::VectorXd& x) { return x; }

/// Follows the column once that has moved on by the play; `start`: where in it, −1 to 1.
Answer play(double width, double start) {
  return [=](const Eigen::VectorXd& x) {
    Eigen::VectorXd y(x.size());
    double at = x(0) + 0.5 * start * width;
    for (Eigen::Index k = 0; k < x.size(); ++k)
      y(k) = at = std::clamp(at, x(k) - 0.5 * width, x(k) + 0.5 * width);
    return y;
  };
}

/// The average of the column's past, exponential over a share of the record.
Eigen::VectorXd past(const Eigen::VectorXd& x, double share) {
  const double keep = std::exp(-1 / (share * static_cast<double>(x.size())));
  Eigen::VectorXd y(x.size());
  double at = x(0);
  for (Eigen::Index k = 0; k < x.size(); ++k) y(k) = at = x(k) + (at - x(k)) * keep;
  return y;
}

/// Those that are no straight line, for a column with these means of the spans.
std::vector<Answer> shapes_of(const Eigen::VectorXd& mean) {
  std::vector<Answer> answers;
  Eigen::VectorXd sorted = mean;
  std::sort(sorted.begin(), sorted.end());
  const double range = sorted(sorted.size() - 1) - sorted(0);
  const auto add_with_its_rest = [&](const Answer& follower) {
    answers.push_back(follower);
    answers.push_back([=](const Eigen::VectorXd& x) { return Eigen::VectorXd(x - follower(x)); });
  };
  constexpr double kNarrowest = 0.06, kWider = 1.2;
  constexpr int kWidths = 15;  // up to 0.8 of the range
  for (int k = 0; k < kWidths; ++k)
    for (const double start : {-1.0, -0.5, 0.0, 0.5, 1.0})
      add_with_its_rest(play(kNarrowest * std::pow(kWider, k) * range, start));
  for (const double share : {0.02, 0.05, 0.1, 0.2, 0.4})
    add_with_its_rest([=](const Eigen::VectorXd& x) { return past(x, share); });
  for (const double quantile : {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9}) {
    const double at =
        sorted(static_cast<Eigen::Index>(quantile * static_cast<double>(sorted.size())));
    answers.push_back(
        [=](const Eigen::VectorXd& x) { return Eigen::VectorXd((x.array() > at).cast<double>()); });
    answers.push_back(
        [=](const Eigen::VectorXd& x) { return Eigen::VectorXd((x.array() - at).cwiseMax(0)); });
  }
  const double middle = mean.mean();
  answers.push_back(
      [=](const Eigen::VectorXd& x) { return Eigen::VectorXd((x.array() - middle).square()); });
  return answers;
}

Eigen::VectorXd centred(const Eigen::VectorXd& x) { return x.array() - x.mean(); }

/// Answers to those that change in the record. Of shapes the mean of the answer is for now that to
/// the means.
std::vector<Column> columns_of(const SampleTable& table, std::size_t first, Eigen::Index count,
                               const Spans& spans) {
  std::vector<Column> columns;
  const auto add = [&](const std::string& name, const std::vector<double>& values) {
    if (values.empty()) return;
    const Values value(values.data() + first, count);
    if (!value.allFinite()) return;
    const Eigen::VectorXd mean = spans.means(value);
    if (!(mean.maxCoeff() > mean.minCoeff())) return;
    columns.push_back({name, line, 0, value, centred(mean)});
    for (Answer& shape : shapes_of(mean)) {
      Eigen::VectorXd answer = centred(shape(mean));
      if (answer.maxCoeff() > answer.minCoeff())
        columns.push_back({name, std::move(shape), kPriceOfShape, value, std::move(answer)});
    }
  };
  add("temp_C", table.temp_C);
  for (const Covariate& covariate : table.covariates) add(covariate.name, covariate.value);
  return columns;
}

/// Generalised least squares of the design in this noise.
Eigen::VectorXd coefficients_in(const PooledNoise& noise, const Eigen::MatrixXd& design,
                                const Eigen::VectorXd& mean) {
  const Eigen::LLT<Eigen::MatrixXd> factor(noise.covariance);
  const Eigen::MatrixXd white_design = factor.matrixL().solve(design);
  const Eigen::VectorXd white_mean = factor.matrixL().solve(mean);
  return white_design.colPivHouseholderQr().solve(white_mean);
}

/// What a design leaves of a vector.
class Remainder {
 public:
  explicit Remainder(const Eigen::MatrixXd& design) : design_(design), qr_(design) {}
  Eigen::VectorXd of(const Eigen::VectorXd& v) const { return v - design_ * qr_.solve(v); }

 private:
  Eigen::MatrixXd design_;
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr_;
};

/// Those by which −2 ln L in white noise is clearly smaller, which are looked at more closely: slow
/// noise as well as what follows a column is much more than that. None that the design holds.
std::vector<const Column*> worth_a_look(const std::vector<Column>& columns,
                                        const Eigen::MatrixXd& design,
                                        const Eigen::VectorXd& mean) {
  constexpr double kHeld = 1e-9;  // left of a column, as a share
  const Remainder remainder(design);
  const Eigen::VectorXd left = remainder.of(mean);
  std::vector<const Column*> worth;
  for (const Column& column : columns) {
    const Eigen::VectorXd other = remainder.of(column.mean);
    if (other.squaredNorm() < kHeld * column.mean.squaredNorm()) continue;
    const double share =
        left.dot(other) * left.dot(other) / (left.squaredNorm() * other.squaredNorm());
    if (-static_cast<double>(mean.size()) * std::log1p(-std::min(share, 1.0)) > kClearly)
      worth.push_back(&column);
  }
  return worth;
}

/// Of shapes the few that promise most in this noise, with their answers at the samples. Of those
/// that are nearly the same the best one.
std::vector<Column> likeliest_shapes(const std::vector<const Column*>& columns,
                                     const PooledNoise& noise, const Eigen::MatrixXd& design,
                                     const Eigen::VectorXd& mean, const Spans& spans) {
  const Eigen::LLT<Eigen::MatrixXd> factor(noise.covariance);
  const Remainder remainder(factor.matrixL().solve(design));
  const auto left_of = [&](const Eigen::VectorXd& v) {
    return remainder.of(factor.matrixL().solve(v));
  };
  const Eigen::VectorXd left = left_of(mean);
  struct Promise {
    double gain = 0;
    const Column* column = nullptr;
    Eigen::VectorXd direction = {};
  };
  std::vector<Promise> promised;
  for (const Column* column : columns) {
    if (column->price == 0) continue;
    Eigen::VectorXd other = left_of(column->mean);
    const double size = other.norm();
    if (!(size > 0)) continue;
    other /= size;
    promised.push_back({left.dot(other) * left.dot(other), column, std::move(other)});
  }
  std::stable_sort(promised.begin(), promised.end(),
                   [](const Promise& a, const Promise& b) { return a.gain > b.gain; });
  constexpr double kSame = 0.98;  // cosine
  std::vector<Column> likeliest;
  std::vector<const Eigen::VectorXd*> directions;
  for (const Promise& promise : promised) {
    if (likeliest.size() == kShapesRefined) break;
    if (std::any_of(directions.begin(), directions.end(), [&](const Eigen::VectorXd* taken) {
          return std::abs(taken->dot(promise.direction)) > kSame;
        }))
      continue;
    directions.push_back(&promise.direction);
    likeliest.push_back(*promise.column);
    const Eigen::VectorXd answer = likeliest.back().at_samples();
    likeliest.back().mean = centred(spans.means(Values(answer.data(), answer.size())));
  }
  return likeliest;
}

Eigen::MatrixXd with_column(const Eigen::MatrixXd& design, const Eigen::VectorXd& column) {
  Eigen::MatrixXd wider(design.rows(), design.cols() + 1);
  wider << design, column;
  return wider;
}

}  // namespace

std::vector<std::string> take_out_columns(std::vector<double>& record, const SampleTable& table,
                                          std::size_t first, double step_s) {
  assert(first + record.size() <= table.size() && step_s > 0);
  Spans spans;
  spans.samples = static_cast<Eigen::Index>(
      std::max(kFewestOfSpan, record.size() / static_cast<std::size_t>(kMostSpans)));
  spans.count = std::ssize(record) / spans.samples;
  Eigen::Map<Eigen::VectorXd> u(record.data(), std::ssize(record));
  if (spans.count < kFewestSpans || !u.allFinite()) return {};
  // A record that stands on one code is no better known for what is taken out of it.
  if ((u.tail(u.size() - 1).array() != u.head(u.size() - 1).array()).count() < spans.count)
    return {};
  const std::vector<Column> columns = columns_of(table, first, u.size(), spans);
  const Eigen::VectorXd mean =
      spans.means(Values(record.data(), u.size())).array() - record.front();
  const double scatter = (mean.tail(spans.count - 1) - mean.head(spans.count - 1)).norm();
  if (columns.empty() || !(scatter > 0)) return {};

  std::vector<SampleWindow> windows;
  for (Eigen::Index k = 0; k < spans.count; ++k)
    windows.push_back({static_cast<double>(k * spans.samples) * step_s, step_s,
                       static_cast<std::size_t>(spans.samples)});
  NoiseModel white;  // to begin with
  white.N.value =
      scatter * std::sqrt(windows.front().duration_s() / 2 / static_cast<double>(spans.count - 1));
  const NoiseProcesses processes = noise_processes(windows);
  const NoisePool pool(processes, white, {});
  Eigen::MatrixXd design = Eigen::VectorXd::Ones(spans.count);
  std::vector<Column> followed;
  std::optional<PooledNoise> so_far;
  while (followed.size() < kMostTaken) {
    const std::vector<const Column*> worth = worth_a_look(columns, design, mean);
    if (worth.empty()) break;
    if (!so_far) so_far = pool.pool(mean, design);
    std::vector<Column> possible = likeliest_shapes(worth, *so_far, design, mean, spans);
    for (const Column* column : worth)
      if (column->price == 0) possible.push_back(*column);
    std::optional<PooledNoise> best;
    const Column* which = nullptr;
    for (const Column& column : possible) {
      PooledNoise found = pool.pool(mean, with_column(design, column.mean), &so_far->power);
      if (best &&
          best->likelihood_deviance + which->price <= found.likelihood_deviance + column.price)
        continue;
      best = std::move(found);
      which = &column;
    }
    if (!best || best->likelihood_deviance + which->price > so_far->likelihood_deviance - kClearly)
      break;
    design = with_column(design, which->mean);
    followed.push_back(*which);
    so_far = std::move(best);
  }
  std::vector<std::string> names;
  if (followed.empty()) return names;
  const Eigen::VectorXd coefficients = coefficients_in(*so_far, design, mean);
  for (std::size_t k = 0; k < followed.size(); ++k) {
    u -= coefficients(static_cast<Eigen::Index>(k) + 1) * centred(followed[k].at_samples());
    if (std::find(names.begin(), names.end(), followed[k].name) == names.end())
      names.push_back(followed[k].name);
  }
  return names;
}

}  // namespace plumbline
