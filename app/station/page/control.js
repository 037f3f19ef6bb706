// Orders and the form that starts runs. Not part of the kiosk view.
import {ask, id} from "/common.js";
import {newest} from "/live.js";

let station = null;

async function look() {
  try {
    station = await ask("/api/station");
  } catch {
    return;
  }
  const select = id("start-plan");
  if (select.length !== station.plans.length) {
    select.replaceChildren(...station.plans.map((plan) => new Option(plan, plan)));
  }
  id("start-golden").hidden = !station.golden;
  id("start-golden").textContent = `Golden unit ${station.golden}`;
  arrange();
}

let phase = "";
let status = null;
let run = null;
function arrange() {
  const control = station?.control ?? false;
  const running = phase === "running";
  const wasHidden = id("start").hidden;
  id("orders").hidden = !(control && running);
  id("start").hidden = !control || station.plans.length === 0 || running || phase === "calculating" || Boolean(station.last_start?.running);
  // A scanner types the serial number and Enter.
  if (wasHidden && !id("start").hidden) id("start-serial").focus();
  const focused = document.activeElement;
  id("pause").disabled = status?.state === "paused" || status?.pause_requested !== "none";
  id("resume").disabled = status?.state !== "paused" && status?.pause_requested === "none";
  // The focus would be lost on a button that is off; the other one is what may be wanted next.
  if (focused === id("pause") && focused.disabled) id("resume").focus();
  if (focused === id("resume") && focused.disabled) id("pause").focus();
  const unfinished = control && Boolean(run?.id) && ["interrupted", "stopped", "failed"].includes(phase)
    && station.resumable.length > 0 && !station.last_start?.running;
  id("unfinished").hidden = !unfinished;
  if (unfinished) id("go-on").textContent = `Go on with run ${run.id} of ${run.serial}`;
  const failed = station?.last_start?.message;
  if (failed && !running) id("start-answer").textContent = `The last start ended: ${failed}`;
}

async function act(path, order, answer) {
  answer.textContent = "";
  for (let attempt = 0; attempt < 2; ++attempt) {
    try {
      await ask(path, {
        method: "POST",
        headers: {"Content-Type": "application/json", "X-CSRF-Token": station.csrf},
        body: JSON.stringify(order),
      });
      return true;
    } catch (error) {
      // The station was started anew since this page was loaded: its token is another one now.
      if (error.status === 403 && attempt === 0) { await look(); continue; }
      answer.textContent = error.message;
      return false;
    }
  }
  return false;
}

id("pause").addEventListener("click", () => act("/api/order", {order: "pause"}, id("order-answer")));
id("resume").addEventListener("click", () => act("/api/order", {order: "resume"}, id("order-answer")));
const dialog = id("confirm-stop");
id("stop").addEventListener("click", () => dialog.showModal());
dialog.addEventListener("close", () => {
  if (dialog.returnValue === "yes") act("/api/order", {order: "stop"}, id("order-answer"));
  dialog.returnValue = "";
});

// The scanner's Enter goes to the next field that is empty; the last one starts.
id("start").addEventListener("keydown", (event) => {
  if (event.key !== "Enter" || event.target.tagName !== "INPUT") return;
  const empty = [...id("start").querySelectorAll("input")].find((input) => !input.value.trim());
  if (!empty) return;
  event.preventDefault();
  empty.focus();
});
id("start").addEventListener("submit", async (event) => {
  event.preventDefault();
  const order = {
    serial: id("start-serial").value.trim(), operator: id("start-operator").value.trim(), plan: id("start-plan").value,
  };
  localStorage.setItem("operator", order.operator);
  if (await act("/api/start", order, id("start-answer"))) {
    id("start-serial").value = "";
    await look();
  }
});
// The golden unit is measured like any other, only more often.
id("start-golden").addEventListener("click", () => {
  id("start-serial").value = station.golden;
  (id("start-operator").value.trim() ? id("start-go") : id("start-operator")).focus();
});
id("go-on").addEventListener("click", async () => {
  const operator = id("start-operator").value.trim();
  if (!operator) {
    id("go-on-answer").textContent = "Who measures? Fill in the operator below.";
    id("start-operator").focus();
    return;
  }
  const chosen = id("start-plan").value;
  const plan = station.resumable.includes(chosen) ? chosen : station.resumable[0];
  if (await act("/api/start", {serial: run.serial, operator, plan, resume: true}, id("go-on-answer"))) await look();
});
id("start-operator").value = localStorage.getItem("operator") ?? "";

function take(message) {
  const other = phase !== message.phase;
  ({phase, status, run} = message);
  if (other) look(); else arrange();
}
window.addEventListener("live", (event) => take(event.detail));
setInterval(() => { if (station?.last_start?.running) look(); }, 1000);
// What came before this part of the page was loaded; where nothing goes on, nothing more may come.
if (newest()) take(newest()); else look();
