#include "estimator/fit/eight_state_filter.h"

#include <cassert>
#include <cmath>
#include <cstring>
#include <numbers>
#include <unsupported/Eigen/MatrixFunctions>

namespace plumbline {
namespace {

double squared(double value) { return value * value; }

// The arithmetic of a step and of an update, on columns of the covariance in halves of four: the
// compiler maps them to whatever vectors there are. Each of the two functions exists once for any
// processor and once for those with AVX2 and FMA.
using Four = double __attribute__((vector_size(32)));

struct Column {
  Four top;
  Four bottom;
};

// Vectors never pass through a call: without AVX there is no agreed way to.
[[gnu::always_inline]] inline void load(const double* from, Four& rows) {
  std::memcpy(&rows, from, sizeof rows);
}
[[gnu::always_inline]] inline void store(const Four& rows, double* to) {
  std::memcpy(to, &rows, sizeof rows);
}
[[gnu::always_inline]] inline void load(const double* from, Column& c) {
  load(from, c.top);
  load(from + 4, c.bottom);
}
[[gnu::always_inline]] inline void store(const Column& c, double* to) {
  store(c.top, to);
  store(c.bottom, to + 4);
}

constexpr std::size_t kSize = kEightStateCount;

/// Rows 4 … 7 of a column: the first two by a factor, the two of the ramp act on each other.
[[gnu::always_inline]] inline void carry_rows(const Four& same, const Four& other, Four& rows) {
  rows = same * rows + other * __builtin_shufflevector(rows, rows, 0, 1, 3, 2);
}

/// x ← F·x, P ← F·P·Fᵀ + Q.
[[gnu::always_inline]] inline void carry(const double* same, const double* other,
                                         const double* noise, double noise_ramp, double* x,
                                         double* P) {
  Four kept, crossed;
  load(same, kept);
  load(other, crossed);
#pragma GCC unroll 4
  for (std::size_t k = 0; k < 4; ++k) {
    double* const lower = P + kSize * k + 4;
    Four rows;
    load(lower, rows);
    carry_rows(kept, crossed, rows);
    store(rows, lower);
  }
  Column flicker, walk, ramp, rate;
  load(P + kSize * kStateFlicker, flicker);
  load(P + kSize * kStateRandomWalk, walk);
  load(P + kSize * kStateRamp, ramp);
  load(P + kSize * kStateRampRate, rate);
  Column c{same[0] * flicker.top, same[0] * flicker.bottom};
  carry_rows(kept, crossed, c.bottom);
  c.bottom += Four{noise[kStateFlicker], 0, 0, 0};
  store(c, P + kSize * kStateFlicker);
  c = {same[1] * walk.top, same[1] * walk.bottom};
  carry_rows(kept, crossed, c.bottom);
  c.bottom += Four{0, noise[kStateRandomWalk], 0, 0};
  store(c, P + kSize * kStateRandomWalk);
  c = {same[2] * ramp.top + other[2] * rate.top, same[2] * ramp.bottom + other[2] * rate.bottom};
  carry_rows(kept, crossed, c.bottom);
  c.bottom += Four{0, 0, noise[kStateRamp], noise_ramp};
  store(c, P + kSize * kStateRamp);
  c = {other[3] * ramp.top + same[3] * rate.top, other[3] * ramp.bottom + same[3] * rate.bottom};
  carry_rows(kept, crossed, c.bottom);
  c.bottom += Four{0, 0, noise_ramp, noise[kStateRampRate]};
  store(c, P + kSize * kStateRampRate);
  for (std::size_t k = 0; k < 4; ++k) P[(kSize + 1) * k] += noise[k];
  Four states;
  load(x + 4, states);
  carry_rows(kept, crossed, states);
  store(states, x + 4);
}

[[gnu::always_inline]] inline double dot(const Column& a, const Column& b) {
  const Four sum = a.top * b.top + a.bottom * b.bottom;
  return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

/// Joseph's form for one measurement, (I − g·hᵀ)·P·(I − g·hᵀ)ᵀ + r·g·gᵀ, one factor after the other
/// (Bierman 1977). `h` has kSize entries. Returns innovation and its variance.
[[gnu::always_inline]] inline Innovation correct(const double* h, double measured, double r,
                                                 double* x, double* P) {
  // Sums in two parts, which need not wait for each other.
  Column v{};
  Column v2{};
#pragma GCC unroll 8
  for (std::size_t k = 0; k < kSize; ++k) {
    Column c;
    load(P + kSize * k, c);
    Column& sum = k % 2 == 0 ? v : v2;
    sum.top += c.top * h[k];
    sum.bottom += c.bottom * h[k];
  }
  v.top += v2.top;
  v.bottom += v2.bottom;
  // Read one by one: they have just been written so.
  const Column seen{{h[0], h[1], h[2], h[3]}, {h[4], h[5], h[6], h[7]}};
  Column states;
  load(x, states);
  const Innovation innovation{measured - dot(seen, states), dot(seen, v) + r};
  const double inverse = 1 / innovation.variance_V2;
  const Column g{v.top * inverse, v.bottom * inverse};
  states.top += g.top * innovation.value_V;
  states.bottom += g.bottom * innovation.value_V;
  store(states, x);

  double v_of[kSize];
  double g_of[kSize];
  store(v, v_of);
  store(g, g_of);
  Column w{};
  Column w2{};
#pragma GCC unroll 8
  for (std::size_t k = 0; k < kSize; ++k) {
    Column c;
    load(P + kSize * k, c);
    c.top -= g.top * v_of[k];
    c.bottom -= g.bottom * v_of[k];
    Column& sum = k % 2 == 0 ? w : w2;
    sum.top += c.top * h[k];
    sum.bottom += c.bottom * h[k];
    store(c, P + kSize * k);
  }
  const Column u{r * g.top - (w.top + w2.top), r * g.bottom - (w.bottom + w2.bottom)};
#pragma GCC unroll 8
  for (std::size_t k = 0; k < kSize; ++k) {
    Column c;
    load(P + kSize * k, c);
    c.top += u.top * g_of[k];
    c.bottom += u.bottom * g_of[k];
    store(c, P + kSize * k);
  }
  return innovation;
}

struct Kernel {
  void (*carry)(const double*, const double*, const double*, double, double*, double*);
  Innovation (*correct)(const double*, double, double, double*, double*);
};

void carry_plain(const double* same, const double* other, const double* noise, double noise_ramp,
                 double* x, double* P) {
  carry(same, other, noise, noise_ramp, x, P);
}
Innovation correct_plain(const double* h, double measured, double r, double* x, double* P) {
  return correct(h, measured, r, x, P);
}

#if defined(__x86_64__)
[[gnu::target("avx2,fma")]] void carry_avx2(const double* same, const double* other,
                                            const double* noise, double noise_ramp, double* x,
                                            double* P) {
  carry(same, other, noise, noise_ramp, x, P);
}
[[gnu::target("avx2,fma")]] Innovation correct_avx2(const double* h, double measured, double r,
                                                    double* x, double* P) {
  return correct(h, measured, r, x, P);
}
const Kernel kKernel = __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0
                           ? Kernel{carry_avx2, correct_avx2}
                           : Kernel{carry_plain, correct_plain};
#else
const Kernel kKernel{carry_plain, correct_plain};
#endif

}  // namespace

double flicker_variance_V2(const NoiseModel& noise) {
  // A first-order Gauss-Markov process has its largest Allan deviation, 0.6174·σ_stationary, at
  // τ = 1.89 correlation times (IEEE Std 952, annex C); flicker noise has the plateau B·√(2 ln2/π).
  constexpr double kGaussMarkovPeak = 0.6174;
  const double plateau_V =
      noise.B.coefficient() * std::sqrt(2.0 * std::numbers::ln2 / std::numbers::pi);
  return squared(plateau_V / kGaussMarkovPeak);
}

EightStateFilter::EightStateFilter(const NoiseModel& noise, const EightStateOptions& options,
                                   double start_s)
    : flicker_rate_per_s_(1.0 / options.flicker_correlation_s),
      walk_density_(squared(noise.K.coefficient())),
      walk_decay_per_s_(noise.walk_decay_per_s),
      ramp_frequency_(options.ramp_frequency_rad_s),
      parameter_density_(options.parameter_walk.cwiseAbs2()),
      as_printed_(options.as_printed),
      t_s_(start_s) {
  assert(options.flicker_correlation_s > 0 && options.ramp_frequency_rad_s > 0);
  const double flicker_variance = flicker_variance_V2(noise);
  flicker_density_ = 2.0 * flicker_rate_per_s_ * flicker_variance;
  const double slope_V_per_s = noise.R.coefficient();
  ramp_density_ = squared(slope_V_per_s) * ramp_frequency_;

  x_.setZero();
  x_.head<4>() = options.prior_mean;
  P_.setZero();
  P_.diagonal().head<4>() = options.prior_sd.cwiseAbs2();
  P_(kStateFlicker, kStateFlicker) = flicker_variance;
  // Random walk and ramp are counted from the start: their level is U0's. A walk that forgets has
  // been going on for long.
  if (walk_decay_per_s_ > 0)
    P_(kStateRandomWalk, kStateRandomWalk) = walk_density_ / (2.0 * walk_decay_per_s_);
  P_(kStateRampRate, kStateRampRate) = squared(slope_V_per_s);
}

EightStateFilter::Step EightStateFilter::discretise(std::int64_t length_ns) const {
  const double dt_s = 1e-9 * static_cast<double>(length_ns);
  Step step;
  step.length_ns = length_ns;
  for (std::size_t i = 0; i < 4; ++i)
    step.noise[i] = parameter_density_(static_cast<Eigen::Index>(i)) * dt_s;

  step.same[0] = std::exp(-flicker_rate_per_s_ * dt_s);
  step.noise[kStateFlicker] = -flicker_density_ / (2.0 * flicker_rate_per_s_) *
                              std::expm1(-2.0 * flicker_rate_per_s_ * dt_s);
  step.same[1] = std::exp(-walk_decay_per_s_ * dt_s);
  step.noise[kStateRandomWalk] =
      walk_density_ * (walk_decay_per_s_ > 0 ? -std::expm1(-2.0 * walk_decay_per_s_ * dt_s) /
                                                   (2.0 * walk_decay_per_s_)
                                             : dt_s);

  // Van Loan (1978): exp([−A G; 0 Aᵀ]·dt) = [· A⁻G; 0 Φᵀ].
  Eigen::Matrix2d A;
  A << 0.0, 1.0, -squared(ramp_frequency_), -std::numbers::sqrt2 * ramp_frequency_;
  Eigen::Matrix4d block = Eigen::Matrix4d::Zero();
  block.topLeftCorner<2, 2>() = -A;
  block(1, 3) = 1.0;
  block.bottomRightCorner<2, 2>() = A.transpose();
  const Eigen::Matrix4d exponential = (block * dt_s).exp();
  const Eigen::Matrix2d F = exponential.bottomRightCorner<2, 2>().transpose();
  const Eigen::Matrix2d Q = ramp_density_ * F * exponential.topRightCorner<2, 2>();
  step.same[2] = F(0, 0);
  step.other[2] = F(0, 1);
  step.same[3] = F(1, 1);
  step.other[3] = F(1, 0);
  step.noise[kStateRamp] = Q(0, 0);
  step.noise[kStateRampRate] = Q(1, 1);
  step.noise_ramp = 0.5 * (Q(0, 1) + Q(1, 0));
  return step;
}

EightStateFilter::Step EightStateFilter::printed_step() const {
  Step step;
  step.same = {-flicker_rate_per_s_, 0, -ramp_frequency_, -std::numbers::sqrt2 * ramp_frequency_};
  // G: ones for the parameters, βB, K, and R in the row of v2.
  step.noise = {1,
                1,
                1,
                1,
                flicker_density_ * flicker_rate_per_s_ / 2,
                walk_density_,
                0,
                ramp_density_ / ramp_frequency_};
  return step;
}

const EightStateFilter::Step& EightStateFilter::step_of(std::int64_t length_ns) {
  // Fibonacci hashing: the upper bits of the product.
  const auto slot = static_cast<std::uint64_t>(length_ns) * 0x9E3779B97F4A7C15U >> 58U;
  Step& step = steps_[slot];
  if (step.length_ns != length_ns) {
    step = as_printed_ ? printed_step() : discretise(length_ns);
    step.length_ns = length_ns;
  }
  return step;
}

void EightStateFilter::predict(double t_s) {
  assert(t_s >= t_s_);
  const Step& step = step_of(static_cast<std::int64_t>(1e9 * (t_s - t_s_) + 0.5));
  t_s_ = t_s;
  kKernel.carry(step.same.data(), step.other.data(), step.noise.data(), step.noise_ramp, x_.data(),
                P_.data());
}

Innovation EightStateFilter::update(const Eigen::Vector3d& a_g, double voltage_V,
                                    double variance_V2) {
  const double h[kSize] = {a_g.x(), a_g.y(), a_g.z(), 1, 1, 1, 1, as_printed_ ? 1.0 : 0.0};
  const Innovation innovation = kKernel.correct(h, voltage_V, variance_V2, x_.data(), P_.data());
  // Rounding makes the two triangles differ by little; every so often they are made equal.
  constexpr unsigned kOften = 64;
  if (++updates_ % kOften == 0) P_ = (0.5 * (P_ + P_.transpose())).eval();
  return innovation;
}

AxisEstimate EightStateFilter::parameters() const {
  return {x_.head<4>(), P_.topLeftCorner<4, 4>()};
}

}  // namespace plumbline
