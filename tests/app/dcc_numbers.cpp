#include "tests/app/dcc_numbers.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <sstream>
#include <vector>

#include "app/certificate/dcc/dcc_units.h"
#include "app/certificate/dcc/dcc_writer.h"
#include "app/certificate/sensor_terms.h"
#include "app/io/json.h"
#include "app/verify/dcc_reader.h"

namespace plumbline::app {
namespace {

struct Stated {
  std::string result;  ///< refType of the dcc:result
  std::string about;   ///< its name
  std::string quantity;
  std::string name;  ///< of the quantity
  std::string label;
  std::string unit;
  std::string text;  ///< of dcc:noQuantity
  double value = 0;
  double expanded = 0;  ///< 0: none stated
  bool seen = false;

  std::string words() const {
    return fmt::format("{} “{}” / {} “{}” / {} {} = {}{}", result, about, quantity, name, label,
                       unit, value, text);
  }
};

std::string view(const xmlChar* text) {
  return text == nullptr ? "" : reinterpret_cast<const char*>(text);
}

std::string content(const xmlNode* node) {
  xmlChar* text = xmlNodeGetContent(node);
  std::string copy = view(text);
  xmlFree(text);
  return copy;
}

std::string ref_type(const xmlNode* node) {
  xmlChar* text = xmlGetNoNsProp(node, reinterpret_cast<const xmlChar*>("refType"));
  std::string copy = view(text);
  xmlFree(text);
  return copy;
}

using ElementVisitor = std::function<void(const xmlNode*)>;

/// Elements of this name below a node, not below one another.
void each(const xmlNode* node, const std::string& name, const ElementVisitor& visit) {
  for (const xmlNode* c = node->children; c != nullptr; c = c->next) {
    if (c->type == XML_ELEMENT_NODE && view(c->name) == name) {
      visit(c);
    } else {
      each(c, name, visit);
    }
  }
}

std::vector<std::string> words_below(const xmlNode* node, const std::string& name) {
  std::vector<std::string> list;
  each(node, name, [&](const xmlNode* found) {
    std::istringstream text(content(found));
    for (std::string word; text >> word;) list.push_back(word);
  });
  return list;
}

std::string name_of(const xmlNode* node) {
  for (const xmlNode* c = node->children; c != nullptr; c = c->next) {
    if (view(c->name) == "name") return content(c);
  }
  return {};
}

void add_quantity(const xmlNode* node, Stated stated, std::vector<Stated>& all) {
  stated.quantity = ref_type(node);
  stated.name = name_of(node);
  const auto add_values = [&](const xmlNode* list, const std::string& suffix) {
    const auto labels = words_below(list, "label" + suffix);
    const auto values = words_below(list, "value" + suffix);
    const auto expanded = words_below(list, "valueExpandedMU" + suffix);
    const auto units = words_below(list, "unit" + suffix);
    ASSERT_EQ(units.size(), 1U) << stated.words();
    for (std::size_t k = 0; k < values.size(); ++k) {
      Stated one = stated;
      one.label = k < labels.size() ? labels[k] : "";
      one.unit = units.front();
      one.value = std::stod(values[k]);
      one.expanded = k < expanded.size() ? std::stod(expanded[k]) : 0;
      all.push_back(one);
    }
  };
  // The limits of a decision stand below the quantity that was decided on.
  for (const xmlNode* c = node->children; c != nullptr; c = c->next) {
    const std::string name = view(c->name);
    if (name == "noQuantity") {
      stated.text = content(c);
      all.push_back(stated);
    } else if (name == "real") {
      add_values(c, "");
    } else if (name == "realListXMLList") {
      add_values(c, "XMLList");
    } else if (name == "hybrid") {
      each(c, "realListXMLList", [&](const xmlNode* list) { add_values(list, "XMLList"); });
    } else if (name == "measurementMetaData") {
      each(c, "quantity", [&](const xmlNode* inner) { add_quantity(inner, stated, all); });
      stated.text = words_below(c, "conformity").at(0);
      stated.quantity = "conformity";
      all.push_back(stated);
    }
  }
}

class Numbers {
 public:
  explicit Numbers(const std::string& xml) {
    const auto dcc = read_dcc(xml, "certificate.xml");
    EXPECT_TRUE(dcc) << dcc.error().message;
    if (!dcc) return;
    const xmlNode* root = xmlDocGetRootElement(dcc->tree.get());
    each(root, "result", [&](const xmlNode* result) {
      Stated stated;
      stated.result = ref_type(result);
      stated.about = name_of(result);
      each(result, "quantity", [&](const xmlNode* node) { add_quantity(node, stated, all_); });
    });
  }

  /// `u` 0: no uncertainty is stated. `about` is a part of the names of result and quantity.
  void expect(const std::string& result, const std::string& about, const std::string& label,
              const std::string& unit, double value, double u) {
    Stated* found = find(result, about, [&](const Stated& s) {
      return s.label == label && s.unit == unit && s.text.empty();
    });
    if (found == nullptr) {
      ADD_FAILURE() << "certificate.xml does not say: " << result << " " << about << " " << label
                    << " " << unit;
      return;
    }
    EXPECT_DOUBLE_EQ(found->value, value) << found->words();
    EXPECT_DOUBLE_EQ(found->expanded, 2 * u) << found->words();
  }

