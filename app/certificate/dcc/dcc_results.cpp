// dcc:measurementResults: methods, conditions and every number of the certificate.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "app/certificate/dcc/dcc_parts.h"
#include "app/certificate/dcc/dcc_units.h"
#include "app/certificate/effect_words.h"
#include "app/certificate/scalar_results.h"
#include "app/certificate/sensor_terms.h"
#include "estimator/decision.h"

namespace plumbline::app::dcc {
namespace {

constexpr const char* kMethodId = "method";

/// Values of one quantity in one unit, with standard uncertainties (none: not stated).
struct Series {
  std::vector<std::string> labels;
  std::vector<double> values;
  std::vector<double> u;
  std::string unit;
};

Series scaled(Series series, double factor, const std::string& unit) {
  for (double& value : series.values) value *= factor;
  for (double& value : series.u) value *= std::abs(factor);
  series.unit = unit;
  return series;
}

void add_list(const XmlElement& parent, const Series& series) {
  const XmlElement list = parent.add("si:realListXMLList");
  std::string labels;
  for (const std::string& label : series.labels) labels += (labels.empty() ? "" : " ") + label;
  list.add("si:labelXMLList", labels);
  list.add("si:valueXMLList", numbers(series.values));
  list.add("si:unitXMLList", series.unit);
  if (series.u.empty()) return;
  const XmlElement expanded =
      list.add("si:measurementUncertaintyUnivariateXMLList").add("si:expandedMUXMLList");
  std::vector<double> doubled = series.u;
  for (double& value : doubled) value *= 2;
  expanded.add("si:valueExpandedMUXMLList", numbers(doubled));
  expanded.add("si:coverageFactorXMLList", kCoverageFactor);
  expanded.add("si:coverageProbabilityXMLList", kCoverageProbability);
  expanded.add("si:distributionXMLList", "normal");
}

/// The same quantity in SI units and as it is used everywhere else.
void add_hybrid(const XmlElement& parent, const Series& si, const Series& other) {
  const XmlElement hybrid = parent.add("si:hybrid");
  add_list(hybrid, si);
  add_list(hybrid, other);
}

void add_real(const XmlElement& parent, const std::string& label, double value, double u,
              const std::string& unit) {
  const XmlElement real = parent.add("si:real");
  if (!label.empty()) real.add("si:label", label);
  real.add("si:value", number(value));
  real.add("si:unit", unit);
  if (!(u > 0) || !std::isfinite(u)) return;
  const XmlElement expanded = real.add("si:measurementUncertaintyUnivariate").add("si:expandedMU");
  expanded.add("si:valueExpandedMU", number(2 * u));
  expanded.add("si:coverageFactor", kCoverageFactor);
  expanded.add("si:coverageProbability", kCoverageProbability);
  expanded.add("si:distribution", "normal");
}

XmlElement add_result(const Context& c, const XmlElement& results, const char* ref_type,
                      const std::string& name) {
  const XmlElement result = results.add("dcc:result");
  result.attribute("refType", ref_type);
  c.text(result, "dcc:name", name);
  return result.add("dcc:data");
}

/// A named quantity whose value follows; finish with used_method().
XmlElement add_quantity(const Context& c, const XmlElement& data, const char* ref_type,
                        const std::string& name) {
  const XmlElement quantity = data.add("dcc:quantity");
  quantity.attribute("refType", ref_type);
  c.text(quantity, "dcc:name", name);
  return quantity;
}

std::string method_name(const Context& c) {
  return c.input.scalar != nullptr
             ? c.tr("scalar calibration from the magnitude of gravity at rest")
             : c.tr("multipoint tumble test, weighted least squares");
}

void used_method(const Context& c, const XmlElement& quantity) {
  const XmlElement method = quantity.add("dcc:usedMethods").add("dcc:usedMethod");
  method.attribute("refId", kMethodId);
  c.text(method, "dcc:name", method_name(c));
}

// --- methods and conditions ----------------------------------------------------------------------

void add_methods(const Context& c, const XmlElement& parent) {
  const XmlElement methods = parent.add("dcc:usedMethods");
  const auto add = [&](const char* ref_type, const std::string& name, const std::string& text,
                       const char* norm) {
    const XmlElement method = methods.add("dcc:usedMethod");
    if (std::string_view(ref_type) == "basic_calibrationMethod") method.attribute("id", kMethodId);
    method.attribute("refType", ref_type);
    c.text(method, "dcc:name", name);
    if (!text.empty()) c.text(method, "dcc:description", text);
    if (norm != nullptr) method.add("dcc:norm", norm);
  };
  const Laboratory& lab = c.input.laboratory;
  add("basic_calibrationMethod", method_name(c),
      c.tr("Procedure") + ": " +
          (lab.procedure.empty() ? c.document.words.missing : lab.procedure) + ". " +
          c.tr("Deviations from the procedure") + ": " +
          (lab.deviations.empty() ? c.document.words.missing : lab.deviations),
      c.input.scalar != nullptr ? nullptr : "IEEE Std 1293");
  add("basic_methodMeasurementUncertainty", c.tr("Uncertainty budget"),
      c.tr(
          "Expanded uncertainty with coverage factor k = 2, about 95 % for a normal distribution."),
      "JCGM 100:2008");
  const Decision decision = stated_decision(c.input.calibration.decision, c.input.events);
  if (decision.status != DecisionStatus::none) {
    add("plumbline_decisionRule", c.tr("Decision rule"),
        decision.rule.empty() ? "" : c.tr(decision.rule), "ILAC-G8:09/2019");
  }
}

void add_software(const XmlElement& parent) {
  const XmlElement software = parent.add("dcc:usedSoftware").add("dcc:software");
  software.add("dcc:name").add("dcc:content", "plumbline");
  software.add("dcc:release", program_version());
  software.add("dcc:type", "application");
}

void add_equipment(const Context& c, const XmlElement& parent) {
  const XmlElement head = parent.add("dcc:measuringEquipments").add("dcc:measuringEquipment");
  head.attribute("refType", "basic_measurementStandard");
  c.text(head, "dcc:name", c.tr("two-axis dividing head"));
  const AngleUncertainty& angles = c.input.description.angles;
  if (!(angles.delta_arcsec > 0) && !(angles.h_arcsec > 0)) return;
  const XmlElement quantities = head.add("dcc:measuringEquipmentQuantities");
  const auto add = [&](const char* ref_type, const std::string& name, double u) {
    const XmlElement quantity = quantities.add("dcc:measuringEquipmentQuantity");
    quantity.attribute("refType", ref_type);
    c.text(quantity, "dcc:name", name);
    add_real(quantity, "", u, 0, "\\arcsecond");
  };
  add("plumbline_uDelta", c.tr("standard uncertainty of one positioning in δ"),
      angles.delta_arcsec);
  add("plumbline_uH", c.tr("standard uncertainty of one positioning in h"), angles.h_arcsec);
}

void add_conditions(const Context& c, const XmlElement& parent) {
  const XmlElement list = parent.add("dcc:influenceConditions");
  const Gravity& gravity = c.input.description.gravity;
  const XmlElement local = list.add("dcc:influenceCondition");
  local.attribute("refType", "plumbline_localGravity");
  c.text(local, "dcc:name", c.tr("Local gravity"));
  add_real(local.add("dcc:data").add("dcc:quantity"), "", gravity.local_mps2, gravity.u_mps2,
           dsi::kAcceleration);
  double low = INFINITY, high = -INFINITY;
  for (const PoseResult& pose : c.input.calibration.pose_results) {
    if (!std::isfinite(pose.temp_C)) continue;
    low = std::min(low, pose.temp_C);
    high = std::max(high, pose.temp_C);
  }
  if (!(low <= high)) return;
  const XmlElement temperature = list.add("dcc:influenceCondition");
  temperature.attribute("refType", "basic_temperature");
  c.text(temperature, "dcc:name", c.tr("Temperature during the run"));
  const XmlElement data = temperature.add("dcc:data");
  for (const auto& [ref_type, value] :
       {std::pair("basic_temperatureMin", low), std::pair("basic_temperatureMax", high)}) {
    const XmlElement quantity = data.add("dcc:quantity");
    quantity.attribute("refType", ref_type);
    add_real(quantity, "", value, 0, "\\degreecelsius");
  }
}

// --- results -------------------------------------------------------------------------------------

void add_parameters(const Context& c, const XmlElement& results) {
  const TriadEstimate& estimate = c.input.calibration.final.batch_ls;
  const XmlElement matrix =
      add_result(c, results, dcc_ref::kSensitivity, c.tr("Sensitivity of the axes x, y, z"));
  Series offsets{{}, {}, {}, dsi::kVolt};
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    Series row{{}, {}, {}, dsi::kVoltPerG};
    for (Eigen::Index j = 0; j < 3; ++j) {
      row.labels.push_back(
          fmt::format("K_{}{}", kAxisName[i], kAxisName[static_cast<std::size_t>(j)]));
      row.values.push_back(estimate[i].value(j));
      row.u.push_back(std::sqrt(estimate[i].covariance(j, j)));
    }
    const XmlElement quantity = add_quantity(c, matrix, dcc_ref::kSensitivity,
                                             c.tr("sensitivity of axis {}", kAxisName[i]));
    add_hybrid(quantity, scaled(row, 1 / kStandardGravity_mps2, dsi::kSensitivity), row);
    used_method(c, quantity);
    offsets.labels.push_back(fmt::format("U_{}0", kAxisName[i]));
    offsets.values.push_back(estimate[i].value(3));
    offsets.u.push_back(std::sqrt(estimate[i].covariance(3, 3)));
  }
  const XmlElement quantity =
      add_quantity(c, add_result(c, results, dcc_ref::kOffset, c.tr("Offset of the axes x, y, z")),
                   dcc_ref::kOffset, c.tr("output voltage without specific force"));
  add_list(quantity, offsets);
  used_method(c, quantity);
}

/// The nine parameters of a calibration without angles.
void add_scalar(const Context& c, const XmlElement& results) {
  const ScalarEstimate& estimate = c.input.scalar->calibration.final;
  const ReadingUnits units = reading_units(c.input.scalar->source.reading_unit);
  const auto add = [&](const char* ref_type, const std::string& name, Eigen::Index first,
                       std::vector<std::string> labels, double factor, const std::string& unit) {
    Series series{std::move(labels), {}, {}, unit};
    for (Eigen::Index i = first; i < first + 3; ++i) {
      series.values.push_back(estimate.value(i));
      series.u.push_back(std::sqrt(std::max(0.0, estimate.covariance(i, i))));
    }
    const XmlElement quantity =
        add_quantity(c, add_result(c, results, ref_type, name), ref_type, name);
    add_list(quantity, scaled(series, factor, unit));
    used_method(c, quantity);
  };
  add(dcc_ref::kBias, c.tr("Bias of the axes x, y, z"), 0, {"bias_x", "bias_y", "bias_z"},
      units.factor, units.bias);
  add(dcc_ref::kScale, c.tr("Scale of the axes x, y, z"), 3, {"scale_x", "scale_y", "scale_z"},
      1 / units.factor, units.scale);
  add(dcc_ref::kNonorthogonality, c.tr("Non-orthogonality"), 6,
      {"angle_yz", "angle_zy", "angle_zx"}, 1, "\\radian");
}

void add_sensor_terms(const Context& c, const XmlElement& results) {
  const SensorTerms terms = sensor_terms(c.input.calibration.final.batch_ls);
  const XmlElement data =
      add_result(c, results, dcc_ref::kIeee1293, c.tr("Terms of IEEE Std 1293"));
  const auto add = [&](const char* ref_type, const std::string& name, const Series& si) {
    const XmlElement quantity = add_quantity(c, data, ref_type, name);
    add_list(quantity, si);
    used_method(c, quantity);
  };
  Series K1, K0, tilt, between;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const AxisTerms& axis = terms.axis[i];
    const auto push = [](Series& series, std::string label, const Quantity& quantity) {
      series.labels.push_back(std::move(label));
      series.values.push_back(quantity.value);
      series.u.push_back(quantity.u);
    };
    push(K1, fmt::format("K1_{}", kAxisName[i]), axis.scale_V_per_g);
    push(K0, fmt::format("K0_{}", kAxisName[i]), axis.bias_g);
    for (std::size_t j = 0; j < kAxisCount; ++j) {
      if (j != i) {
        push(tilt, fmt::format("delta_{}{}", kAxisName[i], kAxisName[j]), axis.misalignment[j]);
      }
    }
    push(
        between,
        fmt::format("theta_{}{}", kAxisName[(i + 1) % kAxisCount], kAxisName[(i + 2) % kAxisCount]),
        terms.nonorthogonality_rad[i]);
  }
  add("plumbline_K1", c.tr("scale factor K1"),
      scaled(K1, 1 / kStandardGravity_mps2, dsi::kSensitivity));
  add("plumbline_K0", c.tr("bias K0"), scaled(K0, kStandardGravity_mps2, dsi::kAcceleration));
  add("plumbline_misalignment", c.tr("misalignment of the input axes"),
      scaled(tilt, 1, "\\radian"));
  add(dcc_ref::kNonorthogonality, c.tr("angle between input axes less 90 degrees"),
      scaled(between, 1, "\\radian"));
}

