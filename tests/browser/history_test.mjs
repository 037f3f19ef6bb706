// Parameters over units in the browser: control limits, performance against tolerances, yield, and the
// golden unit apart.
import assert from "node:assert/strict";
import {writeFileSync} from "node:fs";
import {join} from "node:path";
import test from "node:test";
import {Bench, keepPicture, nameless, says} from "./station.mjs";

test("trends, yield and the golden unit", async (t) => {
  const bench = new Bench(t);
  const values = [0.03000, 0.03001, 0.02999, 0.03002, 0.03000, 0.03001, 0.02999, 0.03030];
  values.forEach((value, i) => bench.record(`A-${i + 1}`, "finished", `unit-${i}`, value, i === 7 ? "fail" : "pass"));
  for (const [i, value] of [0.03100, 0.03101, 0.03099].entries()) bench.record("G-1", "finished", `golden-${i}`, value, "pass");
  bench.record("A-8", "finished", "again", 0.03001, "conditional_pass");  // once more, and better
  bench.record("A-9", "finished", "last", 0.03040, "fail");
  const tolerances = join(bench.folder, "tolerances.toml");
  writeFileSync(tolerances, "[K_xx]\nmin = 0.0295\nmax = 0.0305\n");
  const server = await bench.serve(["--golden", "G-1", "--tolerances", tolerances]);
  const page = await bench.page({viewport: {width: 1600, height: 1000}});
  await page.goto(server.url);
  await says(page, "#verdict", "FAIL");
  await page.getByRole("link", {name: "Units"}).click();
  // By hand: nine units, eight within 0.02999…0.03002 and one at 0.03040; mean moving range 65e-6.
  const Kxx = page.getByRole("img", {name: /^K_xx over 9 runs/});
  await Kxx.waitFor();
  const facts = await Kxx.getAttribute("aria-label");
  assert.match(facts, /mean 0\.03005, s 0\.00013, Pp 1\.2\d, Ppk 1\.1\d; 1 beyond the limits/);
  assert.match(await page.locator("#yield").innerText(), /Units with a decision\s+9\s+Passed at once\s+77\.8 %\s+Passed in the end\s+88\.9 %/);
  assert.equal(await page.getByRole("heading", {name: "Golden unit G-1"}).count(), 1);
  assert.match(await page.locator("#golden").getByRole("img", {name: /^K_xx/}).getAttribute("aria-label"), /over 3 runs: mean 0\.03100/);
  assert.deepEqual(await nameless(page), []);
  await keepPicture(page, "trends");

  await page.getByRole("link", {name: "Runs"}).click();
  const rows = page.locator("#runs tbody tr");
  await page.getByText("13 runs.").waitFor();
  assert.equal(await rows.count(), 13);
  await page.getByRole("searchbox", {name: "Serial number"}).fill("a-8");
  await page.getByText("2 runs.").waitFor();
  assert.deepEqual(await rows.getByRole("cell").filter({hasText: /PASS|FAIL/}).allTextContents(), ["CONDITIONAL PASS", "FAIL"]);
  await page.getByRole("searchbox", {name: "Serial number"}).fill("nobody");
  await page.getByText("No run of a unit like “nobody”.").waitFor();
});
