#include "storage/hash_chain.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <memory>

#include "storage/run_loader.h"
#include "storage/sample_blob.h"

namespace plumbline::storage {

namespace {

class Hasher {
 public:
  Hasher() : context_(EVP_MD_CTX_new(), &EVP_MD_CTX_free) {
    EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr);
  }

  void put_bytes(Bytes bytes) { EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()); }
  void put(long long value) {
    std::array<std::byte, 8> bytes{};
    const auto bits = static_cast<unsigned long long>(value);
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      bytes[i] = static_cast<std::byte>((bits >> (8 * i)) & 0xffU);
    }
    put_bytes(bytes);
  }
  // SQLite keeps no sign of zero.
  void put(double value) { put(std::bit_cast<long long>(value + 0.0)); }
  void put(const std::string& text) {
    put(static_cast<long long>(text.size()));
    put_bytes(std::as_bytes(std::span(text)));
  }

  Hash result() {
    Hash hash{};
    unsigned size = 0;
    EVP_DigestFinal_ex(context_.get(), reinterpret_cast<unsigned char*>(hash.data()), &size);
    assert(size == hash.size());
    return hash;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

Hash from_hex(const std::string& text) {
  Hash hash{};
  assert(text.size() == 2 * hash.size());
  for (std::size_t i = 0; i < hash.size(); ++i) {
    hash[i] = static_cast<std::byte>(std::stoi(text.substr(2 * i, 2), nullptr, 16));
  }
  return hash;
}

Result<RunSummary> summary_of(const Database& database, RunId run) {
  const auto runs = list_runs(database);
  if (!runs) return fail(runs.error());
  const auto found = std::find_if(runs->begin(), runs->end(),
                                  [&](const RunSummary& summary) { return summary.id == run; });
  if (found != runs->end()) return *found;
  return fail(ErrorCode::input, fmt::format("{}: there is no run {}; `plumbline runs` lists them",
                                            database.file().string(), run));
}

}  // namespace

Hash first_link(RunId run, const RunHeader& header) {
  Hasher hasher;
  hasher.put(std::string("plumbline.chain/1"));
  hasher.put(run);
  hasher.put(header.serial);
  hasher.put(header.program_version);
  hasher.put(header.started_utc);
  hasher.put(header.rate_hz);
  hasher.put(static_cast<long long>(header.adc.bits));
  hasher.put(header.adc.min_V);
  hasher.put(header.adc.max_V);
  hasher.put(header.config_toml);
  hasher.put(header.plan_csv);
  return hasher.result();
}

Hash next_link(const Hash& before, const PoseRecord& pose) {
  Hasher hasher;
  hasher.put_bytes(before);
  hasher.put(pose.ordinal);
  hasher.put(std::string(to_string(pose.kind)));
  hasher.put(pose.delta_deg);
  hasher.put(pose.h_deg);
  hasher.put(pose.delta_enc_deg);
  hasher.put(pose.h_enc_deg);
  hasher.put(pose.settle_s);
  hasher.put(static_cast<long long>(pose.settle_capped));
  hasher.put(static_cast<long long>(pose.approach));
  hasher.put(static_cast<long long>(pose.samples.size()));
  hasher.put_bytes(pack_samples(pose.samples));
  hasher.put(static_cast<long long>(pose.covariates.size()));
  for (const StoredCovariate& covariate : pose.covariates) {
    hasher.put(covariate.name);
    hasher.put(covariate.t_s);
    hasher.put(covariate.value);
  }
  return hasher.result();
}

std::string to_hex(Bytes hash) {
  std::string text;
  for (const std::byte byte : hash) text += fmt::format("{:02x}", std::to_integer<int>(byte));
  return text;
}

Result<ChainReport> check_chain(const Database& database, RunId run) {
  const auto snapshot = Transaction::begin(database, Transaction::Kind::reading);
  if (!snapshot) return fail(snapshot.error());
  const auto summary = summary_of(database, run);
  if (!summary) return fail(summary.error());

  ChainReport report{
      .run = run, .poses = summary->poses, .head = summary->chain_head, .faults = {}};
  Hash last = first_link(run, summary->header);
  const Hash first = last;
  auto done = each_pose(database, run, [&](const StoredPose& pose) {
    const std::string name =
        fmt::format("pose {} ({})", pose.record.ordinal, to_string(pose.record.kind));
    if (pose.link.empty()) {
      report.faults.push_back(name + ": was not recorded by this program, it has no link");
      return;
    }
    const bool is_first = last == first;
    const Hash expected = next_link(last, pose.record);
    if (to_hex(expected) != pose.link) {
      report.faults.push_back(
          name + ": was changed, or " +
          (is_first ? "the description of the run was, or a pose" : "something") +
          " before it was changed, removed or inserted");
    }
    if (!pose.consistent) {
      report.faults.push_back(name + ": its times or its count are not those of its samples");
    }
    last = from_hex(pose.link);  // so that one fault is reported once
  });
  if (!done) return fail(done.error());
  done = database.each(
      "SELECT pose FROM link WHERE run = ?1 AND pose NOT IN (SELECT id FROM pose WHERE run = ?1)",
      [&](const Statement& row) {
        report.faults.push_back(
            fmt::format("a pose was removed (row {} of the table pose)", row.integer(0)));
      },
      run);
  if (!done) return fail(done.error());
  done = database.each(
      "SELECT ordinal FROM suspect JOIN pose ON pose.id = suspect.pose WHERE run = ?1 AND NOT "
      "EXISTS"
      " (SELECT 1 FROM event WHERE event.run = ?1 AND kind = 'suspect' AND instr(text, why) > 0)",
      [&](const Statement& row) {
        report.faults.push_back(
            fmt::format("pose {}: was taken out of the run, and no event says so", row.integer(0)));
      },
      run);
  if (!done) return fail(done.error());
  if (to_hex(last) != summary->chain_head) {
    report.faults.push_back(
        "the last pose does not carry the head of the chain: poses were removed or added at the "
        "end, or the head was changed");
  }
  return report;
}

Result<std::vector<RunId>> removed_runs(const Database& database) {
  std::vector<RunId> removed;
  const auto done = database.each(
      "WITH RECURSIVE number (id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM number WHERE id <"
      " (SELECT max(seq) FROM sqlite_sequence WHERE name = 'run'))"
      " SELECT id FROM number WHERE id NOT IN (SELECT id FROM run) AND"
      " EXISTS (SELECT 1 FROM sqlite_sequence WHERE name = 'run')",
      [&](const Statement& row) { removed.push_back(row.integer(0)); });
  if (!done) return fail(done.error());
  return removed;
}

Result<void> link_older_runs(const Database& database) {
  const auto runs = list_runs(database);
  if (!runs) return fail(runs.error());
  for (const RunSummary& summary : *runs) {
    Hash last = first_link(summary.id, summary.header);
    std::vector<std::pair<long long, Hash>> links;
    auto done = each_pose(database, summary.id, [&](const StoredPose& pose) {
      last = next_link(last, pose.record);
      links.emplace_back(pose.id, last);
    });
    for (auto link = links.begin(); done && link != links.end(); ++link) {
      done = database.run("INSERT INTO link (pose, run, hash) VALUES (?1, ?2, ?3)", link->first,
                          summary.id, Bytes(link->second));
    }
    if (done) {
      done = database.run("UPDATE run SET chain_head = ?2 WHERE id = ?1", summary.id, Bytes(last));
    }
    if (!done) return done;
  }
  return {};
}

}  // namespace plumbline::storage