  void expect_text(const std::string& result, const std::string& about, const std::string& text) {
    const Stated* found = find(
        result, about, [&](const Stated& s) { return s.text.find(text) != std::string::npos; });
    EXPECT_NE(found, nullptr) << result << " " << about << " " << text;
  }

  void expect_nothing_else() const {
    EXPECT_FALSE(all_.empty());
    for (const Stated& stated : all_) {
      EXPECT_TRUE(stated.seen) << "result.json does not say: " << stated.words();
    }
  }

 private:
  template <class Test>
  Stated* find(const std::string& result, const std::string& about, const Test& test) {
    for (Stated& stated : all_) {
      const std::string names = stated.about + " / " + stated.quantity + " / " + stated.name;
      if (stated.seen || stated.result != result || names.find(about) == std::string::npos ||
          !test(stated)) {
        continue;
      }
      stated.seen = true;
      return &stated;
    }
    return nullptr;
  }

  std::vector<Stated> all_;
};

TriadEstimate triad_of(const Json& fit) {
  TriadEstimate triad;
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const Json& axis = fit.at(kAxisName[i]);
    for (Eigen::Index j = 0; j < 4; ++j) {
      triad[i].value(j) = j < 3 ? axis.at("K_V_per_g").at(static_cast<std::size_t>(j)).get<double>()
                                : axis.at("U0_V").get<double>();
      for (Eigen::Index k = 0; k < 4; ++k) {
        triad[i].covariance(j, k) =
            axis.at("covariance").at(static_cast<std::size_t>(j)).at(static_cast<std::size_t>(k));
      }
    }
  }
  return triad;
}

void expect_twelve(const Json& fit, Numbers& numbers) {
  const TriadEstimate triad = triad_of(fit);
  const SensorTerms terms = sensor_terms(triad);
  const auto term = [&](const std::string& label, const Quantity& q, double factor,
                        const std::string& unit) {
    numbers.expect(dcc_ref::kIeee1293, "", label, unit, factor * q.value, std::abs(factor) * q.u);
  };
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const std::string axis = kAxisName[i];
    const Json& row = fit.at(axis);
    for (std::size_t j = 0; j < kAxisCount; ++j) {
      const double value = row.at("K_V_per_g").at(j), u = row.at("u_K_V_per_g").at(j);
      const std::string label = "K_" + axis + kAxisName[j];
      numbers.expect(dcc_ref::kSensitivity, "", label, dsi::kVoltPerG, value, u);
      numbers.expect(dcc_ref::kSensitivity, "", label, dsi::kSensitivity,
                     value / kStandardGravity_mps2, u / kStandardGravity_mps2);
      if (j != i)
        term("delta_" + axis + kAxisName[j], terms.axis[i].misalignment[j], 1, "\\radian");
    }
    numbers.expect(dcc_ref::kOffset, "", "U_" + axis + "0", dsi::kVolt, row.at("U0_V"),
                   row.at("u_U0_V"));
    term("K1_" + axis, terms.axis[i].scale_V_per_g, 1 / kStandardGravity_mps2, dsi::kSensitivity);
    term("K0_" + axis, terms.axis[i].bias_g, kStandardGravity_mps2, dsi::kAcceleration);
    term(fmt::format("theta_{}{}", kAxisName[(i + 1) % 3], kAxisName[(i + 2) % 3]),
         terms.nonorthogonality_rad[i], 1, "\\radian");
  }
}

void expect_nine(const Json& scalar, Numbers& numbers) {
  const Json& fit = scalar.contains("with_effects") ? scalar.at("with_effects") : scalar;
  const ReadingUnits units = reading_units(scalar.at("reading_unit"));
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    const std::string axis = kAxisName[i];
    numbers.expect(dcc_ref::kBias, "", "bias_" + axis, units.bias,
                   units.factor * fit.at("bias").at(i).get<double>(),
                   units.factor * fit.at("u_bias").at(i).get<double>());
    numbers.expect(dcc_ref::kScale, "", "scale_" + axis, units.scale,
                   fit.at("scale").at(i).get<double>() / units.factor,
                   fit.at("u_scale").at(i).get<double>() / units.factor);
  }
  for (const char* angle : {"yz", "zy", "zx"}) {
    numbers.expect(dcc_ref::kNonorthogonality, "", std::string("angle_") + angle, "\\radian",
                   fit.at("nonorthogonality_rad").at(angle),
                   fit.at("u_nonorthogonality_rad").at(angle));
  }
}

