// Following a study: its candidates as plots while it runs and afterwards, and each one's chamber in the view.
import { ask, attempt, change, element, onPage, say, show } from "../state.js";
import { followToEnd, isStoppedNow, running, stop } from "../run.js";
import { Plot, parallel } from "./plots.js";

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
  find("study-same").hidden = true;
  find("tried").textContent = find("study-sentence").textContent = "";
  find("chosen-candidate").replaceChildren(element("p", { className: "soft", textContent: "Click a point to see its numbers, and its chamber in the view." }));
  find("study-view").hidden = false;
  find("study-view").scrollTop = 0;
  look();
}

function toStudy(other) {
  const button = element("button", { type: "button", textContent: other });
  button.addEventListener("click", () => followStudy(other));
  return button;
}

function closeStudy() {
  folder = "";
  clearTimeout(looking);
  find("study-view").hidden = true;
  if (running()) find("tried").textContent = "The tab Run shows its candidates again."; // a count would be of the past
  show(null);
}
find("close-study").addEventListener("click", closeStudy);
// A study takes the place of a tab; the one that runs is seen again from the tab where it was begun.
for (const tab of document.querySelectorAll("nav button")) tab.addEventListener("click", () => {
  if (tab.dataset.tab === "run" && running()) { if (folder !== running()) followStudy(running()); }
  else if (folder) closeStudy();
});
find("study-result").addEventListener("click", () => attempt(async () => {
  const best = data.candidates.find((one) => one.is_best);
  if (best) await choose(best.number); // so that its numbers stand beside its result
  document.dispatchEvent(new CustomEvent("result", { detail: folder }));
}));

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
      find("study-same").hidden = !data.same.length;
      find("study-same").replaceChildren("Other candidates for the same question are in ", ...data.same.flatMap((other) => [toStudy(other), " "]));
      draw();
      model = await ask("/model", { folder: mine }).catch(({ message }) => ({ reason: message })); // its design may be elsewhere
      if (mine !== folder) return;
      draw();
      document.body.dataset.followed = String(data.candidates.length);
    }
  } catch (error) {
    if (mine !== folder) return;
    find("study-sentence").textContent = running() === mine ? "No candidate yet." : error.message; // its folder is not there at once
  }
  const ours = running() === mine;
  find("study-progress").hidden = !ours;
  find("study-stop").disabled = !ours || isStoppedNow();
  find("study-resume").disabled = Boolean(running()) || Boolean(data?.finished);
  find("study-result").disabled = !data?.finished;
  find("study-more").disabled = Boolean(running()) || !data?.candidates.length;
  if (ours || (data && !data.finished)) looking = setTimeout(look, EVERY);
}

// Names of axes, tips and marks of the candidates.
function prepared(now) {
  const axes = now.varied;
  for (const one of now.candidates) {
    one.tip = [`candidate ${one.name}, ${WORDS[one.kind]}${one.told && `: ${one.told}`}`, ...axes.map(({ name, label }) => `${label}: ${one.values[name]}`)].join("\n");
    one.mark = { colour: now.colours[one.is_start ? "start" : one.kind], cross: isCross(one.kind) };
  }
  return { ...now, axes };
}
const BEST = "#b3261e"; // ring round the best
const isCross = (kind) => !["simulated", "confirmed"].includes(kind);
const short = (x) => String(Number(x.toPrecision(3)));
const mark = (one) => ({ ...one.mark, ring: one.number === chosen ? "#1c2226" : one.is_best ? BEST : "" });

// Width of a plot [px]: that of the panel, or half of it.
const wide = () => Math.max(240, find("study-of").clientWidth);
const half = () => wide() < 520 ? wide() : Math.min(400, wide() / 2 - 5);
const searched = () => data.candidates.filter((one) => one.kind !== "confirmed");
const objectiveAxis = () => ({ low: data.range[0], high: data.range[1], label: data.objectives[0] });
const title = (text) => element("h3", { textContent: text });
const soft = (text) => element("p", { className: "soft", textContent: text });
const figure = (caption, ...inner) => element("figure", {}, element("figcaption", { textContent: caption }), ...inner);

