// The view of what goes on.
import {drawMap, drawTrace} from "/chart.js";
import {ask, cell, decisionWords, element, id, milli, uncertain, whenLooksChange} from "/common.js";

const svg = (tag, attributes, text) => {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text) node.textContent = text;
  return node;
};
const kSpan_s = 120;
const kMostRows = 6000;

// What is shown in big words.
const words = {
  idle: "Waiting", homing: "Homing", moving: "Moving", settling: "Settling", sampling: "Sampling", paused: "Paused",
  recovering: "Recovering", stopping: "Stopping", finished: "Finished", stopped: "Stopped", failed: "Failed",
  calculating: "Calculating", interrupted: "Interrupted", empty: "Ready",
};
const reasons = {
  calculating: "Everything is measured; the certificate is on its way.",
  interrupted: "The program that measured has died. The run can be resumed.",
  stopped: "Ended on request. The run can be resumed.",
  failed: "Ended by a fault. The run can be resumed.",
  empty: "No run has been recorded yet.",
};
const alarms = new Set(["fault", "bus", "loss", "retry", "suspect", "put off", "left out", "settle_cap"]);

let live = null;
let rows = [];
let poses = [];
let posesVersion = -1;
let axis = 0;
let dirty = true;

// The last message; null before the first one.
export const newest = () => live;

function clock(seconds) {
  if (seconds === null || seconds === undefined) return "–";
  const whole = Math.max(0, Math.round(seconds));
  const two = (n) => String(n).padStart(2, "0");
  const h = Math.floor(whole / 3600);
  return h > 0 ? `${h}:${two(Math.floor(whole / 60) % 60)}:${two(whole % 60)}` : `${Math.floor(whole / 60)}:${two(whole % 60)}`;
}

const text = (name, value) => { const node = id(name); if (node.textContent !== value) node.textContent = value; };

// One of the facts below the state; without a value it is left out.
function fact(name, value) {
  text(name, value);
  id(name).parentElement.hidden = value === "";
}

// Nothing where the station does not answer: the next message asks again.
const get = (path) => ask(path).catch(() => null);

// What came before this page was opened.
export async function startLive() {
  const all = await get("/api/trace");
  if (all) rows = all.trace;
  await refresh(true);
  dirty = true;
}

let refreshing = false;
let again = false;
async function refresh(everything = false) {
  if (refreshing || !live) { again = again || everything; return; }
  refreshing = true;
  if (everything || live.poses_version !== posesVersion) {
    const all = await get("/api/poses");
    if (all) { poses = all.poses; posesVersion = all.poses_version; }
  }
  showEvents((await get("/api/events"))?.events ?? []);
  refreshing = false;
  dirty = true;
  if (again) { again = false; refresh(true); }
}

let lastEvents = "";
function showEvents(list) {
  const newest = list.slice(-200).reverse();
  const key = newest.map((e) => `${e.t_s}${e.text}`).join();
  if (key === lastEvents) return;
  lastEvents = key;
  id("events").replaceChildren(...newest.map((event) => {
    // Counts of what went wrong on the bus are none when they are all zero.
    const harmless = event.kind === "bus" && / received([,;] 0 [^,;]+)+$/.test(event.text);
    const item = element("li", "", alarms.has(event.kind) && !harmless ? {class: "alarm"} : {});
    item.append(element("time", event.utc.slice(11, 19), {datetime: event.utc}), element("span", event.kind), element("span", event.text));
    return item;
  }));
}

export function showLive(message) {
  const other = live?.run?.id !== message.run?.id || live?.phase !== message.phase;
  const before = live?.status?.reason;
  live = message;
  document.body.dataset.phase = message.phase;
  const last = rows.length ? rows[rows.length - 1][0] : -1;
  for (const row of message.trace) if (row[0] > last) rows.push(row);
  if (rows.length > kMostRows) rows = rows.slice(-kMostRows);
  if (other) startLive();
  else if (message.poses_version !== posesVersion || before !== message.status?.reason) refresh();
  board();
  estimate();
  dirty = true;
  window.dispatchEvent(new CustomEvent("live", {detail: message}));
}

