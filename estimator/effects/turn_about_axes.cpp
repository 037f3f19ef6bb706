#include "estimator/effects/turn_about_axes.h"

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimator/effects/function_of_driver.h"
#include "estimator/effects/wrapped_term.h"

namespace plumbline {
namespace {

struct Axis {
  double HeadGeometry::*angle;
  const char* suffix;  ///< of the names of its amplitudes
};

/// The parameters are those of the term, with one for each axis in the place of each amplitude.
class TurnAboutAxes final : public WrappedTerm {
 public:
  /// `moves`: the angle that the term displaces.
  TurnAboutAxes(std::unique_ptr<SmoothTerm> of_one, double HeadGeometry::*moves,
                std::vector<Axis> axes)
      : WrappedTerm(std::move(of_one)), moves_(moves), axes_(std::move(axes)) {
    for (const ParameterInfo& info : term().parameters())
      is_amplitude_.push_back(info.role == ParameterRole::amplitude);
  }

  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos;
    for (const ParameterInfo& info : term().parameters()) {
      if (info.role != ParameterRole::amplitude) {
        infos.push_back(info);
        continue;
      }
      for (const Axis& axis : axes_) {
        infos.push_back(info);
        infos.back().name += axis.suffix;
        infos.back().needed = false;  // about one axis it may do nothing
      }
    }
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    return about_axes(term().hypotheses(log, axis));
  }
  std::optional<std::size_t> sets_in_at(const VisitLog& log,
                                        const std::vector<double>& p) const override {
    return term().sets_in_at(log, about(axes_.size() - 1, p.data()));
  }
  double choice_uncertainty(const VisitLog& log, std::size_t axis, const std::vector<double>& p,
                            std::size_t k) const override {
    std::size_t of_term = 0, at = 0;
    while (of_term < is_amplitude_.size() && at + width(of_term) <= k) at += width(of_term++);
    if (of_term == is_amplitude_.size() || is_amplitude_[of_term]) return 0;
    return term().choice_uncertainty(log, axis, about(axes_.size() - 1, p.data()), of_term);
  }
  /// About the same axes.
  std::vector<Hypothesis> closer(const VisitLog& log, std::size_t axis,
                                 const Hypothesis& found) const override {
    std::vector<Hypothesis> others;
    for (const Hypothesis& of_term : term().closer(log, axis, {about(1, found.p.data())})) {
      std::vector<double> p = found.p;
      std::size_t at = 0;
      for (std::size_t k = 0; k < is_amplitude_.size(); ++k) {
        if (!is_amplitude_[k]) p[at] = of_term.p[k];
        at += width(k);
      }
      others.push_back({std::move(p)});
    }
    return others;
  }
  /// What one angle seemed to do by itself, or in one direction.
  std::vector<Hypothesis> in_one(const VisitLog&, std::size_t, const Effect& repeated,
                                 const std::vector<std::vector<double>>& p) const override {
    constexpr double kOfTheOther = 0.2;
    const auto* other = dynamic_cast<const SmoothTerm*>(&repeated);
    if (other == nullptr || other == this || moves_ != kTilt.angle || p.size() != 1 ||
        other->driver() != driver() || p.front().size() != is_amplitude_.size())
      return {};
    const std::string function = shape().substr(0, shape().rfind(kTilt.words()));
    std::vector<double> both;
    for (std::size_t axis = 0; axis < axes_.size(); ++axis) {
      const Target along{.form = TermForm::geometry, .angle = axes_[axis].angle};
      if (other->shape() != function + along.words()) continue;
      for (std::size_t k = 0; k < is_amplitude_.size(); ++k) {
        const std::size_t first = both.size();
        both.insert(both.end(), width(k), p.front()[k]);
        for (std::size_t a = 0; is_amplitude_[k] && a < axes_.size(); ++a)
          if (a != axis) both[first + a] *= kOfTheOther;
      }
    }
    if (both.empty()) return {};
    return {{std::move(both)}};
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    for (std::size_t axis = 0; axis < axes_.size(); ++axis) {
      HeadGeometry by;
      term().displace(log, visit, about(axis, p).data(), by);
      head.*axes_[axis].angle += by.*moves_;
    }
  }

 private:
  std::size_t width(std::size_t k) const { return is_amplitude_[k] ? axes_.size() : 1; }
  /// The term's own parameters where it turns about one of the axes.
  std::vector<double> about(std::size_t axis, const double* p) const {
    std::vector<double> of_term;
    of_term.reserve(is_amplitude_.size());
    for (std::size_t k = 0; k < is_amplitude_.size(); p += width(k++))
      of_term.push_back(is_amplitude_[k] ? p[axis] : *p);
    return of_term;
  }
  std::vector<Hypothesis> about_axes(const std::vector<Hypothesis>& of_term) const {
    std::vector<Hypothesis> all;
    for (const Hypothesis& hypothesis : of_term) {
      std::vector<double> p;
      for (std::size_t k = 0; k < is_amplitude_.size(); ++k)
        p.insert(p.end(), width(k), hypothesis.p[k]);
      all.push_back({std::move(p)});
    }
    return all;
  }

  double HeadGeometry::*moves_;
  std::vector<Axis> axes_;
  std::vector<bool> is_amplitude_;  ///< each of the term's parameters
};

}  // namespace

std::unique_ptr<SmoothTerm> about_some_axis(std::unique_ptr<SmoothTerm> term) {
  return std::make_unique<TurnAboutAxes>(std::move(term), kSeat.angle,
                                         std::vector<Axis>{{&HeadGeometry::seat_x_rad, "_x"},
                                                           {&HeadGeometry::seat_y_rad, "_y"},
                                                           {&HeadGeometry::delta_rad, "_z"}});
}

std::unique_ptr<SmoothTerm> in_both_directions(std::unique_ptr<SmoothTerm> term) {
  return std::make_unique<TurnAboutAxes>(
      std::move(term), kTilt.angle,
      std::vector<Axis>{{&HeadGeometry::h_rad, "_h"}, {&HeadGeometry::roll_rad, "_roll"}});
}

}  // namespace plumbline
