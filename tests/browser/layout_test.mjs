// Nothing sticks out of the station page nor of a certificate on it, on a wide screen and on a phone,
// with names as long as a form allows, twelve effects and an aborted run; every text can be read in
// light and in dark; and two runs are compared.
import assert from "node:assert/strict";
import test from "node:test";
import {Bench, eventually, faint, focused, keepPicture, nameless, overflowing, says} from "./station.mjs";

const longName = "W".repeat(60);

async function expectTidy(page, what) {
  for (const width of [1920, 1600, 390]) {
    await page.setViewportSize({width, height: 900});
    await new Promise((done) => { setTimeout(done, 300); });
    assert.deepEqual(await overflowing(page), [], `${what}, ${width} px wide`);
    await keepPicture(page, `${what}-${width}`);
  }
  for (const colorScheme of ["dark", "light"]) {
    await page.emulateMedia({colorScheme});
    assert.deepEqual(await faint(page), [], `${what}, ${colorScheme}`);
  }
  await page.setViewportSize({width: 1600, height: 900});
}

test("long names, many effects and an aborted run fit", async (t) => {
  const bench = new Bench(t);
  bench.record(longName, "finished", "one", 0.030, "conditional_pass");
  bench.record("A-2", "finished", "two", 0.031, "conditional_pass");
  const server = await bench.serve(["--control", "--golden", "G-1", "--simulate"]);
  const page = await bench.page({viewport: {width: 1600, height: 900}});
  await page.goto(server.url);
  await says(page, "#verdict", "CONDITIONAL PASS");
  await expectTidy(page, "verdict-of-many-effects");

  await page.getByRole("link", {name: "Runs"}).click();
  const rows = page.locator("#runs tbody tr");
  await eventually(page, async () => await rows.count() === 2);
  await expectTidy(page, "runs-of-long-names");
  const search = page.getByRole("searchbox", {name: "Serial number"});
  await search.fill("WWW");
  await eventually(page, async () => await rows.count() === 1);
  await page.getByRole("checkbox", {name: "Compare run 1"}).check();
  await search.fill("-");  // only the other one
  await page.getByRole("cell", {name: "A-2", exact: true}).waitFor();
  assert.equal(await rows.count(), 1);
  await page.getByRole("checkbox", {name: "Compare run 2"}).check();
  await page.getByRole("button", {name: "Compare two"}).click();
  const lines = page.locator("#comparison tbody tr");
  await eventually(page, async () => await lines.count() === 12);
  assert.equal(await focused(page), "comparison");
  assert.deepEqual(await lines.first().locator("> *").allTextContents(),
    ["Kxx / (V/g)", "0.030000 ± 0.000020", "0.031000 ± 0.000020", "0.001000", "35.36  differs"]);
  assert.equal(await page.locator("#comparison .bad").count(), 3);
  assert.deepEqual(await nameless(page), []);
  await expectTidy(page, "comparison");

  await page.getByRole("link", {name: "Units"}).click();
  await eventually(page, async () => await page.locator("#trends canvas").count() === 12);
  await expectTidy(page, "units-of-long-names");
  await page.goto(`${server.url}runs/1/certificate.html`);
  await eventually(page, async () => await page.locator("figure svg").count() > 6);
  await expectTidy(page, "certificate-of-long-names");

  bench.record(longName, "failed");
  await page.goto(`${server.url}kiosk`);
  await says(page, "#state", "Failed");
  await expectTidy(page, "kiosk-aborted");
});
