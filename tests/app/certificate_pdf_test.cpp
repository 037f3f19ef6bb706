// certificate.pdf as others see it: through poppler's tools and as a picture.
#include <cairo.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <regex>
#include <sstream>

#include "app/certificate/fingerprint.h"
#include "app/certificate/pdf_file.h"
#include "app/certificate/pdf_writer.h"
#include "tests/app/certificate_example.h"
#include "tests/app/temp_folder.h"

namespace plumbline::app {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kCreated = "2026-01-31T12:34:56Z";

std::string pdf_of(const Document& document) {
  const auto typeface = Typeface::load();
  EXPECT_TRUE(typeface) << typeface.error().message;
  const auto pdf = write_pdf(document, *typeface, {.created_utc = kCreated, .producer = "test"});
  EXPECT_TRUE(pdf) << pdf.error().message;
  return *pdf;
}

/// What a command prints; its failure is the test's.
std::string output_of(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::string text;
  char block[4096];
  for (std::size_t n = 0; (n = std::fread(block, 1, sizeof block, pipe.get())) > 0;) {
    text.append(block, n);
  }
  EXPECT_FALSE(text.empty()) << command << " printed nothing; is it installed (scripts/setup)?";
  return text;
}

/// The pages as poppler reads them, in the order in which they were drawn.
std::vector<std::string> page_texts(const fs::path& pdf) {
  std::istringstream text(output_of("pdftotext -raw -enc UTF-8 '" + pdf.string() + "' -"));
  std::vector<std::string> pages;
  for (std::string page; std::getline(text, page, '\f');) pages.push_back(page);
  return pages;
}

/// Takes the foot away and returns its words.
std::string strip_foot(std::string& page, const std::string& id) {
  const std::size_t foot = page.rfind(id);
  if (foot == std::string::npos) return {};
  std::string text = page.substr(foot);
  page.erase(foot);
  return text;
}

std::vector<std::string> words(const std::string& text) {
  std::vector<std::string> list;
  append_words(text, list);
  return list;
}

std::map<std::string, int> counted(const std::vector<std::string>& list) {
  std::map<std::string, int> count;
  for (const std::string& word : list) ++count[word];
  return count;
}

/// Words that the HTML shows: text outside head and the descriptions of pictures.
std::vector<std::string> html_shown(std::string html) {
  html = std::regex_replace(html, std::regex("<head>[^]*?</head>"), " ");
  html = std::regex_replace(html, std::regex("<title>[^<]*</title>"), " ");
  html = std::regex_replace(html, std::regex("<[^>]*>"), " ");
  for (const auto& [entity, character] :
       {std::pair("&lt;", "<"), std::pair("&gt;", ">"), std::pair("&quot;", "\""),
        std::pair("&#39;", "'"), std::pair("&amp;", "&")}) {
    html = std::regex_replace(html, std::regex(entity), character);
  }
  return words(html);
}

class CertificatePdf : public testing::Test {
 protected:
  fs::path write(const std::string& name, const std::string& pdf) {
    fs::create_directories(folder_);
    write_text(folder_ / name, pdf);
    return folder_ / name;
  }
  /// They stay, for whoever wants to look at them.
  const fs::path folder_ = fs::path(PLUMBLINE_BINARY_DIR) / "certificate-pdf";
};

void expect_same_words(const Document& document, const fs::path& pdf) {
  std::vector<std::string> shown;
  auto pages = page_texts(pdf);
  for (std::string& page : pages) {
    strip_foot(page, document.id);
    // A line may end inside a word that has a hyphen of its own.
    page = std::regex_replace(page, std::regex("-\n"), "-");
    for (std::string& word : words(page)) shown.push_back(std::move(word));
  }
  const auto in_pdf = counted(shown);
  const auto in_html = counted(html_shown(write_html(document)));
  // A table that goes on over the page repeats its heading in the PDF only.
  std::map<std::string, int> headings;
  for (const Block& block : document.blocks) {
    if (const auto* table = std::get_if<Table>(&block)) {
      for (const std::string& cell : table->header) {
        for (const std::string& word : words(cell)) ++headings[word];
      }
    }
  }
  for (const auto& [word, count] : in_html) {
    const auto it = in_pdf.find(word);
    const int found = it == in_pdf.end() ? 0 : it->second;
    EXPECT_GE(found, count) << "missing in the PDF: " << word;
    EXPECT_TRUE(found == count || headings.count(word) > 0) << word;
  }
  for (const auto& [word, count] : in_pdf) {
    EXPECT_EQ(in_html.count(word), 1U) << "only in the PDF: " << word;
  }
}

TEST_F(CertificatePdf, SaysWordForWordWhatTheHtmlSays) {
  const auto expect = [&](const std::string& name, const Document& document) {
    SCOPED_TRACE(name);
    expect_same_words(document, write(name, pdf_of(document)));
  };
  for (const Language language : {Language::en, Language::uk}) {
    const std::string end = std::string("-") + code_of(language) + ".pdf";
    CertificateExample example;
    example.language = language;
    expect("words" + end, make_certificate(example.input()));
    example.add_effects(3);
    example.add_not_found();
    expect("words-effects" + end, make_certificate(example.input()));

    CertificateExample unfinished;
    unfinished.language = language;
    unfinished.calibration.decision = {DecisionStatus::pass, 0.2, 0.1, 0.01, 0.02, ""};
    unfinished.events = {
        {0, "operator", "Олена O'Neil"},
        {60, "retry",
         "pose 2 (grid) at δ = 10.0000°, h = 0.0000°, attempt 1 of 3: the head has not arrived at "
         "δ "
         "= 10.0000°, h = 0.0000° within 6.6 s; it stands at δ = 8.7720°, h = 0.0000°"},
        {80, "state", "stopping: stopped on request"},
        {80, kIncomplete, "the run is not finished: stopped after 42 poses"}};
    expect("words-unfinished" + end, make_certificate(unfinished.input()));

    ScalarExample scalar;
    scalar.common.language = language;
    expect("words-scalar" + end, scalar.document());
    scalar.add_findings();
    expect("words-scalar-effects" + end, scalar.document());
  }
}

// What a reader sees first of a run that was stopped, in the PDF as in the other two.
TEST_F(CertificatePdf, UnfinishedRunIsNotHeadedPass) {
  CertificateExample example;
  example.calibration.decision = {DecisionStatus::pass, 0.2, 0.1, 0.01, 0.02, ""};
  EXPECT_THAT(page_texts(write("pass.pdf", pdf_of(make_certificate(example.input())))).front(),
              HasSubstr("\nPASS\n"));
  example.events = {{0, "incomplete", "the run is not finished: aborted after 17 poses"}};
  const auto path = write("not-pass.pdf", pdf_of(make_certificate(example.input())));
  EXPECT_THAT(page_texts(path).front(), HasSubstr("\nRun not finished\n"));
  for (const std::string& page : page_texts(path)) EXPECT_THAT(page, Not(HasSubstr("PASS")));
}

TEST_F(CertificatePdf, EveryPageCarriesNumberAndPageCount) {
  const Document document = make_certificate(CertificateExample().input());
  auto pages = page_texts(write("feet.pdf", pdf_of(document)));
  ASSERT_GT(pages.size(), 3U);
  for (std::size_t k = 0; k < pages.size(); ++k) {
    const std::string foot = strip_foot(pages[k], document.id);
    EXPECT_THAT(foot, HasSubstr(fmt::format("page {} of {}", k + 1, pages.size())));
  }
}

TEST_F(CertificatePdf, SameInputSameBytesWithTheDateOfTheDocument) {
  const Document document = make_certificate(CertificateExample().input());
  const std::string pdf = pdf_of(document);
  EXPECT_EQ(pdf, pdf_of(make_certificate(CertificateExample().input())));
  const std::string info = output_of("TZ=UTC pdfinfo '" + write("info.pdf", pdf).string() + "'");
  EXPECT_THAT(info, HasSubstr("CreationDate:    Sat Jan 31 12:34:56 2026 UTC"));
  EXPECT_THAT(info, HasSubstr("Title:           " + document.title + " " + document.id));
}

TEST_F(CertificatePdf, FontsAreEmbedded) {
  const auto pdf = write("fonts.pdf", pdf_of(make_certificate(CertificateExample().input())));
  std::istringstream lines(output_of("pdffonts '" + pdf.string() + "' | tail -n +3"));
  int fonts = 0;
  for (std::string line; std::getline(lines, line); ++fonts) {
    EXPECT_TRUE(std::regex_search(line, std::regex("(Liberation|DejaVu)Sans"))) << line;
    EXPECT_TRUE(std::regex_search(line, std::regex(" yes yes yes "))) << line;
  }
  EXPECT_GE(fonts, 2);
}

TEST_F(CertificatePdf, RefusesToGoOnWithoutFonts) {
  const auto typeface = Typeface::load((folder_ / "no-fonts").string());
  ASSERT_FALSE(typeface);
  EXPECT_EQ(typeface.error().code, ErrorCode::output);
  EXPECT_THAT(typeface.error().message, HasSubstr("fonts-liberation2"));
}

// --- nothing sticks out, nothing lies on something else ---

struct Word {
  double left, top, right, bottom;
  std::string text;
  double area() const { return (right - left) * (bottom - top); }
};

std::vector<std::vector<Word>> word_boxes(const fs::path& pdf) {
  const std::string boxes = output_of("pdftotext -bbox '" + pdf.string() + "' -");
  static const std::regex kItem(
      "<page |<word xMin=\"([-0-9.]+)\" yMin=\"([-0-9.]+)\" xMax=\"([-0-9.]+)\" "
      "yMax=\"([-0-9.]+)\">([^<]*)<");
  std::vector<std::vector<Word>> pages;
  for (std::sregex_iterator it(boxes.begin(), boxes.end(), kItem), end; it != end; ++it) {
    if (it->str().starts_with("<page")) {
      pages.emplace_back();
    } else {
      pages.back().push_back({std::stod((*it)[1]), std::stod((*it)[2]), std::stod((*it)[3]),
                              std::stod((*it)[4]), (*it)[5]});
    }
  }
  return pages;
}

void expect_tidy(const fs::path& pdf) {
  constexpr double kFoot = 785, kLeastFilled = 540;  // pt from the top
  const auto pages = word_boxes(pdf);
  ASSERT_FALSE(pages.empty());
  for (std::size_t p = 0; p < pages.size(); ++p) {
    double lowest = 0;
    for (const Word& word : pages[p]) {
      if (word.bottom < kFoot) lowest = std::max(lowest, word.bottom);
    }
    EXPECT_TRUE(p + 1 == pages.size() || lowest > kLeastFilled)
        << "page " << p + 1 << " of " << pages.size() << " is filled to " << lowest << " pt only";
    for (std::size_t i = 0; i < pages[p].size(); ++i) {
      const Word& a = pages[p][i];
      EXPECT_TRUE(a.left >= 44 && a.right <= 595.3 - 44 && a.top >= 40 && a.bottom <= 841.9 - 14)
          << "page " << p + 1 << ": " << a.text << " at " << a.left << " … " << a.right;
      for (std::size_t j = i + 1; j < pages[p].size(); ++j) {
        const Word& b = pages[p][j];
        const double width = std::min(a.right, b.right) - std::max(a.left, b.left);
        const double height = std::min(a.bottom, b.bottom) - std::max(a.top, b.top);
        if (width <= 0 || height <= 0) continue;
        EXPECT_LT(width * height, 0.3 * std::min(a.area(), b.area()))
            << "page " << p + 1 << ": " << a.text << " lies on " << b.text;
      }
    }
  }
}

TEST_F(CertificatePdf, NothingOverflowsOrOverlaps) {
  CertificateExample plain;
  expect_tidy(write("plain.pdf", pdf_of(make_certificate(plain.input()))));

  CertificateExample crowded;
  crowded.add_effects(12);
  crowded.make_names_long();
  crowded.add_not_found();
  expect_tidy(write("crowded.pdf", pdf_of(make_certificate(crowded.input()))));
  crowded.language = Language::uk;
  expect_tidy(write("crowded-uk.pdf", pdf_of(make_certificate(crowded.input()))));

  CertificateExample aborted;
  aborted.calibration.poses = 17;
  aborted.calibration.pose_results.resize(17);
  aborted.calibration.skipped_rows = 40;
  aborted.calibration.diagnosis.verdict = Verdict::undetermined;
  aborted.calibration.diagnosis.reason = "17 poses are too few";
  for (auto& noise : aborted.calibration.noise) noise = {};
  aborted.calibration.decision = {DecisionStatus::pass, 0.2, 0.1, 0.01, 0.02, ""};
  aborted.events = {{0, "incomplete", "the run is not finished: aborted after 17 poses"}};
  expect_tidy(write("aborted.pdf", pdf_of(make_certificate(aborted.input()))));

  ScalarExample scalar;
  expect_tidy(write("scalar.pdf", pdf_of(scalar.document())));
  scalar.add_findings();
  scalar.common.make_names_long();
  expect_tidy(write("scalar-crowded.pdf", pdf_of(scalar.document())));
}

// --- attachments ---

TEST(PdfFile, AttachmentComesBackAndPagesKeepTheirHash) {
  const std::string pages = pdf_of(make_certificate(CertificateExample().input()));
  const Attachment xml{"certificate.xml", "text/xml", "the same in XML", "<a>ü</a>\n"};
  const auto first = attach(pages, {xml}, kCreated);
  const auto second = attach(pages, {xml}, kCreated);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(*first, *second);
  const auto plain = open_pdf(pages, "a.pdf");
  const auto opened = open_pdf(*first, "b.pdf");
  ASSERT_TRUE(plain && opened);
  EXPECT_EQ(opened->pages_sha256, plain->pages_sha256);
  ASSERT_EQ(opened->attachments.size(), 1U);
  EXPECT_EQ(opened->attachments[0].name, xml.name);
  EXPECT_EQ(opened->attachments[0].content, xml.content);
}

TEST(PdfFile, OtherPagesHaveAnotherHash) {
  CertificateExample example;
  const auto before = open_pdf(pdf_of(make_certificate(example.input())), "a.pdf");
  example.calibration.pose_results[7].residual_after_mps2[1] += 0.01;  // a picture, no word
  const auto after = open_pdf(pdf_of(make_certificate(example.input())), "b.pdf");
  ASSERT_TRUE(before && after);
  EXPECT_NE(before->pages_sha256, after->pages_sha256);
}

TEST(PdfFile, DamageIsOneLine) {
  std::string pdf = pdf_of(make_certificate(CertificateExample().input()));
  pdf.resize(pdf.size() / 2);
  const auto opened = open_pdf(pdf, "half.pdf");
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, ErrorCode::input);
  EXPECT_THAT(opened.error().message, HasSubstr("half.pdf"));
  EXPECT_FALSE(open_pdf("no pdf", "text.pdf"));
}

