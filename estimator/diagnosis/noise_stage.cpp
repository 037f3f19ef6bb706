#include "estimator/diagnosis/noise_stage.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "estimator/fit/rounding.h"
#include "estimator/noise/powers_allowance.h"
#include "estimator/parallel_for.h"

namespace plumbline {
namespace {

Eigen::MatrixXd independent_columns(const Eigen::MatrixXd& block) {
  // Columns of other axes are zero here; what one axis alone cannot tell apart stays in: a head
  // angle seen by this axis only weakly costs one degree of freedom at most.
  const Eigen::VectorXd norms = block.colwise().norm();
  Eigen::MatrixXd basis(block.rows(), 0);
  for (Eigen::Index j = 0; j < block.cols(); ++j) {
    if (!(norms(j) > 0)) continue;
    Eigen::VectorXd direction = block.col(j) / norms(j);
    direction -= basis * (basis.transpose() * direction);
    direction -= basis * (basis.transpose() * direction);
    if (direction.norm() < 1e-6) continue;
    basis.conservativeResize(Eigen::NoChange, basis.cols() + 1);
    basis.col(basis.cols() - 1) = direction.normalized();
  }
  return basis;
}

/// Of each contrast, the visits whose dwells resolve it: in short ones the finest are zero.
Eigen::ArrayXd visits_that_resolve(const VisitLog& log) {
  Eigen::ArrayXd count = Eigen::ArrayXd::Zero(log.dwell_contrasts());
  for (const auto& [samples, contrasts] : log.contrasts) {
    const auto visits =
        std::count_if(log.visits.begin(), log.visits.end(),
                      [&, length = samples](const Visit& visit) { return visit.count == length; });
    count += static_cast<double>(visits) *
             (contrasts.colwise().squaredNorm().transpose().array() > 0).cast<double>();
  }
  return count;
}

// Scatter of the contrasts about the model. Few odd dwells do not matter; the median would not do,
// since readings of a coarse converter are often all the same.
PerAxis<Eigen::VectorXd> dwell_scatter_V(const SearchInput& input,
                                         const EnlargedParameters& parameters) {
  const auto predicted = predict_dwells_V(input.log, parameters);
  const Eigen::ArrayXd resolved = visits_that_resolve(input.log).max(1);
  PerAxis<Eigen::VectorXd> sd_V;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    sd_V[i].resize(input.log.dwell_contrasts());
    for (Eigen::Index d = 0; d < sd_V[i].size(); ++d) {
      const Eigen::ArrayXd off =
          (input.observed.dwell_V[i].col(d) - predicted[i].col(d)).array().abs();
      const double rms = std::sqrt(off.square().sum() / resolved(d));
      const double clipped = std::sqrt(off.min(4 * rms).square().sum() / resolved(d));
      // Contrasts that are all zero (single readings) carry no information.
      sd_V[i](d) = clipped > 0 ? clipped : 1;
    }
  }
  return sd_V;
}

/// Variance that the model's prediction of each mean has because it is made where the axis would be
/// without slow noise: near a step of the response (a code, a limit) noise of `sd_V` decides on
/// which side a visit is. Beyond the variance of the noise itself.
Eigen::VectorXd crossing_variance_V2(const VisitLog& log, const EnlargedParameters& parameters,
                                     std::size_t axis, const Eigen::VectorXd& predicted_V,
                                     double sd_V) {
  constexpr int kPlaces = 5;      // on either side
  constexpr double kApart = 0.5;  // standard deviations
  Eigen::VectorXd square_V2 = Eigen::VectorXd::Zero(predicted_V.size());
  double weights = 1, plain_V2 = 0;
  for (int place = -kPlaces; place <= kPlaces; ++place) {
    if (place == 0) continue;
    EnlargedParameters shifted = parameters;
    const double away = kApart * place;
    shifted.twelve[axis](3) += away * sd_V;
    const double weight = std::exp(-0.5 * away * away);
    square_V2 += weight * (predict_means_V(log, shifted)[axis] - predicted_V).cwiseAbs2();
    plain_V2 += weight * std::pow(away * sd_V, 2);
    weights += weight;
  }
  return ((square_V2.array() - plain_V2) / weights).max(0);
}

/// Variance of the prediction of each mean from visits that effects leave open: by how much one way
/// or the other differs from what the model says; at the first visit the square of what the effect
/// does elsewhere.
PerAxis<Eigen::VectorXd> variance_left_open_V2(const VisitLog& log,
                                               const EnlargedParameters& parameters,
                                               const PerAxis<Eigen::VectorXd>& predicted_V) {
  PerAxis<Eigen::VectorXd> variance_V2;
  variance_V2.fill(Eigen::VectorXd::Zero(predicted_V[0].size()));
  for (std::size_t k = 0; k < parameters.effects.size(); ++k) {
    const auto ways = parameters.effects[k].effect->ways_at_ties(parameters.effects[k].p);
    for (const std::vector<double>& p : ways) {
      EnlargedParameters one_way = parameters;
      one_way.effects[k].p = p;
      const PerAxis<Eigen::VectorXd> otherwise_V = predict_means_V(log, one_way);
      for (std::size_t i = 0; i < kAxisCount; ++i)
        variance_V2[i] +=
            (otherwise_V[i] - predicted_V[i]).cwiseAbs2() / static_cast<double>(ways.size());
    }
    if (!parameters.effects[k].effect->guesses_at_start()) continue;
    const PerAxis<Eigen::VectorXd> without_V = predict_means_V(log, without_effect(parameters, k));
    for (std::size_t i = 0; i < kAxisCount; ++i)
      variance_V2[i](0) += (predicted_V[i] - without_V[i]).squaredNorm() /
                           static_cast<double>(predicted_V[i].size());
  }
  return variance_V2;
}

/// What the static record says of the noise of an axis.
NoiseModel record_of(const SearchInput& input, std::size_t axis, bool coarse) {
  if (input.log.codes[axis].coarser_lattice) return without_record(input.noise[axis]);
  return coarse ? record_beside_rounding(input.noise[axis], *input.log.adc,
                                         input.log.sample_sd_V[axis])
                : input.noise[axis];
}

/// Whether the readings of an axis are of a coarser lattice that the model does not hold (yet).
/// They are then freed of rounding to it: a model that holds the lattice turns every error on its
/// edges into one of a whole step, in which what else there is on that axis hides.
bool lacks_lattice(const VisitLog& log, const EnlargedParameters& parameters, std::size_t axis) {
  return log.codes[axis].coarser_lattice &&
         std::none_of(parameters.effects.begin(), parameters.effects.end(),
                      [&](const ActiveEffect& active) {
                        return active.axis == axis && active.effect->certain(log, axis);
                      });
}

/// Means of readings with what the declared converter made of each point of the lattice undone.
Eigen::VectorXd on_lattice_V(const Lattice& lattice, const Eigen::VectorXd& mean_V) {
  const auto nominal_V = [&](std::ptrdiff_t k) {
    return lattice.origin_V + lattice.step_V * static_cast<double>(k);
  };
  const auto reading_V = [&](std::ptrdiff_t k) {
    const double seen_V = lattice.seen_V(static_cast<double>(k));
    return std::isnan(seen_V) ? nominal_V(k) : seen_V;
  };
  return mean_V.unaryExpr([&](double value_V) {
    auto below =
        static_cast<std::ptrdiff_t>(std::floor((value_V - lattice.origin_V) / lattice.step_V));
    if (value_V < reading_V(below)) --below;
    if (value_V >= reading_V(below + 1)) ++below;
    const double from_V = reading_V(below), to_V = reading_V(below + 1);
    return nominal_V(below) + lattice.step_V * (value_V - from_V) / (to_V - from_V);
  });
}

}  // namespace

