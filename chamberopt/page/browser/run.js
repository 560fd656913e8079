// Running the commands on what is saved, and writing a study from the sliders.
import { asLines, ask, attempt, element, isUnsaved, listen, onPage, read, say, state, wordsOf } from "./state.js";
import { bound, ends, makeFields, varied, varyOnly } from "./fields.js";
import { bars, followed, sinceBegin } from "./steps.js";

const find = (id) => document.getElementById(id);

export function fillRun() {
  const before = find("of").value;
  const names = state.file.files.map((one) => one.name);
  find("of").replaceChildren(...state.file.files.map(({ name, kind, words }) => element("option", { value: name,
    textContent: kind === "study" ? `study ${name}: ${words}` : `${words} (${name})` })));
  find("of").value = names.includes(before) ? before : state.file.file;
  const free = (k) => `study-of-sliders${k > 1 ? `-${k}` : ""}.toml`;
  let k = 1;
  while (names.includes(free(k))) k += 1;
  find("study-name").value = free(k);
  const aim = find("aim").value;
  find("aim").replaceChildren(...state.file.aims.map(([value, textContent]) => element("option", { value, textContent })));
  if (aim) find("aim").value = aim;
  else { // the page is new: what was proposed is a start, the usual aim first
    const studies = state.file.files.filter((one) => one.asks), [[usual] = []] = state.file.aims;
    takeQuestion(studies.find((one) => one.asks.aim === usual) ?? studies[0]);
  }
  allow();
  tellDuration();
  showVaried();
}

let searched = ""; // folder of a search of the chosen study
let isRunning = false, refused = ""; // why the chosen file cannot be run
const chosen = () => state.file.files.find((one) => one.name === find("of").value);
// A design is simulated; a study is searched or mapped.
function allow() {
  const { kind, words } = chosen() ?? {};
  find("lasts").hidden = isRunning; // the bars tell what is left
  find("of-words").textContent = kind === "study" ? words : "";
  for (const button of document.querySelectorAll("[data-command], #search-sliders")) button.disabled = isRunning || (Boolean(refused) && "command" in button.dataset);
  for (const one of document.querySelectorAll(".of-design, .of-study")) one.hidden = one.className !== `of-${kind}`;
  find("go-on").hidden ||= !searched;
  find("more-of").disabled = isRunning;
}
find("of").addEventListener("change", () => {
  takeQuestion(chosen());
  allow();
  tellDuration();
});
find("of-the-design").addEventListener("click", () => {
  find("of").value = state.file.files.find(({ kind }) => kind === "design").name;
  find("of").dispatchEvent(new Event("change"));
  document.querySelector("[data-command=simulate]").click();
});

// Begin the search of one's own with the question of a file, if it is a study.
function takeQuestion(file) {
  if (!file?.asks) return;
  const { aim, vary, evaluations } = file.asks;
  limits = file.asks.limits.map(([name, label, side, value]) => ({ name, label, side, value }));
  showLimits();
  if (state.file.aims.some(([name]) => name === aim)) find("aim").value = aim;
  if (evaluations) find("evaluations").value = evaluations;
  varyOnly(vary);
}

// How long the file will take, where the server knows that from results, or why it will be refused.
async function tellDuration() {
  const of = find("of").value;
  refused = searched = "";
  const ranges = find("ranges").checked, known = await ask("/duration", { of, ranges }).catch((error) => { refused = wordsOf(error); });
  if (find("of").value !== of) return;
  find("lasts").className = refused ? "wrong" : "soft";
  find("lasts").replaceChildren(...(refused ? [...onPage(refused), element("p", { hidden: !chosen()?.asks, textContent: "The search below asks the same between values that hold those of the design." })] : []));
  showEfforts(known?.efforts ?? {});
  if (known && !known.efforts.asked && !isRunning && !find("run").hidden) await tryDuration(of, ranges);
  searched = known?.searched ?? "";
  find("searched").textContent = searched;
  allow();
}
document.querySelector("[data-tab=run]").addEventListener("click", () => setTimeout(tellDuration)); // once the tab is shown
find("ranges").addEventListener("change", tellDuration);

// What is known of each effort stands beside it: its time, and why it tells too little; of a study below its button.
const effort = () => document.querySelector("input[name=effort]:checked").value;
function showEfforts(efforts, origin = "") {
  const isDesign = chosen()?.kind === "design";
  for (const one of document.querySelectorAll("[name=effort]")) {
    const { words = "", few = [] } = efforts[one.value] ?? {}, place = one.parentElement.querySelector("small");
    place.replaceChildren(...(words ? [`${words}${origin}`] : []), ...(few.length ? [element("span", { className: "few" }, "; ", ...onPage(few))] : []));
  }
  if (!isDesign && efforts.asked) find("lasts").textContent = `It will take ${efforts.asked.words}.`;
}

