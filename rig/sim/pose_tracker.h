// Recognises the poses in the motion of the head: from rest through motion to rest.
#pragma once

#include "rig/sim/unit.h"

namespace plumbline::sim {

/// A stop shorter than this is only passed through (one-sided approach) and is no pose.
inline constexpr double kShortestPose_s = 0.3;

/// Where the head stands, from which side it came and since when.
class PoseTracker {
 public:
  /// The head at the next instant; times must not decrease.
  void observe(double t_s, const HeadState& head);
  /// The head stands at another pose since t_s.
  void arrive(double t_s, const Arrival& arrival);

  bool moving() const { return moving_; }
  int approach() const { return approach_; }  ///< direction of the last δ motion
  long long pose() const { return pose_; }    ///< number of the pose, or of the one being gone to
  double arrival_s() const { return arrival_s_; }

 private:
  struct Angles {
    double delta_deg = 0;
    double h_deg = 0;
  };

  bool started_ = false;
  bool moving_ = false;
  int approach_ = 0;
  long long pose_ = 0;
  double arrival_s_ = 0;
  Angles rest_;  ///< last one, via stops included
};

}  // namespace plumbline::sim
