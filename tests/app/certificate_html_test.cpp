// certificate.html as a browser lays it out: a wide window, and a telephone.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "tests/app/certificate_example.h"
#include "tests/app/temp_folder.h"

namespace plumbline::app {
namespace {

/// Replaces the page by a list of what stands out of its place: of the window, of its own box, of
/// its picture, or lies on another label of the same picture.
constexpr const char* kMeasure = R"js(<script>
const wrong = [];
const say = (what, element) =>
  wrong.push(what + ": " + element.tagName + " " + element.textContent.trim().slice(0, 40));
const root = document.documentElement;
if (root.scrollWidth > root.clientWidth) wrong.push("the page is wider than the window");
for (const element of document.querySelectorAll("p, dd, dt, h1, h2, td, th, caption, figcaption"))
  if (element.scrollWidth > element.clientWidth + 1) say("wider than its box", element);
for (const svg of document.querySelectorAll("svg")) {
  const frame = svg.getBoundingClientRect();
  const labels = [...svg.querySelectorAll("text")].map((e) => [e, e.getBoundingClientRect()]);
  labels.forEach(([e, r], i) => {
    if (r.left < frame.left - 1 || r.right > frame.right + 1 || r.top < frame.top - 1 ||
        r.bottom > frame.bottom + 1) say("out of the picture", e);
    for (const [f, s] of labels.slice(i + 1)) {
      const width = Math.min(r.right, s.right) - Math.max(r.left, s.left);
      const height = Math.min(r.bottom, s.bottom) - Math.max(r.top, s.top);
      const least = Math.min(r.width * r.height, s.width * s.height);
      if (width > 0 && height > 0 && width * height > 0.3 * least) {
        say("on “" + f.textContent + "”", e);
      }
    }
  });
}
document.body.textContent = "measured" + wrong.map((w) => "|" + w).join("");
</script>)js";

constexpr const char* kBrowser = "/usr/bin/chromium";

/// What the browser finds: "measured", then one entry for everything that is wrong.
std::string laid_out(const Document& document, int width_px, const TempFolder& folder) {
  std::string html = write_html(document);
  html.insert(html.find("</body>"), kMeasure);
  write_text(folder / "page.html", html);
  const std::string command = fmt::format(
      "'{}' --headless=new --no-sandbox --disable-gpu --disable-dev-shm-usage "
      "--disable-background-networking --hide-scrollbars --user-data-dir='{}' "
      "--window-size={},1000 --dump-dom 'file://{}' 2>/dev/null",
      kBrowser, std::string(folder / "profile"), width_px, std::string(folder / "page.html"));
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::string text;
  char block[4096];
  for (std::size_t n = 0; (n = std::fread(block, 1, sizeof block, pipe.get())) > 0;) {
    text.append(block, n);
  }
  const std::size_t at = text.find("measured");
  if (at == std::string::npos) return "not measured: " + text;
  text = text.substr(at, text.find("</body>", at) - at);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())) != 0) {
    text.pop_back();
  }
  return text;
}

TEST(CertificateHtml, NothingStandsOutOfItsPlace) {
  if (!std::filesystem::exists(kBrowser)) GTEST_SKIP() << "no browser (scripts/setup)";
  const TempFolder folder;
  CertificateExample example;
  example.add_effects(2);
  EXPECT_EQ(laid_out(make_certificate(example.input()), 1000, folder), "measured");
  example.add_effects(10);
  example.make_names_long();
  example.add_not_found();
  example.language = Language::uk;
  for (const int width_px : {1000, 500}) {
    EXPECT_EQ(laid_out(make_certificate(example.input()), width_px, folder), "measured");
  }
}

// The measuring itself: a label outside its picture and a word that nothing breaks are seen.
TEST(CertificateHtml, WhatStandsOutIsNoticed) {
  if (!std::filesystem::exists(kBrowser)) GTEST_SKIP() << "no browser (scripts/setup)";
  Document document;
  Figure figure;
  figure.draw = [](Canvas& canvas) {
    canvas.text({690, 20}, "a long label at the edge", {});
    canvas.text({100, 100}, "one", {});
    canvas.text({102, 101}, "two", {});
  };
  document.blocks = {figure};
  const TempFolder folder;
  const std::string found = laid_out(document, 1000, folder);
  EXPECT_THAT(found, testing::HasSubstr("out of the picture: text a long label"));
  EXPECT_THAT(found, testing::HasSubstr("on “two”: text one"));
}

}  // namespace
}  // namespace plumbline::app
