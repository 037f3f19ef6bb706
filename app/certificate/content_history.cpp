// Where the numbers come from: program, data, events.
#include <fmt/format.h>

#include <filesystem>
#include <map>

#include "app/certificate/content.h"
#include "app/certificate/dcc/signature.h"
#include "app/certificate/rounding.h"

namespace plumbline::app::content {

namespace {

/// "recovering: why" after the event that says why.
bool repeats(const CertificateEvent& event, const CertificateEvent& before) {
  constexpr std::string_view kRecovering = "recovering: ";
  return event.kind == "state" && event.text.starts_with(kRecovering) &&
         before.text.ends_with(std::string_view(event.text).substr(kRecovering.size()));
}

/// A run has a thousand changes of state; what a reader looks for is what was out of the ordinary.
struct Told {
  std::vector<CertificateEvent> events;
  std::map<std::string, std::size_t> further;  ///< by kind: how many more
  std::size_t routine = 0;
};

constexpr std::size_t kMostOfAKind = 12;

bool is_routine(const CertificateEvent& event) {
  if (event.kind != "state") return false;
  for (const char* state : {"moving", "settling", "sampling"}) {
    if (event.text.starts_with(state)) return true;
  }
  return false;
}

Told told_events(const std::vector<CertificateEvent>& events) {
  Told told;
  std::map<std::string, std::size_t> seen;
  for (std::size_t k = 0; k < events.size(); ++k) {
    const CertificateEvent& event = events[k];
    if (k > 0 && repeats(event, events[k - 1])) continue;
    if (is_routine(event)) {
      ++told.routine;
    } else if (++seen[event.kind] > kMostOfAKind) {
      ++told.further[event.kind];
    } else {
      told.events.push_back(event);
    }
  }
  return told;
}

}  // namespace

void add_history(const Composer& c) {
  c.add(Heading{c.tr("Data and events")});
  const std::size_t skipped = c.input.calibration.skipped_rows;
  std::string outlying;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (const std::size_t count = c.input.calibration.outlying_readings[axis]; count > 0)
      outlying += fmt::format("{}{}: {}", outlying.empty() ? "" : ", ", kAxisName[axis], count);
  Facts facts;
  facts.rows = {{c.tr("Program"), "plumbline " + program_version()},
                {c.tr("Seed"), fmt::format("{}", c.input.provenance.seed)},
                {c.tr("Rows skipped"), skipped == 0 ? c.tr("none") : fmt::format("{}", skipped)},
                {c.tr("Readings left out, far out of their pose"),
                 outlying.empty() ? c.tr("none") : outlying}};
  for (const auto& [name, hash] : c.input.provenance.input_sha256) {
    const std::string file = std::filesystem::path(name).filename().string();
    facts.rows.push_back({c.tr("SHA-256 of {}", file), hash});
  }
  // Says which run of the database, and that none of its poses was changed.
  if (!c.input.provenance.chain_head.empty()) {
    facts.rows.push_back(
        {c.tr("Last link of the run's hash chain"), c.input.provenance.chain_head});
  }
  if (!c.input.result_sha256.empty()) {
    facts.rows.push_back({c.tr("SHA-256 of {}", "result.json"), c.input.result_sha256});
  }
  if (c.input.signing != nullptr) {
    facts.rows.push_back({c.tr("Signature of certificate.xml"),
                          c.tr("with the key of {}; SHA-256 of its certificate {}",
                               c.input.signing->subject, c.input.signing->certificate_sha256)});
  }
  c.add(std::move(facts));
  if (c.input.events.empty()) {
    c.add(Paragraph{c.tr("No events were recorded.")});
    return;
  }
  const Told told = told_events(c.input.events);
  Table table;
  table.caption = c.tr("Events of the run");
  table.header = {c.tr("time, s"), c.tr("kind"), c.tr("what happened")};
  table.word_columns = {1, 2};
  for (const CertificateEvent& event : told.events) {
    // What a person wrote stays as it was written.
    const bool own_words = event.kind == "operator" || event.kind == "job";
    table.rows.push_back({significant(event.t_s, 5), c.tr.phrase(event.kind),
                          own_words ? event.text : c.tr.phrase(event.text)});
  }
  if (!table.rows.empty()) c.add(std::move(table));
  for (const auto& [kind, count] : told.further) {
    c.add(Paragraph{c.tr("Further events of the kind “{}” that are kept with the run: {}.",
                         c.tr.phrase(kind), count)});
  }
  if (told.routine > 0) {
    c.add(
        Paragraph{c.tr("Not listed: {} changes of state from pose to pose as planned; they are "
                       "kept with the run.",
                       told.routine)});
  }
}

}  // namespace plumbline::app::content
