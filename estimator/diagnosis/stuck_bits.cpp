#include "estimator/diagnosis/stuck_bits.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include "estimator/diagnosis/search_model.h"
#include "estimator/effects/catalogue.h"
#include "estimator/fit/least_squares.h"
#include "estimator/fit/rounding.h"
#include "estimator/median.h"
#include "estimator/noise/square.h"
#include "estimator/pose_means.h"

namespace plumbline {
namespace {

const Effect& stuck_bit_effect() {
  const auto& all = effect_catalogue();
  return **std::find_if(all.begin(), all.end(),
                        [](const Effect* effect) { return effect->id() == "adc.stuck_bit"; });
}

double weight_V(const StuckBit& stuck, const Adc& adc) {
  return std::ldexp(adc.lsb_V(), stuck.bit);
}

/// What a reading may lack: nothing, or the weights of some of the bits.
std::vector<double> lacks_V(const std::vector<StuckBit>& stuck, const Adc& adc) {
  std::vector<double> all = {0};
  for (const StuckBit& bit : stuck) {
    const double lack_V = bit.value ? -weight_V(bit, adc) : weight_V(bit, adc);
    for (std::size_t k = all.size(); k-- > 0;) all.push_back(all[k] + lack_V);
  }
  return all;
}

/// The reading with what it may lack that brings it next to u_V.
double next_to(double u_V, double reading_V, const std::vector<double>& lacks_V) {
  return reading_V + *std::min_element(lacks_V.begin(), lacks_V.end(), [&](double a, double b) {
           return std::abs(reading_V + a - u_V) < std::abs(reading_V + b - u_V);
         });
}

/// The voltage of a dwell by the likelihood of its readings, each of which may lack something.
struct DwellVoltage {
  double u_V = 0;
  double log_likelihood = 0;  ///< but for a constant
  double extra_V2 = 0;        ///< variance of u_V beyond that of the mean of as many whole readings
};

/// The maximum that expectation maximisation reaches from `start_V`.
DwellVoltage likeliest(std::span<const double> readings_V, const std::vector<double>& lacks_V,
                       double sd_V, double start_V) {
  constexpr int kMostRounds = 40;
  constexpr double kEnough = 1e-3;            // standard deviations of a reading
  constexpr double kOutOfQuestion = 40;       // difference of squares
  constexpr double kLeastInformation = 0.05;  // of that of whole readings
  DwellVoltage dwell{start_V, 0, 0};
  const auto count = static_cast<double>(readings_V.size());
  for (int round = 0; round < kMostRounds; ++round) {
    double sum_V = 0, spread_V2 = 0;
    dwell.log_likelihood = 0;
    for (const double reading_V : readings_V) {
      const double nearest_V = next_to(dwell.u_V, reading_V, lacks_V);
      const double least = square((nearest_V - dwell.u_V) / sd_V);
      double weights = 0, weighted_V = 0, square_V2 = 0;
      for (const double lack_V : lacks_V) {
        const double u_V = reading_V + lack_V;
        const double further = square((u_V - dwell.u_V) / sd_V) - least;
        if (further > kOutOfQuestion) continue;
        const double weight = further > 0 ? std::exp(-0.5 * further) : 1;
        weights += weight;
        weighted_V += weight * (u_V - nearest_V);
        square_V2 += weight * square(u_V - nearest_V);
      }
      const double away_V = weighted_V / weights;
      sum_V += nearest_V + away_V;
      spread_V2 += square_V2 / weights - square(away_V);
      dwell.log_likelihood += std::log(weights) - 0.5 * least;
    }
    const double next_V = sum_V / count;
    const double moved_V = std::abs(next_V - dwell.u_V);
    const double information = std::max(1 - spread_V2 / (count * square(sd_V)), kLeastInformation);
    dwell.extra_V2 = square(sd_V) / count * (1 / information - 1);
    dwell.u_V = next_V;
    if (moved_V < kEnough * sd_V) break;
  }
  return dwell;
}

/// Axes whose stuck bits have edges that noise leaves sharp.
PerAxis<bool> with_sharp_bits(const VisitLog& log) {
  constexpr double kSharp = 0.6;  // of the bit's weight
  constexpr int kLowest = 2;      // bit that rounding leaves next to nothing of
  PerAxis<bool> sharp{};
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const std::vector<StuckBit>& stuck = log.codes[axis].stuck_bits;
    sharp[axis] = !stuck.empty() && std::all_of(stuck.begin(), stuck.end(), [&](const auto& bit) {
      return bit.bit >= kLowest && log.input_sd_V[axis] < kSharp * weight_V(bit, *log.adc);
    });
  }
  return sharp;
}

/// A run whose stuck bits are being given back.
class BitsGivenBack {
 public:
  BitsGivenBack(const SearchInput& input, const CalibrationInput& measured)
      : measured_(measured),
        raw_(input.log),
        sharp_(with_sharp_bits(input.log)),
        run_(measured.run) {}

