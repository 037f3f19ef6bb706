// The station page: what goes on at the rig and what has been measured, in a browser.
//
// GET  /                    the page; /kiosk the same without anything to press
// GET  /api/station         {control, csrf, plans, last_start, program_version, database, golden}
// GET  /api/live            the newest MESSAGE of live_feed.h; /api/stream all of them as events
// GET  /api/trace, /api/poses, /api/events     of the run at hand
// GET  /api/runs?serial=&most=   /api/trends   /api/compare?a=&b=
// GET  /runs/ID/FILE        certificate.html|pdf|xml, result.json; samples.csv, static.csv,
//                           confirm.csv, run.toml made from the database
// GET  /metrics, /healthz
// POST /api/order {"order": "pause"|"resume"|"stop"}, /api/start {"serial", "operator", "plan"}
// POST /login {"token"}
#pragma once

#include <memory>
#include <string>

#include "app/station/guard.h"
#include "app/station/history.h"
#include "app/station/http.h"
#include "app/station/launcher.h"

namespace plumbline::app {

struct StationOptions {
  GuardOptions guard;  ///< its address is where to listen
  HistoryOptions history;
  LauncherOptions launcher;  ///< no plans: nothing can be started here
};

/// Pages that may follow a run at the same time; who comes later asks again and again instead.
inline constexpr int kMostViewers = 16;

class Station {
 public:
  static Result<std::unique_ptr<Station>> start(const StationOptions& options);
  ~Station();
  Station(const Station&) = delete;
  Station& operator=(const Station&) = delete;

  const ListenAddress& address() const;
  /// Waits until the viewers have been told how the last run ended, at most some seconds.
  void let_viewers_see_the_end() const;

 private:
  struct Parts;
  explicit Station(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace plumbline::app