PerAxis<const PooledNoise*> all_of(const PerAxis<PooledNoise>& noise) {
  return {&noise[0], &noise[1], &noise[2]};
}

Stage settle_noise(const SearchInput& input, const EnlargedParameters& parameters,
                   const Before& before, const Eigen::MatrixXd& beside) {
  const auto predicted = predict_means_V(input.log, parameters);
  const Eigen::MatrixXd jacobian = prediction_jacobian(input.log, parameters);
  const Eigen::Index n = predicted[0].size();
  Eigen::VectorXd readings(n);
  for (Eigen::Index k = 0; k < n; ++k)
    readings(k) = static_cast<double>(input.log.visits[static_cast<std::size_t>(k)].count);
  Stage stage;
  stage.observed = input.observed;
  stage.whitening.dwell_sd_V = dwell_scatter_V(input, parameters);
  const PerAxis<Eigen::VectorXd> left_open_V2 =
      variance_left_open_V2(input.log, parameters, predicted);
  parallel_for(kAxisCount, [&](std::size_t i) {
    Eigen::VectorXd& mean_V = stage.observed.mean_V[i];
    const std::optional<Lattice>& lattice = input.log.codes[i].coarser_lattice;
    const bool on_lattice = lacks_lattice(input.log, parameters, i);
    if (on_lattice) mean_V = on_lattice_V(*lattice, mean_V);
    const Eigen::VectorXd measured_V = mean_V;
    const bool freed = before.freed != nullptr && before.freed->coarse[i];
    RoundingFree free{mean_V, Eigen::VectorXd::Zero(n)};
    const auto free_means = [&](const Eigen::VectorXd& expected_V) {
      // A converter without one of its bits does not round as it should.
      if (!input.log.adc || readings.maxCoeff() < 2 || !input.log.codes[i].stuck_bits.empty())
        return;
      const CodeScale scale =
          on_lattice ? CodeScale{.origin_V = lattice->origin_V, .step_V = lattice->step_V}
                     : scale_of(*input.log.adc);
      free = free_of_rounding(measured_V, expected_V, scale, input.log.sample_sd_V[i], readings,
                              input.log.line_V2[i]);
      mean_V = free.mean_V;
    };
    if (freed) {
      mean_V = before.freed->observed.mean_V[i];
      free = {mean_V, before.freed->own_V2[i] - input.known_V2[i], true,
              before.freed->beyond_V2[i]};
    } else {
      free_means(predicted[i]);
    }
    const Eigen::VectorXd first_V2 = free.variance_V2;
    if (before.known[i] != nullptr) {
      stage.noise[i] = *before.known[i];
    } else {
      Eigen::MatrixXd columns(n, jacobian.cols() + beside.cols());
      columns.leftCols(jacobian.cols()) = jacobian.middleRows(static_cast<Eigen::Index>(i) * n, n);
      if (beside.cols() > 0) columns.rightCols(beside.cols()) = beside;
      const Eigen::MatrixXd design = independent_columns(columns);
      const NoiseModel record = record_of(input, i, free.coarse);
      const auto pool = [&](const Eigen::VectorXd& own_V2) {
        const NoisePool noise(input.processes, record, own_V2);
        const Eigen::VectorXd residual_V = mean_V - predicted[i];
        if (before.powers != nullptr) return noise.at((*before.powers)[i], residual_V, design);
        return noise.pool(residual_V, design,
                          before.start != nullptr ? &(*before.start)[i].power : nullptr);
      };
      if (left_open_V2[i].maxCoeff() > 0) stage.crossing_V2[i] = left_open_V2[i];
      const Eigen::VectorXd own_V2 = input.known_V2[i] + free.variance_V2 + left_open_V2[i];
      stage.noise[i] = pool(own_V2);
      // Where the response is nothing but steps, only the visits near their edges say anything.
      if (has_effect_on(parameters, i) && !input.log.codes[i].coarser_lattice) {
        constexpr double kShareThatMatters = 0.1;
        const double mean_V2 = (stage.noise[i].covariance.diagonal() - left_open_V2[i]).mean();
        const Eigen::VectorXd crossing_V2 =
            crossing_variance_V2(input.log, parameters, i, predicted[i], std::sqrt(mean_V2));
        if (crossing_V2.maxCoeff() > kShareThatMatters * mean_V2) {
          stage.crossing_V2[i] = left_open_V2[i] + crossing_V2;
          stage.noise[i] = pool(own_V2 + crossing_V2);
        }
      }
    }
    if (free.coarse && !freed) {
      free_means(predicted[i] +
                 expected_from_others(stage.noise[i].covariance, mean_V - predicted[i]));
      if (before.known[i] == nullptr)
        stage.noise[i].covariance.diagonal() += free.variance_V2 - first_V2;
    }
    stage.coarse[i] = free.coarse;
    stage.beyond_V2[i] = free.beyond_V2;
    stage.own_V2[i] = input.known_V2[i] + free.variance_V2;
  });
  return stage;
}

