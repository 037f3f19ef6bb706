// What the tests in the browser share: a station with its database as a process of its own, runs to
// show, and a real Chromium that looks at it.
//
// PLUMBLINE_SCREENSHOTS=DIR keeps pictures of the pages.
import assert from "node:assert/strict";
import {execFileSync, spawn, spawnSync} from "node:child_process";
import {once} from "node:events";
import {mkdtempSync, readFileSync, rmSync, writeFileSync} from "node:fs";
import {tmpdir} from "node:os";
import {join} from "node:path";
import {createInterface} from "node:readline";
import {setTimeout as sleep} from "node:timers/promises";
import {fileURLToPath} from "node:url";
import {chromium} from "playwright-core";

const binaries = process.env.PLUMBLINE_BINARY_DIR;
const sources = fileURLToPath(new URL("../..", import.meta.url));

// What a test uses, with a folder of its own; all of it is gone after the test, however that ends.
export class Bench {
  constructor(t) {
    this.folder = mkdtempSync(join(tmpdir(), "plumbline-browser-"));
    this.pages = [];
    this.children = new Set();
    t.after(() => this.clear());
  }

  async clear() {
    await this.browser?.close();
    // A run that was started from the page outlives its station; a test that failed leaves one.
    spawnSync(join(binaries, "plumbline"), ["ctl", "--db", join(this.folder, "runs.db"), "stop", "--wait"]);
    for (const child of this.children) child.kill("SIGKILL");
    rmSync(this.folder, {recursive: true, force: true, maxRetries: 5});
    assert.deepEqual(this.pages.flatMap((page) => page.complaints), []);
  }

  start(words) {
    const child = spawn(words[0], words.slice(1), {stdio: ["ignore", "pipe", "pipe"]});
    this.children.add(child);
    child.said = "";
    for (const stream of [child.stdout, child.stderr]) stream.on("data", (text) => { child.said += text; });
    child.ended = once(child, "close").then(([code]) => { this.children.delete(child); return code; });
    return child;
  }

  // `plumbline serve` over folder/runs.db.
  async serve(words, listen = "127.0.0.1:0") {
    const child = this.start([join(binaries, "plumbline"), "serve", "--db", join(this.folder, "runs.db"), "--listen", listen, ...words]);
    const [line] = await Promise.race([once(createInterface({input: child.stdout}), "line"), child.ended.then(() => [""])]);
    const url = line.match(/http:\/\/\S+/)?.[0];
    assert.ok(url, child.said);
    const stop = async () => {
      child.kill("SIGTERM");
      assert.equal(await child.ended, 0, child.said);
    };
    return {url, address: new URL(url).host, stop};
  }

  // Puts a run into folder/runs.db; see record_run.cpp.
  record(...words) {
    execFileSync(join(binaries, "record_run"), [this.folder, ...words.map(String)], {stdio: ["ignore", "ignore", "inherit"]});
  }

  // A page in Debian's browser. Everything that it complains of makes the test fail: errors on the
  // console, exceptions, what its security policy forbids.
  async page(options = {}) {
    this.browser ??= await chromium.launch({
      executablePath: "/usr/bin/chromium", chromiumSandbox: false,
      args: ["--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-gpu"],
    });
    const context = await this.browser.newContext({viewport: {width: 1280, height: 1000}, locale: "en", ...options});
    const page = await context.newPage();
    page.setDefaultTimeout(60000);
    page.complaints = [];
    page.stationMayBeGone = false;
    page.on("pageerror", (error) => page.complaints.push(String(error)));
    page.on("console", (message) => {
      if (message.type() !== "error") return;
      if (page.stationMayBeGone && message.text().includes("net::ERR_")) return;
      page.complaints.push(`${message.text()} (${message.location().url})`);
    });
    this.pages.push(page);
    return page;
  }