function draw() {
  if (!data.candidates.length) return find("study-of").replaceChildren(soft("No chamber is simulated yet: the plots begin with the first."));
  const shares = new Map((model?.shares ?? []).map(([name, share, text]) => [name, { share, text }]));
  const axes = data.axes.toSorted((a, b) => (shares.get(b.name)?.share ?? 0) - (shares.get(a.name)?.share ?? 0));
  const before = find("study-of").querySelector(".rows")?.scrollTop ?? 0;
  find("study-of").replaceChildren(...inOrder(), table(), ...overEach(axes, shares), ...(axes.length > 1 ? [...overTwo(axes), ...overAll()] : []),
    ...(data.objectives.length > 1 ? front() : []), ...(model?.check?.rows?.length ? check() : []));
  const rows = find("study-of").querySelector(".rows"), row = rows.querySelector("tr.chosen"), foot = before + rows.clientHeight;
  const isSeen = !row || (row.offsetTop - rows.querySelector("thead").offsetHeight >= before && row.offsetTop + row.offsetHeight <= foot);
  rows.scrollTop = isSeen ? before : row.offsetTop - rows.clientHeight / 2;
}

// Every candidate as a row, a confirmation below the candidate that it confirms.
function table() {
  const cells = (tag, texts) => texts.map((one) => element(tag, {}, ...[one].flat()));
  const rows = data.candidates.toSorted((a, b) => a.of - b.of || a.number - b.number).map((one) => {
    const row = element("tr", { className: [one.number === chosen && "chosen", one.is_best && "best"].filter(Boolean).join(" ") },
      ...cells("td", [one.name, ...data.axes.map(({ name }) => String(one.values[name] ?? "")), one.told, [[one.standing, one.is_start ? "" : WORDS[one.kind]].filter(Boolean).join(", "), ...(one.reason.length ? [": ", ...onPage(one.reason)] : [])]]));
    row.dataset.number = one.number;
    return row;
  });
  const head = element("tr", {}, ...cells("th", ["", ...data.axes.map(({ label }) => label), data.objectives[0], ""]));
  return element("div", { className: "rows" }, element("table", {}, element("thead", {}, head), element("tbody", {}, ...rows)));
}

function inOrder() {
  const { candidates, colours } = data, last = Math.max(...candidates.map((one) => one.of)) + 0.5;
  const plot = new Plot({ width: wide(), height: 220, x: { low: 0.5, high: last, label: "candidate", whole: true }, y: objectiveAxis(), title: "objective of each candidate" });
  plot.steps(data.best, last, colours.simulated);
  for (const one of candidates) plot.candidate(one, one.of === one.number ? one.of : one.of + 0.2, one.objective, mark(one));
  const kinds = Object.keys(WORDS).filter((kind) => candidates.some((one) => one.kind === kind));
  const best = candidates.filter((one) => one.is_best).map((one) => [BEST, false, `ring: ${one.standing}, candidate ${one.name}`]);
  const marks = [...best, [colours.start, false, "the start"], ...kinds.map((kind) => [colours[kind], isCross(kind), WORDS[kind]])];
  return [figure("Every candidate in its order, with its 95 % interval, hollow where it is not resolved; the line is the best so far, as searched. What is confirmed stands beside its candidate.", plot.drawing,
    element("ul", { className: "marks" }, ...marks.map(([colour, cross, text]) => {
      const sign = element("b", { textContent: cross ? "✕" : colour === BEST ? "○" : "●" });
      sign.style.color = colour;
      return element("li", {}, sign, ` ${text}`);
    })))];
}

function overEach(axes, shares) {
  const said = !model ? "The model is being fitted …" : model.reason || `The curve is the model's, the other numbers as in candidate ${model.best}, with its 95 % band; `
    + "there is none where the evaluations do not support it. The share is that of the objective's variance over the bounds.";
  return [title("Over each number"), soft(said), element("div", { className: "slices" }, ...axes.map((axis) => {
    const plot = new Plot({ width: half(), height: 220, x: axis, y: objectiveAxis(), title: `objective over ${axis.label}` });
    if (!axis.texts.length) plot.curve(model?.slices?.[axis.name] ?? [], data.colours.model);
    for (const one of searched()) plot.candidate(one, one.values[axis.name], one.objective, mark(one));
    const known = shares.get(axis.name);
    const drawn = figure(known ? `${axis.label}: ${known.text} of the variance alone` : axis.label, plot.drawing);
    drawn.style.width = `${half()}px`; // a long caption is broken
    return drawn;
  }))];
}