void set_whitening(Stage& stage, const Before& before) {
  parallel_for(kAxisCount, [&](std::size_t i) {
    if (before.known[i] != nullptr && before.whitening != nullptr)
      stage.whitening.factor[i] = before.whitening->factor[i];
    else
      stage.whitening.set(i, stage.noise[i].covariance);
  });
}

Stage settle(const SearchInput& input, const EnlargedParameters& parameters, const Before& before) {
  Stage stage = settle_noise(input, parameters, before);
  set_whitening(stage, before);
  stage.fit = fit_enlarged(input.log, stage.observed, stage.whitening, parameters);
  return stage;
}

double deviance_of_axis(const SearchInput& input, const EnlargedParameters& parameters,
                        std::size_t axis, const Stage& stage) {
  Before before{.known = all_of(stage.noise), .start = &stage.noise, .freed = &stage};
  before.known[axis] = nullptr;
  return settle_noise(input, parameters, before).noise[axis].likelihood_deviance;
}

Eigen::MatrixXd with_allowance_for_noise(const SearchInput& input, const SearchResult& found,
                                         const Eigen::MatrixXd& jacobian) {
  const Eigen::MatrixXd& C = found.fit.covariance;
  const auto n = std::ssize(input.log.visits);
  const auto predicted = predict_means_V(input.log, found.fit.parameters);
  PerAxis<Eigen::MatrixXd> X;
  PerAxis<EstimatedPowers> powers;
  parallel_for(kAxisCount, [&](std::size_t i) {
    X[i] = jacobian.middleRows(static_cast<Eigen::Index>(i) * n, n);
    const PooledNoise& noise = found.noise[i];
    const NoisePool pool(input.processes, record_of(input, i, found.coarse[i]), found.own_V2[i]);
    const Eigen::MatrixXd design = independent_columns(X[i]);
    powers[i] = pool.estimated(noise, make_projector(noise.covariance, design).P,
                               found.observed.mean_V[i] - predicted[i], design);
  });
  // Whether there is slow noise at all, the axes of a triad say for one of which the steps of a
  // coarser lattice hide most.
  double gain_of_slow = 0;
  for (const EstimatedPowers& of : powers) gain_of_slow = std::max(gain_of_slow, of.gain_of_slow);
  std::vector<PowersAllowance> of_axis(kAxisCount);
  parallel_for(kAxisCount, [&](std::size_t i) {
    if (input.log.codes[i].coarser_lattice) powers[i].gain_of_slow = gain_of_slow;
    of_axis[i] =
        allowance_for_powers(input.processes, powers[i], found.noise[i].covariance, X[i], C);
  });
  return with_allowance(C, of_axis);
}

