#include "app/config/own_effects.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <muParser.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <deque>
#include <mutex>
#include <string>
#include <utility>

#include "estimator/angle_units.h"
#include "rig/strict_toml.h"

namespace plumbline::app {

namespace {

constexpr std::array kActsOn = {"bias", "scale", "delta", "h", "roll", "skew"};
enum class Target { bias, scale, delta, h, roll, skew };
const std::vector<std::string> kKinds = {"amplitude", "shape", "index"};
constexpr const char* kPrefix = "user.";

/// What an expression may use, in the order of its values.
enum Variable {
  kDelta,
  kH,
  kAx,
  kAy,
  kAz,
  kA,
  kTime,
  kTimeInPose,
  kTemperature,
  kPose,
  kPrevDelta,
  kPrevH,
  kPrevAx,
  kPrevAy,
  kPrevAz,
  kPrevA,
  kVariables
};
constexpr std::array<const char*, kVariables> kVariableName = {"delta_deg",
                                                               "h_deg",
                                                               "a_x",
                                                               "a_y",
                                                               "a_z",
                                                               "a",
                                                               "t_s",
                                                               "t_in_pose",
                                                               "temp_C",
                                                               "pose",
                                                               "prev_delta_deg",
                                                               "prev_h_deg",
                                                               "prev_a_x",
                                                               "prev_a_y",
                                                               "prev_a_z",
                                                               "prev_a"};

struct Parameter {
  ParameterInfo info;
  std::vector<double> starts;
};

struct Description {
  std::string name;
  Target target = Target::bias;
  std::vector<std::size_t> axes;
  std::string expression;
  std::vector<Parameter> parameters;
};

/// One parser with the numbers that it reads. muparser's own are not shared between threads.
struct Evaluator {
  mu::Parser parser;
  std::array<double, kVariables> variable{};
  std::vector<double> parameter;
  std::deque<double> column;  ///< stays where it is while it grows
  std::vector<std::string> column_name;

  explicit Evaluator(const Description& description) : parameter(description.parameters.size(), 0) {
    for (std::size_t v = 0; v < kVariables; ++v) parser.DefineVar(kVariableName[v], &variable[v]);
    for (std::size_t k = 0; k < parameter.size(); ++k)
      parser.DefineVar(description.parameters[k].info.name, &parameter[k]);
    parser.SetVarFactory(
        [](const char* name, void* self) {
          auto& evaluator = *static_cast<Evaluator*>(self);
          evaluator.column_name.emplace_back(name);
          return &evaluator.column.emplace_back(0);
        },
        this);
    parser.SetExpr(description.expression);
    parser.GetUsedVar();  // makes the columns known
  }
  Evaluator(const Evaluator&) = delete;
  Evaluator& operator=(const Evaluator&) = delete;

  bool uses(Variable v) const { return parser.GetUsedVar().contains(kVariableName[v]); }
};

class OwnEffect final : public Effect {
 public:
  OwnEffect(Description description, double reference_C)
      : description_(std::move(description)), reference_C_(reference_C) {
    auto first = std::make_unique<Evaluator>(description_);
    columns_ = first->column_name;
    within_dwell_ = first->uses(kTimeInPose);
    uses_temperature_ = first->uses(kTemperature);
    uses_own_axis_ = first->uses(kA) || first->uses(kPrevA);
    for (std::size_t v = kPrevDelta; v < kVariables; ++v)
      remembers_ |= first->uses(static_cast<Variable>(v));
    idle_.push_back(std::move(first));
  }

