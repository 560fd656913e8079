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

// A command in stages as a list of them with what is being done, and a bar of their usual shares of the time.
const SHARES = [3, 1, 3, 4, 2, 4, 1]; // of a proposal with pilots; measured, as what follows
const TIMES = [4, 15]; // all stages over the first, which reads the part: a fillet of a bracket took 6 times, those of a shaft 14
let farthest = 0, inner = []; // of the bar, which never goes back; steps that were seen within the stage
export const stage = ([first, ...within], at, seconds) => {
  if (!at) return first ? [element("div", {}, first.step, element("progress"))] : [];
  if (inner.of !== at.number) {
    if (at.number === 1) farthest = 0;
    inner = Object.assign([], { of: at.number });
  }
  for (const { step } of within) if (!inner.includes(step)) inner.push(step);
  const counted = within.find(({ total }) => total), share = (k) => at.count === SHARES.length ? SHARES[k] : 1;
  const done = counted ? counted.done / counted.total : 1 - 0.7 ** inner.length;
  const sum = (count) => Array.from({ length: count }, (_, k) => share(k)).reduce((a, b) => a + b, 0);
  farthest = Math.max(farthest, sum(at.number - 1) + share(at.number - 1) * Math.min(done, 0.95));
  const words = within.map(({ step, done: now, total }) => total ? `${step}: ${Math.floor(now)} of ${total}` : step).join(", ");
  const took = (k) => { // stages may be skipped
    const next = Math.min(...Object.keys(at.began).map(Number).filter((number) => number > k + 1));
    return k + 1 in at.began ? `, ${inWords(at.began[next] - at.began[k + 1])}` : ", not needed";
  };
  const items = at.names.map((name, k) => element("li", { className: k + 1 < at.number ? "done" : k + 1 === at.number ? "now" : "" },
    name, k + 1 < at.number ? took(k) : "", ...(k + 1 === at.number && words ? [element("small", { textContent: ` ${words}` })] : [])));
  return [element("div", {}, element("progress", { max: sum(at.count), value: farthest }), left(at, seconds)), element("ol", { className: "stages" }, ...items)];
};

// The time that is left by how long the first stage took.
function left({ count, began }, seconds) {
  if (count !== SHARES.length) return "";
  if (!began[2]) return " how long it takes is told once the part is read";
  const [least, most] = TIMES.map((times) => times * began[2] - seconds);
  if (most <= 0) return "";
  return least < 10 ? ` less than ${inWords(most)} left, usually` : ` ${inWords(least)} to ${inWords(most)} left, usually`;
}

export const bars = (steps) => {
  forget(steps);
  const first = steps.findIndex(({ total }) => total); // what is within a step of a known total may end before its own: that tells no time
  return steps.map((one, k) => element("div", {}, words(one, steps[k + 1], first >= 0 && k > first),
    Object.assign(element("progress"), one.total ? { max: one.total, value: one.done } : {})));
};
