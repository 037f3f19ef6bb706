#include "rig/sim/unit.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "rig/sim/effects/effect.h"
#include "rig/sim/head_errors.h"
#include "rig/sim/noise.h"
#include "rig/sim/pose_tracker.h"
#include "rig/sim/random.h"
#include "rig/sim/room.h"
#include "rig/sim/world.h"

namespace plumbline::sim {

namespace {

constexpr double kDegPerArcsec = 1.0 / 3600.0;

PerAxis<double> scaled(const std::array<double, 3>& v, double factor) {
  return {v[0] * factor, v[1] * factor, v[2] * factor};
}

double response_V(const Triad& triad, std::size_t axis, const PerAxis<double>& a) {
  const PerAxis<double>& k = triad.K_V_per_g[axis];
  return triad.U0_V[axis] + k[0] * a[0] + k[1] * a[1] + k[2] * a[2];
}

/// Rounds to the nearest code; an exact tie goes to the even one. Beyond the span the end codes.
std::int32_t converted(const Adc& adc, double u_V, bool& clipped) {
  const double lowest = -std::ldexp(1.0, adc.bits - 1);
  const double code = std::nearbyint((u_V - 0.5 * (adc.min_V + adc.max_V)) / adc.lsb_V());
  clipped = clipped || code < lowest || code > -lowest - 1;
  return static_cast<std::int32_t>(std::clamp(code, lowest, -lowest - 1));
}

}  // namespace

struct Unit::Impl {
  Impl(const World& w, std::uint64_t seed)
      : world(w),
        triad(draw_triad(w, seed)),
        gravity_g(w.gravity.local_mps2 / kStandardGravity_mps2),
        room(w.room, seed),
        positioning(seed, "positioning"),
        effects(make_effects(w, triad, seed)) {
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      noise.emplace_back(w.noise_V[i], w.rate_hz, seed, i);
    }
  }

  double time_of(std::int64_t n) const { return static_cast<double>(n) / world.rate_hz; }

  /// Moment at t_s as the effects see it, the attitude aside.
  Moment moment_at(double t_s, const HeadState& head, bool moving) {
    Moment now;
    now.t_s = t_s;
    now.dt_s = t_s - last_s;
    last_s = t_s;
    now.delta_deg = head.delta.angle_deg;
    now.h_deg = head.h.angle_deg;
    now.delta_speed_deg_s = head.delta.speed_deg_s;
    now.h_speed_deg_s = head.h.speed_deg_s;
    now.moving = moving;
    now.approach = tracker.approach();
    now.pose = tracker.pose();
    now.t_in_pose_s = t_s - tracker.arrival_s();
    const HeadErrors ideal;
    now.a_nominal = scaled(attitude(ideal, now.delta_deg, now.h_deg).up, gravity_g);
    room_state = room.next(t_s, now.dt_s, now.h_deg, moving);
    now.air_C = room_state.air_C;
    now.temp_C = room_state.temp_C;
    now.rh_pct = room_state.rh_pct;
    now.supply_V = room_state.supply_V;
    now.motor_A = room_state.motor_A;
    for (auto& effect : effects) effect->observe(now);
    return now;
  }

  void draw_positioning_error() {
    delta_scatter_deg = world.positioning.delta_arcsec * kDegPerArcsec * positioning.normal();
    h_scatter_deg = world.positioning.h_arcsec * kDegPerArcsec * positioning.normal();
  }