// Of a design without results a moment is simulated, once for each version of its file.
const tried = new Map();
async function tryDuration(of, ranges) {
  if (chosen()?.kind !== "design") return;
  const key = `${of} ${ranges} ${state.file.read}`, tell = (words) => { if (find("of").value === of && !isRunning) find("lasts").textContent = words; };
  if (!tried.has(key)) {
    tell("finding out how long it takes …");
    tried.set(key, await ask("/tried", { of, ranges }).then(({ efforts }) => efforts, () => ({})));
  }
  tell("");
  if (find("of").value === of && find("ranges").checked === ranges) showEfforts(tried.get(key), ", by a moment of it");
}

// Limits of figures: name, label with unit, side and value of each.
let limits = [];
function showLimits() {
  find("limits").replaceChildren(...limits.map((one) => {
    const options = [...state.file.figures, ...(state.file.figures.some(([name]) => name === one.name) ? [] : [[one.name, one.label]])];
    const figure = element("select", { ariaLabel: "figure" }, ...options.map(([value, textContent]) => element("option", { value, textContent })));
    const side = element("select", { ariaLabel: "side of the limit" }, ...[["min", "at least"], ["max", "at most"]].map(([value, textContent]) => element("option", { value, textContent })));
    const box = element("input", { type: "number", step: "any", ariaLabel: "limit" });
    [figure.value, side.value, box.value] = [one.name, one.side, one.value];
    figure.addEventListener("change", () => Object.assign(one, { name: figure.value, label: figure.selectedOptions[0].textContent }));
    side.addEventListener("change", () => { one.side = side.value; });
    box.addEventListener("change", () => { one.value = box.value; });
    const out = element("button", { type: "button", textContent: "✕", title: "leave this limit out" });
    out.addEventListener("click", () => { limits = limits.filter((other) => other !== one); showLimits(); unsay(); });
    return element("li", {}, figure, side, box, out);
  }));
}
find("add-limit").addEventListener("click", () => {
  const [[name, label]] = state.file.figures;
  limits.push({ name, label, side: "min", value: "" });
  showLimits();
});

let putBack = []; // a number whose ends were put back, and why
function showVaried() {
  const items = [...varied].map((name) => {
    const { in_full } = state.fields.find((one) => one.name === name);
    const [low, high] = ends.get(name).map((value, k) => element("input", { type: "number", step: "any", value, ariaLabel: `${in_full}, ${["least", "largest"][k]}` }));
    for (const end of [low, high]) end.addEventListener("input", () => end.closest("li").querySelector(".wrong")?.remove());
    for (const end of [low, high]) end.addEventListener("change", () => {
      const why = bound(name, [Number(low.value), Number(high.value)]);
      putBack = why ? [name, why] : [];
      showVaried();
    });
    const out = element("button", { type: "button", textContent: "✕", title: "leave it as it is", ariaLabel: `Leave ${in_full} as it is` });
    out.addEventListener("click", () => { varied.delete(name); makeFields(); });
    return element("li", { title: name }, element("span", { textContent: in_full }), low, "…", high, out, ...(putBack[0] === name ? [element("p", { className: "wrong", role: "alert", textContent: putBack[1] })] : []));
  });
  find("varied").replaceChildren(...(items.length ? items : [element("li", { textContent: "nothing yet" })]));
}
document.addEventListener("varied", showVaried);

// Follow a command to its end, and tell what it has left.
export async function followToEnd(started) {
  const { result, kept } = await follow(started);
  tellDuration();
  tell("ended", kept ? result : "");
}
const tell = (name, detail) => document.dispatchEvent(new CustomEvent(name, { detail }));

// Folder of the study that runs now, or "".
export const running = () => study;
let study = "";

// Show a command that runs, by default what the server has started last, and give its last status; {} if there is none.
export const follow = async (started) => await followed(show, started) ?? {};

// What a command keeps that is stopped, said before it is, and afterwards.
const KEEPS = { simulate: ["ends it with a result of the replicas that have ended by then, three at least, with wider intervals.", "stopped; nothing is kept"],
  run: ["ends it after the chambers that are simulated now. What is tried is kept, and Resume goes on.", "stopped; what was tried is kept"],
  sweep: ["ends it at once. What is tried is kept, and the command that is then said goes on in a terminal.", "stopped; what was tried is kept"] };
const CALIBRATED = "loses it: the intervals of a design with a calibration take all replicas.";
const keeps = (command) => command.startsWith("chamberopt simulate ") && state.file.is_calibrated ? [CALIBRATED, KEEPS.simulate[1]] : KEEPS[command.split(" ")[1]] ?? ["", "stopped"];

