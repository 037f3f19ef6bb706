// Runs, their comparison, and parameters over units.
import {ask} from "/app.js";
import {drawTrend} from "/chart.js";
import {decisionWords, uncertain} from "/live.js";

const id = (name) => document.getElementById(name);
const element = (tag, content = "", attributes = {}) => {
  const node = document.createElement(tag);
  if (content instanceof Node) node.append(content); else node.textContent = content;
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  return node;
};
const mm = (values) => values.map((v) => v === null ? "–" : (v * 1000).toPrecision(2)).join("  ");

let chosen = [];

function files(run) {
  const span = element("span");
  const add = (name, text) => {
    span.append(span.childNodes.length ? " · " : "", element("a", text, {href: `/runs/${run.id}/${name}`, "aria-label": `${text} of run ${run.id}`}));
  };
  if (run.result) {
    add("certificate.html", "certificate"); add("certificate.pdf", "PDF"); add("certificate.xml", "XML"); add("result.json", "result");
  }
  add("samples.csv", "samples"); add("static.csv", "static"); add("confirm.csv", "confirm"); add("run.toml", "config");
  return span;
}

function tag(decision) {
  const [word, kind] = decisionWords(decision);
  return element("span", word, {class: `tag ${kind}`});
}

function runRow(run) {
  const row = element("tr");
  const box = element("input", "", {type: "checkbox", "aria-label": `Compare run ${run.id}`});
  box.disabled = !run.result;
  box.checked = chosen.includes(run.id);
  box.addEventListener("change", () => {
    chosen = chosen.filter((one) => one !== run.id);
    if (box.checked) chosen.push(run.id);
    id("compare").disabled = chosen.length !== 2;
  });
  const result = run.result;
  row.append(element("td", box), element("td", String(run.id)), element("td", run.serial + (run.golden ? " (golden)" : "")),
    element("td", run.started_utc.replace("T", " ").replace("Z", "")), element("td", run.state), element("td", String(run.poses)),
    element("td", result ? tag(result.decision) : "–"),
    element("td", result ? result.verdict.replace("_", " ") + (result.effects.length ? `: ${result.effects.join(", ")}` : "") : "–"),
    element("td", result ? `${mm(result.before_mps2)} → ${mm(result.after_mps2)}` : "–"), element("td", files(run)));
  return row;
}

export async function showRuns() {
  const serial = id("search-serial").value.trim();
  let found;
  try { found = await ask(`/api/runs?serial=${encodeURIComponent(serial)}`); } catch (error) { id("runs-note").textContent = error.message; return; }
  id("runs").tBodies[0].replaceChildren(...found.runs.map(runRow));
  id("runs-note").textContent = found.total === 0 ? (serial ? `No run of a unit like “${serial}”.` : "No run has been recorded yet.")
    : `${found.runs.length} of ${found.total} runs. Error: RMS of held-out poses, axes x y z, before → after the added effects.`;
}

let waiting = 0;
id("search-serial").addEventListener("input", () => { clearTimeout(waiting); waiting = setTimeout(showRuns, 200); });
id("search").addEventListener("submit", (event) => { event.preventDefault(); showRuns(); });

id("compare").addEventListener("click", async () => {
  const [a, b] = [...chosen].sort((x, y) => x - y);
  const card = id("comparison");
  card.hidden = false;
  try {
    const both = await ask(`/api/compare?a=${a}&b=${b}`);
    const table = element("table");
    const head = element("tr");
    for (const name of ["Parameter", `Run ${a} (${both.a.serial})`, `Run ${b} (${both.b.serial})`, "Difference", "Eₙ"]) head.append(element("th", name, {scope: "col"}));
    table.append(element("thead", head));
    const body = element("tbody");
    for (const row of both.parameters) {
      const line = element("tr");
      const far = row.E_n === null || Math.abs(row.E_n) > 1;
      line.append(element("th", `${row.name} / (${row.unit})`, {scope: "row"}), element("td", uncertain(row.a, row.U_a)), element("td", uncertain(row.b, row.U_b)),
        element("td", row.difference.toExponential(2).replaceAll("-", "−")),
        element("td", element("span", `${row.E_n === null ? "∞" : row.E_n.toFixed(2).replace("-", "−")}${far ? "  differs" : ""}`, far ? {class: "tag bad"} : {})));
      body.append(line);
    }
    table.append(body);
    const scroll = element("div", table, {class: "scroll"});
    card.replaceChildren(element("h2", `Run ${a} and run ${b}`), scroll,
      element("p", "± is U at k = 2. |Eₙ| > 1: the difference exceeds what both uncertainties allow.", {class: "note"}));
  } catch (error) {
    card.replaceChildren(element("p", error.message));
  }
  card.focus();
});

function trendCard(series) {
  const figure = element("figure", "", {class: "card trend"});
  const performance = series.performance;
  const index = (value) => value === null || value === undefined ? "–" : value.toFixed(2);
  figure.append(element("figcaption", `${series.name} / (${series.unit})`), element("canvas", "", {role: "img", "aria-label": `${series.name} over ${series.points.length} runs`}),
    element("p", performance ? `mean ${performance.mean.toPrecision(6).replace("-", "−")}, s ${performance.s.toPrecision(2)}`
      + (performance.Ppk === null ? "" : `, Pp ${index(performance.Pp)}, Ppk ${index(performance.Ppk)}`)
      + (series.chart?.outside.length ? `; ${series.chart.outside.length} beyond the limits` : "") : "limits need two runs or more", {class: "figures"}));
  return figure;
}

let charts = [];
function drawCharts() {
  for (const [canvas, series] of charts) drawTrend(canvas, series);
}
window.addEventListener("resize", drawCharts);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawCharts);

function fill(container, list, note) {
  if (list.length === 0) { container.replaceChildren(element("p", note, {class: "note"})); return; }
  const cards = list.map(trendCard);
  container.replaceChildren(...cards);
  cards.forEach((card, i) => charts.push([card.querySelector("canvas"), list[i]]));
}

export async function showUnits() {
  let all;
  try { all = await ask("/api/trends"); } catch (error) { id("trends").replaceChildren(element("p", error.message)); return; }
  charts = [];
  const share = (value) => value === null ? "–" : `${(100 * value).toFixed(1)} %`;
  const facts = [["Units with a decision", String(all.yield.units)], ["Passed at once", share(all.yield.first_pass)], ["Passed in the end", share(all.yield.final)]];
  for (const [decision, count] of Object.entries(all.yield.decisions)) facts.push([decisionWords(decision)[0].toLowerCase(), String(count)]);
  id("yield").replaceChildren(...facts.map(([name, value]) => {
    const box = element("div");
    box.append(element("dt", name), element("dd", value));
    return box;
  }));
  fill(id("trends"), all.units, "No unit has been certified yet.");
  id("golden-card").hidden = !all.golden_serial;
  id("golden-serial").textContent = all.golden_serial;
  fill(id("golden"), all.golden, "It has not been measured yet.");
  drawCharts();
}