function board() {
  const {phase, status, run, verdict} = live;
  const state = phase === "running" ? status.state : phase;
  document.body.dataset.state = state;
  text("state", words[state] ?? state);
  text("reason", phase === "running" ? status.reason : verdict ? outcome(verdict) : reasons[phase] ?? "");
  text("serial", run?.serial ?? "–");
  text("run", run?.id ? String(run.id) : "–");
  const temp = status?.newest?.temp_C;
  fact("done", status ? `${status.done} of ${status.steps}` : "");
  fact("remaining", status ? clock(status.remaining_s) : "");
  fact("temperature", typeof temp === "number" ? `${temp.toFixed(2)} °C` : "");
  fact("alarms", status ? alarmWords(status) : "");
  // How far a run came that ended early is not known here: no bar rather than an empty one.
  id("progress").hidden = !status && phase !== "finished" && phase !== "calculating";
  id("progress").value = status ? status.progress : 1;
  const box = id("verdict");
  box.hidden = !verdict;
  if (verdict) {
    const [word, kind] = decisionWords(verdict.decision);
    text("verdict", word);
    box.className = kind;
  }
  document.title = verdict ? `${decisionWords(verdict.decision)[0]} – ${run.serial}` : `${words[state] ?? state} – plumbline`;
}

// What needed attention in this session, and the drive's own alarm.
function alarmWords({head, attention}) {
  const parts = head.alarm.flatMap((code, i) => code === 0 ? [] : [`drive alarm ${code.toString(16).toUpperCase()}h (${["δ", "h"][i]})`]);
  for (const [kind, count] of Object.entries(attention)) if (count > 0) parts.push(`${kind.replace("_", " ")} ${count}`);
  return parts.join(", ");
}

function outcome({verdict, effects, limit_mps2, max_abs_error_mps2, u_mps2}) {
  const parts = [];
  if (max_abs_error_mps2 !== null) {
    parts.push(`largest error ${uncertain(1000 * max_abs_error_mps2, 2000 * u_mps2)} mm/s²` + (limit_mps2 > 0 ? `, limit ${milli(limit_mps2, 3)}` : ""));
  }
  const words = verdict.replace("_", " ");
  parts.push(verdict === "clean" ? "nothing left unexplained" : effects.length ? `${words}: ${effects.join(", ")}` : words);
  return parts.join("; ");
}

function estimate() {
  const {estimate, noise} = live;
  id("estimate").tBodies[0].replaceChildren(...["x", "y", "z"].map((name, i) => {
    const row = element("tr");
    const fit = estimate?.[name];
    row.append(element("th", name, {scope: "row"}),
      cell("Scale K / (V/g)", fit ? uncertain(fit.value[i], 2 * fit.u[i]) : "–"), cell("Bias U₀ / V", fit ? uncertain(fit.value[3], 2 * fit.u[3]) : "–"),
      cell("Residual RMS / (mm/s²)", milli(fit?.rms_mps2, 3)), cell("Noise of a sample / (mm/s²)", milli(noise?.sd_mps2?.[i], 3)));
    return row;
  }));
}

