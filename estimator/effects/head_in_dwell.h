// What has no name and moves an angle of the head while the sensor is read.
#pragma once

#include <string>

#include "estimator/effects/function_of_driver.h"
#include "estimator/effects/smooth_term.h"

namespace plumbline {

/// The course of the angle, and its words, are the derived class's.
class HeadInDwell : public SmoothTerm {
 public:
  explicit HeadInDwell(double HeadGeometry::*angle) : angle_(angle) {}

  std::string id() const override { return "unlisted:t_in_pose:geometry"; }
  const std::string& driver() const override { return driver_; }
  TermForm form() const override { return TermForm::geometry; }
  std::string shape() const override {
    return function() + Target{.form = TermForm::geometry, .angle = angle_}.words();
  }
  Subject subject() const override { return Subject::head; }
  bool within_dwell() const override { return true; }

 protected:
  virtual std::string function() const = 0;
  double HeadGeometry::*angle() const { return angle_; }
  bool is_delta() const { return angle_ == &HeadGeometry::delta_rad; }

 private:
  double HeadGeometry::*angle_;
  std::string driver_ = "t_in_pose";
};

}  // namespace plumbline
