// A queue of jobs for a night: one TOML file, done from top to bottom.
//
//   config = "rig.toml"          # beside this file; what the jobs share
//   database = "night.db"        # beside this file
//   out = "night"                # a folder for each job, and jobs.json with what is done
//   hook = ""                    # as of `plumbline run --hook`
//   on_fault = "stop"            # or "next", after a job that ends with a rig fault
//
//   [[job]]
//   name = "cold"                # of the folder
//   serial = "A-0017"
//   action = "calibrate"         # record: measure only; verify: measure, then evaluate …
//   against = ""                 # … verify: with the calibration of this earlier job
//   repeat = 1
//   set = { plan = { soak_s = 60 }, grid = { … } }   # what differs from config
//   wait_for = { column = "temp_C", min = 18, max = 19, hold_s = 600, limit_s = 14400 }
//
// A job that was under way when the program died is resumed; one that is done is not done again.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/config/rig_description.h"
#include "estimator/measurement.h"

namespace plumbline::app {

enum class JobAction { record, calibrate, verify };

/// Waited for before the job starts, by the sensor's clock.
struct WaitCondition {
  std::string column;
  double min = 0;
  double max = 0;
  double hold_s = 60;      ///< inside the band without a break
  double limit_s = 14400;  ///< then the job fails
};

struct Job {
  std::string name;  ///< with "-1", "-2" … when it is repeated
  JobAction action = JobAction::calibrate;
  std::string against;
  RigDescription rig;  ///< config with `set` in it
  std::optional<WaitCondition> wait_for;
};

struct JobQueue {
  std::filesystem::path database;
  std::filesystem::path out;
  std::string hook;
  bool stop_on_fault = true;
  std::vector<Job> jobs;  ///< repeats written out
};

/// Reads the queue and every configuration that follows from it; strict like read_rig_description.
Result<JobQueue> read_job_queue(const std::filesystem::path& file);

/// What the plan of a job takes, homing and waiting for its condition not counted.
double planned_s(const Job& job);

}  // namespace plumbline::app
