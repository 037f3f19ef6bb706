// Canvas drawings in the colours of the page: traces, the map over δ × h, control charts.

const style = () => getComputedStyle(document.documentElement);
const colour = (name) => style().getPropertyValue(`--${name}`).trim();
const font = '12px system-ui, "Liberation Sans", sans-serif';

// The canvas at the resolution of the screen; nothing while it is not visible.
function surface(canvas) {
  const box = canvas.getBoundingClientRect();
  if (box.width < 2 || box.height < 2) return null;
  const ratio = window.devicePixelRatio || 1;
  const width = Math.round(box.width * ratio), height = Math.round(box.height * ratio);
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, {width, height});
  const c = canvas.getContext("2d");
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  c.clearRect(0, 0, box.width, box.height);
  c.font = font;
  return {c, width: box.width, height: box.height};
}

// Round numbers that divide [low, high] into about `count` steps, two at least.
function ticks(low, high, count) {
  const raw = (high - low) / count;
  if (!(raw > 0) || !Number.isFinite(raw)) return [];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).findLast((s) => s <= raw * 1.5);
  const list = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; ++k) list.push(k * step);
  return list;
}

function label(value, list) {
  const step = list.length > 1 ? Math.abs(list[1] - list[0]) : Math.abs(value) || 1;
  return value.toFixed(Math.min(12, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)))).replace("-", "−");
}

function frame({c, width, height}, box, xs, ys, xText, yText) {
  c.strokeStyle = colour("line");
  c.fillStyle = colour("quiet");
  c.lineWidth = 1;
  c.textAlign = "right"; c.textBaseline = "middle";
  for (const y of ys.list) {
    const at = Math.round(ys.at(y)) + 0.5;
    c.beginPath(); c.moveTo(box.left, at); c.lineTo(width - box.right, at); c.stroke();
    c.fillText(label(y, ys.list), box.left - 6, at);
  }
  c.textAlign = "center"; c.textBaseline = "top";
  for (const x of xs.list) c.fillText(label(x, xs.list), xs.at(x), height - box.bottom + 6);
  c.textAlign = "right"; c.textBaseline = "bottom"; c.fillText(xText, width - box.right, height);
  c.textAlign = "left"; c.textBaseline = "top"; c.fillText(yText, 0, 0);
}

const scale = (low, high, from, to) => (value) => from + (value - low) / (high - low) * (to - from);

// rows: [t_s, x, y, z, T]; the newest `span` seconds of the node's clock.
export function drawTrace(canvas, rows, span, note) {
  const to = surface(canvas);
  if (!to) return;
  const {c, width, height} = to;
  if (rows.length < 2) {
    c.fillStyle = colour("quiet"); c.textAlign = "center";
    c.fillText(note, width / 2, height / 2);
    return;
  }
  const last = rows[rows.length - 1][0];
  const seen = rows.filter((row) => row[0] >= last - span);
  let low = Infinity, high = -Infinity;
  for (const row of seen) for (let i = 1; i <= 3; ++i) { low = Math.min(low, row[i]); high = Math.max(high, row[i]); }
  const pad = Math.max((high - low) * 0.06, 1e-4);
  low -= pad; high += pad;
  const box = {left: 64, right: 8, top: 18, bottom: 34};
  const begin = Math.max(last - span, seen[0][0]);
  const xAt = scale(begin, Math.max(last, begin + 1e-3), box.left, width - box.right);
  const yAt = scale(low, high, height - box.bottom, box.top);
  frame(to, box, {list: ticks(begin, last, 6), at: xAt}, {list: ticks(low, high, 5), at: yAt}, "time / s", "V");
  ["x", "y", "z"].forEach((axis, i) => {
    c.strokeStyle = colour(axis);
    c.lineWidth = 1.8;
    c.setLineDash([[], [7, 4], [2, 3]][i]);
    c.beginPath();
    seen.forEach((row, k) => { if (k) c.lineTo(xAt(row[0]), yAt(row[i + 1])); else c.moveTo(xAt(row[0]), yAt(row[i + 1])); });
    c.stroke();
  });
  c.setLineDash([]);
}

const hex = (text) => [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16));
function mixed(value, low, mid, high) {
  const end = value < 0 ? low : high, part = Math.min(1, Math.abs(value));
  return `rgb(${mid.map((m, i) => Math.round(m + (end[i] - m) * part)).join(" ")})`;
}

