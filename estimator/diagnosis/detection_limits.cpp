#include "estimator/diagnosis/detection_limits.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include "estimator/diagnosis/screening.h"
#include "estimator/effects/code_evidence.h"

namespace plumbline {
namespace {

constexpr double kSigmas = 5;
constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// Limits of one amplitude over the hypotheses of one family.
struct Amplitude {
  const Candidate* first = nullptr;
  std::size_t parameter = 0;
  Eigen::Index together_with = 0;  ///< amplitudes of the family
  std::vector<double> limits;
};

/// An effect, and the axis that it acts on; nothing for the head.
using Place = std::pair<std::string, std::optional<std::size_t>>;
Place place_of(const Candidate& candidate) {
  Place place{candidate.effect->id(), std::nullopt};
  if (candidate.effect->subject() == Subject::sensor) place.second = candidate.axis;
  return place;
}

DetectionLimit limit_of(const Candidate& candidate, const ParameterInfo& info,
                        std::vector<double> limits) {
  std::sort(limits.begin(), limits.end());
  DetectionLimit limit;
  std::tie(limit.id, limit.axis) = place_of(candidate);
  limit.parameter = info.name;
  limit.unit = info.unit;
  limit.limit = limits[limits.size() / 2];
  limit.best = limits.front();
  limit.worst = limits.back();
  return limit;
}

void add_amplitudes(const Candidate& candidate, const Eigen::MatrixXd& transform,
                    std::vector<Amplitude>& amplitudes) {
  const auto infos = candidate.effect->parameters();
  Eigen::Index count = 0;
  for (std::size_t k = 0; k < infos.size(); ++k)
    count += infos[k].role == ParameterRole::amplitude && candidate.hypothesis.p[k] != 0 ? 1 : 0;
  Eigen::Index column = 0;
  for (std::size_t k = 0; k < infos.size(); ++k) {
    if (infos[k].role != ParameterRole::amplitude || candidate.hypothesis.p[k] == 0) continue;
    // The inverse of the columns' products is transformᵀ·transform.
    const double limit = transform.rows() < count ? kInfinite
                                                  : kSigmas * std::abs(candidate.hypothesis.p[k]) *
                                                        transform.col(column).norm();
    ++column;
    auto it = std::find_if(amplitudes.begin(), amplitudes.end(), [&](const Amplitude& a) {
      return a.parameter == k && a.first->family == candidate.family;
    });
    if (it == amplitudes.end())
      it = amplitudes.insert(amplitudes.end(), {&candidate, k, count, {}});
    it->limits.push_back(limit);
  }
}

/// An effect whose size is a shape, on one axis: sizes and by how many σ their responses stand out.
struct Size {
  const Candidate* first = nullptr;
  std::vector<std::pair<double, double>> course;  ///< size, σ

  /// From the size that shows least to the one that shows most.
  void sort() {
    std::sort(course.begin(), course.end());
    if (course.front().second > course.back().second) std::reverse(course.begin(), course.end());
  }
  /// Index of the first size that stands out; course.size() when none does.
  std::size_t crossing() const {
    return static_cast<std::size_t>(
        std::find_if(course.begin(), course.end(),
                     [](const auto& c) { return c.second >= kSigmas; }) -
        course.begin());
  }
  /// Sizes to be looked at next: beyond the weak end, or between the two about the limit.
  std::vector<double> next() const {
    constexpr int kSizes = 8;
    const std::size_t at = crossing();
    std::vector<double> sizes;
    if (at == course.size() || course.size() < 2) return sizes;
    const double from = at == 0 ? course[0].first : course[at - 1].first;
    const double ratio = at == 0 ? course[0].first / course[1].first
                                 : std::pow(course[at].first / from, 1.0 / (kSizes + 1));
    for (int k = 1; k <= kSizes; ++k) sizes.push_back(from * std::pow(ratio, k));
    return sizes;
  }
  double limit() const {
    const std::size_t at = crossing();
    if (at == course.size()) return kInfinite;
    if (at == 0) return course[0].first;
    const auto& [weak, weak_sigma] = course[at - 1];
    const auto& [strong, strong_sigma] = course[at];
    return weak + (strong - weak) * (kSigmas - weak_sigma) / (strong_sigma - weak_sigma);
  }
};

void sort(std::vector<DetectionLimit>& limits) {
  std::stable_sort(limits.begin(), limits.end(),
                   [](const DetectionLimit& a, const DetectionLimit& b) {
                     return std::tie(a.id, a.axis) < std::tie(b.id, b.axis);
                   });
}

/// Of an effect without amplitude.
double size_sigmas(const Eigen::MatrixXd& transform) {
  return transform.rows() == 0 ? 0 : 1 / transform(0, 0);
}

}  // namespace

std::vector<DetectionLimit> detection_limits(const BesideModel& beside) {
  const CandidateList& list = beside.list;
  std::vector<Amplitude> amplitudes;
  std::vector<Size> sizes;
  std::map<Place, double> log_p;
  for (std::size_t c = 0; c < list.candidates.size(); ++c) {
    const Candidate& candidate = list.candidates[c];
    if (!candidate.has_name() || beside.is_in_model(candidate)) continue;
    const Eigen::MatrixXd transform = beside.transform(c);
    if (transform.rows() > 0) {
      double& strongest = log_p[place_of(candidate)];
      strongest = std::min(strongest, beside.log_p(c));
    }
    const auto infos = candidate.effect->parameters();
    const auto is_estimated = [](const ParameterInfo& info) {
      return info.role != ParameterRole::index;
    };
    const auto has = [&](ParameterRole role) {
      return std::any_of(infos.begin(), infos.end(),
                         [&](const ParameterInfo& info) { return info.role == role; });
    };
    if (has(ParameterRole::amplitude)) {
      add_amplitudes(candidate, transform, amplitudes);
    } else if (std::count_if(infos.begin(), infos.end(), is_estimated) == 1 &&
               is_estimated(infos.front())) {
      if (sizes.empty() || sizes.back().first->effect != candidate.effect ||
          sizes.back().first->axis != candidate.axis)
        sizes.push_back({&candidate, {}});
      // One variant stands for all.
      const std::vector<double>&p = candidate.hypothesis.p,
            &first = sizes.back().first->hypothesis.p;
      if (std::equal(p.begin() + 1, p.end(), first.begin() + 1))
        sizes.back().course.emplace_back(p.front(), size_sigmas(transform));
    }
  }

  std::vector<DetectionLimit> limits;
  for (const Amplitude& a : amplitudes) {
    const ParameterInfo info = a.first->effect->parameters()[a.parameter];
    // An amplitude that also stands in a larger family is stated by the smaller one.
    const bool smaller =
        std::any_of(amplitudes.begin(), amplitudes.end(), [&](const Amplitude& other) {
          return other.first->effect == a.first->effect && other.first->axis == a.first->axis &&
                 other.parameter == a.parameter && other.together_with < a.together_with;
        });
    if (!smaller) limits.push_back(limit_of(*a.first, info, a.limits));
  }

  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    CandidateList closer;
    std::vector<Size*> owner;
    for (Size& size : sizes) {
      size.sort();
      for (const double value : size.next()) {
        Hypothesis hypothesis = size.first->hypothesis;
        hypothesis.p.front() = value;
        closer.candidates.push_back(size.first->with(std::move(hypothesis)));
        owner.push_back(&size);
      }
    }
    if (owner.empty()) break;
    const std::vector<Eigen::MatrixXd> transforms = beside.transforms_of(closer);
    for (std::size_t c = 0; c < owner.size(); ++c)
      owner[c]->course.emplace_back(closer.candidates[c].hypothesis.p.front(),
                                    size_sigmas(transforms[c]));
  }
  for (Size& size : sizes) {
    size.sort();
    limits.push_back(
        limit_of(*size.first, size.first->effect->parameters().front(), {size.limit()}));
  }
  for (DetectionLimit& limit : limits) limit.sigmas = sigmas_of(log_p[{limit.id, limit.axis}]);
  sort(limits);
  return limits;
}

