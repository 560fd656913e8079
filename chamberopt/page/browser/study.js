// Following a study: its candidates as plots while it runs and afterwards, and each one's chamber in the view.
import { ask, attempt, change, element, say, show } from "./state.js";
import { followToEnd, running } from "./run.js";
import { Plot, parallel } from "./plots.js";
import { named } from "./words.js";

const EVERY = 2000; // ms between looks at a study
const find = (id) => document.getElementById(id);
const WORDS = { simulated: "simulated", missed: "misses a constraint", refused: "refused by geometry, not simulated",
  failed: "could not be simulated", confirmed: "confirmed with new seeds" };
let folder = "", data = null, model = null, chosen = null, pair = [], looking = 0;

export function followStudy(of) {
  folder = of;
  data = model = chosen = null;
  pair = [];
  find("study-title").textContent = folder;
  find("study-of").replaceChildren();
  find("tried").textContent = find("study-sentence").textContent = "";
  find("chosen-candidate").replaceChildren(element("p", { className: "soft", textContent: "Click a point to see its numbers, and its chamber above." }));
  find("study-view").hidden = false;
  look();
}

function close() {
  folder = "";
  clearTimeout(looking);
  find("study-view").hidden = true;
  show(null);
}
find("close-study").addEventListener("click", close);

// Look at the study, draw what is new, and look again until it has ended.
async function look() {
  clearTimeout(looking);
  const mine = folder;
  try {
    const now = await ask("/candidates", { folder: mine, seen: data?.version });
    if (mine !== folder) return;
    if (now.candidates) {
      data = prepared(now);
      find("tried").textContent = find("study-sentence").textContent = data.sentence;
      draw();
      model = await ask("/model", { folder: mine });
      if (mine !== folder) return;
      draw();
      document.body.dataset.followed = String(data.candidates.length);
    }
  } catch (error) {
    if (mine !== folder) return;
    find("study-sentence").textContent = running() === mine ? "No candidate yet." : error.message; // its folder is not there at once
  }
  const ours = running() === mine;
  find("study-stop").disabled = !ours;
  find("study-resume").disabled = Boolean(running()) || Boolean(data?.finished);
  find("study-more").disabled = Boolean(running()) || !data?.candidates.length;
  if (ours || (data && !data.finished)) looking = setTimeout(look, EVERY);
}

// Names of axes, tips and marks of the candidates.
function prepared(now) {
  const axes = now.varied.map((one) => ({ ...one, label: named(one.name) }));
  for (const one of now.candidates) {
    const figure = one.objective ? `: ${short(one.objective[0])}${one.objective[1] ? ` ± ${short(one.objective[1])}` : ""}` : "";
    one.tip = [`candidate ${one.number}, ${WORDS[one.kind]}${figure}`, ...axes.map(({ name, label }) => `${label}: ${one.values[name]}`)].join("\n");
    one.mark = { colour: now.colours[one.is_start ? "start" : one.kind], cross: !["simulated", "confirmed"].includes(one.kind) };
  }
  return { ...now, axes };
}
const short = (x) => String(Number(x.toPrecision(4)));
const mark = (one) => ({ ...one.mark, ring: one.number === chosen ? "#1c2226" : one.is_start ? data.colours.start : "" });

