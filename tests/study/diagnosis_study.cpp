// The study of the diagnosis: many simulated sets, a CSV row for each, tables at the end.
// Exit code: 0 done, 2 wrong use. What the tables have to show is judged by a person.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <mutex>
#include <optional>
#include <thread>

#include "estimator/linear_algebra.h"
#include "estimator/parallel_for.h"
#include "tests/study/diagnosis.h"

namespace {

using namespace plumbline;
using namespace plumbline::study;

struct Options {
  std::vector<std::string> effects;
  std::vector<double> sizes = {1, 3, 10};
  std::vector<std::string> orders = {"serpentine", "raster", "random"};
  std::vector<std::string> noises = {"white", "examples", "coloured"};
  std::vector<int> bits = {12, 16};
  std::vector<int> samples = {40, 50};
  std::vector<double> static_s = {300, 600, 1800};
  int sets = 20;
  int count = 2;
  std::uint64_t seed = 1;
  int threads = 1;
  double detectable = 8;
  double minutes = 0;  ///< 0: no end
  std::string csv, tables_file, dump_folder;
  std::vector<std::string> summed;
};

/// One value of each list, drawn by streams of their own: a shorter list leaves the others' draws.
SetDesign draw_design(const Options& o, std::uint64_t seed, std::vector<std::string> effects,
                      double size) {
  const auto pick = [seed](const auto& list, const char* stream) {
    return list[sim::Random(seed, stream).index(list.size())];
  };
  SetDesign design;
  design.seed = seed;
  design.effects = std::move(effects);
  design.size = size;
  design.order = order_of(pick(o.orders, "study.order"));
  design.noise = noise_of(pick(o.noises, "study.noise.kind"));
  design.bits = pick(o.bits, "study.bits");
  design.samples_per_pose = pick(o.samples, "study.samples");
  design.static_s = pick(o.static_s, "study.static");
  return design;
}

std::vector<SetDesign> clean_designs(const Options& o) {
  std::vector<SetDesign> designs;
  for (int k = 0; k < o.sets; ++k)
    designs.push_back(draw_design(o, o.seed + static_cast<std::uint64_t>(k), {}, 0));
  return designs;
}

/// Every effect and size, `sets` sets each.
std::vector<SetDesign> single_designs(const Options& o, const std::vector<std::string>& effects) {
  std::vector<SetDesign> designs;
  for (int k = 0; k < o.sets; ++k) {
    for (const std::string& names : effects) {
      for (const double size : o.sizes) {
        designs.push_back(
            draw_design(o, o.seed + static_cast<std::uint64_t>(k), effect_parts(names), size));
      }
    }
  }
  return designs;
}

/// `count` different listed effects at once, drawn by the seed.
std::vector<SetDesign> multiple_designs(const Options& o) {
  const std::vector<std::string> names = o.effects.empty() ? effect_names(true) : o.effects;
  std::vector<SetDesign> designs;
  for (int k = 0; k < o.sets; ++k) {
    const auto seed = o.seed + static_cast<std::uint64_t>(k);
    sim::Random random(seed, "study.pick");
    std::vector<std::string> chosen;
    while (std::ssize(chosen) < std::min<std::ptrdiff_t>(o.count, std::ssize(names))) {
      const std::string& name = names[random.index(names.size())];
      if (std::find(chosen.begin(), chosen.end(), name) == chosen.end()) chosen.push_back(name);
    }
    designs.push_back(draw_design(o, seed, chosen, o.sizes[random.index(o.sizes.size())]));
  }
  return designs;
}

/// Everything, in turns, so that a study that is stopped early has something of all.
std::vector<SetDesign> all_designs(const Options& o) {
  std::vector<SetDesign> designs;
  for (int k = 0; k < o.sets; ++k) {
    Options turn = o;
    turn.seed = o.seed + static_cast<std::uint64_t>(k);
    turn.sets = 1;
    const auto add = [&](const std::vector<SetDesign>& more) {
      designs.insert(designs.end(), more.begin(), more.end());
    };
    add(single_designs(turn, effect_names(true)));
    add(single_designs(turn, effect_names(false)));
    // 25 without effect and 5 with two and with three for each of the others' 20.
    turn.seed = o.seed + 25 * static_cast<std::uint64_t>(k);
    turn.sets = 25;
    add(clean_designs(turn));
    turn.sets = 5;
    for (turn.count = 2; turn.count <= 3; ++turn.count) add(multiple_designs(turn));
  }
  return designs;
}

std::string short_line(const SetOutcome& o) {
  return fmt::format("seed {} {} x{} {} {} {} bits: {} named {}/{} stated {} wrong {}; {}\n",
                     o.design.seed, fmt::join(o.design.effects, "+"), o.design.size,
                     study::to_string(o.design.order), study::to_string(o.design.noise),
                     o.design.bits, o.feasible ? to_string(o.verdict) : "not feasible", o.named,
                     o.effects, o.named_or_stated + o.driver_right, o.wrong, o.found);
}

std::optional<std::string> text_of(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return std::nullopt;
  return std::string(std::istreambuf_iterator<char>(in), {});
}

/// What an earlier piece has left in the file, which afterwards ends with a whole line.
Result<std::vector<SetOutcome>> resume(const std::string& file) {
  std::string text = text_of(file).value_or("");
  text.resize(text.rfind('\n') + 1);
  const auto earlier = read_csv(text, file);
  if (!earlier) return earlier;
  std::ofstream(file, std::ios::binary) << (text.empty() ? csv_header() : text);
  return earlier;
}

/// Outcomes of the designs as far as the time allows, earlier ones of the same file included.
Result<std::vector<SetOutcome>> run_all(const Options& o, std::vector<SetDesign> designs) {
  std::vector<SetOutcome> outcomes;
  std::ofstream csv;
  if (!o.csv.empty()) {
    const auto earlier = resume(o.csv);
    if (!earlier) return earlier;
    std::map<std::string, const SetOutcome*> done;
    for (const SetOutcome& outcome : *earlier) done[reproduce(outcome.design)] = &outcome;
    std::erase_if(designs, [&](const SetDesign& design) {
      const auto found = done.find(reproduce(design));
      if (found != done.end()) outcomes.push_back(*found->second);
      return found != done.end();
    });
    csv.open(o.csv, std::ios::app);
  }
  std::atomic<std::size_t> next = 0;
  std::size_t done = 0;
  std::mutex writing;
  const auto start = std::chrono::steady_clock::now();
  const auto in_time = [&] {
    return o.minutes <= 0 ||
           std::chrono::steady_clock::now() - start < std::chrono::duration<double>(60 * o.minutes);
  };
  const auto work = [&] {
    const SerialScope one_thread_a_set;
    for (std::size_t k = next++; k < designs.size() && in_time(); k = next++) {
      SetOutcome outcome = run_set(designs[k]);
      const std::scoped_lock lock(writing);
      ++done;
      std::cerr << fmt::format("{}/{} ", done, designs.size()) << short_line(outcome);
      if (csv) csv << csv_row(outcome) << std::flush;
      outcomes.push_back(std::move(outcome));
    }
  };
  {
    std::vector<std::jthread> helpers;
    for (int thread = 1; thread < o.threads; ++thread) helpers.emplace_back(work);
    work();
  }
  return outcomes;
}

int report(const Options& o, const std::vector<SetOutcome>& outcomes) {
  const std::string text = summary(outcomes, o.detectable);
  std::cout << text;
  if (!o.tables_file.empty()) std::ofstream(o.tables_file) << text;
  return 0;
}

/// Tables over the rows of earlier pieces.
int sum_up(const Options& o) {
  std::vector<SetOutcome> outcomes;
  for (const std::string& file : o.summed) {
    const auto text = text_of(file);
    if (!text) {
      std::cerr << file << ": cannot be read\n";
      return 2;
    }
    const auto rows = read_csv(*text, file);
    if (!rows) {
      std::cerr << rows.error().message << "\n";
      return 2;
    }
    outcomes.insert(outcomes.end(), rows->begin(), rows->end());
  }
  return report(o, outcomes);
}

int run(const Options& o, const std::vector<SetDesign>& designs) {
  for (const SetDesign& design : designs) {
    for (const std::string& name : design.effects) {
      if (find_study_effect(name) != nullptr) continue;
      std::cerr << fmt::format("unknown effect \"{}\"\n", name);
      return 2;
    }
  }
  if (!o.dump_folder.empty()) {
    for (std::size_t k = 0; k < designs.size(); ++k) {
      const std::string folder =
          designs.size() == 1 ? o.dump_folder : fmt::format("{}/{}", o.dump_folder, k);
      if (const auto written = dump(make_set(designs[k]), folder); !written) {
        std::cerr << written.error().message << "\n";
        return 2;
      }
    }
  }
  const auto outcomes = run_all(o, designs);
  if (!outcomes) {
    std::cerr << outcomes.error().message << "\n";
    return 2;
  }
  return report(o, *outcomes);
}

}  // namespace