void add_effects(const Context& c, const XmlElement& results) {
  const Diagnosis& diagnosis = c.input.calibration.diagnosis;
  const auto add = [&](const std::string& name, const std::string& id,
                       const std::vector<EffectParameter>& parameters) {
    if (parameters.empty()) return;
    const XmlElement data = add_result(c, results, dcc_ref::kEffect, name + " (" + id + ")");
    for (const EffectParameter& p : parameters) {
      const XmlElement quantity =
          add_quantity(c, data, dcc_ref::kEffect,
                       p.axis ? fmt::format("{} ({})", p.name, kAxisName.at(*p.axis)) : p.name);
      const auto unit = dsi_unit(p.unit);
      if (!unit) {
        c.text(quantity, "dcc:noQuantity", parameter_text(p));
      } else {
        add_real(quantity, p.name, unit->factor * p.value, unit->factor * p.u, unit->unit);
      }
      used_method(c, quantity);
    }
  };
  for (const FoundEffect& effect : diagnosis.effects) {
    add(effect_name(effect.id, c.tr), effect.id, effect.parameters);
  }
  for (const UnlistedStructure& found : diagnosis.unlisted) {
    add(unlisted_name(found, c.tr), "unlisted:" + found.driver, found.parameters);
  }
}

const char* conformity(DecisionStatus status) {
  switch (status) {
    case DecisionStatus::pass:
      return "pass";
    case DecisionStatus::conditional_pass:
      return "conditionalPass";
    case DecisionStatus::conditional_fail:
      return "conditionalFail";
    case DecisionStatus::fail:
    case DecisionStatus::none:
      break;
  }
  return "fail";
}