// poses: [step, delta, h, rx, ry, rz…]; axis 0…2. Returns the value of the full colour, m/s².
export function drawMap(canvas, plan, poses, axis, aim) {
  const to = surface(canvas);
  if (!to || !plan) return null;
  const {c, width, height} = to;
  const list = ([start, stop, step]) => {
    const values = [];
    for (let v = start; v <= stop + 1e-9; v += step || 1) values.push(v);
    return values;
  };
  const deltas = list(plan.delta_deg), hs = list(plan.h_deg);
  const box = {left: 40, right: 70, top: 6, bottom: 34};
  const w = (width - box.left - box.right) / deltas.length, h = (height - box.top - box.bottom) / hs.length;
  const xAt = (i) => box.left + i * w, yAt = (k) => height - box.bottom - (k + 1) * h;
  const known = poses.filter((p) => p[3 + axis] !== null);
  const full = known.reduce((m, p) => Math.max(m, Math.abs(p[3 + axis])), 0) || 1e-6;
  c.fillStyle = colour("map-empty");
  for (let i = 0; i < deltas.length; ++i) for (let k = 0; k < hs.length; ++k) c.fillRect(xAt(i) + .5, yAt(k) + .5, Math.max(w - 1, 1), Math.max(h - 1, 1));
  const [low, mid, high] = ["map-low", "map-mid", "map-high"].map((name) => hex(colour(name)));
  const index = (values, v) => values.reduce((best, one, i) => Math.abs(one - v) < Math.abs(values[best] - v) ? i : best, 0);
  for (const p of poses) {
    const i = index(deltas, p[1]), k = index(hs, p[2]);
    const value = p[3 + axis];
    c.fillStyle = value === null ? colour("quiet") : mixed(value / full, low, mid, high);
    c.fillRect(xAt(i) + .5, yAt(k) + .5, Math.max(w - 1, 1), Math.max(h - 1, 1));
    if (value !== null && value < 0 && w > 7 && h > 7) {  // a dash: tells the sign without colour
      c.fillStyle = colour("ink");
      c.fillRect(xAt(i) + w * .35, yAt(k) + h / 2, w * .3, 1);
    }
  }
  if (aim) {
    c.strokeStyle = colour("ink"); c.lineWidth = 2;
    c.strokeRect(xAt(index(deltas, aim.delta_deg)), yAt(index(hs, aim.h_deg)), w, h);
  }
  c.fillStyle = colour("quiet");
  c.textAlign = "center"; c.textBaseline = "top";
  const every = (values, most) => Math.max(1, Math.ceil(values.length / most));
  deltas.forEach((v, i) => { if (i % every(deltas, 9) === 0) c.fillText(`${v}°`, xAt(i) + w / 2, height - box.bottom + 5); });
  c.textAlign = "right"; c.textBaseline = "middle";
  hs.forEach((v, k) => { if (k % every(hs, 9) === 0) c.fillText(`${v}°`, box.left - 5, yAt(k) + h / 2); });
  c.textBaseline = "bottom"; c.fillText("δ", width - box.right, height);
  c.textAlign = "left"; c.textBaseline = "top"; c.fillText("h", 2, box.top);
  const bar = {x: width - box.right + 12, y: box.top + 8, w: 12, h: height - box.top - box.bottom - 16};
  for (let i = 0; i < bar.h; ++i) {
    c.fillStyle = mixed(1 - 2 * i / bar.h, low, mid, high);
    c.fillRect(bar.x, bar.y + i, bar.w, 1.5);
  }
  c.fillStyle = colour("quiet"); c.textBaseline = "middle";
  const text = (v) => known.length ? (v * 1000).toPrecision(2).replace("-", "−") : "";
  c.fillText(text(full), bar.x + bar.w + 4, bar.y);
  c.fillText("0", bar.x + bar.w + 4, bar.y + bar.h / 2);
  c.fillText(text(-full), bar.x + bar.w + 4, bar.y + bar.h);
  return known.length ? full : null;
}

function cut(c, text, room) {
  let shown = text;
  for (let length = text.length - 1; length > 0 && c.measureText(shown).width > room; --length) shown = `${text.slice(0, length)}…`;
  return shown;
}