  std::string id() const override { return kPrefix + description_.name; }
  Subject subject() const override {
    return description_.target == Target::bias || description_.target == Target::scale
               ? Subject::sensor
               : Subject::head;
  }
  std::vector<ParameterInfo> parameters() const override {
    std::vector<ParameterInfo> infos;
    for (const Parameter& p : description_.parameters) infos.push_back(p.info);
    return infos;
  }
  bool acts_on(std::size_t axis) const override {
    return subject() == Subject::head ||
           std::find(description_.axes.begin(), description_.axes.end(), axis) !=
               description_.axes.end();
  }
  std::vector<Hypothesis> hypotheses(const VisitLog&, std::size_t axis) const override {
    if (!acts_on(axis)) return {};
    std::vector<Hypothesis> starts = {{}};
    for (const Parameter& p : description_.parameters) {
      std::vector<Hypothesis> longer;
      for (const Hypothesis& start : starts)
        for (const double value : p.starts) {
          longer.push_back(start);
          longer.back().p.push_back(value);
        }
      starts = std::move(longer);
    }
    return starts;
  }
  void displace(const VisitLog& log, std::size_t visit, const double* p,
                HeadGeometry& head) const override {
    head.*angle() += mean_over_dwell(
        log, visit, [&](double since_s) { return angle_rad(log, visit, p, since_s); });
  }
  double term_g(const TermInput& input, const double* p) const override {
    return mean_over_dwell(input.log, input.visit,
                           [&](double since_s) { return sample_g(input, p, since_s); });
  }
  bool within_dwell() const override { return within_dwell_; }
  Eigen::VectorXd course_g(const TermInput& input, const double* p) const override {
    const auto value_at = [&](double since_s) { return sample_g(input, p, since_s); };
    return effect::since_arrival_s(input.at()).unaryExpr(value_at).matrix();
  }
  AngleCourse angle_course(const VisitLog& log, std::size_t visit, const double* p) const override {
    const auto value_at = [&](double since_s) { return angle_rad(log, visit, p, since_s); };
    return {angle(), effect::since_arrival_s(log.visits[visit]).unaryExpr(value_at).matrix()};
  }
  bool remembers() const override { return remembers_; }
  std::string definition() const override;
  std::vector<std::string> columns() const override {
    std::vector<std::string> all = columns_;
    if (uses_temperature_) all.emplace_back(kTemperatureColumn);
    return all;
  }

  bool uses_own_axis() const { return uses_own_axis_; }
  /// Where a search starts.
  std::vector<double> start() const {
    std::vector<double> p;
    for (const Parameter& parameter : description_.parameters)
      p.push_back(parameter.starts.front());
    return p;
  }
  /// The value for made-up surroundings, number `which` of several.
  double trial(int which, const std::vector<double>& p) const {
    Evaluator evaluator(description_);
    for (std::size_t v = 0; v < kVariables; ++v)
      evaluator.variable[v] = 0.3 + 0.37 * which + 0.11 * static_cast<double>(v);
    std::copy(p.begin(), p.end(), evaluator.parameter.begin());  // the parser looks there
    for (double& column : evaluator.column) column = 1 + 0.1 * which;
    return evaluator.parser.Eval();
  }