  /// Whether readings stand for the voltage of their dwell, not for what it is at their instant.
  bool blurs_dwells(std::size_t axis) const {
    constexpr double kBlurs =
        0.2;  // of the lowest bit's weight; 1 in 160 readings lies beyond half
    return sharp_[axis] && raw_.input_sd_V[axis] > kBlurs * lowest_V(axis);
  }
  bool any() const { return sharp_[0] || sharp_[1] || sharp_[2]; }
  bool on(std::size_t axis) const { return sharp_[axis]; }
  /// Weight of the lowest bit.
  double lowest_V(std::size_t axis) const {
    return weight_V(raw_.codes[axis].stuck_bits.front(), *raw_.adc);
  }
  const MeasurementSet& run() const { return run_; }
  /// Variance that the means have beyond those of whole readings; empty on other axes.
  const Eigen::VectorXd& extra_V2(std::size_t axis) const { return extra_V2_[axis]; }

  /// About these voltages; whether a reading is another now.
  bool about(std::size_t axis, const Eigen::VectorXd& expected_V) {
    const auto given_back = [&](double off_V) {
      std::vector<double> u_V = measured_.run.samples.u_V[axis];
      extra_V2_[axis] = give_bits_back(raw_.codes[axis].stuck_bits, *raw_.adc,
                                       raw_.input_sd_V[axis], expected_V, off_V, run_.poses, u_V);
      return u_V;
    };
    // Most dwells say by themselves how far off expectations are, which tells the others more.
    constexpr double kMostOff = 0.25, kLeastOff = 0.03;  // of the lowest bit's weight
    const double bit_V = lowest_V(axis);
    std::vector<double> u_V = given_back(kMostOff * bit_V);
    const double off_V = usual_distance_V(u_V, expected_V);
    u_V = given_back(std::clamp(off_V, kLeastOff * bit_V, kMostOff * bit_V));
    constexpr double kAnother = 0.1;  // standard deviations of a reading
    const auto& before_V = run_.samples.u_V[axis];
    const bool another =
        !std::equal(u_V.begin(), u_V.end(), before_V.begin(), [&](double now_V, double was_V) {
          return std::abs(now_V - was_V) < kAnother * raw_.input_sd_V[axis];
        });
    run_.samples.u_V[axis] = std::move(u_V);
    return another;
  }

  /// About the twelve parameters. How much the readings lack on average is not known beforehand:
  /// the zero that leaves least of them is taken.
  Eigen::Vector4d about_twelve(std::size_t axis, const Eigen::MatrixXd& A) {
    constexpr int kLevels = 4, kRounds = 6;
    const Eigen::Vector4d first = solve_least_squares(A, means_V(measured_.run, axis)).x;
    const auto lacks = lacks_V(raw_.codes[axis].stuck_bits, *raw_.adc);
    const auto [low, high] = std::minmax_element(lacks.begin(), lacks.end());
    double least = std::numeric_limits<double>::infinity();
    Eigen::VectorXd best_V;
    for (int level = 0; level <= kLevels; ++level) {
      Eigen::VectorXd x = first;
      x(3) += *low + (*high - *low) * level / kLevels;
      LeastSquaresResult fit;
      Eigen::VectorXd expected_V;
      for (int round = 0; round < kRounds; ++round) {
        expected_V = A * x;
        if (!about(axis, expected_V) && round > 0) break;
        fit = solve_least_squares(A, means_V(run_, axis));
        x = fit.x;
      }
      if (!(fit.residual_sum_of_squares < least)) continue;
      least = fit.residual_sum_of_squares;
      best_V = expected_V;
    }
    about(axis, best_V);
    return solve_least_squares(A, means_V(run_, axis)).x;
  }

 private:
  /// Of the dwells' means from where they are expected: their median in terms of a standard
  /// deviation.
  double usual_distance_V(const std::vector<double>& u_V, const Eigen::VectorXd& expected_V) const {
    std::vector<double> distance_V;
    for (std::size_t k = 0; k < run_.poses.size(); ++k) {
      const auto readings_V = std::span(u_V).subspan(run_.poses[k].first, run_.poses[k].count);
      const double mean_V = std::accumulate(readings_V.begin(), readings_V.end(), 0.0) /
                            static_cast<double>(readings_V.size());
      distance_V.push_back(std::abs(mean_V - expected_V(static_cast<Eigen::Index>(k))));
    }
    return sd_of_distances(std::move(distance_V));
  }
  static Eigen::VectorXd means_V(const MeasurementSet& run, std::size_t axis) {
    return mean_voltages(pose_means(run), axis);
  }