function show({ command, result, kept, steps, held, seconds, printed, exit }) {
  if (exit !== null && command.startsWith("chamberopt new ")) return; // of the front page
  const before = study;
  study = exit === null && isStudy(command) ? result : "";
  if (study && study !== before) document.querySelector("[data-tab=run]").click(); // which shows it, also after a reload
  find("stop").disabled = exit !== null || isStoppedNow();
  find("stop-keeps").textContent = exit !== null ? "" : stopped ? STOPPING : `Stop ${keeps(command)[0]}`;
  if (exit !== null) sayStopped(0);
  isRunning = exit === null;
  allow();
  const now = exit === null ? sinceBegin(seconds) : exit === 0 ? "finished" : exit === 130 ? kept ? "stopped; what was simulated until then is a result" : keeps(command)[1] : `ended with exit status ${exit}`;
  find("progress").replaceChildren(element("p", { title: command }, element("b", { textContent: now })), ...bars(steps), ...slowed(held), ...toResult(command, result, exit, kept));
  find("study-progress").replaceChildren(...(study ? [...find("progress").children].map((one) => one.cloneNode(true)) : [])); // which is in its place
  find("printed").replaceChildren(...asLines(printed));
  find("printed-fold").hidden = !printed.length;
  if (exit) find("printed-fold").open = true;
}

// Balls in a gap hit its sides so often that a run takes many times longer.
const slowed = (held) => held ? [element("p", { className: "warning", textContent: `${held.balls} ${held.balls > 1 ? "balls are" : "ball is"} held in a gap, one at ${held.place} in the chamber: this makes the run longer. Other balls, or a narrower or wider gap, mend it.` })] : [];

// A page that was loaded anew meanwhile has not shown what the command has found.
function toResult(command, result, exit, kept) {
  if (!result || exit === null) return [];
  const button = (textContent, act) => {
    const made = element("button", { type: "button", textContent, title: result });
    made.addEventListener("click", act);
    return made;
  };
  return [...(kept ? [button("Show the result", () => tell("result", result)), " "] : []),
    ...(isStudy(command) ? [button("See its candidates", () => tell("study", result))] : [])];
}
const isStudy = (command) => command.startsWith("chamberopt run ");

// Commands use the saved file: their buttons say when they save it first.
async function save() { if (isUnsaved()) await read("/save", { changes: state.changes }); }
const starting = [...document.querySelectorAll("[data-command], #search-sliders")].map((button) => [button, button.textContent]);
listen(() => {
  for (const [button, words] of starting) button.textContent = isUnsaved() ? `Save and ${words[0].toLowerCase()}${words.slice(1)}` : words;
});

for (const button of document.querySelectorAll("[data-command]")) button.addEventListener("click", () => attempt(async () => {
  await save();
  await followToEnd(await ask("/start", { command: button.dataset.command, of: find("of").value, points: find("points").value, ranges: find("ranges").checked, effort: effort() }));
}, find("run-fault")));
find("more-of").addEventListener("click", () => attempt(async () => {
  await save();
  const started = await ask("/more", { folder: searched, evaluations: Number(find("more-of-it").value) });
  await read(); // the further study is a file of its own
  await followToEnd(started);
}, find("run-fault")));
// A second stop loses what the first keeps: its button says so, and takes no double click.
const STOPPING = "stopping …; Stop now does not wait, and loses what is not written yet.", DOUBLE = 3000; // ms
let stopped = 0; // when it was asked; 0 for not
export const isStoppedNow = () => stopped > 0 && performance.now() - stopped < DOUBLE;
function sayStopped(at) {
  stopped = at;
  for (const id of ["stop", "study-stop"]) find(id).textContent = at ? "Stop now" : "Stop";
}
export const stop = () => attempt(async () => {
  sayStopped(performance.now());
  find("stop").disabled = find("study-stop").disabled = true;
  find("stop-keeps").textContent = STOPPING;
  await ask("/stop", {});
});
find("stop").addEventListener("click", stop);
// What was refused is no longer said once something else is asked.
const unsay = () => { find("run-fault").textContent = find("search-fault").textContent = ""; };
find("run").addEventListener("input", unsay);
// Write the study of the sliders, and run it.
find("search-sliders").addEventListener("click", () => attempt(async () => {
  const vary = Object.fromEntries([...varied].map((name) => [name, ends.get(name)]));
  const question = { vary, aim: find("aim").value, name: find("study-name").value, evaluations: Number(find("evaluations").value),
    limits: limits.map(({ name, side, value }) => [name, side, value === "" ? null : Number(value)]) };
  await save();
  const { study } = await ask("/study", question);
  await read();
  find("of").value = study;
  allow();
  say(`written: ${study}`, true);
  await followToEnd(await ask("/start", { command: "run", of: study, ranges: find("ranges").checked }));
}, find("search-fault")));