 private:
  double HeadGeometry::*angle() const {
    switch (description_.target) {
      case Target::h:
        return &HeadGeometry::h_rad;
      case Target::roll:
        return &HeadGeometry::roll_rad;
      case Target::skew:
        return &HeadGeometry::skew_rad;
      default:
        return &HeadGeometry::delta_rad;
    }
  }
  double angle_rad(const VisitLog& log, std::size_t visit, const double* p, double since_s) const {
    return value(log, visit, nullptr, nullptr, p, since_s) / kDegPerRad;
  }
  /// From so many of its samples; one in the middle where nothing changes in between.
  template <class ValueAt>
  double mean_over_dwell(const VisitLog& log, std::size_t visit, const ValueAt& value_at) const {
    if (!within_dwell_) return value_at(mean_time_in_pose_s(log, visit));
    constexpr std::size_t kMost = 32;
    const Visit& at = log.visits[visit];
    const std::size_t points = std::min(at.count, kMost);
    const double step_s = at.step_s * static_cast<double>(at.count) / static_cast<double>(points);
    const double first_s = 0.5 * (step_s - at.step_s);
    double sum = 0;
    for (std::size_t k = 0; k < points; ++k)
      sum += value_at(first_s + step_s * static_cast<double>(k));
    return sum / static_cast<double>(points);
  }
  double sample_g(const TermInput& input, const double* p, double since_arrival_s) const {
    const double term = value(input.log, input.visit, &input.a_g, &input.axis, p, since_arrival_s);
    return description_.target == Target::scale ? term * input.a() : term;
  }
  static double mean_time_in_pose_s(const VisitLog& log, std::size_t visit) {
    return log.visits[visit].t_mean_s - log.visits[visit].t_arrival_s;
  }
  /// a_g and axis: null for the head, whose geometry is what is being changed.
  double value(const VisitLog& log, std::size_t visit, const std::vector<Eigen::Vector3d>* a_g,
               const std::size_t* axis, const double* p, double since_arrival_s) const {
    Lease lease(*this);
    Evaluator& evaluator = lease.get();
    auto& v = evaluator.variable;
    const std::size_t before = log.before(visit) == nullptr ? visit : visit - 1;
    const Visit& at = log.visits[visit];
    const Visit& from = log.visits[before];
    const auto force = [&](std::size_t k) -> Eigen::Vector3d {
      if (a_g != nullptr) return (*a_g)[k];
      return specific_force_g({log.visits[k].delta_rad, log.visits[k].h_rad}, log.gamma);
    };
    const Eigen::Vector3d a = force(visit), prev_a = force(before);
    v[kDelta] = at.delta_rad * kDegPerRad;
    v[kH] = at.h_rad * kDegPerRad;
    v[kTime] = at.t_arrival_s + since_arrival_s;
    v[kTimeInPose] = since_arrival_s;
    v[kTemperature] = reference_C_ + at.temperature_K;
    v[kPose] = static_cast<double>(visit) - static_cast<double>(log.earlier);
    v[kPrevDelta] = from.delta_rad * kDegPerRad;
    v[kPrevH] = from.h_rad * kDegPerRad;
    for (Eigen::Index i = 0; i < 3; ++i) {
      v[static_cast<std::size_t>(kAx + i)] = a(i);
      v[static_cast<std::size_t>(kPrevAx + i)] = prev_a(i);
    }
    if (axis != nullptr) {
      v[kA] = a(static_cast<Eigen::Index>(*axis));
      v[kPrevA] = prev_a(static_cast<Eigen::Index>(*axis));
    }
    std::copy(p, p + evaluator.parameter.size(), evaluator.parameter.begin());
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      const auto name = std::find(log.covariate_names.begin(), log.covariate_names.end(),
                                  evaluator.column_name[c]);
      if (name == log.covariate_names.end()) return 0;
      evaluator.column[c] =
          at.covariate[static_cast<std::size_t>(name - log.covariate_names.begin())];
    }
    // Outside the domain of the expression there is no effect rather than no result at all.
    const double result = evaluator.parser.Eval();
    return std::isfinite(result) ? result : 0;
  }

  /// A parser of its own for the duration of one evaluation, whatever other threads do.
  class Lease {
   public:
    explicit Lease(const OwnEffect& effect) : effect_(effect) {
      const std::lock_guard lock(effect_.mutex_);
      if (!effect_.idle_.empty()) {
        evaluator_ = std::move(effect_.idle_.back());
        effect_.idle_.pop_back();
      }
    }
    ~Lease() {
      if (!evaluator_) return;
      const std::lock_guard lock(effect_.mutex_);
      effect_.idle_.push_back(std::move(evaluator_));
    }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    Evaluator& get() {
      if (!evaluator_) evaluator_ = std::make_unique<Evaluator>(effect_.description_);
      return *evaluator_;
    }

   private:
    const OwnEffect& effect_;
    std::unique_ptr<Evaluator> evaluator_;
  };

  Description description_;
  double reference_C_ = 0;
  std::vector<std::string> columns_;
  bool within_dwell_ = false;
  bool uses_temperature_ = false;
  bool uses_own_axis_ = false;
  bool remembers_ = false;
  mutable std::mutex mutex_;
  mutable std::vector<std::unique_ptr<Evaluator>> idle_;
};

/// A basic string of TOML.
std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    if (static_cast<unsigned char>(c) < 0x20) {
      result += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    } else {
      result += c;
    }
  }
  return result + '"';
}

