#include "estimator/effects/effect.h"

namespace plumbline {
namespace {

// Cross-coupling nonlinearity (IEEE 1293 Kip, Kio, Kpo): k_jk·a_j·a_k, j ≠ k.
class CrossProduct final : public Effect {
 public:
  std::string id() const override { return "sensor.cross_product"; }
  Subject subject() const override { return Subject::sensor; }
  std::vector<ParameterInfo> parameters() const override {
    return {{"k_xy", "g/g^2", ParameterRole::amplitude},
            {"k_xz", "g/g^2", ParameterRole::amplitude},
            {"k_yz", "g/g^2", ParameterRole::amplitude}};
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t) const override {
    // One product, two or all three.
    std::vector<Hypothesis> found;
    for (unsigned products = 1; products < 8; ++products) {
      std::vector<double>& p = found.emplace_back().p;
      for (const unsigned k : {0U, 1U, 2U})
        p.push_back((products >> k & 1U) != 0 ? effect::kSmallTerm : 0);
    }
    return found;
  }
  double term_g(const TermInput& input, const double* p) const override {
    const Eigen::Vector3d& a = input.a_g[input.visit];
    return p[0] * a.x() * a.y() + p[1] * a.x() * a.z() + p[2] * a.y() * a.z();
  }
};

}  // namespace

const Effect& sensor_cross_product() {
  static const CrossProduct instance;
  return instance;
}

}  // namespace plumbline