void expect_parameters(const Json& found, const std::string& about, Numbers& numbers) {
  for (const Json& p : found.at("parameters")) {
    const std::string name = p.at("name");
    const auto unit = dsi_unit(p.at("unit"));
    if (unit) {
      numbers.expect(dcc_ref::kEffect, about, name, unit->unit,
                     unit->factor * p.at("value").get<double>(),
                     unit->factor * p.at("u").get<double>());
    } else {
      numbers.expect_text(dcc_ref::kEffect, about, name);
    }
  }
}

void expect_diagnosis(const Json& diagnosis, Numbers& numbers) {
  for (const Json& effect : diagnosis.at("effects")) {
    expect_parameters(effect, "(" + effect.at("id").get<std::string>() + ")", numbers);
  }
  for (const Json& found : diagnosis.at("unlisted")) {
    expect_parameters(found, "(unlisted:" + found.at("driver").get<std::string>() + ")", numbers);
  }
  if (!diagnosis.contains("detection_limits")) return;
  for (const Json& limit : diagnosis.at("detection_limits")) {
    if (limit.at("limit").is_null()) continue;
    const double value = limit.at("limit");
    const std::string parameter = limit.at("parameter");
    std::string about = fmt::format("({}): {}", limit.at("id").get<std::string>(), parameter);
    if (!limit.at("axis").is_null()) about += " (" + limit.at("axis").get<std::string>() + ")";
    if (const auto unit = dsi_unit(limit.at("unit"))) {
      numbers.expect(dcc_ref::kDetectionLimit, about, parameter, unit->unit, unit->factor * value,
                     0);
    } else {
      numbers.expect_text(dcc_ref::kDetectionLimit, about, fmt::format("{} ", value));
    }
  }
}

void expect_errors(const Json& error, Numbers& numbers) {
  const auto per_axis = [&](const std::string& quantity, const Json& values, const Json* u) {
    for (std::size_t i = 0; i < kAxisCount; ++i) {
      numbers.expect(dcc_ref::kError, "plumbline_" + quantity + " ", kAxisName[i],
                     dsi::kAcceleration, values.at(i), u == nullptr ? 0 : u->at(i).get<double>());
    }
  };
  for (const auto& [phase, suffix] : {std::pair("before", "Before"), std::pair("after", "After")}) {
    const Json& stated = error.at(phase);
    per_axis(std::string("fitRms") + suffix, stated.at("fit_pose_rms"), nullptr);
    per_axis(std::string("heldoutRms") + suffix, stated.at("heldout_pose_rms"), nullptr);
    per_axis(std::string("heldoutMax") + suffix, stated.at("heldout_pose_max_abs"), nullptr);
    per_axis(std::string("sampleRms") + suffix, stated.at("sample_rms"), nullptr);
  }
  per_axis("floorRms", error.at("floor").at("pose_rms"), &error.at("floor").at("u_pose_rms"));
}

void expect_decision(const Json& decision, Numbers& numbers) {
  static const std::map<std::string, std::string> kWords = {
      {"pass", "pass"},
      {"fail", "fail"},
      {"conditional_pass", "conditionalPass"},
      {"conditional_fail", "conditionalFail"}};
  const std::string status = decision.at("status");
  if (status == "none") return;
  const auto expect = [&](const std::string& quantity, double value, double u) {
    numbers.expect(dcc_ref::kConformity, quantity, "", dsi::kAcceleration, value, u);
  };
  expect("basic_measurementError", decision.at("max_abs_error_mps2"), decision.at("u_mps2"));
  expect("basic_acceptanceLimitUpper", decision.at("limit_mps2"), 0);
  expect("plumbline_guardBand", decision.at("guard_band_mps2"), 0);
  numbers.expect_text(dcc_ref::kConformity, "conformity", kWords.at(status));
}

void expect_noise(const Json& noise, Numbers& numbers) {
  static constexpr std::pair<const char*, const char*> kTerms[] = {
      {"Q", "\\volt\\second"},
      {"N", "\\volt\\second\\tothe{0.5}"},
      {"B", "\\volt"},
      {"K", "\\volt\\second\\tothe{-0.5}"},
      {"R", "\\volt\\second\\tothe{-1}"}};
  for (const auto& [term, unit] : kTerms) {
    for (const char* axis : kAxisName) {
      const Json& stated = noise.at(axis).at(term);
      numbers.expect(dcc_ref::kNoise, "", fmt::format("{}_{}", term, axis), unit,
                     stated.at("value"), stated.at("u"));
    }
  }
}

}  // namespace

void expect_numbers_of_result(const std::string& xml, const std::string& result_json) {
  const Json json = Json::parse(result_json);
  Numbers numbers(xml);
  if (json.contains("scalar")) {
    expect_nine(json.at("scalar"), numbers);
  } else {
    expect_twelve(json.at("final").at("batch_ls"), numbers);
    expect_noise(json.at("noise"), numbers);
  }
  expect_diagnosis(json.at("diagnosis"), numbers);
  expect_errors(json.at("error"), numbers);
  expect_decision(json.at("decision"), numbers);
  numbers.expect_nothing_else();
}

}  // namespace plumbline::app
