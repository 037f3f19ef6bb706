#include "estimator/diagnosis/residual_test.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "estimator/linear_algebra.h"
#include "estimator/noise/chi_squared.h"

namespace plumbline {

namespace {

/// Monomials of degree 2 to 4 of the specific force.
void append_position(const Eigen::MatrixXd& a, std::vector<Eigen::VectorXd>& columns) {
  constexpr int kDegree = 4;
  for (int i = 0; i <= kDegree; ++i)
    for (int j = 0; i + j <= kDegree; ++j)
      for (int k = 0; i + j + k <= kDegree; ++k)
        if (i + j + k >= 2)
          columns.emplace_back(
              (a.col(0).array().pow(i) * a.col(1).array().pow(j) * a.col(2).array().pow(k))
                  .matrix());
}

/// A tilted base or a horizontal field turns with the sensor at full strength however high the
/// spindle points: directions on the horizontal circle, no polynomials of the specific force.
void append_horizontal(const Eigen::MatrixXd& a, std::vector<Eigen::VectorXd>& columns) {
  const Eigen::ArrayXd level = a.leftCols<2>().rowwise().norm().array();
  const Eigen::ArrayXd upright = (level > 1e-6).select(level.inverse(), 0.0);
  for (Eigen::Index c = 0; c < 2; ++c) {
    const Eigen::ArrayXd direction = a.col(c).array() * upright;
    columns.emplace_back(direction.matrix());
    columns.emplace_back((direction * a.col(2).array()).matrix());
  }
  columns.emplace_back(level.matrix());
}

/// What may remain of the way to a pose: the change of the specific force, its sign (hysteresis),
/// and the sense of turning about z times the cross axes (backlash). Zero at the first pose.
void append_history(const Eigen::MatrixXd& a, std::vector<Eigen::VectorXd>& columns) {
  const Eigen::Index n = a.rows();
  Eigen::MatrixXd history = Eigen::MatrixXd::Zero(n, 8);
  for (Eigen::Index i = 1; i < n; ++i) {
    const Eigen::RowVector3d change = a.row(i) - a.row(i - 1);
    const double turn = a(i - 1, 0) * a(i, 1) - a(i - 1, 1) * a(i, 0);
    constexpr double kStill = 1e-9;
    const auto sign = [](double v) { return v > kStill ? 1.0 : v < -kStill ? -1.0 : 0.0; };
    history.row(i) << change, sign(change(0)), sign(change(1)), sign(change(2)),
        sign(turn) * a(i, 0), sign(turn) * a(i, 1);
  }
  for (Eigen::Index c = 0; c < history.cols(); ++c) columns.emplace_back(history.col(c));
}

/// A scale that changes with time.
void append_scale_drift(const Eigen::MatrixXd& a, std::vector<Eigen::VectorXd>& columns) {
  const Eigen::ArrayXd order = Eigen::ArrayXd::LinSpaced(a.rows(), -1, 1);
  for (Eigen::Index c = 0; c < 3; ++c) columns.emplace_back((order * a.col(c).array()).matrix());
}

/// Orthonormal basis of all these functions less what the design spans already.
Eigen::MatrixXd structure_functions(const Eigen::MatrixXd& a, const Eigen::MatrixXd& drivers,
                                    const Eigen::MatrixXd& design) {
  std::vector<Eigen::VectorXd> columns;
  append_position(a, columns);
  append_horizontal(a, columns);
  append_history(a, columns);
  append_scale_drift(a, columns);
  for (Eigen::Index c = 0; c < drivers.cols(); ++c) {
    const Eigen::VectorXd centred = drivers.col(c).array() - drivers.col(c).mean();
    if (centred.norm() > 0) columns.emplace_back(centred / centred.norm());
  }
  const Eigen::Index n = a.rows();
  Eigen::MatrixXd all(n, static_cast<Eigen::Index>(columns.size()));
  for (std::size_t c = 0; c < columns.size(); ++c)
    all.col(static_cast<Eigen::Index>(c)) = columns[c];
  const Eigen::MatrixXd q = orthonormal_basis(design);
  all -= q * (q.transpose() * all);
  // On the sphere the monomials are dependent.
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  qr.setThreshold(1e-6);
  qr.compute(all);
  return qr.householderQ() * Eigen::MatrixXd::Identity(n, qr.rank());
}

/// Degrees of freedom from which the noise along the structure functions is known: Satterthwaite's
/// 2/relvar of tr(S·Σ)/q under the uncertainty of the estimated powers, S what the functions take.
/// P is the projector of the columns that the noise was estimated beside.
double noise_degrees_of_freedom(const NoisePool& pool, const PooledNoise& noise,
                                const Eigen::MatrixXd& P, const Eigen::MatrixXd& taken,
                                double functions) {
  // A slow process estimated at zero is uncertain all the same.
  const std::vector<Eigen::Index> free = {kTermN, kTermB, kTermK};
  Eigen::VectorXd slope(static_cast<Eigen::Index>(free.size()));
  for (std::size_t i = 0; i < free.size(); ++i)
    slope(static_cast<Eigen::Index>(i)) =
        taken.cwiseProduct(pool.processes().unit[static_cast<std::size_t>(free[i])]).sum() /
        functions;
  const double variance = propagated_variance(pool.information_of(noise, P, free), slope);
  return variance > 0 ? 2 / variance : 1e9;
}

/// Below this the noise is taken from what the structure functions leave.
constexpr double kStructureSeen = 1e-3;

/// Geometric mean times e: a p-value whatever the dependence of the two (Vovk & Wang, Biometrika
/// 107, 2020).
double merged(double first, double second) {
  return std::min(1.0, std::exp(1.0) * std::sqrt(first) * std::sqrt(second));
}

/// The structure functions tested under one estimate of the noise.
struct Judgement {
  PooledNoise noise;
  double p_structure = 1;
  double chi2 = 0;    ///< of the model alone
  Eigen::MatrixXd P;  ///< projector of the columns that the noise was estimated beside
};

/// `beside`: how many columns of [design, functions] the noise was estimated beside.
Judgement judge(const NoisePool& pool, PooledNoise noise, const Eigen::VectorXd& y,
                const Eigen::MatrixXd& design, const Eigen::MatrixXd& functions,
                Eigen::Index beside) {
  Judgement result;
  result.noise = std::move(noise);
  const Eigen::MatrixXd before = make_projector(result.noise.covariance, design).P;
  result.chi2 = y.dot(before * y);
  // The same with the functions, by the block form of the projector.
  const Eigen::MatrixXd weighted = before * functions;
  const Eigen::LDLT<Eigen::MatrixXd> normal(functions.transpose() * weighted);
  const Eigen::MatrixXd taken = weighted * normal.solve(weighted.transpose());
  result.P = beside > design.cols() ? Eigen::MatrixXd(before - taken) : before;
  if (functions.cols() > 0) {
    const auto count = static_cast<double>(functions.cols());
    const double dof = noise_degrees_of_freedom(pool, result.noise, result.P, taken, count);
    result.p_structure = f_tail(y.dot(taken * y) / count, count, dof);
  }
  return result;
}

}  // namespace

Eigen::MatrixXd driver_means(const SampleTable& samples, const std::vector<Pose>& poses) {
  std::vector<const std::vector<double>*> columns;
  if (!samples.temp_C.empty()) columns.push_back(&samples.temp_C);
  for (const Covariate& covariate : samples.covariates) columns.push_back(&covariate.value);
  Eigen::MatrixXd means(static_cast<Eigen::Index>(poses.size()), 0);
  for (const std::vector<double>* column : columns) {
    Eigen::VectorXd mean(means.rows());
    for (std::size_t i = 0; i < poses.size(); ++i)
      mean(static_cast<Eigen::Index>(i)) =
          Eigen::Map<const Eigen::VectorXd>(column->data() + poses[i].first,
                                            static_cast<Eigen::Index>(poses[i].count))
              .mean();
    if (!mean.allFinite()) continue;
    means.conservativeResize(Eigen::NoChange, means.cols() + 1);
    means.rightCols<1>() = mean;
  }
  return means;
}

ResidualTestResult test_residual(const NoiseModel& noise, const ResidualTestInput& input) {
  const Eigen::VectorXd& y = input.mean;
  assert(input.specific_force.rows() == y.size() && input.specific_force.cols() == 3);
  assert(input.drivers.size() == 0 || input.drivers.rows() == y.size());
  const Eigen::Index n = y.size();
  const Eigen::MatrixXd functions =
      structure_functions(input.specific_force, input.drivers, input.design);
  Eigen::MatrixXd full(n, input.design.cols() + functions.cols());
  full << input.design, functions;
  const bool enough = n >= input.design.cols() + 3 * functions.cols();
  const NoisePool pool(input.processes, noise, input.extra_variance);
  const Eigen::MatrixXd* beside = &input.design;
  Judgement judged =
      judge(pool, pool.pool(y, input.design), y, input.design, functions, input.design.cols());
  ResidualTestResult result;
  if (enough) {
    // With the noise estimated beside the model alone, structure is partly taken for slow noise;
    // beside the functions, too, slow noise is partly taken for structure. Both count.
    Judgement rich = judge(pool, pool.pool(y, full, &judged.noise.power), y, input.design,
                           functions, full.cols());
    result.p_structure = merged(judged.p_structure, rich.p_structure);
    if (result.p_structure < kStructureSeen) {
      judged = std::move(rich);
      beside = &full;
    }
  }
  result.powers = pool.estimated(judged.noise, judged.P, y, *beside);
  result.noise = std::move(judged.noise);
  result.chi2 = judged.chi2;
  result.dof = static_cast<double>(n - input.design.cols());
  const Eigen::MatrixXd& P = judged.P;
  const Eigen::VectorXd py = P * y;

  // Scatter from pose to pose: the score of an independent variance beside the noise, against its
  // expectation; a scaled χ² with the same two moments (Satterthwaite).
  const double scatter = py.squaredNorm();
  const double expected = P.trace();
  const double variance = 2 * P.squaredNorm();
  result.p_excess =
      chi_squared_tail(2 * expected * scatter / variance, 2 * expected * expected / variance);

  // The pose that fits worst, judged by the others.
  double worst = 0;
  for (Eigen::Index i = 0; i < n; ++i)
    if (P(i, i) > 0) worst = std::max(worst, std::abs(py(i)) / std::sqrt(P(i, i)));
  const double p_worst =
      input.coarse ? f_tail(worst * worst, 1, kDofOfCoarseReadings) : normal_two_sided_tail(worst);
  result.p_outlier = std::min(1.0, static_cast<double>(n) * p_worst);

  result.p_value =
      std::min(1.0, 3 * std::min({result.p_structure, result.p_excess, result.p_outlier}));
  return result;
}

}  // namespace plumbline
