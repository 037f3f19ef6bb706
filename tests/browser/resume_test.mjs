// A run that was interrupted is gone on with from the page; why it could not be is told (there is no
// rig here).
import assert from "node:assert/strict";
import test from "node:test";
import {Bench, eventually, focused, keepPicture, says} from "./station.mjs";

test("an operator goes on with an unfinished run", async (t) => {
  const bench = new Bench(t);
  bench.record("A-9", "running");
  const server = await bench.serve(["--control", "--golden", "G-1", "--config", bench.writeRig()]);
  const page = await bench.page();
  await page.goto(server.url);
  await says(page, "#state", "Interrupted");
  const goOn = page.getByRole("button", {name: "Go on with run 1 of A-9"});
  await goOn.waitFor();
  await keepPicture(page, "interrupted");
  await goOn.click();
  await page.getByRole("alert").getByText("Who measures?").waitFor();
  assert.equal(await focused(page), "start-operator");
  await page.keyboard.type("R. Roe");
  await page.getByRole("button", {name: "Golden unit G-1"}).click();
  assert.equal(await page.getByLabel("Serial number").first().inputValue(), "G-1");
  await goOn.click();
  await eventually(page, async () => (await page.locator("#start-answer").innerText()).includes("The last start ended: plumbline"));
});
