// A run is started, paused, gone on with and stopped without a mouse; meanwhile a kiosk view shows it
// and has nothing to press.
import assert from "node:assert/strict";
import test from "node:test";
import {Bench, eventually, faint, focused, keepPicture, nameless, says} from "./station.mjs";

// Goes to what has this name as a keyboard does.
async function tabTo(page, name) {
  for (let i = 0; i < 30; ++i) {
    await page.keyboard.press("Tab");
    const here = await page.evaluate(() => {
      const at = document.activeElement;
      return {name: at.getAttribute("aria-label") ?? at.textContent.trim(), outline: getComputedStyle(at).outlineStyle};
    });
    if (here.name !== name) continue;
    assert.notEqual(here.outline, "none", `where the focus is must be seen: ${name}`);
    return;
  }
  assert.fail(`no way to ${name} by Tab`);
}

test("everything works by keyboard, and the kiosk shows it only", async (t) => {
  const bench = new Bench(t);
  const server = await bench.serve(["--control", "--simulate", "--simulated-config", bench.writeRig(), "--speed", "5"]);
  const page = await bench.page();
  await page.goto(server.url);
  await eventually(page, async () => await focused(page) === "start-serial");
  await tabTo(page, "Start");
  await page.evaluate(() => document.activeElement.blur());
  await page.reload();
  await eventually(page, async () => await focused(page) === "start-serial");
  await page.keyboard.type("K-1\nR. Roe\n");
  await page.locator("body[data-phase=running]").waitFor();

  const kiosk = await bench.page();
  await kiosk.goto(`${server.url}kiosk`);
  await says(kiosk, "#serial", "K-1");
  await eventually(page, async () => parseInt(await page.locator("#done").innerText(), 10) >= 1);

  await tabTo(page, "Pause");
  await page.keyboard.press("Space");
  await says(page, "#state", "Paused");
  await says(kiosk, "#state", "Paused");
  await eventually(page, async () => await focused(page) === "resume");  // not lost on a button that is off

  // In the kiosk there is nothing to press, nothing that Tab reaches but what scrolls, and what its
  // page sends is refused, even with the token of the other page.
  for (const role of ["button", "textbox", "combobox", "checkbox", "dialog", "form", "navigation", "link"]) {
    const found = kiosk.getByRole(role, {includeHidden: true});
    assert.ok(await found.count() === 0 || role === "link", role);
  }
  assert.equal(await kiosk.locator("form, input, select, button, dialog, nav").count(), 0);
  const csrf = await page.evaluate(async () => (await (await fetch("/api/station")).json()).csrf);
  assert.match(csrf, /^[0-9a-f]{64}$/);
  const answers = await kiosk.evaluate(async (token) => {
    const own = await (await fetch("/api/station")).json();
    const headers = {"Content-Type": "application/json", "X-CSRF-Token": token};
    const order = await fetch("/api/order", {method: "POST", headers, body: '{"order":"resume"}'});
    const start = await fetch("/api/start", {method: "POST", headers, body: "{}"});
    return {own: [own.control, own.csrf, own.plans], order: order.status, start: start.status};
  }, csrf);
  assert.deepEqual(answers, {own: [false, null, []], order: 403, start: 403});
  assert.equal(kiosk.complaints.length, 2);  // the browser notes both refusals
  kiosk.complaints.length = 0;
  await says(kiosk, "#state", "Paused");
  assert.deepEqual(await nameless(kiosk), []);
  assert.deepEqual(await faint(kiosk), []);
  await keepPicture(kiosk, "kiosk-paused");

  await page.keyboard.press("Enter");  // Resume has the focus
  await says(page, "#state", /^(?!Paused).+$/);
  await eventually(page, async () => await focused(page) === "pause");
  await tabTo(page, "Stop…");
  await page.keyboard.press("Enter");
  const question = page.getByRole("dialog", {name: "Stop this run?"});
  await question.waitFor();
  await keepPicture(page, "confirm-stop");
  await page.keyboard.press("Enter");  // what is offered first is to go on
  await question.waitFor({state: "hidden"});
  assert.equal(await focused(page), "stop");
  await page.keyboard.press("Enter");
  await page.keyboard.press("Escape");
  await question.waitFor({state: "hidden"});
  assert.equal(await page.locator("body").getAttribute("data-phase"), "running");
  await page.keyboard.press("Enter");
  await tabTo(page, "Stop the run");
  await page.keyboard.press("Enter");
  await says(page, "#state", "Stopped");
  await says(kiosk, "#state", "Stopped");
  await page.getByRole("button", {name: "Start", exact: true}).waitFor();
});