std::string OwnEffect::definition() const {
  std::string text = fmt::format("[[effect]]\nname = {}\nacts_on = {}\n", quoted(description_.name),
                                 quoted(kActsOn.at(static_cast<std::size_t>(description_.target))));
  if (subject() == Subject::sensor) {
    std::string axes;
    for (const std::size_t axis : description_.axes)
      axes += (axes.empty() ? "\"" : ", \"") + std::string(kAxisName.at(axis)) + "\"";
    text += fmt::format("axes = [{}]\n", axes);
  }
  text += fmt::format("expression = {}\n[effect.parameters]\n", quoted(description_.expression));
  for (const Parameter& p : description_.parameters)
    text += fmt::format("{} = {{ starts = [{}], unit = {}, kind = \"{}\" }}\n", p.info.name,
                        fmt::join(p.starts, ", "), quoted(p.info.unit),
                        kKinds.at(static_cast<std::size_t>(p.info.role)));
  return text;
}

bool is_word(const std::string& name) {
  return !name.empty() && std::isdigit(static_cast<unsigned char>(name.front())) == 0 &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
         });
}

template <class Strings>
std::vector<std::string> strings(const Strings& items) {
  return {std::begin(items), std::end(items)};
}

std::vector<Parameter> read_parameters(rig::StrictTable table) {
  std::vector<Parameter> parameters;
  for (const std::string& name : table.keys()) {
    rig::StrictTable item = table.table(name);
    Parameter p;
    p.info.name = name;
    p.info.unit = item.text_or("unit", "");
    const std::string kind = item.choice_or("kind", kKinds.front(), kKinds);
    p.info.role =
        static_cast<ParameterRole>(std::find(kKinds.begin(), kKinds.end(), kind) - kKinds.begin());
    p.starts = item.has("starts") ? item.numbers_or("starts", {})
                                  : std::vector<double>{item.number("start")};
    const bool zero = std::find(p.starts.begin(), p.starts.end(), 0.0) != p.starts.end();
    if (p.starts.empty()) {
      item.refuse("starts", "is empty");
    } else if (p.info.role == ParameterRole::amplitude && (zero || p.starts.size() > 1)) {
      item.refuse(item.has("starts") ? "starts" : "start",
                  "an amplitude starts at one value that is not zero: a small typical size");
    }
    if (!is_word(name) ||
        std::find(kVariableName.begin(), kVariableName.end(), name) != kVariableName.end())
      table.refuse(name, "is no name for a parameter");
    parameters.push_back(std::move(p));
  }
  return parameters;
}

/// What is wrong with the effect as a whole; empty when nothing is.
std::string fault_of(const OwnEffect& effect) {
  const auto infos = effect.parameters();
  if (std::none_of(infos.begin(), infos.end(),
                   [](const ParameterInfo& info) { return info.role == ParameterRole::amplitude; }))
    return "has no parameter of kind \"amplitude\"";
  if (effect.subject() == Subject::head && effect.uses_own_axis())
    return "uses the specific force of one axis; the head is the same for all (a_x, a_y, a_z)";
  constexpr int kTrials = 3;
  const std::vector<double> start = effect.start();
  std::vector<double> none = start;
  for (std::size_t k = 0; k < infos.size(); ++k)
    if (infos[k].role == ParameterRole::amplitude) none[k] = 0;
  for (int which = 0; which < kTrials; ++which) {
    const double without = effect.trial(which, none);
    if (std::abs(without) > 1e-12)
      return fmt::format("is {:.3g} instead of zero where all amplitudes are zero", without);
  }
  for (std::size_t k = 0; k < infos.size(); ++k) {
    if (infos[k].role != ParameterRole::amplitude) continue;
    std::vector<double> twice = start;
    twice[k] *= 2;
    bool matters = false;
    for (int which = 0; which < kTrials; ++which)
      matters = matters || effect.trial(which, twice) != effect.trial(which, start);
    if (!matters) return fmt::format("does not depend on {}", infos[k].name);
  }
  return {};
}

