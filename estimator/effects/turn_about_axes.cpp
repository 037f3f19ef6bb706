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
    const std::vector<ParameterInfo> infos = term().parameters();
    for (std::size_t k = 0; k < infos.size(); ++k) {
      if (infos[k].role != ParameterRole::amplitude)
        own_.push_back({k, {}});
      else
        for (std::size_t axis = 0; axis < axes_.size(); ++axis) own_.push_back({k, axis});
    }
  }

  std::vector<ParameterInfo> parameters() const override {
    const std::vector<ParameterInfo> of_term = term().parameters();
    std::vector<ParameterInfo> infos;
    for (const Own& own : own_) {
      infos.push_back(of_term[own.of_term]);
      if (!own.axis) continue;
      infos.back().name += axes_[*own.axis].suffix;
      infos.back().needed = false;  // about one axis it may do nothing
    }
    return infos;
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t axis) const override {
    std::vector<Hypothesis> all;
    for (const Hypothesis& of_term : term().hypotheses(log, axis)) {
      Hypothesis& about_all = all.emplace_back();
      for (const Own& own : own_) about_all.p.push_back(of_term.p[own.of_term]);
    }
    return all;
  }
  std::optional<std::size_t> sets_in_at(const VisitLog& log,
                                        const std::vector<double>& p) const override {
    return term().sets_in_at(log, about(0, p.data()));
  }
  double choice_uncertainty(const VisitLog& log, std::size_t axis, const std::vector<double>& p,
                            std::size_t k) const override {
    if (own_[k].axis) return 0;
    return term().choice_uncertainty(log, axis, about(0, p.data()), own_[k].of_term);
  }
  /// About the same axes.
  std::vector<Hypothesis> closer(const VisitLog& log, std::size_t axis,
                                 const Hypothesis& found) const override {
    std::vector<Hypothesis> others;
    for (const Hypothesis& of_term : term().closer(log, axis, {about(0, found.p.data())})) {
      Hypothesis& other = others.emplace_back(found);
      for (std::size_t k = 0; k < own_.size(); ++k)
        if (!own_[k].axis) other.p[k] = of_term.p[own_[k].of_term];
    }
    return others;
  }
  /// What one angle seemed to do by itself.
  std::vector<Hypothesis> in_one(const VisitLog&, std::size_t, const Effect& repeated,
                                 const std::vector<std::vector<double>>& p) const override {
    constexpr double kOfTheOther = 0.2;
    std::vector<Hypothesis> found;
    const auto* other = dynamic_cast<const SmoothTerm*>(&repeated);
    if (other == nullptr || other == this || moves_ != kTilt.angle || p.size() != 1 ||
        other->driver() != driver() || p.front().size() != term().parameters().size())
      return found;
    const std::string function = shape().substr(0, shape().rfind(kTilt.words()));
    for (std::size_t axis = 0; axis < axes_.size(); ++axis) {
      const Target along{.form = TermForm::geometry, .angle = axes_[axis].angle};
      if (other->shape() != function + along.words()) continue;
      Hypothesis& both = found.emplace_back();
      for (const Own& own : own_)
        both.p.push_back(p.front()[own.of_term] *
                         (own.axis.value_or(axis) == axis ? 1 : kOfTheOther));
    }
    return found;
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    for (std::size_t axis = 0; axis < axes_.size(); ++axis) {
      if (!acts_about(axis, p)) continue;
      HeadGeometry by;
      term().displace(log, visit, about(axis, p).data(), by);
      head.*axes_[axis].angle += by.*moves_;
    }
  }

 private:
  /// Which of the term's parameters one is, and about which axis; none where all share it.
  struct Own {
    std::size_t of_term;
    std::optional<std::size_t> axis;
  };
  /// Whether any of the amplitudes of one of the axes is not zero.
  bool acts_about(std::size_t axis, const double* p) const {
    for (std::size_t k = 0; k < own_.size(); ++k)
      if (own_[k].axis == axis && p[k] != 0) return true;
    return false;
  }
  /// The term's own parameters where it turns about one of the axes.
  std::vector<double> about(std::size_t axis, const double* p) const {
    std::vector<double> of_term;
    of_term.reserve(own_.size());
    for (std::size_t k = 0; k < own_.size(); ++k)
      if (own_[k].axis.value_or(axis) == axis) of_term.push_back(p[k]);
    return of_term;
  }

  double HeadGeometry::*moves_;
  std::vector<Axis> axes_;
  std::vector<Own> own_;
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