// --- the head: from the side its tilt h, from the front its spindle angle δ ---
const drawing = id("head");
function buildHead() {
  drawing.append(
    svg("path", {class: "base", d: "M20 170 H150 M85 170 V112"}), svg("text", {class: "mark quiet", x: 85, y: 188}, "tilt h"),
    svg("path", {class: "dial", d: "M150 108 A65 65 0 0 0 85 43"}));
  for (let h = 0; h <= 90; h += 30) {
    const r = h * Math.PI / 180;
    drawing.append(svg("line", {class: "tick", x1: 85 + 61 * Math.cos(r), y1: 108 - 61 * Math.sin(r), x2: 85 + 68 * Math.cos(r), y2: 108 - 68 * Math.sin(r)}));
  }
  drawing.append(
    svg("line", {id: "aim-arm", class: "aim", x1: 85, y1: 108, x2: 146, y2: 108}),
    svg("g", {id: "arm"}));
  const arm = drawing.querySelector("#arm");
  arm.append(svg("rect", {class: "body", x: 68, y: 98, width: 52, height: 20, rx: 4}), svg("rect", {class: "body", x: 122, y: 86, width: 9, height: 44, rx: 3}));
  drawing.append(svg("circle", {class: "base", cx: 85, cy: 108, r: 6}));
  drawing.append(svg("circle", {class: "dial", cx: 250, cy: 95, r: 62}), svg("text", {class: "mark quiet", x: 250, y: 190}, "spindle δ"));
  for (let d = 0; d < 360; d += 30) {
    const r = d * Math.PI / 180, a = d % 90 ? 58 : 54;
    drawing.append(svg("line", {class: "tick", x1: 250 + a * Math.sin(r), y1: 95 - a * Math.cos(r), x2: 250 + 66 * Math.sin(r), y2: 95 - 66 * Math.cos(r)}));
  }
  for (const [d, x, y] of [[0, 250, 26], [90, 328, 99], [180, 250, 172], [270, 172, 99]]) drawing.append(svg("text", {class: "mark", x, y}, `${d}`));
  drawing.append(svg("line", {id: "aim-delta", class: "aim", x1: 250, y1: 95, x2: 250, y2: 33}));
  const needle = svg("g", {id: "needle-delta"});
  needle.append(svg("line", {class: "needle", x1: 250, y1: 95, x2: 250, y2: 44}), svg("rect", {class: "body", x: 236, y: 81, width: 28, height: 28, rx: 4}));
  drawing.append(needle);
}
buildHead();

function showHead() {
  const status = live?.status;
  if (!status) { text("pose", "no run is going on"); return; }
  const {head, target} = status;
  const turn = (name, angle, x, y) => drawing.querySelector(name).setAttribute("transform", `rotate(${angle} ${x} ${y})`);
  turn("#arm", -head.h_deg, 85, 108); turn("#aim-arm", -target.h_deg, 85, 108);
  turn("#needle-delta", head.delta_deg, 250, 95); turn("#aim-delta", target.delta_deg, 250, 95);
  const line = `δ ${head.delta_deg.toFixed(3)}° (to ${target.delta_deg}°)   h ${head.h_deg.toFixed(3)}° (to ${target.h_deg}°)`;
  text("pose", line + (head.homed || !["idle", "homing", "recovering"].includes(status.state) ? "" : "   not homed"));
  drawing.setAttribute("aria-label", `Pose of the head: ${line}`);
}

// In the kiosk view, where nothing can be pressed, the axes take turns.
const choice = id("map-axis");
const kiosk = document.documentElement.dataset.view === "kiosk";
if (kiosk) setInterval(() => { axis = (axis + 1) % 3; dirty = true; }, 10000);
else ["x", "y", "z"].forEach((name, i) => {
  const button = element("button", name, {type: "button", "aria-pressed": String(i === axis), "aria-label": `axis ${name}`});
  button.addEventListener("click", () => {
    axis = i;
    [...choice.children].forEach((one, k) => one.setAttribute("aria-pressed", String(k === i)));
    dirty = true;
  });
  choice.append(button);
});

function draw() {
  if (dirty && live && !id("view-live").hidden) {
    dirty = false;
    // Of a run that was over before this station was started only the poses are known.
    document.body.toggleAttribute("data-past", live.phase !== "running" && rows.length === 0);
    showHead();
    drawTrace(id("trace"), rows, kSpan_s, live.phase === "running" ? "no samples yet" : "traces are shown while a run is going on");
    const full = drawMap(id("map"), live.run?.delta_deg ? live.run : null, poses, axis, live.status?.target);
    text("map-scale", full === null ? "the first estimate needs poses at two tilts" : `axis ${"xyz"[axis]}: up to ${(full * 1000).toPrecision(2)} mm/s² at ${poses.length} positions; scale in mm/s², a dash marks negative ones`);
  }
}
// At most ten times a second, however many messages come.
setInterval(() => requestAnimationFrame(draw), 100);
whenLooksChange(() => { dirty = true; });
