#include "rig/strict_toml.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <numeric>
#include <set>
#include <sstream>

namespace plumbline::rig {

struct StrictTable::State {
  std::string name;
  std::string source;
  toml::table table;
  std::set<const toml::node*> asked;    ///< nodes some reader asked for
  std::set<const toml::table*> opened;  ///< tables a reader has gone into
  std::vector<std::pair<std::string, std::vector<std::string>>> known;  ///< per table path
  std::vector<std::string> errors;

  std::vector<std::string>& known_keys(const std::string& path) {
    auto it = std::find_if(known.begin(), known.end(), [&](auto& k) { return k.first == path; });
    if (it == known.end()) it = known.insert(known.end(), {path, {}});
    return it->second;
  }

  std::string place(const toml::node* node) const {
    if (node == nullptr || node->source().begin.line == 0) return name;
    const auto begin = node->source().begin;
    return fmt::format("{}:{}:{}", name, begin.line, begin.column);
  }
};

namespace {

std::string joined(const std::string& path, std::string_view key) {
  return path.empty() ? std::string(key) : path + "." + std::string(key);
}

}  // namespace

std::string nearest(std::string_view word, const std::vector<std::string>& known) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string& candidate : known) {
    std::vector<std::size_t> row(candidate.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 1; i <= word.size(); ++i) {
      std::size_t diagonal = row[0];
      row[0] = i;
      for (std::size_t j = 1; j <= candidate.size(); ++j) {
        const std::size_t replaced = diagonal + (word[i - 1] == candidate[j - 1] ? 0 : 1);
        diagonal = row[j];
        row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
      }
    }
    if (row.back() < best_distance) {
      best_distance = row.back();
      best = candidate;
    }
  }
  return best;
}

StrictTable::StrictTable(std::shared_ptr<State> state, const toml::table* node, std::string path)
    : state_(std::move(state)), node_(node), path_(std::move(path)) {
  if (node_ != nullptr) state_->opened.insert(node_);
}

bool StrictTable::has(std::string_view key) const {
  return node_ != nullptr && node_->contains(key);
}

const toml::node* StrictTable::find(std::string_view key) {
  auto& known = state_->known_keys(path_);
  if (std::find(known.begin(), known.end(), key) == known.end()) known.emplace_back(key);
  const toml::node* node = node_ == nullptr ? nullptr : node_->get(key);
  if (node != nullptr) state_->asked.insert(node);
  return node;
}

void StrictTable::refuse_at(const toml::node* node, const std::string& message) {
  state_->errors.push_back(state_->place(node) + ": " + message);
}

void StrictTable::refuse(std::string_view key, const std::string& reason) {
  const toml::node* node = find(key);
  refuse_at(node == nullptr ? node_ : node, joined(path_, key) + ": " + reason);
}

namespace {

std::string out_of_range(const std::string& key, double value, Range range) {
  return fmt::format("{} = {} is out of range ({} … {})", key, value, range.min, range.max);
}

}  // namespace

double StrictTable::number_or(std::string_view key, double fallback, Range range) {
  const toml::node* node = find(key);
  if (node == nullptr) return fallback;
  const auto value = node->is_number() ? node->value<double>() : std::nullopt;
  if (!value) {
    refuse_at(node, joined(path_, key) + " must be a number");
    return fallback;
  }
  if (!(*value >= range.min && *value <= range.max)) {
    refuse_at(node, out_of_range(joined(path_, key), *value, range));
    return fallback;
  }
  return *value;
}

std::int64_t StrictTable::integer_or(std::string_view key, std::int64_t fallback, Range range) {
  const toml::node* node = find(key);
  if (node == nullptr) return fallback;
  const auto value = node->value_exact<std::int64_t>();
  if (!value) {
    refuse_at(node, joined(path_, key) + " must be a whole number");
    return fallback;
  }
  const auto real = static_cast<double>(*value);
  if (!(real >= range.min && real <= range.max)) {
    refuse_at(node, out_of_range(joined(path_, key), real, range));
    return fallback;
  }
  return *value;
}