std::shared_ptr<const OwnEffect> read_effect(rig::StrictTable& table, double reference_C) {
  Description description;
  description.name = table.text("name");
  if (!is_word(description.name))
    table.refuse("name", "must consist of letters, digits and underscores");
  const auto targets = strings(kActsOn);
  const std::string target = table.has("acts_on")
                                 ? table.choice_or("acts_on", targets.front(), targets)
                                 : table.text("acts_on");
  const auto at = std::find(targets.begin(), targets.end(), target);
  description.target =
      at == targets.end() ? Target::bias : static_cast<Target>(at - targets.begin());
  for (const std::string& axis : table.texts_or("axes", strings(kAxisName))) {
    const auto known = std::find(kAxisName.begin(), kAxisName.end(), axis);
    if (known == kAxisName.end()) {
      table.refuse("axes", fmt::format("there is no axis \"{}\"", axis));
    } else {
      description.axes.push_back(static_cast<std::size_t>(known - kAxisName.begin()));
    }
  }
  if (description.target > Target::scale && table.has("axes"))
    table.refuse("axes", fmt::format("an effect on {} is seen by all axes", target));
  description.expression = table.text("expression");
  description.parameters = read_parameters(table.table("parameters"));
  try {
    auto effect = std::make_shared<const OwnEffect>(std::move(description), reference_C);
    if (const std::string fault = fault_of(*effect); !fault.empty())
      table.refuse("expression", fault);
    return effect;
  } catch (const mu::Parser::exception_type& error) {
    table.refuse("expression", error.GetMsg());
    return nullptr;
  }
}

Result<OwnEffects> own_effects_of(rig::StrictFile& file, double reference_C) {
  OwnEffects effects;
  rig::StrictTable root = file.root();
  for (rig::StrictTable& table : root.tables("effect")) {
    auto effect = read_effect(table, reference_C);
    if (!effect) continue;
    for (const auto& other : effects)
      if (other->id() == effect->id()) table.refuse("name", "is used twice");
    effects.push_back(std::move(effect));
  }
  if (auto done = file.finish(); !done) return fail(done.error());
  return effects;
}

}  // namespace

Result<OwnEffects> read_own_effects(const std::filesystem::path& path, double reference_C) {
  auto file = rig::StrictFile::read(path);
  if (!file) return fail(file.error());
  auto effects = own_effects_of(*file, reference_C);
  if (effects && effects->empty())
    return fail(ErrorCode::input, path.string() + ": describes no effect; write [[effect]] tables");
  return effects;
}

Result<OwnEffects> parse_own_effects(std::string_view text, const std::string& name,
                                     double reference_C) {
  auto file = rig::StrictFile::parse(text, name);
  if (!file) return fail(file.error());
  return own_effects_of(*file, reference_C);
}

Result<void> check_columns(const OwnEffects& effects, const SampleTable& samples) {
  std::vector<std::string> known = strings(kVariableName);
  if (samples.temp_C.empty()) std::erase(known, kTemperatureColumn);
  for (const Covariate& column : samples.covariates) known.push_back(column.name);
  for (const auto& effect : effects) {
    for (const std::string& column : effect->columns()) {
      if (std::find(known.begin(), known.end(), column) != known.end()) continue;
      if (column == kTemperatureColumn)
        return fail(ErrorCode::input,
                    effect->id() + ": needs temp_C, which the samples do not have");
      const std::string near = rig::nearest(column, known);
      return fail(ErrorCode::input,
                  fmt::format("{}: {} is neither a parameter nor a variable nor a column of the "
                              "samples{}",
                              effect->id(), column,
                              near.empty() ? "" : fmt::format("; did you mean {}?", near)));
    }
  }
  return {};
}

Result<OwnEffects> own_effects_for(const std::filesystem::path& path, double reference_C,
                                   const SampleTable& samples) {
  auto effects = read_own_effects(path, reference_C);
  if (!effects) return effects;
  if (auto good = check_columns(*effects, samples); !good) return fail(good.error());
  return effects;
}

}  // namespace plumbline::app