function draw() {
  const wide = Math.max(320, find("study-of").clientWidth), narrow = wide < 520 ? wide : Math.min(400, wide / 2 - 5);
  const { candidates, axes, objectives: [objective, second], colours } = data, [low, high] = data.range;
  const searched = candidates.filter((one) => one.kind !== "confirmed"), y = { low, high, label: objective };
  const figure = (caption, ...inner) => element("figure", {}, element("figcaption", { textContent: caption }), ...inner);
  const last = candidates.length + 0.5;

  const order = new Plot({ width: wide, height: 220, x: { low: 0.5, high: last, label: "candidate", whole: true }, y, title: "objective of each candidate" });
  order.steps(data.best, last, colours.simulated);
  for (const one of candidates) order.candidate(one, one.number, one.objective, mark(one));
  const legend = Object.entries(WORDS).filter(([kind]) => candidates.some((one) => one.kind === kind)).map(([kind, text]) => [colours[kind], kind === "simulated" || kind === "confirmed" ? "●" : "✕", text]);
  const parts = [figure("Every candidate in its order, with its 95 % interval; the line is the best so far, as searched.", order.drawing,
    element("ul", { className: "marks" }, ...[[colours.start, "●", "the start"], ...legend].map(([colour, sign, text]) => {
      const item = element("li", { textContent: text }), patch = element("b", { textContent: sign });
      patch.style.color = colour;
      item.prepend(patch, " ");
      return item;
    })))];

  const shares = new Map((model?.shares ?? []).map(([name, share, text]) => [name, [share, text]]));
  const sorted = axes.toSorted((a, b) => (shares.get(b.name)?.[0] ?? 0) - (shares.get(a.name)?.[0] ?? 0));
  parts.push(element("h3", { textContent: "Over each number" }), element("p", { className: "soft", textContent: model === null ? "The model is being fitted …" : model.reason
    || `The curve is the model's, the other numbers as in candidate ${model.best}, with its 95 % band; none where the evaluations do not support it. The share is that of the objective's variance over the bounds.` }),
  element("div", { className: "slices" }, ...sorted.map((axis) => {
    const plot = new Plot({ width: narrow, height: 220, x: axis, y, title: `objective over ${axis.label}` });
    if (!axis.texts.length) plot.curve(model?.slices?.[axis.name] ?? [], colours.model);
    for (const one of searched) plot.candidate(one, one.values[axis.name], one.objective, mark(one));
    const share = shares.get(axis.name);
    return figure(share ? `${axis.label}: ${share[1]} of the variance alone` : axis.label, plot.drawing);
  })));

  if (axes.length > 1) {
    const [a, b] = ["across", "upwards"].map((id, k) => {
      const select = element("select", { id }, ...sorted.map((one) => element("option", { value: one.name, textContent: one.label })));
      select.value = pair[k] ?? sorted[k].name;
      select.addEventListener("change", () => { pair[k] = select.value; draw(); });
      return select;
    });
    const axisOf = (select) => axes.find((one) => one.name === select.value);
    const plot = new Plot({ width: wide, height: 300, x: axisOf(a), y: axisOf(b), title: "candidates over two numbers" });
    for (const one of searched) plot.candidate(one, one.values[a.value], [one.values[b.value], 0], { ...mark(one), colour: colourOf(one) });
    parts.push(element("h3", { textContent: "Over two numbers" }), element("p", {}, "across ", a, " upwards ", b), figure("Coloured by the objective; a cross was not simulated, or misses a constraint.", plot.drawing, colourBar()),
      element("h3", { textContent: "All numbers" }), figure("A line for each candidate, coloured by the objective; dashed: not simulated.",
        parallel({ width: wide, height: 260, axes, candidates: searched, colourOf }), colourBar()));
  }
  if (second) {
    const range = (k) => searched.flatMap((one) => (k ? one.second : one.objective)?.[0] ?? []);
    const axis = (k, label) => ({ low: Math.min(...range(k)), high: Math.max(...range(k)), label });
    if (range(1).length > 1) {
      const plot = new Plot({ width: wide, height: 300, x: axis(0, objective), y: axis(1, second), title: "one objective against the other" });
      const on = data.front.map((number) => candidates[number - 1]);
      plot.line(on.map((one) => [one.objective[0], one.second[0]]), colours.confirmed, { "stroke-dasharray": "5 3" });
      for (const one of searched) if (one.second) plot.candidate(one, one.objective[0], one.second, mark(one));
      parts.push(element("h3", { textContent: "The Pareto front" }), figure("One objective against the other; the line joins the candidates that no other beats in both, as searched.", plot.drawing));
    }
  }
  if (model?.check?.rows?.length) {
    const rows = model.check.rows, ends = rows.flatMap(([, value, told, half]) => [value, told - half, told + half]);
    const both = { low: Math.min(...ends), high: Math.max(...ends) };
    const plot = new Plot({ width: narrow, height: 320, x: { ...both, label: `simulated: ${objective}` }, y: { ...both, label: `by the others: ${objective}` }, title: "check of the model" });
    plot.line([[both.low, both.low], [both.high, both.high]], colours.missed);
    for (const [number, value, told, half] of rows) plot.candidate(candidates[number - 1], value, [told, half], mark(candidates[number - 1]));
    parts.push(element("h3", { textContent: "How good the model is" }), figure(model.check.sentence, plot.drawing));
  }
  find("study-of").replaceChildren(...parts);
}

