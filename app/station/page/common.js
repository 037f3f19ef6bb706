// What several parts of the page need: elements, questions to the station, numbers as they are shown.

export const id = (name) => document.getElementById(name);

export function element(tag, content = "", attributes = {}) {
  const node = document.createElement(tag);
  if (content instanceof Node) node.append(content); else node.textContent = content;
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  return node;
}

// A cell that still says what it is where a narrow screen shows no heading above it.
export const cell = (name, content) => element("td", content, {"data-name": name});

export async function ask(path, options) {
  const reply = await fetch(path, options);
  if (reply.status === 401) location.reload();
  if (!reply.ok) {
    let why = `${reply.status}`;
    try { why = (await reply.clone().json()).error ?? why; } catch { why = (await reply.text()).trim() || why; }
    throw Object.assign(new Error(why), {status: reply.status});
  }
  return reply.json();
}

// What is drawn by script is drawn anew when the page's size or colours change.
export function whenLooksChange(draw) {
  window.addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}

const decisions = {
  pass: ["PASS", "good"], conditional_pass: ["CONDITIONAL PASS", "warn"],
  conditional_fail: ["CONDITIONAL FAIL", "warn"], fail: ["FAIL", "bad"], none: ["NO LIMIT STATED", "none"],
};
// A decision in words, and the class of its colours.
export const decisionWords = (decision) => decisions[decision] ?? [decision, "none"];

const minus = (text) => text.replaceAll("-", "−");
// The place of U's second digit.
const places = (U) => Math.min(12, Math.max(0, 1 - Math.floor(Math.log10(U))));

// A value to that place.
export const rounded = (value, U) => minus(U > 0 ? value.toFixed(places(U)) : String(value));

export function uncertain(value, U) {
  if (!Number.isFinite(value)) return "–";
  return U > 0 ? `${rounded(value, U)} ± ${rounded(U, U)}` : rounded(value, U);
}

// In thousandths with so many digits, never as a power of ten.
export function milli(value, digits) {
  if (typeof value !== "number") return "–";
  const large = Math.abs(value * 1000) >= 10 ** digits;
  return minus(large ? (value * 1000).toFixed(0) : (value * 1000).toPrecision(digits));
}

// "K_xy" with its index below the line, and its unit.
export function symbol(name, unit) {
  const node = element("span");
  const [letter, index] = name.startsWith("U0_") ? ["U", `0${name.slice(3)}`] : name.split("_");
  node.append(letter, element("sub", index), ` / ${unit.includes("/") ? `(${unit})` : unit}`);
  return node;
}