// --- approved pictures ---

struct Picture {
  int width = 0, height = 0;
  std::vector<unsigned char> gray;
};

Picture read_png(const fs::path& path) {
  const std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> surface(
      cairo_image_surface_create_from_png(path.c_str()), cairo_surface_destroy);
  Picture picture{cairo_image_surface_get_width(surface.get()),
                  cairo_image_surface_get_height(surface.get()),
                  {}};
  const unsigned char* data = cairo_image_surface_get_data(surface.get());
  const int stride = cairo_image_surface_get_stride(surface.get());
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) picture.gray.push_back(data[y * stride + 4 * x + 1]);
  }
  return picture;
}

// Approve again with PLUMBLINE_APPROVE=1 after looking at build/…/certificate-pages.
TEST_F(CertificatePdf, PagesLookAsApproved) {
  CertificateExample example;
  example.add_effects(2);
  ScalarExample scalar;
  scalar.add_findings();
  const fs::path seen = fs::path(PLUMBLINE_BINARY_DIR) / "certificate-pages";
  fs::remove_all(seen);
  fs::create_directories(seen);
  for (const auto& [name, document] : {std::pair("page", make_certificate(example.input())),
                                       std::pair("scalar", scalar.document())}) {
    const auto pdf = write(fmt::format("approved-{}.pdf", name), pdf_of(document));
    // Gray and coarse: what is compared is where things are and how dark.
    std::system(
        fmt::format("pdftoppm -r 30 -gray -png '{}' '{}'", pdf.string(), (seen / name).string())
            .c_str());
  }
  const fs::path approved = fs::path(PLUMBLINE_SOURCE_DIR) / "tests/golden/certificate-pages";
  if (std::getenv("PLUMBLINE_APPROVE") != nullptr) {
    fs::remove_all(approved);
    fs::create_directories(approved);
    fs::copy(seen, approved);
  }
  std::size_t pages = 0;
  for (const auto& entry : fs::directory_iterator(seen)) {
    ++pages;
    const Picture is = read_png(entry.path());
    const Picture should = read_png(approved / entry.path().filename());
    ASSERT_EQ(is.width, should.width) << entry.path();
    ASSERT_EQ(is.height, should.height) << entry.path();
    double sum = 0;
    std::size_t far = 0;
    for (std::size_t k = 0; k < is.gray.size(); ++k) {
      const int difference = std::abs(is.gray[k] - should.gray[k]);
      sum += difference;
      far += difference > 60 ? 1 : 0;
    }
    const auto pixels = static_cast<double>(is.gray.size());
    EXPECT_LT(sum / pixels, 1.5) << entry.path() << " differs from the approved picture";
    EXPECT_LT(static_cast<double>(far) / pixels, 0.005) << entry.path();
  }
  const auto expected = std::distance(fs::directory_iterator(approved), fs::directory_iterator{});
  EXPECT_EQ(pages, static_cast<std::size_t>(expected));
}

}  // namespace
}  // namespace plumbline::app