std::string StrictTable::text_or(std::string_view key, std::string fallback) {
  const toml::node* node = find(key);
  if (node == nullptr) return fallback;
  const auto value = node->value_exact<std::string>();
  if (!value) {
    refuse_at(node, joined(path_, key) + " must be a text in quotes");
    return fallback;
  }
  return *value;
}

bool StrictTable::flag_or(std::string_view key, bool fallback) {
  const toml::node* node = find(key);
  if (node == nullptr) return fallback;
  const auto value = node->value_exact<bool>();
  if (!value) {
    refuse_at(node, joined(path_, key) + " must be true or false");
    return fallback;
  }
  return *value;
}

namespace {

std::string missing(const std::string& path, std::string_view key) {
  return path.empty() ? fmt::format("the key {} is missing", key)
                      : fmt::format("[{}] lacks the key {}", path, key);
}

}  // namespace

double StrictTable::number(std::string_view key, Range range) {
  if (!has(key)) {
    find(key);
    refuse_at(node_, missing(path_, key));
    return range.min > -1e299 ? range.min : 0.0;
  }
  return number_or(key, 0.0, range);
}

std::int64_t StrictTable::integer(std::string_view key, Range range) {
  if (!has(key)) {
    find(key);
    refuse_at(node_, missing(path_, key));
    return 0;
  }
  return integer_or(key, 0, range);
}

std::string StrictTable::text(std::string_view key) {
  if (!has(key)) {
    find(key);
    refuse_at(node_, missing(path_, key));
    return {};
  }
  return text_or(key, {});
}

std::string StrictTable::choice_or(std::string_view key, std::string fallback,
                                   const std::vector<std::string>& choices) {
  const std::string value = text_or(key, fallback);
  if (value == fallback || std::find(choices.begin(), choices.end(), value) != choices.end()) {
    return value;
  }
  const std::string hint = nearest(value, choices);
  refuse_at(node_->get(key),
            fmt::format("{} = \"{}\" is not one of {}{}", joined(path_, key), value,
                        fmt::join(choices, ", "),
                        hint.empty() ? "" : fmt::format("; did you mean \"{}\"?", hint)));
  return fallback;
}

std::vector<double> StrictTable::numbers_or(std::string_view key, std::vector<double> fallback,
                                            std::size_t count, Range range) {
  const toml::node* node = find(key);
  if (node == nullptr) return fallback;
  std::vector<double> values;
  if (const toml::array* array = node->as_array()) {
    for (const toml::node& item : *array) {
      const auto value = item.is_number() ? item.value<double>() : std::nullopt;
      if (!value) {
        refuse_at(&item, joined(path_, key) + " must hold numbers only");
        return fallback;
      }
      if (!(*value >= range.min && *value <= range.max)) {
        refuse_at(&item, out_of_range(joined(path_, key), *value, range));
        return fallback;
      }
      values.push_back(*value);
    }
  } else {
    refuse_at(node, joined(path_, key) + " must be an array of numbers");
    return fallback;
  }
  if (count != 0 && values.size() != count) {
    refuse_at(node, fmt::format("{} must hold {} numbers, not {}", joined(path_, key), count,
                                values.size()));
    return fallback;
  }
  return values;
}

std::vector<std::string> StrictTable::texts_or(std::string_view key,
                                               std::vector<std::string> fallback) {
  const toml::node* node = find(key);
  if (node == nullptr) return fallback;
  std::vector<std::string> values;
  const toml::array* array = node->as_array();
  if (array == nullptr) {
    refuse_at(node, joined(path_, key) + " must be an array of texts");
    return fallback;
  }
  for (const toml::node& item : *array) {
    const auto value = item.value_exact<std::string>();
    if (!value) {
      refuse_at(&item, joined(path_, key) + " must hold texts only");
      return fallback;
    }
    values.push_back(*value);
  }
  return values;
}