  NodeSample sample(const HeadState& head) {
    const double arrival_before_s = tracker.arrival_s();
    tracker.observe(time_of(counter), head);
    if (tracker.arrival_s() != arrival_before_s) draw_positioning_error();
    Moment now = moment_at(time_of(counter), head, tracker.moving());

    HeadErrors errors = world.head;
    errors.delta_index_deg += delta_scatter_deg;
    errors.h_index_deg += h_scatter_deg;
    const auto plain_a =
        scaled(attitude(errors, now.delta_deg, now.h_deg, now.approach).up, gravity_g);
    for (auto& effect : effects) effect->bend_head(now, errors);
    now.attitude = attitude(errors, now.delta_deg, now.h_deg, now.approach);
    now.a = scaled(now.attitude.up, gravity_g);
    if (!a_at_rest || now.pose != came_to) a_previous = a_at_rest.value_or(now.a);
    came_to = now.pose;
    if (!now.moving || !a_at_rest) a_at_rest = now.a;
    now.a_previous = a_previous;

    NodeSample out;
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const double noise_V = noise[i].next_V(noise_dt_s);
      bool plain_clipped = false;
      last.plain_code[i] =
          converted(world.adc, response_V(triad, i, plain_a) + noise_V, plain_clipped);

      double u_V = response_V(triad, i, now.a);
      double factor = 1;
      for (auto& effect : effects) {
        u_V += triad.K_V_per_g[i][i] * effect->sensor_g(now, i);
        factor *= effect->noise_factor(now, i);
      }
      last.noiseless_V[i] = u_V;
      u_V += factor * noise_V;
      for (auto& effect : effects) u_V = effect->convert_V(now, i, u_V);
      out.code[i] = converted(world.adc, u_V, out.clipped);
      for (auto& effect : effects) out.code[i] = effect->encode(now, i, out.code[i]);
    }
    const RoomState shown = room.read(room_state);
    out.counter = counter;
    out.t_s = now.t_s;
    out.temp_C = shown.temp_C;
    out.rh_pct = shown.rh_pct;
    out.supply_V = shown.supply_V;
    out.motor_A = shown.motor_A;

    last.delta_deg = now.delta_deg;
    last.h_deg = now.h_deg;
    last.a_g = now.a;
    last.code = out.code;
    last.temp_C = now.temp_C;
    last.pose = now.pose;
    ++counter;
    noise_dt_s = 1 / world.rate_hz;
    return out;
  }

  World world;
  Triad triad;
  double gravity_g;
  RoomProcess room;
  Random positioning;
  std::vector<std::unique_ptr<Effect>> effects;
  std::vector<ChannelNoise> noise;
  PoseTracker tracker;
  RoomState room_state;
  SampleTruth last;
  std::int64_t counter = 0;
  double last_s = 0;
  double noise_dt_s = 0;
  double delta_scatter_deg = 0;
  double h_scatter_deg = 0;
  std::optional<PerAxis<double>> a_at_rest;  ///< true one at the last rest, via stops included, g
  PerAxis<double> a_previous{};              ///< the same at the last pose left
  long long came_to = 0;                     ///< pose since which a_previous holds
};

Unit::Unit(const World& world, std::uint64_t seed) : impl_(std::make_unique<Impl>(world, seed)) {}
Unit::~Unit() = default;
Unit::Unit(Unit&&) noexcept = default;
Unit& Unit::operator=(Unit&&) noexcept = default;

NodeSample Unit::next(const HeadState& head) { return impl_->sample(head); }

double Unit::next_time_s() const { return impl_->time_of(impl_->counter); }

const SampleTruth& Unit::truth() const { return impl_->last; }

void Unit::jump_to_pose(const Arrival& arrival) {
  Impl& unit = *impl_;
  // The first tick at or after the arrival; the tolerance keeps an arrival that is a tick itself.
  const auto tick = std::max(
      unit.counter, static_cast<std::int64_t>(std::ceil(arrival.t_s * unit.world.rate_hz - 1e-6)));
  unit.noise_dt_s += static_cast<double>(tick - unit.counter) / unit.world.rate_hz;
  unit.counter = tick;
  unit.tracker.arrive(unit.time_of(tick), arrival);
  unit.draw_positioning_error();
  HeadState head;
  head.delta.angle_deg = arrival.delta_deg;
  head.h.angle_deg = arrival.h_deg;
  unit.moment_at(unit.time_of(tick), head, true);
}

}  // namespace plumbline::sim
