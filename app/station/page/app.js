// Connection to the station and the choice of the view. Everything shown comes from the server, so
// a reload loses nothing.
import {ask, id} from "/common.js";
import {showLive, startLive} from "/live.js";

const kiosk = document.documentElement.dataset.view === "kiosk";
const link = id("link");
const views = ["live", "runs", "units"];

async function showView() {
  if (kiosk) return;  // has one view only
  const asked = location.hash.slice(1);
  const view = views.includes(asked) ? asked : "live";
  for (const name of views) {
    id(`view-${name}`).hidden = name !== view;
    const tab = document.querySelector(`[data-tab="${name}"]`);
    if (name === view) tab.setAttribute("aria-current", "page"); else tab.removeAttribute("aria-current");
  }
  const history = await import("/history.js");
  if (view === "runs") history.showRuns();
  if (view === "units") history.showUnits();
  if (view === "live") window.dispatchEvent(new Event("resize"));
}

function connected(yes, how = "") {
  link.textContent = yes ? how : "No connection to the station – trying again";
  link.classList.toggle("lost", !yes);
  document.body.dataset.link = yes ? "up" : "down";
}

// Messages as they come; where the station serves no further stream, asked for every two seconds.
let source = null;
let poll = 0;
function follow() {
  source?.close();
  clearTimeout(poll);
  source = new EventSource("/api/stream");
  let opened = false;
  source.onopen = () => { opened = true; connected(true, "live"); startLive(); };
  source.onmessage = (event) => showLive(JSON.parse(event.data));
  source.onerror = () => {
    const refused = source.readyState === EventSource.CLOSED;
    if (refused || !opened) {
      source.close();
      pollOnce();
    } else {
      connected(false);  // the browser tries again by itself
    }
  };
}

let polls = 0;
async function pollOnce() {
  try {
    showLive(await ask("/api/live"));
    connected(true, "live, every 2 s");
    if (polls === 0) startLive();
  } catch {
    connected(false);
    polls = -1;
  }
  // From time to time a place may have become free.
  if (++polls % 15 === 0 && polls >= 0) { poll = setTimeout(follow, 2000); return; }
  poll = setTimeout(pollOnce, 2000);
}

window.addEventListener("hashchange", showView);
showView();
follow();
if (!kiosk) import("/control.js");
