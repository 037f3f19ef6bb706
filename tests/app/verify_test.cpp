// `plumbline verify` on certificates that the program wrote, whole and tampered with.
#include "app/verify/verify.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <nlohmann/json.hpp>

#include "app/certificate/dcc/dcc_units.h"
#include "app/certificate/dcc/dcc_writer.h"
#include "app/certificate/fingerprint.h"
#include "app/verify/dcc_reader.h"
#include "tests/app/certificate_example.h"
#include "tests/app/example_set.h"
#include "tests/app/program.h"
#include "tests/app/temp_folder.h"

namespace plumbline::app {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

/// The published schemas, where they lie beside the project; empty where they do not.
fs::path schema_folder() {
  const fs::path folder = fs::path(PLUMBLINE_SHARED_DIR) / "dcc";
  return fs::exists(folder / "v3.3.0/dcc.xsd") ? folder : fs::path{};
}

std::string xml_of(const CertificateExample& example) {
  return write_dcc(example.input(), make_certificate(example.input()),
                   {.html_sha256 = std::string(64, '1'), .pdf_pages_sha256 = std::string(64, '2')});
}

std::vector<std::string> wrong_with(const std::string& xml, bool schema_too = false) {
  const auto dcc = read_dcc(xml, "test.xml");
  if (!dcc) return {dcc.error().message};
  VerifyReport report;
  check_rules(*dcc, report);
  if (schema_too) {
    const auto done = check_schema(*dcc, schema_folder(), report);
    if (!done) return {done.error().message};
  }
  std::vector<std::string> wrong;
  for (const Check& check : report.checks) {
    if (check.state == CheckState::bad) wrong.push_back(check.text);
  }
  return wrong;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

// --- the digital certificate by itself ---

TEST(Dcc, KeepsSchemaAndRulesInEveryForm) {
  const bool schema = !schema_folder().empty();
  CertificateExample plain;
  EXPECT_THAT(wrong_with(xml_of(plain), schema), testing::IsEmpty());

  CertificateExample full;
  full.add_effects(12);
  full.make_names_long();
  full.language = Language::uk;
  full.laboratory.received = full.laboratory.performed_from = "2026-01-30";
  full.calibration.decision = {DecisionStatus::conditional_pass, 0.2, 0.19, 0.01, 0.02, "a rule"};
  EXPECT_THAT(wrong_with(xml_of(full), schema), testing::IsEmpty());

  CertificateExample hostile;
  hostile.description.dut.serial = "a<b>&\"'\x01 \t ]]> \xff x";
  hostile.provenance.dut = hostile.description.dut;
  EXPECT_THAT(wrong_with(xml_of(hostile), schema), testing::IsEmpty());
  if (!schema) GTEST_SKIP() << "the published DCC schemas are not beside the project";
}

TEST(Dcc, SchemaRefusesWhatItShould) {
  if (schema_folder().empty())
    GTEST_SKIP() << "the published DCC schemas are not beside the project";
  const std::string xml = xml_of(CertificateExample());
  EXPECT_THAT(wrong_with(replaced(replaced(xml, "<dcc:customer>", "<dcc:client>"),
                                  "</dcc:customer>", "</dcc:client>"),
                         true),
              Not(testing::IsEmpty()));
}

TEST(Dcc, RulesFindWhatTheSchemaDoesNot) {
  const std::string xml = xml_of(CertificateExample());
  const std::pair<std::string, std::string> changes[] = {
      {"<si:labelXMLList>K_xx K_xy K_xz<", "<si:labelXMLList>K_xx K_xy<"},
      {"<si:unitXMLList>\\volt<", "<si:unitXMLList>\\vault<"},
      {"<dcc:mandatoryLang",
       "<dcc:usedLangCodeISO639_1>en</dcc:usedLangCodeISO639_1><dcc:mandatoryLang"},
      {"lang=\"en\"", "lang=\"fr\""},
      {"<si:coverageFactorXMLList>2<", "<si:coverageFactorXMLList>2 2<"}};
  for (const auto& [from, to] : changes) {
    EXPECT_THAT(wrong_with(replaced(xml, from, to)), testing::SizeIs(1)) << to;
  }
  std::string without = xml;
  const std::size_t from = without.rfind("<dcc:usedMethods>");
  const std::size_t to = without.rfind("</dcc:usedMethods>");
  without.erase(from, to - from + std::string("</dcc:usedMethods>").size());
  EXPECT_THAT(wrong_with(without), testing::ElementsAre(HasSubstr("usedMethods")));
}

TEST(Dcc, UnitsOfTheDsi) {
  for (const char* good : {"\\volt", "\\metre\\second\\tothe{-2}", "\\milli\\volt", "\\one",
                           "\\volt\\second\\tothe{-0.5}"}) {
    EXPECT_TRUE(is_dsi_unit(good)) << good;
  }
  for (const char* bad : {"", "V", "\\volt ", "\\volt \\metre", "\\gn", "\\tothe{2}", "\\milli",
                          "\\volt\\tothe{x}", "\\volt{2}"}) {
    EXPECT_FALSE(is_dsi_unit(bad)) << bad;
  }
  EXPECT_DOUBLE_EQ(dsi_unit("g/g^2")->factor, 1 / 9.80665);
  EXPECT_FALSE(dsi_unit("1/pct"));
}

TEST(Dcc, SaysWhatWasNotStated) {
  const std::string xml = xml_of(CertificateExample());
  EXPECT_THAT(xml, HasSubstr("<dcc:countryCodeISO3166_1>ZZ<"));
  EXPECT_THAT(xml,
              HasSubstr("The country of the laboratory was not stated; ZZ stands in its place."));
  EXPECT_THAT(xml, HasSubstr("The dates of performance were not stated"));
}

TEST(Dcc, OwnHashCoversEverything) {
  const std::string xml = xml_of(CertificateExample());
  const auto dcc = read_dcc(xml, "test.xml");
  ASSERT_TRUE(dcc);
  EXPECT_EQ(dcc->hash(dcc_ref::kSelf), dcc_self_hash(xml));
  EXPECT_NE(dcc_self_hash(replaced(xml, "0.032", "0.033")), dcc->hash(dcc_ref::kSelf));
}

TEST(Dcc, ExternalEntitiesAreNotRead) {
  const std::string xml =
      "<!DOCTYPE x [<!ENTITY secret SYSTEM \"file:///etc/hostname\">]>\n"
      "<dcc:digitalCalibrationCertificate xmlns:dcc=\"https://ptb.de/dcc\">"
      "<dcc:uniqueIdentifier>&secret;</dcc:uniqueIdentifier></dcc:digitalCalibrationCertificate>";
  const auto dcc = read_dcc(xml, "evil.xml");
  EXPECT_TRUE(!dcc || dcc->id.empty());
}

TEST(Fingerprint, HtmlHasTheWordsOfTheDocument) {
  CertificateExample example;
  example.add_effects(12);
  for (const Language language : {Language::en, Language::uk}) {
    example.language = language;
    const Document document = make_certificate(example.input());
    const auto words = html_words(write_html(document), "a.html");
    ASSERT_TRUE(words) << words.error().message;
    EXPECT_EQ(*words, words_of(document));
    EXPECT_EQ(fingerprint(*words), document.fingerprint);
    EXPECT_THAT(document.words.fingerprint, HasSubstr(document.fingerprint));
  }
}

// --- the program ---

class Verify : public testing::Test {
 protected:
  void SetUp() override {
    ExampleSet set;
    set.write(folder_.path());
    write_text(folder_ / "lab.toml", "[laboratory]\nname = \"Lab 7\"\ncountry = \"UA\"\n");
    ::setenv("SOURCE_DATE_EPOCH", "1769862896", 1);  // 2026-01-31T12:34:56Z
    calibrate("out", {});
  }
  void TearDown() override { ::unsetenv("SOURCE_DATE_EPOCH"); }

  void calibrate(const std::string& out, std::vector<std::string> more) {
    std::vector<std::string> arguments = {"calibrate",
                                          "--samples",
                                          folder_ / "samples.csv",
                                          "--static",
                                          folder_ / "static.csv",
                                          "--config",
                                          folder_ / "run.toml",
                                          "--lab",
                                          folder_ / "lab.toml",
                                          "--out",
                                          folder_ / out};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto outcome = run_plumbline(arguments);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }
  ProgramOutcome verify(const fs::path& target) {
    std::vector<std::string> arguments = {"verify", target};
    if (!schema_folder().empty()) {
      arguments.insert(arguments.end(), {"--schema", schema_folder()});
    }
    return run_plumbline(arguments);
  }
  std::string read(const std::string& name) { return text_of(folder_ / ("out/" + name)); }
  void change(const std::string& name, const std::string& from, const std::string& to) {
    write_text(folder_ / ("out/" + name), replaced(read(name), from, to));
  }

  TempFolder folder_;
};

TEST_F(Verify, WhatTheProgramWroteHolds) {
  for (const char* target : {"out", "out/certificate.xml", "out/certificate.pdf"}) {
    const auto outcome = verify(folder_ / target);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
    EXPECT_THAT(outcome.out, Not(HasSubstr("FAILED")));
    EXPECT_THAT(outcome.out, HasSubstr("unchanged and consistent"));
  }
  EXPECT_THAT(read("certificate.html"), HasSubstr("Lab 7, UA"));
  EXPECT_THAT(read("certificate.html"), HasSubstr("2026-01-31T12:34:56Z"));
}

TEST_F(Verify, SameInputGivesTheSameFiles) {
  calibrate("again", {});
  for (const char* name :
       {"certificate.html", "certificate.xml", "certificate.pdf", "result.json"}) {
    EXPECT_EQ(read(name), text_of(folder_ / ("again/" + std::string(name)))) << name;
  }
}

TEST_F(Verify, XmlHasTheNumbersOfResultJson) {
  const auto json = nlohmann::json::parse(read("result.json"));
  const auto dcc = read_dcc(read("certificate.xml"), "certificate.xml");
  ASSERT_TRUE(dcc);
  for (const char* axis : kAxisName) {
    const auto& row = json["final"]["batch_ls"][axis];
    const XmlList* native = dcc->list("K_" + std::string(axis) + "x", dsi::kVoltPerG);
    const XmlList* si = dcc->list("K_" + std::string(axis) + "x", dsi::kSensitivity);
    ASSERT_TRUE(native != nullptr && si != nullptr);
    EXPECT_EQ(native->values, row["K_V_per_g"].get<std::vector<double>>());
    for (std::size_t j = 0; j < 3; ++j) {
      EXPECT_DOUBLE_EQ(native->expanded[j], 2 * row["u_K_V_per_g"][j].get<double>());
      EXPECT_DOUBLE_EQ(si->values[j], native->values[j] / kStandardGravity_mps2);
    }
  }
}

TEST_F(Verify, EveryChangeIsNoticed) {
  fs::copy(folder_ / "out", folder_ / "whole");
  const auto refused = [&](const std::string& what) {
    const auto outcome = verify(folder_ / "out");
    EXPECT_EQ(outcome.exit_code, 1) << what << "\n" << outcome.out << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("FAILED")) << what;
    fs::copy(folder_ / "whole", folder_ / "out", fs::copy_options::overwrite_existing);
  };
  change("certificate.html", "Lab 7", "Lab 8");
  refused("a word of the HTML");
  change("result.json", "\"poses\": 60", "\"poses\": 61");
  refused("a number of result.json");
  change("certificate.xml", "Lab 7", "Lab 8");
  refused("a word of the XML");
  calibrate("other", {"--language", "uk"});
  fs::copy_file(folder_ / "other/certificate.pdf", folder_ / "out/certificate.pdf",
                fs::copy_options::overwrite_existing);
  refused("another PDF");
}

TEST_F(Verify, ForgedHashesDoNotMakeNumbersAgree) {
  // Somebody who changes a value in the XML and puts the XML's own hash right.
  const auto json = nlohmann::json::parse(read("result.json"));
  std::string xml = read("certificate.xml");
  const std::string from = json["final"]["batch_ls"]["x"]["U0_V"].dump();
  xml = replaced(xml, from, "-2.5");
  const auto dcc = read_dcc(xml, "forged.xml");
  ASSERT_TRUE(dcc);
  xml = replaced(xml, dcc->hash(dcc_ref::kSelf), dcc_self_hash(xml));
  write_text(folder_ / "out/certificate.xml", xml);
  const auto outcome = verify(folder_ / "out");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out, HasSubstr("ok     certificate.xml: the hash is that"));
  EXPECT_THAT(outcome.out, HasSubstr("FAILED XML and result.json agree in U_x0, U_y0, U_z0"));
}

TEST_F(Verify, WhatCannotBeReadIsOneLineAndCode2) {
  write_text(folder_ / "text.xml", "no xml");
  write_text(folder_ / "other.xml", "<a/>");
  for (const char* target : {"absent", "text.xml", "other.xml", "samples.csv"}) {
    const auto outcome = verify(folder_ / target);
    EXPECT_EQ(outcome.exit_code, 2) << target;
    EXPECT_EQ(outcome.error_lines(), 1) << outcome.err;
  }
  const auto outcome =
      run_plumbline({"verify", folder_ / "out", "--schema", folder_ / "no-schema"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("there is no such schema"));
}

}  // namespace
}  // namespace plumbline::app
