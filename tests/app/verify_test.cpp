// `plumbline verify` on certificates that the program wrote, whole and tampered with.
#include "app/verify/verify.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>
#include <nlohmann/json.hpp>

#include "app/certificate/dcc/dcc_units.h"
#include "app/certificate/dcc/dcc_writer.h"
#include "app/certificate/dcc/signature.h"
#include "app/certificate/fingerprint.h"
#include "app/io/result_json.h"
#include "app/verify/dcc_reader.h"
#include "tests/app/certificate_example.h"
#include "tests/app/dcc_numbers.h"
#include "tests/app/example_set.h"
#include "tests/app/program.h"
#include "tests/app/signing_identity.h"
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

TEST(Dcc, HasTheNumbersOfResultJsonHoweverManyThereAre) {
  CertificateExample full;
  full.add_effects(12);
  full.make_names_long();
  full.add_not_found();
  full.calibration.decision = {DecisionStatus::conditional_pass, 0.2, 0.19, 0.01, 0.02, "a rule"};
  CertificateInput input = full.input();
  input.verification = nullptr;  // of evaluation.json
  expect_numbers_of_result(write_dcc(input, make_certificate(input), {}),
                           result_json(full.calibration, full.provenance).dump());
}

TEST(Dcc, KeepsSchemaAndRulesInEveryForm) {
  const bool schema = !schema_folder().empty();
  CertificateExample plain;
  EXPECT_THAT(wrong_with(xml_of(plain), schema), testing::IsEmpty());

  CertificateExample full;
  full.add_effects(12);
  full.make_names_long();
  full.add_not_found();
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

// --- the signature ---

class Signature : public testing::Test {
 protected:
  Result<SigningKey> read(const Identity& key, const Identity& certificate,
                          const std::string& passphrase = "") {
    write_text(folder_ / "key.pem", key.key_pem(passphrase.empty() ? nullptr : passphrase.c_str()));
    write_text(folder_ / "crt.pem", certificate.certificate_pem());
    return read_signing_key(folder_ / "key.pem", folder_ / "crt.pem", passphrase);
  }
  std::string signed_by(const Identity& who) {
    const auto key = read(who, who);
    EXPECT_TRUE(key) << key.error().message;
    CertificateExample example;
    CertificateInput input = example.input();
    input.signing = &*key;
    const auto xml = sign_dcc(write_dcc(input, make_certificate(input), {}), *key);
    EXPECT_TRUE(xml) << xml.error().message;
    return *xml;
  }
  static SignatureFound found(const std::string& xml, const std::string& trusted = "") {
    const auto result = check_signature(xml, trusted);
    EXPECT_TRUE(result) << result.error().message;
    return result.value_or(SignatureFound{});
  }

  TempFolder folder_;
  const Identity lab_{"Лабораторія 7"};
};

TEST_F(Signature, HoldsForTheDocumentItIsOn) {
  const std::string xml = signed_by(lab_);
  const SignatureFound signature = found(xml);
  EXPECT_TRUE(signature.present);
  EXPECT_EQ(signature.wrong, "");
  EXPECT_EQ(signature.subject, "CN=Лабораторія 7");
  EXPECT_FALSE(signature.trusted.has_value());
  // All else is as if it had not been signed.
  EXPECT_THAT(wrong_with(xml, !schema_folder().empty()), testing::IsEmpty());
  const auto dcc = read_dcc(xml, "signed.xml");
  ASSERT_TRUE(dcc);
  EXPECT_EQ(dcc->hash(dcc_ref::kSelf), dcc_self_hash(xml));
  EXPECT_EQ(dcc->hash(dcc_ref::kSigner), signature.certificate_sha256);
  EXPECT_FALSE(found(without_signature(xml)).present);
}

TEST_F(Signature, RsaGivesTheSameBytes) {
  const Identity rsa("Lab 8", nullptr, EVP_RSA_gen(2048));
  const std::string xml = signed_by(rsa);
  EXPECT_EQ(xml, signed_by(rsa));
  EXPECT_EQ(found(xml).wrong, "");
}

TEST_F(Signature, AnyChangeBreaksIt) {
  const std::string xml = signed_by(lab_);
  EXPECT_NE(found(replaced(xml, "0.032", "0.033")).wrong, "");
  EXPECT_NE(found(replaced(xml, "</dcc:administrativeData>", " </dcc:administrativeData>")).wrong,
            "");
  // Another's certificate in the place of the signer's.
  const std::string other = signed_by(Identity("Somebody"));
  const auto part = [](const std::string& text, const char* name) {
    const std::size_t begin = text.find(std::string("<ds:") + name);
    const std::string end = std::string("</ds:") + name + ">";
    return text.substr(begin, text.find(end) + end.size() - begin);
  };
  EXPECT_NE(found(replaced(xml, part(xml, "KeyInfo"), part(other, "KeyInfo"))).wrong, "");
  // Two of them, or one that covers a part or something else only.
  const std::string whole =
      xml.substr(without_signature(xml).rfind("</"), xml.size() - without_signature(xml).size());
  EXPECT_THAT(found(replaced(xml, whole, whole + whole)).wrong, HasSubstr("several"));
  EXPECT_THAT(found(replaced(xml, "URI=\"\"", "URI=\"#a\"")).wrong, HasSubstr("part"));
  EXPECT_THAT(found(replaced(xml, part(xml, "Transforms"), "")).wrong, HasSubstr("not the doc"));
  EXPECT_THAT(found(replaced(replaced(xml, whole, ""), "</dcc:statements>",
                             "</dcc:statements><x>" + whole + "</x>"))
                  .wrong,
              HasSubstr("not the document's own"));
}

TEST_F(Signature, IsKnownOrNot) {
  const Identity authority("Authority");
  const Identity issued("Lab 9", &authority);
  const std::string xml = signed_by(issued);
  EXPECT_EQ(found(xml, issued.certificate_pem()).trusted, true);
  EXPECT_EQ(found(xml, lab_.certificate_pem() + authority.certificate_pem()).trusted, true);
  EXPECT_EQ(found(xml, lab_.certificate_pem()).trusted, false);
  EXPECT_EQ(found(xml, Identity("Authority").certificate_pem()).trusted, false) << "same name";
  EXPECT_FALSE(check_signature(xml, "no certificate"));
}

TEST_F(Signature, UnusableKeysAreRefusedBeforehand) {
  EXPECT_TRUE(read(lab_, lab_, "secret"));
  EXPECT_THAT(read_signing_key(folder_ / "key.pem", folder_ / "crt.pem", "guess").error().message,
              HasSubstr("PLUMBLINE_KEY_PASSPHRASE"));
  EXPECT_THAT(read(Identity("Other"), lab_).error().message, HasSubstr("another key"));
  EXPECT_THAT(read(Identity("Short", nullptr, EVP_RSA_gen(1024)), lab_).error().message,
              HasSubstr("2048"));
  Identity old("Old");
  old.expire();
  EXPECT_THAT(read(old, old).error().message, HasSubstr("expired"));
  EXPECT_FALSE(read_signing_key(folder_ / "absent", folder_ / "crt.pem", ""));
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
  expect_numbers_of_result(read("certificate.xml"), read("result.json"));
}

// With an effect that was added, others that were not found, and a decision.
TEST_F(Verify, XmlHasTheNumbersOfResultJsonWithEffectsAndDecision) {
  ExampleSet set;
  set.quadratic_g_per_g2 = 0.05;
  set.write(folder_.path());
  write_text(folder_ / "run.toml", example_run_toml() + "[limits]\nmax_abs_error_mps2 = 0.5\n");
  for (const char* language : {"en", "uk"}) {
    calibrate(language, {"--language", language});
    const fs::path out = folder_ / language;
    const std::string result = text_of(out / "result.json");
    EXPECT_THAT(result, HasSubstr("\"id\": \"sensor.quadratic\""));
    EXPECT_THAT(result, HasSubstr("\"status\": \"pass\""));
    expect_numbers_of_result(text_of(out / "certificate.xml"), result);
    EXPECT_EQ(verify(out).exit_code, 0);
  }
}

TEST_F(Verify, SignedByTheLaboratory) {
  const Identity lab("Lab 7"), stranger("Stranger");
  write_text(folder_ / "lab.key", lab.key_pem());
  write_text(folder_ / "lab.crt", lab.certificate_pem());
  write_text(folder_ / "stranger.crt", stranger.certificate_pem());
  write_text(folder_ / "lab.toml", "[signature]\nkey = \"lab.key\"\ncertificate = \"lab.crt\"\n");
  const auto known = [&](const char* target, const char* signer) {
    return run_plumbline({"verify", folder_ / target, "--signer", folder_ / signer});
  };
  EXPECT_EQ(known("out", "lab.crt").exit_code, 1) << "it is not signed";
  calibrate("signed", {});
  const auto good = known("signed", "lab.crt");
  EXPECT_EQ(good.exit_code, 0) << good.out << good.err;
  EXPECT_THAT(good.out, HasSubstr("ok     signature of the whole XML by CN=Lab 7"));
  EXPECT_EQ(known("signed/certificate.pdf", "lab.crt").exit_code, 0);
  EXPECT_EQ(known("signed", "stranger.crt").exit_code, 1);
  EXPECT_EQ(known("signed", "lab.key").exit_code, 2);
  EXPECT_THAT(text_of(folder_ / "signed/certificate.html"), HasSubstr("with the key of CN=Lab 7"));
  // Taking the signature off is noticed: the certificate says that it has one.
  write_text(folder_ / "signed/certificate.xml",
             without_signature(text_of(folder_ / "signed/certificate.xml")));
  const auto bare = verify(folder_ / "signed/certificate.xml");
  EXPECT_EQ(bare.exit_code, 1);
  EXPECT_THAT(bare.out, HasSubstr("FAILED signature: there is none"));
  write_text(folder_ / "lab.crt", stranger.certificate_pem());
  const auto refused = run_plumbline({"calibrate", "--samples", folder_ / "samples.csv", "--config",
                                      folder_ / "run.toml", "--lab", folder_ / "lab.toml", "--out",
                                      folder_ / "none"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_EQ(refused.error_lines(), 1) << refused.err;
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
  // Somebody who changes what the XML says and puts the XML's own hash right.
  ExampleSet set;
  set.quadratic_g_per_g2 = 0.05;
  set.write(folder_.path());
  write_text(folder_ / "run.toml", example_run_toml() + "[limits]\nmax_abs_error_mps2 = 0.5\n");
  calibrate("out", {});
  const std::string whole = read("certificate.xml");
  const auto json = nlohmann::json::parse(read("result.json"));
  const auto is_noticed = [&](const std::string& from, const std::string& to,
                              const std::string& in_what) {
    std::string xml = replaced(whole, from, to);
    const auto dcc = read_dcc(xml, "forged.xml");
    ASSERT_TRUE(dcc);
    xml = replaced(xml, dcc->hash(dcc_ref::kSelf), dcc_self_hash(xml));
    write_text(folder_ / "out/certificate.xml", xml);
    const auto outcome = verify(folder_ / "out");
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_THAT(outcome.out, HasSubstr("ok     certificate.xml: the hash is that"));
    EXPECT_THAT(outcome.out, HasSubstr("FAILED XML and result.json agree in " + in_what));
  };
  is_noticed(json["final"]["batch_ls"]["x"]["U0_V"].dump(), "-2.5", "U_x0, U_y0, U_z0");
  is_noticed(json["error"]["after"]["heldout_pose_rms"][1].dump(), "0.001", "heldoutRmsAfter");
  is_noticed(">pass<", ">fail<", "the decision");
  const std::string k2 = "<si:label>k2</si:label>";
  const std::size_t at = whole.find("<si:value>", whole.find(k2));
  is_noticed(whole.substr(at, whole.find('/', at) - at - 1), "<si:value>0.001",
             "the added effects");
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