void add_errors(const Context& c, const XmlElement& results) {
  const Calibration& calibration = c.input.calibration;
  const XmlElement data = add_result(c, results, dcc_ref::kError,
                                     c.tr("Input-referred errors of the calibrated model"));
  const auto add = [&](const std::string& ref_type, const std::string& name,
                       const PerAxis<double>& values, const PerAxis<double>* u = nullptr) {
    const XmlElement quantity = add_quantity(c, data, ("plumbline_" + ref_type).c_str(), name);
    Series series{{"x", "y", "z"}, {values.begin(), values.end()}, {}, dsi::kAcceleration};
    if (u != nullptr) series.u.assign(u->begin(), u->end());
    add_list(quantity, series);
    used_method(c, quantity);
  };
  const auto both = [&](const std::string& ref_type, const std::string& name,
                        const PerAxis<double>& before, const PerAxis<double>& after) {
    add(ref_type + "Before", c.tr("{}, before", name), before);
    add(ref_type + "After", c.tr("{}, after", name), after);
  };
  const ErrorFigures& b = calibration.before;
  const ErrorFigures& a = calibration.after;
  both("fitRms", c.tr("RMS of the pose means, fitted poses"), b.fit_pose_rms_mps2,
       a.fit_pose_rms_mps2);
  both("heldoutRms", c.tr("RMS of the pose means, poses left out of the fit"),
       b.heldout_pose_rms_mps2, a.heldout_pose_rms_mps2);
  both("heldoutMax", c.tr("largest pose mean, poses left out of the fit"),
       b.heldout_pose_max_abs_mps2, a.heldout_pose_max_abs_mps2);
  both("sampleRms", c.tr("RMS of single readings"), b.sample_rms_mps2, a.sample_rms_mps2);
  add("floorRms", c.tr("expected RMS of the pose means from the noise alone"),
      calibration.floor_pose_rms_mps2, &calibration.u_floor_pose_rms_mps2);
  if (const Evaluation* fresh = c.input.verification; fresh != nullptr) {
    both("freshRms", c.tr("RMS of the pose means, fresh verification poses"),
         fresh->before.pose_rms_mps2, fresh->after.pose_rms_mps2);
    both("freshMax", c.tr("largest pose mean, fresh verification poses"),
         fresh->before.pose_max_abs_mps2, fresh->after.pose_max_abs_mps2);
  }
}

