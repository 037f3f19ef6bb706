// An operator starts a dry run from the form, pauses it, goes on, sees the verdict and opens the
// certificate; pages are loaded anew on the way, and the server is started anew.
import assert from "node:assert/strict";
import test from "node:test";
import {Bench, eventually, faint, focused, keepPicture, nameless, says} from "./station.mjs";

const reads = (page, path) => page.evaluate(async (at) => (await fetch(at)).json(), path);

test("an operator measures a unit", async (t) => {
  const bench = new Bench(t);
  const words = ["--control", "--golden", "G-1", "--simulate", "--simulated-config", bench.writeRig(), "--speed", "30"];
  let server = await bench.serve(words);
  const page = await bench.page();
  await page.goto(server.url);
  await says(page, "#state", "Ready");
  await eventually(page, async () => await focused(page) === "start-serial");
  assert.deepEqual(await nameless(page), []);
  await keepPicture(page, "ready");

  // As a scanner does: its Enter goes to the next field that is empty.
  await page.keyboard.type("A-0017\n");
  assert.equal(await focused(page), "start-operator");
  await page.keyboard.type("R. Roe\n");
  await page.locator("body[data-phase=running]").waitFor();
  await page.getByRole("button", {name: "Pause"}).waitFor();
  assert.equal(await page.getByRole("button", {name: "Start", exact: true}).count(), 0);
  // Fourteen more look on to the end; the run below is none the worse for it. Sixteen may: one place is
  // left for the page that is reloaded, whose old stream is missed only at the next sign of life.
  const viewers = Array.from({length: 14}, async () => {
    try {
      const reply = await fetch(`${server.url}api/stream`);
      let seen = "";
      for await (const piece of reply.body.pipeThrough(new TextDecoderStream())) {
        seen = seen.slice(-4000) + piece;
        if (seen.includes('"decision":"pass"')) return true;
      }
      return "the stream ended";
    } catch (error) {
      return String(error);
    }
  });
  // The first ring of twelve poses does not determine the axis that it turns about.
  await eventually(page, async () => parseInt(await page.locator("#done").innerText(), 10) >= 20);
  await page.getByRole("button", {name: "Pause"}).click();
  await says(page, "#state", "Paused");
  assert.match(await page.locator("#remaining").innerText(), /^\d+:\d\d$/);
  assert.doesNotMatch(await page.locator("#alarms").textContent(), /drive/);
  assert.match(await page.locator("#temperature").innerText(), /^\d+\.\d\d °C$/);
  assert.deepEqual(await nameless(page), []);
  const poses = async () => (await reads(page, "/api/poses")).poses.length;
  const before = await poses();
  await page.reload();  // loses nothing
  await says(page, "#state", "Paused");
  await says(page, "#serial", "A-0017");
  await page.getByRole("list", {name: "Events of the run, newest first"}).getByText("R. Roe").waitFor();
  await page.getByRole("row", {name: /^x .*±/}).waitFor();
  assert.equal(await poses(), before);
  assert.ok((await reads(page, "/api/trace")).trace.length > 100);
  // What happens at every pose would bury the rest.
  const {events} = await reads(page, "/api/events");
  assert.ok(events.some((event) => event.kind === "pause"));
  assert.deepEqual(events.filter((event) => /^(moving|settling|sampling): /.test(event.text)), []);
  for (const colorScheme of ["light", "dark"]) {
    await page.emulateMedia({colorScheme});
    assert.deepEqual(await faint(page), [], colorScheme);
  }
  await keepPicture(page, "paused");

  await page.getByRole("button", {name: "Stop…"}).click();
  const question = page.getByRole("dialog", {name: "Stop this run?"});
  await question.getByRole("button", {name: "Go on measuring"}).click();  // asked before it is done
  await question.waitFor({state: "hidden"});
  await page.getByRole("button", {name: "Resume"}).click();
  await says(page, "#state", /^(?!Paused).+$/);

  await says(page, "#verdict", "PASS", 120);
  assert.equal(await page.locator("#state").innerText(), "Finished");
  await page.getByRole("button", {name: "Start", exact: true}).waitFor();
  await keepPicture(page, "verdict");
  assert.deepEqual(await Promise.all(viewers), Array(14).fill(true));
  const [run] = (await reads(page, "/api/runs")).runs;
  assert.ok(run.poses >= 60, `${run.poses} poses`);  // all, unless a slow machine left some out
  assert.equal(run.state, "finished");

  // A server that is started anew is found again, and remembers.
  page.stationMayBeGone = true;
  await server.stop();
  await page.locator("body[data-link=down]").waitFor();
  await page.getByText("No connection to the station").waitFor();
  await says(page, "#verdict", "PASS");
  server = await bench.serve(words, server.address);
  await page.locator("body[data-link=up]").waitFor();
  page.stationMayBeGone = false;
  await says(page, "#verdict", "PASS");

  await page.getByRole("link", {name: "Units"}).click();
  await page.getByRole("img", {name: /^U0_z over 1 run:/}).waitFor();
  assert.equal(await page.locator("#trends canvas").count(), 12);
  await keepPicture(page, "units");
  await page.getByRole("link", {name: "Runs"}).click();
  await page.getByRole("row", {name: /A-0017/}).waitFor();
  assert.deepEqual(await nameless(page), []);
  await keepPicture(page, "runs");
  const download = page.waitForEvent("download");
  await page.getByRole("link", {name: "samples of run 1"}).click();
  assert.equal((await download).suggestedFilename(), "run-1-samples.csv");
  await page.getByRole("link", {name: "certificate of run 1"}).click();
  await page.waitForURL("**/runs/1/certificate.html");
  await page.getByRole("heading", {level: 1}).waitFor();
  const certificate = await page.locator("body").innerText();
  for (const word of ["A-0017", "R. Roe", "PASS"]) assert.ok(certificate.includes(word), word);
});
