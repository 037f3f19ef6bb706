// Who may do what, as it looks in a browser: a station that only shows, one that asks for a token, and
// a page of another site.
import assert from "node:assert/strict";
import {chmodSync, writeFileSync} from "node:fs";
import {createServer} from "node:http";
import {join} from "node:path";
import test from "node:test";
import {Bench, faint, focused, keepPicture, nameless, overflowing, says} from "./station.mjs";

const controlToken = "c0ntrol-0123456789abcdef", viewToken = "view-only-0123456789abcd";

test("without --control there is nothing to press", async (t) => {
  const bench = new Bench(t);
  const server = await bench.serve(["--simulate"]);
  const page = await bench.page();
  await page.goto(server.url);
  await says(page, "#state", "Ready");
  await page.locator("body[data-link=up]").waitFor();
  for (const name of ["Start", "Pause", "Resume", "Stop…"]) {
    assert.equal(await page.getByRole("button", {name, exact: true}).count(), 0, name);
  }
});

test("a token decides who looks and who acts", async (t) => {
  const bench = new Bench(t);
  const file = join(bench.folder, "tokens");
  writeFileSync(file, `control = ${controlToken}\nview = ${viewToken}\n`);
  chmodSync(file, 0o600);
  const server = await bench.serve(["--control", "--simulate", "--token-file", file, "--host-name", "127.0.0.1"], "0.0.0.0:0");
  const url = `http://127.0.0.1:${new URL(server.url).port}/`;
  for (const [token, mayAct] of [[viewToken, false], [controlToken, true]]) {
    const page = await bench.page({viewport: {width: 390, height: 800}});
    await page.goto(url);
    await page.getByRole("heading", {name: "This station asks for a token"}).waitFor();
    assert.equal(await focused(page), "token");
    assert.deepEqual([await nameless(page), await faint(page), await overflowing(page)], [[], [], []]);
    await keepPicture(page, "login");
    await page.keyboard.type("not the right one\n");
    await page.getByRole("alert").getByText("not a token").waitFor();
    await page.getByLabel("Token").fill(token);
    await page.keyboard.press("Enter");
    await says(page, "#state", "Ready");
    const start = page.getByRole("button", {name: "Start", exact: true});
    if (mayAct) await start.waitFor(); else assert.equal(await start.count(), 0);
    await page.reload();  // the token need not be typed again
    await says(page, "#state", "Ready");
    // The browser notes that it was asked for a token, and that the first one was none.
    assert.ok(page.complaints.every((line) => line.includes("401")), String(page.complaints));
    page.complaints.length = 0;
  }
});

test("a page of another site reads nothing and starts nothing", async (t) => {
  const bench = new Bench(t);
  const server = await bench.serve(["--control", "--simulate"]);
  const other = createServer((request, reply) => reply.end("<!doctype html><title>other</title>"));
  await new Promise((ready) => { other.listen(0, "127.0.0.1", ready); });
  other.unref();
  const page = await bench.page();
  await page.goto(`http://127.0.0.1:${other.address().port}/`);
  const tried = await page.evaluate(async (url) => {
    const outcome = async (path, options) => {
      try { return (await fetch(url + path, options)).status; } catch { return "refused"; }
    };
    const body = '{"serial":"X","operator":"Y","plan":"dry run (simulated unit)"}';
    const framed = await new Promise((done) => {
      const frame = document.createElement("iframe");
      frame.onload = () => { try { done(frame.contentDocument === null ? "hidden" : frame.contentDocument.body.textContent); } catch { done("hidden"); } };
      frame.src = url;
      document.body.append(frame);
    });
    return [await outcome("api/live"), await outcome("api/station"), await outcome("api/start", {method: "POST", headers: {"Content-Type": "application/json"}, body}),
      await outcome("api/start", {method: "POST", mode: "no-cors", body}), framed];
  }, server.url);
  assert.deepEqual(tried, ["refused", "refused", "refused", "refused", "hidden"]);
  page.complaints.length = 0;
  await page.goto(server.url);
  await says(page, "#state", "Ready");  // nothing was started
});
