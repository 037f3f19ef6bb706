// Where the numbers come from: program, data, events.
#include <fmt/format.h>

#include <filesystem>

#include "app/certificate/content.h"
#include "app/certificate/rounding.h"

namespace plumbline::app::content {

void add_history(const Composer& c) {
  c.add(Heading{c.tr("Data and events")});
  const std::size_t skipped = c.input.calibration.skipped_rows;
  Facts facts;
  facts.rows = {{c.tr("Program"), "plumbline " + program_version()},
                {c.tr("Seed"), fmt::format("{}", c.input.provenance.seed)},
                {c.tr("Rows skipped"), skipped == 0 ? c.tr("none") : fmt::format("{}", skipped)}};
  for (const auto& [name, hash] : c.input.provenance.input_sha256) {
    const std::string file = std::filesystem::path(name).filename().string();
    facts.rows.push_back({c.tr("SHA-256 of {}", file), hash});
  }
  if (!c.input.result_sha256.empty()) {
    facts.rows.push_back({c.tr("SHA-256 of {}", "result.json"), c.input.result_sha256});
  }
  c.add(std::move(facts));
  if (c.input.events.empty()) {
    c.add(Paragraph{c.tr("No events were recorded.")});
    return;
  }
  Table table;
  table.caption = c.tr("Events of the run");
  table.header = {c.tr("time, s"), c.tr("kind"), c.tr("what happened")};
  table.word_columns = {1, 2};
  for (const CertificateEvent& event : c.input.events) {
    table.rows.push_back({significant(event.t_s, 5), event.kind, event.text});
  }
  c.add(std::move(table));
}

}  // namespace plumbline::app::content
