#include "rig/sim/pose_tracker.h"

#include <cmath>

namespace plumbline::sim {

namespace {

/// Settling and encoder steps move a resting axis by less than this.
constexpr double kMotion_deg = 0.1;

int direction(double travel_deg) {
  if (std::abs(travel_deg) < kMotion_deg) return 0;
  return travel_deg > 0 ? 1 : -1;
}

}  // namespace

void PoseTracker::observe(double t_s, const HeadState& head) {
  const Angles here{head.delta.angle_deg, head.h.angle_deg};
  if (!started_) {
    started_ = true;
    rest_ = here;
    arrival_s_ = t_s;
  }
  const bool moving = head.delta.moving || head.h.moving;
  if (moving && !moving_) {
    if (t_s - arrival_s_ >= kShortestPose_s) ++pose_;
    moving_ = true;
  }
  const bool arrived = head.delta.in_position && head.h.in_position;
  if (moving_ && !moving && arrived) {
    if (const int turned = direction(here.delta_deg - rest_.delta_deg); turned != 0) {
      approach_ = turned;
    }
    rest_ = here;
    arrival_s_ = t_s;
    moving_ = false;
  }
}

void PoseTracker::arrive(double t_s, const Arrival& arrival) {
  const Angles here{arrival.delta_deg, arrival.h_deg};
  started_ = true;
  moving_ = false;
  if (arrival.approach != 0) approach_ = arrival.approach;
  rest_ = here;
  pose_ = arrival.pose;
  arrival_s_ = t_s;
}

}  // namespace plumbline::sim