// Chart of individuals and moving ranges: values with ± U bars, mean and control limits.
export function drawTrend(canvas, series) {
  const to = surface(canvas);
  if (!to) return;
  const {c, width, height} = to;
  const {points, chart, performance} = series;
  let low = Infinity, high = -Infinity;
  const take = (v) => { if (v !== null && v !== undefined) { low = Math.min(low, v); high = Math.max(high, v); } };
  for (const p of points) { take(p.value - 2 * p.u); take(p.value + 2 * p.u); }
  if (chart) { take(chart.lower); take(chart.upper); }
  take(performance?.lower); take(performance?.upper);
  const pad = (high - low) * 0.08 || Math.abs(high) * 1e-6 || 1e-9;
  low -= pad; high += pad;
  const list = ticks(low, high, 4);
  // Below, on a scale of their own, the moving ranges.
  const ranges = chart?.range ?? [];
  const most = Math.max(chart?.upper_range ?? 0, ...ranges) * 1.1 || 1;
  const steps = ticks(0, most, 2);
  const widest = (values) => Math.max(0, ...values.map((v) => c.measureText(label(v, values)).width));
  const left = Math.max(widest(list), widest(steps)) + 10;
  const strip = ranges.length ? height * 0.24 : 0;
  const box = {left, right: 40, top: 8, bottom: 20 + (strip ? strip + 24 : 0)};
  const xAt = (i) => box.left + (i + 0.5) / points.length * (width - box.left - box.right);
  const yAt = scale(low, high, height - box.bottom, box.top);
  frame(to, box, {list: [], at: xAt}, {list, at: yAt}, "", "");
  const line = (v, dash, name, text, at = yAt) => {
    if (v === null || v === undefined) return;
    c.strokeStyle = colour(name); c.lineWidth = 1.4; c.setLineDash(dash);
    c.beginPath(); c.moveTo(box.left, at(v)); c.lineTo(width - box.right, at(v)); c.stroke();
    c.setLineDash([]); c.fillStyle = colour(name); c.textAlign = "left"; c.textBaseline = "middle";
    c.fillText(text, width - box.right + 4, at(v));
  };
  if (strip) {
    const below = {left, right: 40, top: height - 20 - strip, bottom: 20};
    const rangeAt = scale(0, most, height - below.bottom, below.top);
    frame(to, below, {list: [], at: xAt}, {list: steps, at: rangeAt}, "", "");
    line(chart.mean_range, [], "quiet", "MR", rangeAt);
    line(chart.upper_range, [6, 4], "warn", "UCL", rangeAt);
    c.strokeStyle = c.fillStyle = colour("accent"); c.lineWidth = 1;
    c.beginPath();
    ranges.forEach((r, i) => { if (i) c.lineTo(xAt(i + 1), rangeAt(r)); else c.moveTo(xAt(1), rangeAt(r)); });
    c.stroke();
    ranges.forEach((r, i) => {
      c.fillStyle = r > chart.upper_range ? colour("bad") : colour("accent");
      c.beginPath();
      if (r > chart.upper_range) c.rect(xAt(i + 1) - 4, rangeAt(r) - 4, 8, 8); else c.arc(xAt(i + 1), rangeAt(r), 3, 0, 7);
      c.fill();
    });
  }
  if (chart) {
    line(chart.mean, [], "quiet", "x̄");
    line(chart.lower, [6, 4], "warn", "LCL"); line(chart.upper, [6, 4], "warn", "UCL");
  }
  line(performance?.lower, [2, 3], "bad", "LSL"); line(performance?.upper, [2, 3], "bad", "USL");
  c.strokeStyle = colour("accent"); c.lineWidth = 1;
  c.beginPath();
  points.forEach((p, i) => { if (i) c.lineTo(xAt(i), yAt(p.value)); else c.moveTo(xAt(i), yAt(p.value)); });
  c.stroke();
  const outside = new Set(chart?.outside ?? []);
  points.forEach((p, i) => {
    c.strokeStyle = c.fillStyle = outside.has(i) ? colour("bad") : colour("accent");
    c.beginPath(); c.moveTo(xAt(i), yAt(p.value - 2 * p.u)); c.lineTo(xAt(i), yAt(p.value + 2 * p.u)); c.stroke();
    c.beginPath();
    if (outside.has(i)) c.rect(xAt(i) - 4.5, yAt(p.value) - 4.5, 9, 9); else c.arc(xAt(i), yAt(p.value), 3.5, 0, 7);
    c.fill();
  });
  c.fillStyle = colour("quiet"); c.textAlign = "center"; c.textBaseline = "top";
  // As many serial numbers as there is room for, each cut to its room.
  const every = Math.ceil(points.length / Math.max(1, Math.floor((width - left) / 90)));
  const room = every * (xAt(1) - xAt(0)) - 8;
  points.forEach((p, i) => { if (i % every === 0) c.fillText(cut(c, p.label ?? p.serial, room), xAt(i), height - box.bottom + 6); });
}