int main(int argc, char** argv) {
  plumbline::start_with_kernels_for_processor(argv);
  Options o;
  o.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  CLI::App app{"Does the diagnosis name what is there, and nothing else?"};
  app.require_subcommand(0, 1);
  app.fallthrough();
  app.add_option("--sets", o.sets, "sets per effect and size, or in all (clean, multiple)")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  app.add_option("--seed", o.seed, "of the first set; the others count up")->capture_default_str();
  app.add_option("--effects", o.effects,
                 "instead of all; a+b for both at once, \"none\" for no effect")
      ->delimiter(',');
  app.add_option("--sizes", o.sizes, "in noise of a pose")->delimiter(',')->capture_default_str();
  app.add_option("--orders", o.orders, "of the visits; one is drawn for each set")
      ->delimiter(',')
      ->check(CLI::IsMember({"serpentine", "raster", "random"}))
      ->capture_default_str();
  app.add_option("--noises", o.noises, "likewise")
      ->delimiter(',')
      ->check(CLI::IsMember({"white", "examples", "coloured"}))
      ->capture_default_str();
  app.add_option("--bits", o.bits, "likewise")->delimiter(',')->capture_default_str();
  app.add_option("--samples", o.samples, "per pose, likewise")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--static", o.static_s, "length of the static record in s, likewise")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--threads", o.threads, "changes the time, not the result")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  app.add_option("--detectable", o.detectable, "weaker effects, in sigma, count as not detectable")
      ->capture_default_str();
  app.add_option("--csv", o.csv,
                 "file for one row per set; what is in it already is not done again");
  app.add_option("--minutes", o.minutes, "start no further set after that time; 0: do all")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--summary", o.summed, "only the tables over these files of rows")
      ->check(CLI::ExistingFile);
  app.add_option("--tables", o.tables_file, "file for the tables");
  app.add_option("--dump", o.dump_folder, "folder for the sets as files");
  const auto* clean = app.add_subcommand("clean", "sets without any effect");
  const auto* single = app.add_subcommand("single", "one listed effect (or those of --effects)");
  const auto* multiple = app.add_subcommand("multiple", "several listed effects at once");
  app.add_option("--count", o.count, "effects at once (multiple)")->capture_default_str();
  const auto* own = app.add_subcommand("own", "one effect that is on no list");
  const auto* everything = app.add_subcommand("all", "all of these in turns, for a night");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (!o.summed.empty()) return sum_up(o);
  if (everything->parsed()) return run(o, all_designs(o));
  if (clean->parsed()) return run(o, clean_designs(o));
  if (multiple->parsed()) return run(o, multiple_designs(o));
  const auto all = effect_names(!own->parsed());
  if (single->parsed() || own->parsed())
    return run(o, single_designs(o, o.effects.empty() ? all : o.effects));
  std::cerr << "one of clean, single, multiple, own, all or --summary is needed\n";
  return 2;
}
