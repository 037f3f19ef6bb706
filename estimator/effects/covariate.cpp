#include "estimator/effects/covariate.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace plumbline {
namespace {

const std::string kIdBegin = "covariate:";

class CovariateEffect final : public Effect {
 public:
  CovariateEffect(std::string column, std::size_t index, bool scale)
      : column_(std::move(column)), index_(index), scale_(scale) {}

  std::string id() const override { return kIdBegin + column_; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"c", scale_ ? "1/unit" : "g/unit", ParameterRole::amplitude},
            {"mean", "unit", ParameterRole::index}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog& log, std::size_t) const override {
    double mean = 0, largest = 0;
    for (const Visit& visit : log.visits) mean += visit.covariate[index_];
    mean /= static_cast<double>(log.visits.size());
    for (const Visit& visit : log.visits) {
      largest = std::max(largest, std::abs(visit.covariate[index_] - mean));
    }
    if (!(largest > 0)) return {};
    return {{{effect::kSmallTerm / largest, mean}}};
  }
  std::vector<std::string> columns() const override { return {column_}; }
  double term_g(const TermInput& input, const double* p) const override {
    const double value = p[0] * (input.at().covariate[index_] - p[1]);
    return scale_ ? value * input.a() : value;
  }

 private:
  std::string column_;
  std::size_t index_;
  bool scale_;
};

}  // namespace

std::vector<std::unique_ptr<Effect>> covariate_effects(const VisitLog& log) {
  std::vector<std::unique_ptr<Effect>> effects;
  for (std::size_t c = 0; c < log.covariate_names.size(); ++c) {
    for (bool scale : {false, true}) {
      effects.push_back(std::make_unique<CovariateEffect>(log.covariate_names[c], c, scale));
    }
  }
  return effects;
}

std::optional<std::string> covariate_column(const std::string& id) {
  if (!id.starts_with(kIdBegin)) return std::nullopt;
  return id.substr(kIdBegin.size());
}

}  // namespace plumbline
