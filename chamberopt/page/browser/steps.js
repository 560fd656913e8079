// Following a command that the server runs: its steps as bars, and its printed lines.
import { ask, element } from "./state.js";

const EVERY = 500; // ms between looks at a command
const SHORT = 3; // s of a step before anything is said of its time

// Show each status of a command until its end, and give the last; `started` is by default that of the last command.
export async function followed(show, started) {
  let now = started ?? await ask("/status");
  if (!now.command) return null;
  document.body.dataset.ended = "";
  begun.clear();
  while (now.exit === null) {
    show(now);
    await new Promise((done) => { setTimeout(done, EVERY); });
    now = await ask("/status");
  }
  show(now);
  document.body.dataset.ended = String(now.exit);
  return now;
}

const inWords = (seconds) => seconds < 90 ? `${Math.ceil(seconds / 5) * 5} s` : `${Math.ceil(seconds / 60)} min`;

// The time that is left of a step, by its pace since the first of it was done; until then, for how long it has gone on.
// Of the item that is under way the part counts that the step within has done, once one item has told how much of that it takes.
const begun = new Map();
function time({ step, done, total }, within) {
  const now = performance.now() / 1000, begin = begun.get(step) ?? { since: now, done: 0 };
  const part = within?.total && done >= 1 ? within.done / within.total : 0, all = done + part;
  if (all < begin.done || !begin.done) Object.assign(begin, { done: all, at: now }); // compiling is no part of the pace
  begun.set(step, begin);
  if (now - begin.since < SHORT || (total && done >= total)) return "";
  const seconds = (now - begin.at) * (total - all) / (all - begin.done);
  if (!total || now - begin.at < SHORT || !(seconds < Infinity)) return `, for ${inWords(now - begin.since)} so far`;
  return `, ${all < total / 10 ? "roughly" : "about"} ${inWords(seconds)} left of this step`;
}

// For how long a command has worked.
export const sinceBegin = (seconds) => seconds < 120 ? `at work for ${seconds} s` : `at work for ${Math.floor(seconds / 60)} min ${seconds % 60} s`;

const words = (one, within, isWithin) => `${one.step}${one.total ? `: ${Math.floor(one.done)} of ${one.total}` : one.done ? `: ${Math.floor(one.done)} so far` : ""}${one.best === null ? "" : `, best ${Number(one.best.toPrecision(4))}`}${isWithin ? "" : time(one, within)}`;

// Forget the pace of steps that have ended: one of the same name may follow.
function forget(steps) {
  for (const step of begun.keys()) if (!steps.some((one) => one.step === step)) begun.delete(step);
}

// A command in stages as a line of its stage and what is being done of it, and a bar of the stages. Pilots of unlike lengths tell no time left.
let farthest = 0; // of the bar, which never goes back
export const stage = ([first, ...inner], at) => {
  const counted = inner.length > 1 && inner[0].total ? inner[0].done / inner[0].total : 0;
  if (at?.number === 1) farthest = 0;
  farthest = Math.max(farthest, at ? at.number - 1 + counted : 0);
  const words = inner.map(({ step, done, total }) => total ? `${step}: ${Math.floor(done)} of ${total}` : step).join(", ");
  return [element("div", {}, words ? `${first.step} (${words})` : first.step, Object.assign(element("progress"), at ? { max: at.count, value: farthest } : {}))];
};

export const bars = (steps) => {
  forget(steps);
  const first = steps.findIndex(({ total }) => total); // what is within a step of a known total may end before its own: that tells no time
  return steps.map((one, k) => element("div", {}, words(one, steps[k + 1], first >= 0 && k > first),
    Object.assign(element("progress"), one.total ? { max: one.total, value: one.done } : {})));
};