  // The example rig with fewer poses: 12 × 5 and 6 for verification. The watchdog is off: a machine that
  // is busy with a browser may be late for a drive that is in a hurry.
  writeRig() {
    let text = readFileSync(join(sources, "app/examples/rig.toml"), "utf8");
    const all = {
      "delta_deg = { start = 0, stop = 350, step = 10 }": "delta_deg = { start = 0, stop = 330, step = 30 }",
      "h_deg = { start = 0, stop = 80, step = 10 }": "h_deg = { start = 0, stop = 80, step = 20 }",
      "soak_s = 600": "soak_s = 60", "watchdog_ms = 3000": "watchdog_ms = 0",
      "samples_per_pose = 40": "samples_per_pose = 20", "verification_poses = 24": "verification_poses = 6",
    };
    for (const [from, to] of Object.entries(all)) {
      assert.ok(text.includes(from), from);
      text = text.replace(from, to);
    }
    writeFileSync(join(this.folder, "rig.toml"), text);
    return join(this.folder, "rig.toml");
  }
}

// Waits until look() gives something true; says what the page shows when it never does.
export async function eventually(page, look, limit_s = 60) {
  const end = Date.now() + 1000 * limit_s;
  for (;;) {
    const seen = await look();
    if (seen) return seen;
    if (Date.now() > end) assert.fail(`${look}\nthe page shows:\n${await page.locator("body").ariaSnapshot()}`);
    await sleep(50);
  }
}

// Waits until the element says exactly `text`, or what matches it.
export const says = (page, selector, text, limit_s = 60) => eventually(page, async () => {
  const found = page.locator(selector);
  if (await found.count() !== 1) return false;
  const said = (await found.innerText()).trim();
  return text instanceof RegExp ? text.test(said) : said === text;
}, limit_s);

export const focused = (page) => page.evaluate(() => document.activeElement?.id || document.activeElement?.tagName);

// What has no name that a screen reader could say, in the words of the accessibility tree.
export async function nameless(page) {
  const tree = await page.locator("body").ariaSnapshot();
  return tree.split("\n").filter((line) =>
    /^\s*- (button|link|textbox|searchbox|combobox|checkbox|img|form|dialog|region|navigation|progressbar|figure|group|table)(?! ")/.test(line));
}

// Texts whose contrast with what is behind them is below 4.5 (WCAG AA; 3 for large ones).
export const faint = (page) => page.evaluate(() => {
  const numbers = (colour) => colour.match(/[\d.]+/g).map(Number);
  const luminance = (rgb) => {
    const [r, g, b] = rgb.map((v) => v / 255).map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ground = (node) => {
    for (let at = node; at; at = at.parentElement) {
      const [r, g, b, a = 1] = numbers(getComputedStyle(at).backgroundColor);
      if (a === 1) return [r, g, b];
    }
    return [255, 255, 255];
  };
  const found = [];
  for (const node of document.querySelectorAll("body *")) {
    const own = [...node.childNodes].filter((child) => child.nodeType === 3).map((child) => child.data.trim()).join("");
    if (!own || !node.checkVisibility() || node.closest("svg, :disabled")) continue;
    const style = getComputedStyle(node);
    const [a, b] = [luminance(numbers(style.color).slice(0, 3)), luminance(ground(node))].sort((x, y) => y - x);
    const size = parseFloat(style.fontSize), large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
    const contrast = (a + 0.05) / (b + 0.05);
    if (contrast < (large ? 3 : 4.5)) found.push(`${own.slice(0, 40)}: ${contrast.toFixed(2)}`);
  }
  return found;
});

// What is wider than the box that it stands in, and so lies on something else or is cut off. What may
// be scrolled (a wide table) is meant to be wider.
export const overflowing = (page) => page.evaluate(() => {
  const found = document.documentElement.scrollWidth > innerWidth ? ["page"] : [];
  for (const e of document.querySelectorAll("body *")) {
    if (e.closest("svg, .sr, .skip, thead, option, select")) continue;
    const style = getComputedStyle(e);
    if (style.overflowX !== "visible" || style.display === "inline" || e.clientWidth === 0) continue;
    if (e.scrollWidth > e.clientWidth + 1) found.push(`${e.tagName} ${e.id} ${e.textContent.slice(0, 40)}`);
  }
  return found;
});

// In light and in dark.
export async function keepPicture(page, name) {
  const folder = process.env.PLUMBLINE_SCREENSHOTS;
  if (!folder) return;
  for (const colorScheme of ["dark", "light"]) {
    await page.emulateMedia({colorScheme});
    await sleep(400);
    await page.screenshot({path: join(folder, `${name}-${colorScheme}.png`), fullPage: true});
  }
}