namespace {

/// One more column: value_of(visit) at every visit, centred and of unit length. What is not
/// recorded throughout or never changes adds none.
template <typename ValueOf>
void append_centred(const VisitLog& log, Eigen::MatrixXd& functions, const ValueOf& value_of) {
  const auto n = static_cast<Eigen::Index>(log.visits.size());
  Eigen::VectorXd column(n);
  for (Eigen::Index k = 0; k < n; ++k)
    column(k) = value_of(log.visits[static_cast<std::size_t>(k)]);
  column.array() -= column.mean();
  if (!column.allFinite() || !(column.norm() > 0)) return;
  functions.conservativeResize(n, functions.cols() + 1);
  functions.rightCols<1>() = column.normalized();
}

bool is_slow_in_order(const Eigen::VectorXd& values) {
  constexpr double kSlow = 0.05;  // mean squared change from visit to visit, of twice the variance
  const Eigen::Index changes = values.size() - 1;
  return (values.tail(changes) - values.head(changes)).squaredNorm() <
         kSlow * 2 * (values.array() - values.mean()).matrix().squaredNorm();
}

}  // namespace

bool goes_ring_by_ring(const VisitLog& log) {
  Eigen::VectorXd height(std::ssize(log.visits));
  for (Eigen::Index k = 0; k < height.size(); ++k)
    height(k) = std::sin(log.visits[static_cast<std::size_t>(k)].h_rad);
  return is_slow_in_order(height);
}

Eigen::MatrixXd slow_functions(const VisitLog& log) {
  Eigen::MatrixXd functions(std::ssize(log.visits), 0);
  const auto add = [&](const auto& value_of) { append_centred(log, functions, value_of); };
  const double middle_s = 0.5 * (log.first_s() + log.last_s());
  add([&](const Visit& visit) { return visit.t_mean_s - middle_s; });
  add([&](const Visit& visit) { return std::pow(visit.t_mean_s - middle_s, 2); });
  if (log.has_temperature) add([](const Visit& visit) { return visit.temperature_K; });
  for (std::size_t c = 0; c < log.covariate_names.size(); ++c)
    add([c](const Visit& visit) { return visit.covariate[c]; });
  if (!goes_ring_by_ring(log)) return functions;
  for (const double power : {2.0, 3.0})
    add([power](const Visit& visit) { return std::pow(std::sin(visit.h_rad), power); });
  return functions;
}

Eigen::MatrixXd any_course_of_time(const VisitLog& log) {
  Eigen::MatrixXd functions = slow_functions(log);
  const std::ptrdiff_t waves = std::min<std::ptrdiff_t>(16, std::ssize(log.visits) / 12);
  for (std::ptrdiff_t w = 1; w <= waves; ++w) {
    const double rate_per_s =
        std::numbers::pi * static_cast<double>(w) / (log.last_s() - log.first_s());
    append_centred(log, functions, [&](const Visit& visit) {
      return std::cos(rate_per_s * (visit.t_mean_s - log.first_s()));
    });
  }
  return functions;
}

}  // namespace plumbline