/// What was looked for and not found, axis by axis.
void add_detection_limits(const Context& c, const XmlElement& results) {
  const std::vector<DetectionLimit>& limits = c.input.calibration.diagnosis.not_found;
  if (limits.empty()) return;
  const XmlElement data =
      add_result(c, results, dcc_ref::kDetectionLimit,
                 c.tr("Looked for and not found: an effect of this size would have been seen"));
  for (const DetectionLimit& limit : limits) {
    // What these poses do not show at all has no limit.
    if (!std::isfinite(limit.limit)) continue;
    std::string name =
        fmt::format("{} ({}): {}", effect_name(limit.id, c.tr), limit.id, limit.parameter);
    if (limit.axis) name += fmt::format(" ({})", kAxisName.at(*limit.axis));
    const XmlElement quantity = add_quantity(c, data, dcc_ref::kDetectionLimit, name);
    if (const auto unit = dsi_unit(limit.unit)) {
      add_real(quantity, limit.parameter, unit->factor * limit.limit, 0, unit->unit);
    } else {
      c.text(quantity, "dcc:noQuantity", number(limit.limit) + " " + limit.unit);
    }
    used_method(c, quantity);
  }
}

void add_decision(const Context& c, const XmlElement& results) {
  const Decision decision = stated_decision(c.input.calibration.decision, c.input.events);
  if (decision.status == DecisionStatus::none) return;
  const XmlElement quantity =
      add_quantity(c, add_result(c, results, dcc_ref::kConformity, c.tr("Statement of conformity")),
                   "basic_measurementError", c.tr("largest error of a pose left out of the fit"));
  add_real(quantity, "", decision.max_abs_error_mps2, decision.u_mps2, dsi::kAcceleration);
  used_method(c, quantity);
  const XmlElement meta = quantity.add("dcc:measurementMetaData").add("dcc:metaData");
  meta.attribute("refType", "basic_conformity");
  meta.add("dcc:conformity", conformity(decision.status));
  const XmlElement data = meta.add("dcc:data");
  const XmlElement limit = data.add("dcc:quantity");
  limit.attribute("refType", "basic_acceptanceLimitUpper");
  add_real(limit, "", decision.limit_mps2, 0, dsi::kAcceleration);
  const XmlElement guard = data.add("dcc:quantity");
  guard.attribute("refType", "plumbline_guardBand");
  add_real(guard, "", decision.guard_band_mps2, 0, dsi::kAcceleration);
}