std::vector<DetectionLimit> detection_limits(const SearchInput& input, const CandidateList& list,
                                             const SearchResult& result) {
  const CandidateGains gains(*result.responses, result.fit);
  const Eigen::VectorXd& gain = gains.of_residual();
  return detection_limits(
      {list,
       [&](const Candidate& candidate) {
         return std::any_of(result.evidence.begin(), result.evidence.end(), [&](const Evidence& e) {
           return e.candidate.effect == candidate.effect &&
                  (candidate.effect->subject() == Subject::head ||
                   e.candidate.axis == candidate.axis);
         });
       },
       [&](std::size_t c) { return gains.transform(c); },
       [&](std::size_t c) {
         return log_chi_squared_tail(gain(static_cast<Eigen::Index>(c)), gains.dof(c));
       },
       [&](const CandidateList& closer) {
         const CandidateResponses responses =
             candidate_responses(input.log, closer, result.whitening, result.fit.parameters);
         const CandidateGains closer_gains(responses, result.fit);
         std::vector<Eigen::MatrixXd> transforms;
         transforms.reserve(closer.candidates.size());
         for (std::size_t c = 0; c < closer.candidates.size(); ++c)
           transforms.push_back(closer_gains.transform(c));
         return transforms;
       }});
}

void add_limits_of_samples(const MeasurementSet& run, const VisitLog& log,
                           const TriadEstimate& model, const std::vector<FoundEffect>& found,
                           std::vector<DetectionLimit>& limits) {
  constexpr double kChance = 1e-6;
  const auto add = [&](const char* id, std::size_t axis, const char* parameter, double limit,
                       double worst, const char* unit) {
    const auto has_axis = [&](const FoundEffect& other) {
      return other.id == id &&
             std::find(other.axes.begin(), other.axes.end(), axis) != other.axes.end();
    };
    const auto is_there = [&](const DetectionLimit& other) {
      return other.id == id && other.axis == axis;
    };
    if (std::none_of(found.begin(), found.end(), has_axis) &&
        std::none_of(limits.begin(), limits.end(), is_there))
      limits.push_back({id, axis, parameter, limit, limit, worst, unit});
  };
  const auto samples = static_cast<double>(run.samples.size());
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const double step_V = log.step_V(axis);
    const double sd_V = std::hypot(log.input_sd_V[axis], step_V / std::sqrt(12.0));
    const double K_V_per_g = std::abs(model[axis].value(static_cast<Eigen::Index>(axis)));
    const double limit_g = kSigmas * std::sqrt(2 / samples) * sd_V / K_V_per_g;
    add("adc.mains_pickup", axis, "amplitude", limit_g, limit_g, "g");
    if (!log.adc) continue;
    const std::vector<std::int64_t> codes = codes_seen(run.samples.u_V[axis], *log.adc);
    const double steps =
        std::max(2.0, std::ceil(std::pow(kChance, -1 / static_cast<double>(codes.size()))));
    add("adc.quantization", axis, "lsb", steps * step_V, steps * step_V, "V");
    const int bits = bits_that_would_show(codes, *log.adc);
    if (bits > 0) add("adc.stuck_bit", axis, "bit", 0, bits - 1, "");
  }
  sort(limits);
}

}  // namespace plumbline
