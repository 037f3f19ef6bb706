// What a certificate says beside numbers that are only printed: derived terms, budget, languages.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <regex>

#include "app/certificate/budget.h"
#include "app/certificate/dcc/dcc_writer.h"
#include "app/certificate/effect_words.h"
#include "app/certificate/sensor_terms.h"
#include "app/certificate/table_columns.h"
#include "estimator/diagnosis/verdict.h"
#include "estimator/effects/catalogue.h"
#include "estimator/effects/smooth_term.h"
#include "tests/app/certificate_example.h"

namespace plumbline::app {
namespace {

using testing::HasSubstr;
using testing::Not;

TriadEstimate triad(const Eigen::Matrix<double, 3, 4>& parameters, double sd) {
  TriadEstimate estimate;
  for (Eigen::Index i = 0; i < 3; ++i) {
    AxisEstimate& axis = estimate[static_cast<std::size_t>(i)];
    axis.value = parameters.row(i).transpose();
    axis.covariance = sd * sd * Eigen::Matrix4d::Identity();
  }
  return estimate;
}

// --- IEEE 1293 ---

TEST(SensorTerms, ByHand) {
  Eigen::Matrix<double, 3, 4> K;
  K << 3, 0, 4, 10,  // |K_x| = 5, leaning towards z by 4/3
      0, 2, 0, 1,    //
      0, 0, -8, 4;   // inverted axis
  const SensorTerms terms = sensor_terms(triad(K, 0.01));
  EXPECT_DOUBLE_EQ(terms.axis[0].scale_V_per_g.value, 5);
  EXPECT_DOUBLE_EQ(terms.axis[0].scale_V_per_g.u, 0.01);  // along the input axis
  EXPECT_DOUBLE_EQ(terms.axis[0].bias_g.value, 2);
  // K0 = U/K1: u² = (0.01/5)² + (2·0.01/5)²
  EXPECT_NEAR(terms.axis[0].bias_g.u, std::sqrt(4e-6 + 16e-6), 1e-12);
  EXPECT_DOUBLE_EQ(terms.axis[0].misalignment[2].value, 4.0 / 3);
  EXPECT_NEAR(terms.axis[0].misalignment[2].u, 0.01 * std::hypot(1.0 / 3, 4.0 / 9), 1e-12);
  EXPECT_DOUBLE_EQ(terms.axis[2].scale_V_per_g.value, -8);
  EXPECT_DOUBLE_EQ(terms.axis[2].bias_g.value, -0.5);
  // z and x: directions (0 0 1) and (3 0 4)/5, an angle of acos 0.8, that is 90° − asin 0.8.
  EXPECT_NEAR(terms.nonorthogonality_rad[1].value, -std::asin(0.8), 1e-12);
  EXPECT_NEAR(terms.nonorthogonality_rad[2].value, 0, 1e-12);
}

TEST(SensorTerms, MountingRotationChangesNeitherScaleNorBiasNorAnglesBetweenAxes) {
  Eigen::Matrix<double, 3, 4> K;
  K << 3, 0.1, 0.2, 10, -0.3, 2, 0.1, 1, 0.2, 0.1, -8, 4;
  const double c = std::cos(0.05), s = std::sin(0.05);
  Eigen::Matrix3d turn;
  turn << c, -s, 0, s, c, 0, 0, 0, 1;
  Eigen::Matrix<double, 3, 4> turned = K;
  turned.leftCols<3>() = K.leftCols<3>() * turn;
  const SensorTerms before = sensor_terms(triad(K, 0.01)),
                    after = sensor_terms(triad(turned, 0.01));
  for (std::size_t i = 0; i < kAxisCount; ++i) {
    EXPECT_NEAR(before.axis[i].scale_V_per_g.value, after.axis[i].scale_V_per_g.value, 1e-12);
    EXPECT_NEAR(before.axis[i].bias_g.value, after.axis[i].bias_g.value, 1e-12);
    EXPECT_NEAR(before.nonorthogonality_rad[i].value, after.nonorthogonality_rad[i].value, 1e-12);
    EXPECT_NEAR(before.nonorthogonality_rad[i].u, after.nonorthogonality_rad[i].u, 1e-12);
  }
  EXPECT_GT(std::abs(before.axis[0].misalignment[1].value - after.axis[0].misalignment[1].value),
            0.04);
}

// --- budget ---

TEST(Budget, PartsMakeUpTheCombinedUncertainty) {
  CertificateExample example;
  example.description.gravity.u_mps2 = 1e-4;
  example.description.angles = {20, 30};
  const Budget budget = budget_of(example.calibration, example.description, 0, 0);
  double sum = 0, shares = 0;
  for (const BudgetLine& line : budget.lines) {
    sum += line.contribution * line.contribution;
    shares += line.share;
  }
  EXPECT_NEAR(std::sqrt(sum), 1e-6, 1e-12);
  EXPECT_NEAR(shares, 1, 1e-9);
  const BudgetLine& gravity = budget.lines[3];
  EXPECT_EQ(gravity.source, BudgetSource::gravity);
  EXPECT_NEAR(gravity.contribution, 0.032002134 * 1e-4 / 9.8101, 1e-15);
  EXPECT_GT(budget.dof_effective, 320);
}

TEST(Budget, PositioningByHand) {
  // Four poses on the circle h = 0 and one pointing up: K_z hangs on the last pose and the mean of
  // the others. With K = (0, 0, K_z) an error of δ changes nothing, an error of h by 1″ changes
  // the output of the level poses by K_z·1″ each and that of the upright pose not at all.
  CertificateExample example;
  example.calibration.pose_results.resize(5);
  for (int k = 0; k < 5; ++k) {
    auto& pose = example.calibration.pose_results[static_cast<std::size_t>(k)].pose;
    pose.delta_deg = k < 4 ? 90 * k : 0;
    pose.h_deg = k < 4 ? 0 : 90;
  }
  example.calibration.final.batch_ls[2].value = {0, 0, 0.03, -2.5};
  example.description.gravity = {kStandardGravity_mps2, 0};
  example.description.angles = {1, 1};
  const Budget budget = budget_of(example.calibration, example.description, 2, 2);
  const double arcsec_rad = std::numbers::pi / 180 / 3600;
  EXPECT_NEAR(budget.lines[1].sensitivity, 0, 1e-20);
  // K_z = U_5 − mean(U_1 … U_4): the root of four squares of K_z·1″/4.
  EXPECT_NEAR(budget.lines[2].sensitivity, 0.03 * arcsec_rad / 2, 1e-15);
}

// --- effects in words ---

TEST(EffectWords, EveryEffectHasANameInBothLanguages) {
  const Translator en(Language::en), uk(Language::uk);
  for (const Effect* effect : effect_catalogue()) {
    EXPECT_NE(effect_name(effect->id(), en), effect->id()) << effect->id();
    EXPECT_NE(effect_name(effect->id(), uk), effect_name(effect->id(), en)) << effect->id();
  }
  EXPECT_EQ(effect_name("rig.h_scale+rig.backlash", en),
            "scale error of the tilt axis + backlash of the spindle");
  EXPECT_EQ(effect_name("covariate:rh_pct", en), "influence of the recorded column rh_pct");
  EXPECT_EQ(effect_name("unlisted:temp_C.rate:bias", en), "the bias follows temp_C.rate");
  EXPECT_EQ(effect_name("unlisted:temp_C.rate:bias", uk), "зміщення нуля залежить від temp_C.rate");
  EXPECT_THAT(uk.missing(), testing::IsEmpty());
}

TEST(EffectWords, EveryEffectHasATermInBothLanguages) {
  const Translator en(Language::en), uk(Language::uk);
  for (const Effect* effect : effect_catalogue()) {
    const std::string term = effect_term(effect->id(), en);
    EXPECT_NE(term, "") << effect->id();
    EXPECT_NE(effect_term(effect->id(), uk), "") << effect->id();
    // Its parameters are in it, or are what it says in words.
    if (effect->parameters().size() == 1) {
      EXPECT_THAT(term, HasSubstr(effect->parameters().front().name)) << effect->id();
    }
  }
  EXPECT_THAT(uk.missing(), testing::IsEmpty());
  EXPECT_EQ(effect_term("sensor.quadratic+sensor.drift", en), "k2·a_i²; d·t");
  EXPECT_THAT(effect_term("covariate:rh_pct", en), HasSubstr("the column rh_pct"));
  EXPECT_EQ(effect_term("own.effect", en), "");
}

TEST(EffectWords, ParametersAsTheyArePrinted) {
  EXPECT_EQ(parameter_text({"k2", 0, 0.012345, 0.0002, "g/g^2"}),
            "k2 (x) = (0.01235 ± 0.00040) g/g²");
  EXPECT_EQ(parameter_text({"n", {}, 5, 0, ""}), "n = 5");
  EXPECT_EQ(parameter_text({"epsilon", {}, -0.1, 0.01, "deg"}), "epsilon = (−0.100 ± 0.020)°");
}

// --- what must be said ---

TEST(Certificate, EffectsInWordsAndNumbersWithTheirRivals) {
  CertificateExample example;
  example.add_effects(1);
  const std::string html = example.html();
  EXPECT_THAT(html, HasSubstr("second-order nonlinearity (K2) (sensor.quadratic)"));
  EXPECT_THAT(html, HasSubstr("k2 (x) = (0.00212 ± 0.00022) g/g²"));
  EXPECT_THAT(html, HasSubstr("scale factor asymmetry (sensor.asymmetry)"));
  EXPECT_THAT(html, HasSubstr("To tell them apart: poses with h below the horizon"));
  EXPECT_THAT(html, HasSubstr("<dt>second-order nonlinearity (K2)</dt><dd>k2·a_i²</dd>"));
  EXPECT_THAT(html, HasSubstr("x, before"));
  EXPECT_THAT(html, HasSubstr("<td>58.2</td><td>29.1</td>"));  // left-out poses, before and after
}

TEST(Certificate, TellsWhatWasOutOfTheOrdinaryAndCountsTheRest) {
  CertificateExample example;
  CertificateInput input = example.input();
  input.events = {{0, "operator", "R. Roe"}};
  for (int pose = 0; pose < 349; ++pose) {
    const std::string text = "pose " + std::to_string(pose);
    for (const char* state : {"moving: ", "settling: ", "sampling: "}) {
      input.events.push_back({1.0 * pose, "state", state + text});
    }
    if (pose % 10 == 0) input.events.push_back({1.0 * pose, "retry", "retried " + text});
  }
  input.events.push_back({400, "state", "paused: asked to pause"});
  const std::string html = write_html(make_certificate(input));
  EXPECT_THAT(html, HasSubstr("R. Roe"));
  EXPECT_THAT(html, HasSubstr("paused: asked to pause"));
  EXPECT_THAT(html, Not(HasSubstr("moving: pose 7")));
  EXPECT_THAT(html, HasSubstr("Not listed: 1047 changes of state"));
  EXPECT_THAT(html, HasSubstr("retried pose 110"));
  EXPECT_THAT(html, Not(HasSubstr("retried pose 120")));
  EXPECT_THAT(html,
              HasSubstr("Further events of the kind “retry” that are kept with the run: 23."));
}

TEST(Certificate, WhatWasLookedForAndNotFound) {
  CertificateExample example;
  example.calibration.diagnosis.not_found = {
      {.id = "rig.backlash", .axis = {}, .parameter = "w", .limit = 0.0123, .unit = "deg"},
      {.id = "sensor.cubic", .axis = 0, .parameter = "k3", .limit = 0.002, .unit = "g/g^3"},
      {.id = "sensor.cubic", .axis = 2, .parameter = "k3", .limit = 0.004, .unit = "g/g^3"}};
  const std::string html = example.html();
  EXPECT_THAT(html, HasSubstr("Looked for and not found"));
  EXPECT_THAT(html, HasSubstr("<td class=\"words\">w</td><td>0.012°</td>"));
  EXPECT_THAT(html, HasSubstr("<td class=\"words\">x, z</td><td class=\"words\">k3</td>"
                              "<td>0.0040 g/g³</td>"));
}

TEST(Certificate, UkrainianLeavesNothingUntranslated) {
  CertificateExample example;
  example.add_effects(12);
  example.language = Language::uk;
  example.calibration.decision = {DecisionStatus::pass, 0.2, 0.1, 0.01, 0.02, ""};
  UnlistedStructure unlisted;
  unlisted.driver = "rh_pct";
  unlisted.form = "scale";
  example.calibration.diagnosis.unlisted = {unlisted};
  const Translator tr(Language::uk);
  example.add_not_found();
  const std::string html = write_html(make_certificate(example.input(), tr));
  EXPECT_THAT(tr.missing(), testing::IsEmpty());
  EXPECT_THAT(html, HasSubstr("<html lang=\"uk\">"));
  EXPECT_THAT(html, HasSubstr("ВІДПОВІДАЄ"));
  EXPECT_THAT(html, HasSubstr("нелінійність другого порядку"));
  EXPECT_THAT(html, Not(HasSubstr("not stated")));
}

TEST(Certificate, UnfinishedRunIsToldOnTheFirstPage) {
  CertificateExample example;
  EXPECT_EQ(make_certificate(example.input()).tone, Tone::plain);
  example.events = {{0, "incomplete", "the run is not finished: stopped after 42 poses"}};
  const Document english = make_certificate(example.input());
  EXPECT_EQ(english.summary.front(), "The run is not finished: stopped after 42 poses.");
  EXPECT_EQ(english.tone, Tone::warning);
  EXPECT_EQ(english.headline, "Run not finished");
  example.language = Language::uk;
  const Document ukrainian = make_certificate(example.input());
  EXPECT_EQ(ukrainian.summary.front(), "Вимірювання не завершено: зупинено після 42 положень.");
  EXPECT_EQ(ukrainian.headline, "Вимірювання не завершено");
}

// The poses that it never reached may hold the largest error: it can fail, not pass.
TEST(Certificate, UnfinishedRunDoesNotPass) {
  CertificateExample example;
  example.calibration.decision = {DecisionStatus::pass, 0.2, 0.1, 0.01, 0.02, ""};
  EXPECT_EQ(make_certificate(example.input()).headline, "PASS");
  example.events = {{0, "incomplete", "the run is not finished: stopped after 42 poses"}};
  for (const Language language : {Language::en, Language::uk}) {
    example.language = language;
    for (const DecisionStatus status : {DecisionStatus::pass, DecisionStatus::conditional_pass}) {
      example.calibration.decision.status = status;
      const std::string html = example.html();
      for (const char* word : {"PASS", "ВІДПОВІДАЄ"}) EXPECT_THAT(html, Not(HasSubstr(word)));
    }
    const Document document = make_certificate(example.input());
    const std::string xml = write_dcc(example.input(), document, {});
    EXPECT_THAT(xml, Not(HasSubstr("conformity>")));
    EXPECT_THAT(xml, HasSubstr(document.headline));
  }
  EXPECT_THAT(example.html(), HasSubstr("<dd>немає: вимірювання не завершено"));
  example.language = Language::en;
  EXPECT_THAT(example.html(), HasSubstr("<dd>none: the run was not finished"));
  example.calibration.decision.status = DecisionStatus::fail;
  const Document failed = make_certificate(example.input());
  EXPECT_EQ(failed.headline, "Run not finished: FAIL");
  EXPECT_THAT(write_dcc(example.input(), failed, {}), HasSubstr("<dcc:conformity>fail<"));
}

TEST(Certificate, UkrainianForWhatTheCoreSays) {
  const Translator uk(Language::uk), en(Language::en);
  const std::string reason =
      "x axis: residual 0.111 m/s² where 0.026 ± 0.002 is expected; y axis: no noise could be "
      "identified; explained by rig.backlash (x): w = 2.3 deg";
  EXPECT_EQ(en.phrase(reason), reason);
  EXPECT_EQ(uk.phrase(reason),
            "вісь x: залишок 0.111 m/s² за очікуваного 0.026 ± 0.002; вісь y: шум не вдалося "
            "визначити; пояснено: rig.backlash (x): w = 2.3 deg");
  EXPECT_EQ(uk.phrase("17 poses are too few to tell an effect from noise; at least 24 are needed"),
            "положень (17) замало, щоб відрізнити ефект від шуму; потрібно щонайменше 24");
  EXPECT_EQ(uk.phrase("something new"), "something new");
  EXPECT_EQ(uk.phrase("unlisted: temp_C changes the scale (straight line in the average of "
                      "the past, times the component of the next axis, time constant 60 s)"),
            "поза переліком: temp_C змінює чутливість (пряма від середнього минулого, "
            "помножено на складову наступної осі, стала часу 60 s)");
  EXPECT_EQ(uk.phrase("1 further pose in random order (h = 10°) tells it from "
                      "rig.backlash by 7.1 standard deviations"),
            "ще одне положення у випадковому порядку (h = 10°) відрізнить його від "
            "rig.backlash на 7.1 стандартних відхилень");
  EXPECT_EQ(uk.phrase("3 further poses in random order (h from 10° to 40°) tell it from "
                      "rig.backlash by 7.1 standard deviations"),
            "подальші положення у випадковому порядку (кількість 3, h від 10° до 40°) відрізнять "
            "його від rig.backlash на 7.1 стандартних відхилень");
  EXPECT_EQ(uk.phrase("2 further poses in random order (h = 10°) tell it from rig.backlash by 7.1 "
                      "standard deviations"),
            "подальші положення у випадковому порядку (кількість 2, h = 10°) відрізнять його від "
            "rig.backlash на 7.1 стандартних відхилень");
}

TEST(Certificate, UkrainianForEveryShapeWithoutAName) {
  const Visit visit{.step_s = 0.01, .count = 40, .covariate = {45, 5}};
  const VisitLog log = log_of({.has_temperature = true,
                               .covariate_names = {"rh_pct", "supply_V"},
                               .visits = {visit, visit, visit}});
  const Translator uk(Language::uk);
  const std::regex variable("delta_deg|h_deg|temp_C|rh_pct|supply_V|a_i"), english("[a-z]{2,}");
  const auto terms = smooth_terms(log, SmoothTermSelection::any);
  ASSERT_GT(terms.size(), 300U);
  for (const auto& term : terms) {
    const std::string translated = uk.phrase(term->shape());
    EXPECT_FALSE(std::regex_search(std::regex_replace(translated, variable, ""), english))
        << term->shape() << ": " << translated;
  }
}

TEST(Certificate, UkrainianForACalibrationWithoutAngles) {
  const Translator uk(Language::uk);
  const std::regex english("\\b[a-z]{3,} [a-z]{2,}\\b");
  for (const char* text :
       {"residual |a| − g 10.4 mm/s² where 3.75 is expected from the noise inside the rests (5.51 "
        "when its correlation is counted): too much; in part explained by sensor.quadratic (y) k2 "
        "= -0.00415 ± 0.0005 g/g^2; 7.88 mm/s² after, still more than the noise; among 1584 "
        "further hypotheses (temperature and columns where recorded, time, order, polynomials of "
        "the attitude) none explains the rest",
        "residual |a| − g 9 mm/s² where 3 is expected from the noise inside the rests: too much; "
        "tried and excluded: 1584 hypotheses (nonlinearity, hysteresis, settling, drift and steps "
        "in time, temperature and other columns where recorded); the best of them, sensor.drift "
        "(x), has p = 0.02",
        "17 rests are too few to tell an effect from noise; at least 20 are needed",
        "unlisted structure driven by temp_C (z)",
        "readings at known angles (calibrate with the dividing head): without angles only the sum "
        "of the three axes' terms along gravity is seen",
        "the commanded angles and the angle-free result disagree (largest E_n 1.3); directions of "
        "gravity differ by 0.85° rms where noise and positioning leave 0.1°: the head or the "
        "mounting has an error of that size",
        "the commanded angles and the angle-free result agree (largest E_n 0.3); directions of "
        "gravity differ by 0.05° rms where noise and positioning leave 0.1°: no error of the head "
        "is seen"}) {
    EXPECT_FALSE(std::regex_search(uk.phrase(text), english)) << uk.phrase(text);
  }
}

// What the sequencer and the rig write into a run; the operators' own words stay as they are.
TEST(Certificate, UkrainianForTheEventsOfARun) {
  CertificateExample example;
  example.language = Language::uk;
  example.events = {
      {0, "operator", "both axes"},
      {0, "state", "idle: waiting for the sensor and the drive"},
      {0, "identity", "drive 0000-7AB7, node 2718"},
      {47, "settle_cap",
       "pose 9 (grid) at δ = 80.0000°, h = 0.0000°: not at rest after 10 s; sampled all the same"},
      {60, "retry",
       "pose 2 (grid) at δ = 10.0000°, h = 0.0000°, attempt 1 of 3: the head has not arrived at δ "
       "= 10.0000°, h = 0.0000° within 6.6 s; it stands at δ = 8.7720°, h = 0.0000°"},
      {60, "state",
       "recovering: the head has not arrived at δ = 10.0000°, h = 0.0000° within 6.6 s; it stands "
       "at δ = 8.7720°, h = 0.0000°"},
      {70, "retry",
       "homing, attempt 1 of 3: spindle (delta) axis: tcp:127.0.0.1:502 unit 1: no reply within "
       "0.5 s: is "
       "the drive on, is the unit id right?"},
      {80, "fault", "the drive starts with an alarm (δ 66h soft limit, h no alarm); reset"},
      {90, "suspend", "temp_C = 31.2 is outside 18 to 30"},
      {95, "state", "stopping: stopped on request"}};
  const std::string html = example.html();
  for (const char* text :
       {"<td class=\"words\">оператор</td><td class=\"words\">both axes</td>",
        "очікування: очікування давача та привода", "привод 0000-7AB7, вузол 2718",
        "положення 9 (сітка) при δ = 80.0000°, h = 0.0000°: немає спокою через 10 s; відліки взято "
        "все одно",
        "положення 2 (сітка) при δ = 10.0000°, h = 0.0000°, спроба 1 з 3: головка не дійшла до δ = "
        "10.0000°, h = 0.0000° за 6.6 s; вона стоїть на δ = 8.7720°, h = 0.0000°",
        "пошук нуля, спроба 1 з 3: вісь шпинделя (δ): tcp:127.0.0.1:502, пристрій 1: немає "
        "відповіді за "
        "0.5 s: чи ввімкнено привод, чи правильний його номер?",
        "привод починає з аварійним сигналом (δ 66h програмне обмеження, h немає); скинуто",
        "temp_C = 31.2 поза межами від 18 до 30", "зупинення: зупинено на вимогу"}) {
    EXPECT_THAT(html, HasSubstr(text));
  }
  // What the event before has said is not said again.
  EXPECT_THAT(html, Not(HasSubstr("відновлення роботи")));
}

// What the core says and the catalogue repeats: whoever changes one, changes the other.
TEST(Certificate, UkrainianKnowsTheVerdictOfTheCore) {
  VerdictInput input;
  input.poses = 3;
  Diagnosis diagnosis;
  decide_verdict(input, diagnosis);
  EXPECT_THAT(Translator(Language::uk).phrase(diagnosis.reason), HasSubstr("замало"));
  input.poses = 100;
  for (auto& axis : input.axis) {
    axis = {};
    axis.responds = axis.noise_known = true;
    axis.p_value = 0.5;
  }
  decide_verdict(input, diagnosis);
  EXPECT_THAT(Translator(Language::uk).phrase(diagnosis.reason), HasSubstr("залишок такий"));
  EXPECT_THAT(Translator(Language::uk).phrase(diagnosis.reason), Not(HasSubstr("residual")));
}

// --- tables ---

TEST(TableColumns, ShareThePageAndNeverMore) {
  const Table table{.caption = "",
                    .header = {"a", "words", "n"},
                    .rows = {{"x", "one two three four five six seven eight", "1.0"}}};
  const auto monospaced = [](const std::string& text, bool) {
    return 5.0 * static_cast<double>(text.size());
  };
  for (const double total : {500.0, 200.0, 100.0, 30.0}) {
    const auto widths = column_widths(table, total, monospaced);
    EXPECT_NEAR(widths[0] + widths[1] + widths[2], total, 1e-9);
    for (const double width : widths) EXPECT_GT(width, 0);
  }
  // Where there is room for what cannot wrap, it does not.
  const auto widths = column_widths(table, 200, monospaced);
  EXPECT_GE(widths[2], 15);
  EXPECT_GE(widths[1], 25);
}

}  // namespace
}  // namespace plumbline::app