void add_noise(const Context& c, const XmlElement& results) {
  static constexpr const char* kUnit[kTermCount] = {"\\volt\\second", "\\volt\\second\\tothe{0.5}",
                                                    "\\volt", "\\volt\\second\\tothe{-0.5}",
                                                    "\\volt\\second\\tothe{-1}"};
  const PerAxis<NoiseModel>& noise = c.input.calibration.noise;
  if (std::all_of(noise.begin(), noise.end(), [](const auto& n) { return n.source == "none"; })) {
    return;
  }
  const XmlElement data = add_result(c, results, dcc_ref::kNoise, c.tr("Noise"));
  for (std::size_t term = 0; term < kTermCount; ++term) {
    Series series{{}, {}, {}, kUnit[term]};
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      const NoiseTerm value = reported_terms(noise[i])[term];
      series.labels.push_back(fmt::format("{}_{}", kTermName[term], kAxisName[i]));
      series.values.push_back(value.value);
      series.u.push_back(value.u);
    }
    const XmlElement quantity = add_quantity(c, data, dcc_ref::kNoise, kTermName[term]);
    add_list(quantity, series);
    used_method(c, quantity);
  }
}

}  // namespace

void add_measurement_results(const Context& c, const XmlElement& root) {
  const XmlElement result = root.add("dcc:measurementResults").add("dcc:measurementResult");
  c.text(result, "dcc:name", c.tr("Calibration in the field of gravity"));
  add_methods(c, result);
  add_software(result);
  const bool scalar = c.input.scalar != nullptr;
  if (!scalar) add_equipment(c, result);
  add_conditions(c, result);
  const XmlElement results = result.add("dcc:results");
  if (scalar) {
    add_scalar(c, results);
  } else {
    add_parameters(c, results);
    add_sensor_terms(c, results);
  }
  add_effects(c, results);
  add_detection_limits(c, results);
  add_errors(c, results);
  add_decision(c, results);
  if (!scalar) add_noise(c, results);
}

}  // namespace plumbline::app::dcc
