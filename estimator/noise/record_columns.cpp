#include "estimator/noise/record_columns.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>
#include <utility>

#include "estimator/noise/noise_processes.h"
#include "estimator/noise/reml.h"

namespace plumbline {
namespace {

constexpr Eigen::Index kFewestSpans = 40;
constexpr Eigen::Index kMostSpans = 160;
constexpr std::size_t kFewestSamples = 8;  // of a span
// Of −2 ln L: one column in a thousand that has nothing to do with the record.
constexpr double kClearly = 11;

using Values = Eigen::Map<const Eigen::VectorXd>;

/// A column at the record's samples.
struct Column {
  std::string name;
  const double* first = nullptr;
  double level = 0;      ///< mean over the record
  Eigen::VectorXd mean;  ///< of each span, about that
};

/// Spans of equal length that cover the record but for a rest of less than one.
struct Spans {
  Eigen::Index count = 0;
  Eigen::Index samples = 0;  ///< of each
  Eigen::VectorXd means(const Values& of) const {
    return of.head(count * samples).reshaped(samples, count).colwise().mean();
  }
};

/// Those that change in the record.
std::vector<Column> columns_of(const SampleTable& table, std::size_t first, Eigen::Index count,
                               const Spans& spans) {
  std::vector<Column> columns;
  const auto add = [&](const std::string& name, const std::vector<double>& values) {
    if (values.empty()) return;
    const Values value(values.data() + first, count);
    if (!value.allFinite()) return;
    const double level = value.mean();
    const Eigen::VectorXd mean = spans.means(value).array() - level;
    if (mean.maxCoeff() > mean.minCoeff()) columns.push_back({name, value.data(), level, mean});
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

/// Of −2 ln L in white noise, by which a column is looked at more closely: slow noise as well as
/// what follows the column is much more than that.
bool is_worth_a_look(const Eigen::MatrixXd& design, const Eigen::VectorXd& mean,
                     const Eigen::VectorXd& column) {
  const Eigen::VectorXd left = mean - design * design.colPivHouseholderQr().solve(mean);
  const Eigen::VectorXd other = column - design * design.colPivHouseholderQr().solve(column);
  const double share =
      left.dot(other) * left.dot(other) / (left.squaredNorm() * other.squaredNorm());
  return -static_cast<double>(mean.size()) * std::log1p(-std::min(share, 1.0)) > kClearly;
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
      std::max(kFewestSamples, record.size() / static_cast<std::size_t>(kMostSpans)));
  spans.count = std::ssize(record) / spans.samples;
  Eigen::Map<Eigen::VectorXd> u(record.data(), std::ssize(record));
  if (spans.count < kFewestSpans || !u.allFinite()) return {};
  // A record that stands on one code is no better known for what is taken out of it.
  if ((u.tail(u.size() - 1).array() != u.head(u.size() - 1).array()).count() < spans.count)
    return {};
  std::vector<Column> columns = columns_of(table, first, u.size(), spans);
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
  while (!columns.empty()) {
    std::optional<PooledNoise> best;
    auto which = columns.end();
    for (auto column = columns.begin(); column != columns.end(); ++column) {
      if (!is_worth_a_look(design, mean, column->mean)) continue;
      if (!so_far) so_far = pool.pool(mean, design);
      PooledNoise found = pool.pool(mean, with_column(design, column->mean), &so_far->power);
      if (best && best->likelihood_deviance <= found.likelihood_deviance) continue;
      best = std::move(found);
      which = column;
    }
    if (!best || best->likelihood_deviance > so_far->likelihood_deviance - kClearly) break;
    design = with_column(design, which->mean);
    followed.push_back(std::move(*which));
    columns.erase(which);
    so_far = std::move(best);
  }
  std::vector<std::string> names;
  if (followed.empty()) return names;
  const Eigen::VectorXd coefficients = coefficients_in(*so_far, design, mean);
  for (std::size_t k = 0; k < followed.size(); ++k) {
    u.array() -= coefficients(static_cast<Eigen::Index>(k) + 1) *
                 (Values(followed[k].first, u.size()).array() - followed[k].level);
    names.push_back(followed[k].name);
  }
  return names;
}

}  // namespace plumbline