  const CalibrationInput& measured_;
  const VisitLog& raw_;
  PerAxis<bool> sharp_;
  MeasurementSet run_;
  PerAxis<Eigen::VectorXd> extra_V2_;
};

/// Whether what an effect of a model does to its axis is to jump by the weight of a bit once, or
/// there and back, give or take what else it takes up.
bool jumps_by(double weight_V, const VisitLog& log, const EnlargedParameters& model,
              std::size_t effect) {
  constexpr double kNearly = 0.25;
  const ActiveEffect& active = model.effects[effect];
  if (active.effect->subject() == Subject::head) return false;
  const Eigen::VectorXd change_V = predict_means_V(log, model)[active.axis] -
                                   predict_means_V(log, without_effect(model, effect))[active.axis];
  int jumps = 0;
  for (Eigen::Index k = 1; k < change_V.size(); ++k) {
    const double jump = std::abs(change_V(k) - change_V(k - 1)) / weight_V;
    if (jump < kNearly) continue;
    if (std::abs(jump - 1) > kNearly) return false;
    ++jumps;
  }
  return jumps == 1 || jumps == 2;
}

/// Where the visits' voltages are expected by all that the others tell of them. What concerns one
/// visit only, or is of the weight of the bit from one instant to another, could be a bit that was
/// not given back rightly.
Eigen::VectorXd expected_V(const VisitLog& log, const SearchResult& found, std::size_t axis,
                           double weight_V) {
  EnlargedParameters shared = found.fit.parameters;
  for (std::size_t k = shared.effects.size(); k-- > 0;)
    if (shared.effects[k].effect->concerns_one_visit() ||
        (shared.effects[k].axis == axis && jumps_by(weight_V, log, shared, k)))
      shared = without_effect(std::move(shared), k);
  const Eigen::VectorXd predicted_V = predict_means_V(log, shared)[axis];
  return predicted_V + expected_from_others(found.noise[axis].covariance,
                                            found.observed.mean_V[axis] - predicted_V);
}

/// The model of `without` and the bits that were given back, on the readings as they are.
std::optional<SearchResult> with_bits(const SearchInput& input, const CandidateList& list,
                                      const std::vector<std::size_t>& bits,
                                      const SearchResult& without, const SearchOptions& options) {
  SearchModel model(input, list, options);
  EnlargedParameters parameters = without.fit.parameters;
  std::vector<SearchModel::Entry> entries;
  for (const Evidence& evidence : without.evidence) {
    const auto same = std::find_if(
        list.candidates.begin(), list.candidates.end(), [&](const Candidate& candidate) {
          return candidate.effect == evidence.candidate.effect &&
                 candidate.axis == evidence.candidate.axis &&
                 candidate.hypothesis.p == evidence.candidate.hypothesis.p;
        });
    assert(same != list.candidates.end());
    entries.push_back(
        {static_cast<std::size_t>(same - list.candidates.begin()), evidence.p_value, parameters});
  }
  for (const std::size_t bit : bits) {
    parameters = with_effect(std::move(parameters), list.candidates[bit].active());
    entries.push_back({bit, kProven, parameters});
  }
  if (!model.exchange({}, entries)) return std::nullopt;
  SearchResult found = model.take_result();
  found.p_best_rest = without.p_best_rest;
  return found;
}

}  // namespace

