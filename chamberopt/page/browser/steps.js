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

// The time that is left of a step, from the pace since it was first seen; "" before a tenth is done.
const begun = new Map();
function left({ step, done, total }) {
  const now = performance.now() / 1000, first = begun.get(step);
  if (!first || done < first.done) begun.set(step, { done, at: now });
  if (!first || !total || done >= total || done <= first.done || done < total / 10) return "";
  const seconds = (now - first.at) * (total - done) / (done - first.done);
  return `, about ${seconds < 90 ? `${Math.ceil(seconds / 5) * 5} s` : `${Math.ceil(seconds / 60)} min`} left`;
}

// For how long a command has worked.
export const sinceBegin = (seconds) => seconds < 120 ? `at work for ${seconds} s` : `at work for ${Math.floor(seconds / 60)} min`;

// A command in stages as a line of its stage and what is being done of it, and a bar.
export const stage = ([first, ...inner]) => {
  const last = inner.at(-1), now = last ? ` (${last.step}${!last.total && last.done ? `: ${Math.floor(last.done)} so far` : ""})` : "";
  return [element("div", {}, `${first.step}${now}`, element("progress"))];
};

export const bars = (steps) => {
  for (const step of begun.keys()) if (!steps.some((one) => one.step === step)) begun.delete(step);
  return steps.map((one) => element("div", {},
    `${one.step}${one.total ? `: ${Math.floor(one.done)} of ${one.total}` : one.done ? `: ${Math.floor(one.done)} so far` : ""}${one.best === null ? "" : `, best ${one.best.toFixed(4)}`}${left(one)}`,
    Object.assign(element("progress"), one.total ? { max: one.total, value: one.done } : {})));
};