// Colour of a candidate by its objective, along the values that the search has met.
function colourOf(one) {
  if (!one.objective) return data.colours.refused;
  const [low, high] = ends(), share = high > low ? (one.objective[0] - low) / (high - low) : 0.5, scale = data.colours.scale;
  return scale[Math.round(share * (scale.length - 1))];
}
function ends() {
  const values = data.candidates.flatMap((one) => one.kind === "confirmed" ? [] : one.objective?.[0] ?? []);
  return [Math.min(...values), Math.max(...values)];
}
function colourBar() {
  const [low, high] = ends(), bar = element("i");
  bar.style.background = `linear-gradient(to right, ${data.colours.scale.join(", ")})`;
  return element("p", { className: "colours soft" }, Number.isFinite(low) ? short(low) : "", bar, Number.isFinite(high) ? short(high) : "", ` ${data.objectives[0]}`);
}

let drawn = 0;
new ResizeObserver(() => {
  if (drawn === find("study-of").clientWidth) return;
  drawn = find("study-of").clientWidth;
  if (data && folder) draw();
}).observe(find("study-of"));

find("study-of").addEventListener("click", (event) => {
  const one = event.target.closest("[data-number]");
  if (one) attempt(() => choose(Number(one.dataset.number)));
});
find("study-view").addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key], next = (chosen ?? 0) + step;
  if (step && data && next >= 1 && next <= data.candidates.length && event.target.tagName !== "SELECT" && event.target.tagName !== "INPUT") attempt(() => choose(next));
});

// List a candidate's numbers and figures, and show its chamber.
async function choose(number) {
  chosen = number;
  draw();
  const one = await ask("/candidate", { folder, number });
  if (number !== chosen) return;
  const rows = (pairs) => element("table", {}, ...pairs.map(([name, text]) => element("tr", {}, element("th", { textContent: name }), element("td", { textContent: text }))));
  const take = element("button", { id: "take", textContent: "Take these numbers into the design" });
  take.addEventListener("click", () => { change(one.values); say("taken: save the design, or undo", true); });
  const other = one.differs.length ? [element("p", { className: "warning", textContent: `The open design is not the one of this study: it differs in ${one.differs.slice(0, 4).map(named).join(", ")}${one.differs.length > 4 ? ` and ${one.differs.length - 4} more` : ""}. The chamber shown is that of the open design with these numbers.` })] : [];
  find("chosen-candidate").replaceChildren(element("h3", { textContent: `Candidate ${number}` }),
    element("p", { textContent: `${WORDS[one.kind]}${one.reason ? `: ${one.reason}` : ""}` }), ...other,
    rows(Object.entries(one.values).map(([name, value]) => [named(name), String(value)])), element("p", {}, take), rows(one.figures));
  document.body.dataset.candidate = String(number);
  show(one.values, `candidate ${number} is shown`);
}

find("study-stop").addEventListener("click", () => attempt(() => ask("/stop", {})));
find("study-resume").addEventListener("click", () => attempt(async () => goOn(await ask("/resume", { folder }))));
find("study-more").addEventListener("click", () => attempt(async () => {
  goOn(await ask("/more", { folder, evaluations: Number(find("more-evaluations").value) }));
}));
const goOn = (started) => { look(); return followToEnd(started); };
document.addEventListener("running", ({ detail }) => { if (detail !== folder) followStudy(detail); });
