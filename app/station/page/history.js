// Runs, their comparison, and parameters over units.
import {drawTrend} from "/chart.js";
import {ask, cell, decisionWords, element, id, milli, rounded, symbol, uncertain, whenLooksChange} from "/common.js";

const threeAxes = (values) => values.map((v) => milli(v, 2)).join("  ");

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
  row.append(cell("Compare", box), cell("Run", String(run.id)), cell("Unit", run.serial + (run.golden ? " (golden)" : "")),
    cell("Started", run.started_utc.replace("T", " ").replace("Z", "")), cell("State", run.state), cell("Poses", String(run.poses)),
    cell("Decision", result ? tag(result.decision) : "–"),
    cell("Diagnosis", result ? result.verdict.replace("_", " ") + (result.effects.length ? `: ${result.effects.join(", ")}` : "") : "–"),
    cell("Error / (mm/s²)", result ? `${threeAxes(result.before_mps2)} → ${threeAxes(result.after_mps2)}` : "–"), cell("Files", files(run)));
  return row;
}

export async function showRuns() {
  const serial = id("search-serial").value.trim();
  let found;
  try { found = await ask(`/api/runs?serial=${encodeURIComponent(serial)}`); } catch (error) { id("runs-note").textContent = error.message; return; }
  id("runs").tBodies[0].replaceChildren(...found.runs.map(runRow));
  id("runs-note").textContent = found.total === 0 ? (serial ? `No run of a unit like “${serial}”.` : "No run has been recorded yet.")
    : `${found.total > found.runs.length ? `The newest ${found.runs.length} of ${found.total} runs` : found.total === 1 ? "1 run" : `${found.total} runs`}. Error: RMS of held-out poses, axes x y z, before → after the added effects.`;
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
    const table = element("table", "", {class: "stack", "aria-label": `Run ${a} and run ${b}`});
    const head = element("tr");
    for (const name of ["Parameter", `Run ${a} (${both.a.serial})`, `Run ${b} (${both.b.serial})`, "Difference", "Eₙ"]) head.append(element("th", name, {scope: "col"}));
    table.append(element("thead", head));
    const body = element("tbody");
    for (const row of both.parameters) {
      const line = element("tr");
      const far = row.E_n === null || Math.abs(row.E_n) > 1;
      const E_n = `${row.E_n === null ? "∞" : rounded(row.E_n, Math.abs(row.E_n) < 100 ? 0.1 : 10)}${far ? "  differs" : ""}`;
      line.append(element("th", symbol(row.name, row.unit), {scope: "row"}), cell(`Run ${a}`, uncertain(row.a, row.U_a)), cell(`Run ${b}`, uncertain(row.b, row.U_b)),
        cell("Difference", rounded(row.difference, Math.hypot(row.U_a, row.U_b))), cell("Eₙ", element("span", E_n, far ? {class: "tag bad"} : {})));
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
  const {name, unit, points, chart, performance} = series;
  const index = (value) => value === null ? "–" : value.toFixed(2);
  let facts = "limits need two runs or more";
  if (performance) {
    const {mean, s, Pp, Ppk} = performance;
    facts = `mean ${rounded(mean, s)}, s ${rounded(s, s)}`;
    if (Ppk !== null) facts += `, Pp ${index(Pp)}, Ppk ${index(Ppk)}`;
    if (chart?.outside.length) facts += `; ${chart.outside.length} beyond the limits`;
  }
  const figure = element("figure", "", {class: "card trend"});
  figure.append(element("figcaption", symbol(name, unit)), element("canvas", "", {role: "img", "aria-label": `${name} over ${points.length} ${points.length === 1 ? "run" : "runs"}: ${facts}`}),
    element("p", facts, {class: "figures"}));
  return figure;
}

let charts = [];
function drawCharts() {
  for (const [canvas, series] of charts) drawTrend(canvas, series);
}
whenLooksChange(drawCharts);

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
  // It is one unit: when it was measured tells its points apart.
  for (const {points} of all.golden) for (const point of points) point.label = point.utc.slice(0, 10);
  fill(id("golden"), all.golden, "It has not been measured yet.");
  drawCharts();
}