StrictTable StrictTable::table(std::string_view key) {
  const toml::node* node = find(key);
  const toml::table* child = node == nullptr ? nullptr : node->as_table();
  if (node != nullptr && child == nullptr) {
    refuse_at(node, joined(path_, key) + " must be a table");
  }
  return StrictTable(state_, child, joined(path_, key));
}

std::vector<StrictTable> StrictTable::tables(std::string_view key) {
  const toml::node* node = find(key);
  if (node == nullptr) return {};
  const toml::array* array = node->as_array();
  std::vector<StrictTable> result;
  if (array == nullptr) {
    refuse_at(node, fmt::format("{0} must be an array of tables: [[{0}]]", joined(path_, key)));
    return result;
  }
  for (const toml::node& item : *array) {
    if (const toml::table* child = item.as_table()) {
      state_->asked.insert(&item);
      result.push_back(StrictTable(state_, child, joined(path_, key)));
    } else {
      refuse_at(&item, fmt::format("{0} must be an array of tables: [[{0}]]", joined(path_, key)));
    }
  }
  return result;
}

std::vector<std::string> StrictTable::keys() const {
  std::vector<std::pair<toml::source_position, std::string>> found;
  if (node_ != nullptr) {
    for (const auto& [key, node] : *node_) found.emplace_back(key.source().begin, key.str());
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) {
    return std::pair(a.first.line, a.first.column) < std::pair(b.first.line, b.first.column);
  });
  std::vector<std::string> names;
  names.reserve(found.size());
  for (auto& [position, name] : found) names.push_back(std::move(name));
  return names;
}

Result<StrictFile> StrictFile::read(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    return fail(ErrorCode::input, path.string() + ": is a folder, not a file");
  }
  std::ifstream stream(path, std::ios::binary);
  if (!stream) {
    return fail(ErrorCode::input,
                fmt::format("{}: {}", path.string(), std::generic_category().message(errno)));
  }
  std::ostringstream text;
  text << stream.rdbuf();
  return parse(text.str(), path.string());
}

Result<StrictFile> StrictFile::parse(std::string_view text, const std::string& name) {
  auto state = std::make_shared<StrictTable::State>();
  state->name = name;
  state->source = std::string(text);
  try {
    state->table = toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    const auto begin = error.source().begin;
    return fail(ErrorCode::input,
                fmt::format("{}:{}:{}: {}", name, begin.line, begin.column, error.description()));
  }
  return StrictFile(std::move(state));
}

StrictTable StrictFile::root() { return StrictTable(state_, &state_->table, ""); }

const std::string& StrictFile::source() const { return state_->source; }

Result<void> StrictFile::finish() const {
  // An unknown key explains a missing one ("locl_mps2"), so it is reported first.
  std::string unknown;
  auto walk = [&](auto& self, const toml::table& table, const std::string& path) -> void {
    for (const auto& [key, node] : table) {
      if (!unknown.empty()) return;
      if (!state_->asked.contains(&node)) {
        const std::string hint = nearest(key.str(), state_->known_keys(path));
        const auto begin = key.source().begin;
        unknown = fmt::format("{}:{}:{}: unknown key {}{}", state_->name, begin.line, begin.column,
                              joined(path, key.str()),
                              hint.empty() ? "" : fmt::format("; did you mean {}?", hint));
        return;
      }
      if (const toml::table* child = node.as_table(); child && state_->opened.contains(child)) {
        self(self, *child, joined(path, key.str()));
      }
      if (const toml::array* array = node.as_array()) {
        for (const toml::node& item : *array) {
          const toml::table* child = item.as_table();
          if (child && state_->opened.contains(child)) self(self, *child, joined(path, key.str()));
        }
      }
    }
  };
  walk(walk, state_->table, "");
  if (!unknown.empty()) return fail(ErrorCode::input, unknown);
  if (!state_->errors.empty()) return fail(ErrorCode::input, state_->errors.front());
  return {};
}

}  // namespace plumbline::rig
