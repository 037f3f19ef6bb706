#include "rig/sim/machine.h"

namespace plumbline::sim {

double Machine::catch_up() {
  const double now_s = clock_.now_s();
  while (unit_.next_time_s() <= now_s) {
    const double t_s = unit_.next_time_s();
    drive_.advance(t_s);
    samples_.push_back({unit_.next(drive_.head(t_s)), drive_.moves()});
  }
  drive_.advance(now_s);
  drive_.check_watchdog(now_s, std::chrono::steady_clock::now());
  return now_s;
}

std::vector<TimedSample> Machine::take_samples() {
  const std::lock_guard lock(mutex_);
  catch_up();
  return std::exchange(samples_, {});
}

double Machine::next_sample_s() {
  const std::lock_guard lock(mutex_);
  return unit_.next_time_s();
}

}  // namespace plumbline::sim