function overTwo(axes) {
  const selects = [0, 1].map((k) => {
    const select = element("select", { id: ["across", "upwards"][k] }, ...axes.map((one) => element("option", { value: one.name, textContent: one.label })));
    select.value = pair[k] ?? axes[k].name;
    select.addEventListener("change", () => { pair[k] = select.value; draw(); });
    return select;
  });
  const [x, y] = selects.map((select) => axes.find((one) => one.name === select.value));
  const plot = new Plot({ width: wide(), height: 300, x, y, title: "candidates over two numbers" });
  for (const one of searched()) plot.candidate(one, one.values[x.name], [one.values[y.name], 0], { ...mark(one), colour: colourOf(one) });
  return [title("Over two numbers"), element("p", {}, "across ", selects[0], " upwards ", selects[1]),
    figure("Coloured by the objective; a cross was not simulated, or misses a constraint.", plot.drawing, colourBar())];
}

function overAll() {
  const [low, high] = ends(), isKnown = Number.isFinite(low), objective = { name: "objective", label: data.objectives[0], low, high };
  const valueOf = (one, name) => name !== "objective" ? one.values[name] : one.objective ? one.objective[0] : "none";
  const lines = parallel({ width: wide(), height: 260, axes: [...isKnown ? [objective] : [], ...data.axes], candidates: searched(), valueOf, colourOf, chosen });
  return [title("All numbers"), figure("A line for each candidate, coloured by the objective; dashed: not simulated.", lines, colourBar())];
}

function front() {
  const both = searched().filter((one) => one.second);
  if (both.length < 2) return [];
  const axis = (k, values) => ({ name: data.objectives[k], label: data.objectives[k], low: Math.min(...values), high: Math.max(...values), most: data.most[k] });
  const plot = new Plot({ width: wide(), height: 300, x: axis(0, both.map((one) => one.objective[0])), y: axis(1, both.map((one) => one.second[0])), title: "one objective against the other" });
  plot.line(data.front.map((number) => data.candidates[number - 1]).map((one) => [one.objective[0], one.second[0]]), data.colours.confirmed, { "stroke-dasharray": "5 3" });
  for (const one of both) plot.candidate(one, one.objective[0], one.second, mark(one));
  return [title("The Pareto front"), figure("One objective against the other; the line joins the candidates that no other beats in both, as searched.", plot.drawing)];
}

function check() {
  const rows = model.check.rows, ends = rows.flatMap(([, value, told, within]) => [value, told - within, told + within]);
  const low = Math.min(...ends), high = Math.max(...ends), [objective] = data.objectives;
  const plot = new Plot({ width: half(), height: 320, x: { low, high, label: `${objective}, simulated` }, y: { low, high, label: "by the other candidates" }, title: "check of the model" });
  plot.line([[low, low], [high, high]], data.colours.missed);
  for (const [number, value, told, within] of rows) plot.candidate(data.candidates[number - 1], value, [told, within], mark(data.candidates[number - 1]));
  return [title("How good the model is"), figure(model.check.sentence, plot.drawing)];
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
  const taking = (id, textContent, values) => {
    const button = element("button", { id, textContent });
    button.addEventListener("click", () => { change(values); say("taken: save the design, or undo", true); });
    return button;
  };
  const take = taking("take", "Take these numbers into the design", one.values), [time] = Object.values(one.time);
  const timed = time ? [" ", taking("take-time", `Take them with ${time} s of peening, which suit its time to 98 %`, { ...one.values, ...one.time })] : [];
  const other = one.differs.length ? [element("p", { className: "warning", textContent: `The open design is not the one of this study: it differs in ${one.differs.slice(0, 4).join(", ")}${one.differs.length > 4 ? ` and ${one.differs.length - 4} more` : ""}. The chamber shown is that of the open design with these numbers.` })] : [];
  find("chosen-candidate").replaceChildren(element("h3", { textContent: `Candidate ${data.candidates[number - 1].name}` }),
    element("p", {}, WORDS[one.kind], ...(one.reason.length ? [": ", ...onPage(one.reason)] : [])), ...other,
    rows(one.numbers), element("p", {}, take, ...timed), rows(one.figures));
  document.body.dataset.candidate = String(number);
  show(one.values, `candidate ${data.candidates[number - 1].name} is shown`);
}

find("study-stop").addEventListener("click", stop);
find("study-resume").addEventListener("click", () => attempt(async () => goOn(await ask("/resume", { folder }))));
find("study-more").addEventListener("click", () => attempt(async () => {
  goOn(await ask("/more", { folder, evaluations: Number(find("more-evaluations").value) }));
}));
const goOn = (started) => { look(); return followToEnd(started); };
document.addEventListener("study", ({ detail }) => { if (detail !== folder) followStudy(detail); });
