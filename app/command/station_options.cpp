#include "app/command/station_options.h"

#include <fmt/format.h>

#include <cstdio>

namespace plumbline::app {

void add_listen_options(CLI::App& command, ServeOptions& options) {
  command
      .add_option("--listen", options.listen,
                  "address and port of the station page; one that other machines reach needs "
                  "--token-file; port 0: a free one")
      ->capture_default_str();
  command.add_option("--token-file", options.token_file,
                     "asks for a token: lines `control = TOKEN` and `view = TOKEN`, mode 0600");
  command.add_option("--host-name", options.names,
                     "further name that browsers reach the page by; may be repeated");
  command.add_flag("--control", options.control,
                   "the page may give orders; without it, it only shows");
}

void add_serve_options(CLI::App& command, ServeOptions& options) {
  command.add_flag("--serve", options.serve, "station page in the browser while this runs");
  add_listen_options(command, options);
  for (const char* name : {"--listen", "--token-file", "--host-name", "--control"}) {
    command.get_option(name)->needs(command.get_option("--serve"));
  }
}

Result<GuardOptions> guard_options(const ServeOptions& options) {
  auto address = parse_listen_address(options.listen);
  if (!address) return fail(address.error());
  GuardOptions guard;
  guard.address = *std::move(address);
  guard.names = options.names;
  guard.control = options.control;
  if (!options.token_file.empty()) {
    auto tokens = read_token_file(options.token_file);
    if (!tokens) return fail(tokens.error());
    guard.tokens = *std::move(tokens);
  }
  return guard;
}

Result<std::unique_ptr<Station>> station_of_run(const ServeOptions& options,
                                                const std::filesystem::path& database,
                                                const std::filesystem::path& out) {
  if (!options.serve) return nullptr;
  auto guard = guard_options(options);
  if (!guard) return fail(guard.error());
  auto station = Station::start({.guard = *std::move(guard),
                                 .history = {.database = database, .results = out},
                                 .launcher = {}});
  if (station) {
    fmt::print(stderr, "station: http://{}/\n", (*station)->address().text());
  }
  return station;
}

}  // namespace plumbline::app
