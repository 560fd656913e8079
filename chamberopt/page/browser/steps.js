// Following a command that the server runs: its steps as bars, and its printed lines.
import { ask, element } from "./state.js";

const EVERY = 500; // ms between looks at a command

// Show each status of a command until its end, and give the last; `started` is by default that of the last command.
export async function followed(show, started) {
  let now = started ?? await ask("/status");
  if (!now.command) return null;
  document.body.dataset.ended = "";
  while (now.exit === null) {
    show(now);
    await new Promise((done) => { setTimeout(done, EVERY); });
    now = await ask("/status");
  }
  show(now);
  document.body.dataset.ended = String(now.exit);
  return now;
}

export const bars = (steps) => steps.map((step) => element("div", {},
  `${step.step}${step.total ? `: ${step.done} of ${step.total}` : ""}${step.best === null ? "" : `, best ${step.best.toFixed(4)}`}`,
  Object.assign(element("progress"), step.total ? { max: step.total, value: step.done } : {})));
