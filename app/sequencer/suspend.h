// Conditions under which measuring makes no sense: the run waits until they have passed.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace plumbline::app {

/// One entry of [[suspend]] in rig.toml. All times by the sensor's clock.
struct SuspendCondition {
  /// "temp_C", a column of [sensor.covariates], or "vibration": the scatter of the samples at rest
  /// over that of the soak, the largest of the three axes.
  std::string column;
  double min = -std::numeric_limits<double>::infinity();  ///< the band in which is measured
  double max = std::numeric_limits<double>::infinity();
  double hysteresis = 0;  ///< goes on only this far inside the band
  double delay_s = 5;     ///< out of the band without a break before the run is suspended
  double hold_s = 30;     ///< inside without a break before it goes on
};

/// Column name of the scatter that the engine works out itself.
inline constexpr const char* kVibrationColumn = "vibration";

class SuspendMonitor {
 public:
  explicit SuspendMonitor(std::vector<SuspendCondition> conditions);

  /// A reading; times ascend within a column.
  void add(const std::string& column, double t_s, double value);
  /// Why the run has to wait, or nothing.
  std::optional<std::string> reason() const;
  bool watches(const std::string& column) const;

 private:
  struct Watched {
    SuspendCondition condition;
    bool suspended = false;
    std::optional<double> changing_since_s;  ///< since when readings speak for the other state
    double worst = 0;                        ///< the reading that suspended
  };
  std::vector<Watched> watched_;
};

}  // namespace plumbline::app