Eigen::VectorXd give_bits_back(const std::vector<StuckBit>& stuck, const Adc& adc, double sd_V,
                               const Eigen::VectorXd& expected_V, double off_V,
                               const std::vector<Pose>& poses, std::vector<double>& u_V) {
  const std::vector<double> lacks = lacks_V(stuck, adc);
  const double reading_sd_V = std::hypot(sd_V, adc.lsb_V() / std::sqrt(12.0));
  const double smallest_V = weight_V(stuck.front(), adc);  // from the lowest on
  Eigen::VectorXd extra_V2(expected_V.size());
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const auto readings_V = std::span(u_V).subspan(poses[k].first, poses[k].count);
    const double about_V = expected_V(static_cast<Eigen::Index>(k));
    double dwell_V = about_V, most = -std::numeric_limits<double>::infinity();
    for (const double side : {0.0, -0.5, 0.5}) {
      const DwellVoltage dwell =
          likeliest(readings_V, lacks, reading_sd_V, about_V + side * smallest_V);
      const double off = (dwell.u_V - about_V) / off_V;
      const double likely = dwell.log_likelihood - 0.5 * off * off;
      if (!(likely > most)) continue;
      most = likely;
      dwell_V = dwell.u_V;
      extra_V2(static_cast<Eigen::Index>(k)) = dwell.extra_V2;
    }
    double sum_V = 0;
    for (double& reading_V : readings_V) {
      reading_V = next_to(dwell_V, reading_V, lacks);
      sum_V += reading_V;
    }
    // Where noise reaches over the bit the nearest is not always right.
    const double shift_V = dwell_V - sum_V / static_cast<double>(readings_V.size());
    for (double& reading_V : readings_V) reading_V += shift_V;
  }
  return extra_V2;
}

std::optional<SearchBesideBits> search_beside_stuck_bits(
    const SearchInput& input, const CalibrationInput& measured, const Eigen::MatrixXd& A,
    const std::vector<std::shared_ptr<const Effect>>& own, const SearchOptions& options) {
  constexpr int kMostSearches = 8;
  if (!input.log.adc) return std::nullopt;
  BitsGivenBack bits(input, measured);
  if (!bits.any()) return std::nullopt;
  EnlargedParameters start = input.start;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (bits.on(axis)) start.twelve[axis] = bits.about_twelve(axis, A);

  const Effect& stuck_bit = stuck_bit_effect();
  SearchBesideBits result;
  SearchResult& without = result.given_back.before_converter;
  // What moves readings most is found first, so one effect is looked for until nothing moves.
  SearchOptions limited = options;
  limited.max_effects = std::min<std::size_t>(1, options.max_effects);
  // What is left of a bit follows the positions, as what is left of rounding does.
  limited.false_alarm_of_slow = options.false_alarm_of_slow_when_coarse;
  for (int searches = 1;; ++searches) {
    result.log = std::make_unique<const VisitLog>(make_visit_log(bits.run(), measured.description));
    const VisitLog& log = *result.log;
    const Observations observed = observe(bits.run(), log);
    result.candidates = all_candidates(log, own);
    std::erase_if(result.candidates.candidates, [&](const Candidate& candidate) {
      return (candidate.effect == &stuck_bit && bits.on(candidate.axis)) ||
             imitates_proven_rounding(input.log, *candidate.effect);
    });
    PerAxis<Eigen::VectorXd> known_V2 = input.known_V2;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      if (bits.on(axis)) known_V2[axis] += bits.extra_V2(axis);
    without =
        search_effects({log, observed, input.noise, input.processes, known_V2, start, nullptr},
                       result.candidates, limited);
    start.twelve = without.fit.parameters.twelve;
    bool settled = true;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      if (bits.on(axis) && bits.about(axis, expected_V(log, without, axis, bits.lowest_V(axis))))
        settled = false;
    if (!settled && searches < kMostSearches) continue;
    if (without.evidence.size() < limited.max_effects || limited.max_effects == options.max_effects)
      break;
    limited.max_effects = options.max_effects;
  }

  for (const ActiveEffect& active : without.fit.parameters.effects)
    for (const std::size_t axis : axes_of(active))
      if (active.effect->within_dwell() && bits.blurs_dwells(axis)) return std::nullopt;

  std::vector<Candidate>& candidates = result.candidates.candidates;
  std::erase_if(candidates, [&](const Candidate& c) { return c.effect == &stuck_bit; });
  const std::size_t first = candidates.size();
  add_candidates(result.candidates, input.log, stuck_bit);
  std::vector<std::size_t> added;
  for (std::size_t c = first; c < candidates.size(); ++c)
    if (bits.on(candidates[c].axis)) added.push_back(c);
  auto found = with_bits(input, result.candidates, added, without, options);
  if (!found || !without.fit.determined) return std::nullopt;
  result.found = std::move(*found);
  for (std::size_t k = added.size(); k-- > 0;)
    result.given_back.left_out.push_back(without.evidence.size() + k);
  return result;
}

void drop_effects(const SearchInput& input, const std::vector<std::size_t>& dropped,
                  SearchResult& found, CodeEstimate& given_back) {
  if (dropped.empty()) return;
  for (const std::size_t k : dropped) {
    found.remove(k);
    for (std::size_t& bit : given_back.left_out) --bit;
  }
  found.fit = fit_enlarged(input.log, found.observed, found.whitening, found.fit.parameters);
}

}  // namespace plumbline
