// The STATUS and POSE objects of control_socket.h.
#include <unistd.h>

#include <algorithm>

#include "app/sequencer/control_socket.h"

namespace plumbline::app {

namespace {

Json sample_json(const RawSample& sample, const Adc& adc) {
  PerAxis<double> u_V{};
  for (std::size_t i = 0; i < kAxisCount; ++i) u_V[i] = adc.volts(sample.code[i]);
  return {{"t_s", json_number(sample.t_s)},
          {"u_V", json_array(u_V)},
          {"temp_C", json_number(sample.temp_C)}};
}

Json angles_json(const rig::HeadAngles& angles) {
  return {{"delta_deg", json_number(angles.delta_deg)}, {"h_deg", json_number(angles.h_deg)}};
}

Json head_json(const rig::HeadStatus& head) {
  Json json = angles_json(head.actual);
  json["in_position"] = head.in_position;
  json["moving"] = head.moving;
  json["homed"] = head.homed;
  json["alarm"] = head.alarm;
  json["drive_temp_C"] = {json_number(head.drive_temp_C[0]), json_number(head.drive_temp_C[1])};
  return json;
}

const char* pause_text(EngineControl::Pause pause) {
  switch (pause) {
    case EngineControl::Pause::none:
      return "none";
    case EngineControl::Pause::at_pose:
      return "pose";
    case EngineControl::Pause::now:
      return "now";
  }
  return "";
}

}  // namespace

Json pose_json(const PoseMean& pose) {
  Json json = {{"step", pose.step}, {"kind", to_string(pose.kind)}};
  json.update(angles_json(pose.target));
  json.update({{"t_s", json_number(pose.t_s)},
               {"settle_s", json_number(pose.settle_s)},
               {"samples", pose.samples},
               {"mean_V", json_array(pose.mean_V)},
               {"sd_V", json_array(pose.sd_V)},
               {"temp_C", json_number(pose.temp_C)}});
  return json;
}

Json status_json(const LiveSnapshot& snapshot, const EngineControl& control) {
  const Progress& progress = snapshot.progress;
  const LiveRun& run = snapshot.run;
  const double share =
      progress.planned_total_s > 0 ? progress.planned_done_s / progress.planned_total_s : 0;
  Json samples = Json::array();
  for (const RawSample& sample : snapshot.samples) samples.push_back(sample_json(sample, run.adc));
  Json events = Json::array();
  for (const storage::EventRecord& event : snapshot.events) {
    events.push_back({{"t_s", json_number(event.t_s)},
                      {"utc", event.utc},
                      {"kind", event.kind},
                      {"text", event.text}});
  }
  const Attention& attention = progress.attention;
  return {{"schema", "plumbline.status/1"},
          {"pid", ::getpid()},
          {"program_version", program_version()},
          {"run", progress.run > 0 ? Json(progress.run) : Json()},
          {"serial", run.serial},
          {"database", run.database},
          {"out", run.out},
          {"started_utc", run.started_utc},
          {"state", to_string(progress.state)},
          {"reason", progress.reason},
          {"state_since_s", json_number(snapshot.state_since_s)},
          {"pause_requested", pause_text(control.pause_requested())},
          {"step", progress.step},
          {"steps", progress.steps},
          {"done", progress.done},
          {"kind", to_string(progress.kind)},
          {"target", angles_json(progress.target)},
          {"head", head_json(progress.head)},
          {"t_s", json_number(progress.t_s)},
          {"elapsed_s", json_number(snapshot.elapsed_s)},
          {"remaining_s", snapshot.remaining_s < 0 ? Json() : json_number(snapshot.remaining_s)},
          {"progress", json_number(std::clamp(share, 0.0, 1.0))},
          {"samples_received", progress.samples_received},
          {"rate_hz", json_number(run.rate_hz)},
          {"attention",
           {{"retries", attention.retries},
            {"recoveries", attention.recoveries},
            {"suspensions", attention.suspensions},
            {"skipped", attention.skipped},
            {"left_out", attention.left_out},
            {"suspects", attention.suspects}}},
          {"newest", progress.newest ? sample_json(*progress.newest, run.adc) : Json()},
          {"samples", std::move(samples)},
          {"last_pose", progress.last_pose ? pose_json(*progress.last_pose) : Json()},
          {"poses", snapshot.poses},
          {"events", std::move(events)}};
}

}  // namespace plumbline::app
