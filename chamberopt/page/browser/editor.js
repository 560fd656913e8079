// The page: its tabs, what is asked of the server as the design changes, and what is said of it.
import { makeFields, sayAtFields, showValues } from "./fields.js";
import { fillSurfaces, fillTarget, names, showChosen } from "./target.js";
import { fillRun, follow } from "./run.js";
import { closeResults } from "./results.js";
import "./study/study.js";
import { addStep, ask, attempt, byUrgency, change, element, isUnsaved, listen, onPage, read, redo, removeStep, say, showAdded, showStep, state, takeTold, undo, unpack, value, warning, wordsOf } from "./state.js";
import { lookAnew, setHandles, showCavity, showPart, showShape, showState } from "./scene.js";

const find = (id) => document.getElementById(id);
const AGAIN = 3000; // ms after which a check that another page has superseded is asked again
const QUIET = 150; // ms after the last change, before the cavity is cut

for (const tab of document.querySelectorAll("nav button")) tab.addEventListener("click", () => {
  for (const one of document.querySelectorAll("nav button")) one.setAttribute("aria-selected", one === tab);
  for (const one of document.querySelectorAll(".tab")) one.hidden = one.id !== tab.dataset.tab;
  if (tab.dataset.tab !== "results") closeResults();
});

// Another shape, holder, mask or alloy has other numbers, also where a change is undone; steps have their times.
const KINDS = /^(chamber\.shape|materials\.\w+(\.alloy)?|holder\.kind|mask\.kind|zones\.\d+|steps(\..*)?|process\.treatment_time_s)$/;
const structure = () => JSON.stringify(Object.entries(state.changes).filter(([name]) => KINDS.test(name)));
let shownOf = "";
async function followFields() {
  const now = structure();
  if (now === shownOf) return;
  shownOf = now;
  try {
    const told = await ask("/fields", { changes: state.changes });
    if (now !== shownOf) return;
    takeTold(told);
    makeFields();
    fillSurfaces();
    fillSteps();
    showAdded();
  } catch (error) { if (now === shownOf) shownOf = ""; } // asked again with the next change; the shape says what is wrong
}

// The steps of the design; the view shows the chamber of one.
function fillSteps() {
  find("step-buttons").hidden = !state.steps.length;
  find("steps").hidden = state.file.is_drawn && !state.steps.length;
  find("of-first").hidden = !state.step;
  find("down").disabled = state.step > 0;
  for (const one of document.querySelectorAll("input[name=handles]")) one.disabled = state.step > 0;
  find("step-buttons").replaceChildren(...state.steps.flatMap((text, k) => {
    const button = element("button", { textContent: text, ariaPressed: String(k === state.step) });
    button.addEventListener("click", () => { if (k !== state.step) showStep(k); });
    if (!k) return [button]; // the first is the design itself
    const cross = element("button", { textContent: "✕", ariaLabel: `Remove the step ${text}`, title: "remove this step" });
    cross.addEventListener("click", () => attempt(() => removeStep(k)));
    return [element("span", {}, button, cross)];
  }));
}
find("add-step").addEventListener("click", () => attempt(async () => {
  const name = find("step-name").value.trim();
  if (!name) throw new Error("give the new step a name first, such as second side");
  await addStep(name);
  find("step-name").value = "";
  find("new-step").open = false;
}));

// The shape follows at once: the newest changes are asked for as soon as the last answer is here.
let asking = false, asked = null, timer = 0, round = 0;
async function followShape() {
  if (asking) return;
  asking = true;
  while (asked !== state.shown) {
    const changes = asked = state.shown;
    try {
      const answer = unpack(await ask("/shape", { changes, step: state.step }));
      refuse(null);
      if (answer.state.length !== fillTarget.part.triangles.length / 3) await showPartOf(); // its file has changed
      showShape(answer);
      document.body.dataset.shape = String(Number(document.body.dataset.shape ?? 0) + 1);
    } catch (error) { if (asked === state.shown) refuse(error); }
  }
  asking = false;
}

// The cavity, then what is reached, once nothing has moved for a moment; an answer to older values is dropped.
function followCavity() {
  clearTimeout(timer);
  find("said").classList.add("waiting");
  busy("checking the chamber …");
  document.body.dataset.checked = "";
  const mine = ++round;
  timer = setTimeout(async () => {
    try {
      const buffer = await ask("/cavity", { changes: state.shown, step: state.step });
      if (mine !== round) return;
      const cavity = unpack(buffer, 4);
      showCavity(cavity);
      sayOf(cavity);
      sayEffect(cavity.openings);
      document.body.dataset.checked = "cavity";
      busy("finding what the balls reach …");
      const reach = unpack(await ask("/reach", { number: new DataView(buffer).getUint32(0, true) }));
      if (mine !== round) return;
      showState(reach.state);
      sayOf(reach);
      find("said").classList.remove("waiting");
      busy("");
      document.body.dataset.checked = "reach";
    } catch (error) {
      if (mine !== round) return;
      if (error.superseded) timer = setTimeout(followCavity, AGAIN); // by another page of this design
      else refuse(error);
    }
  }, QUIET);
}

// What a change did to the ways out of the chamber besides, against the design as its file has it.
const inFile = new Map(); // openings of each step: wall and size
function sayEffect(openings, isRefused = false) {
  if (isRefused) { find("effect").hidden = true; return; }
  if (!Object.keys(state.shown).length) inFile.set(state.step, openings);
  const before = inFile.get(state.step) ?? openings;
  const sizes = (list, wall) => Object.entries(Object.groupBy(list.filter(([one]) => one === wall), ([, size]) => size))
    .map(([size, same]) => same.length > 1 ? `${same.length} of ${size}` : size).join(" and ");
  const told = [...new Set([...openings, ...before].map(([wall]) => wall))].map((wall) => {
    const now = sizes(openings, wall), was = sizes(before, wall);
    if (now === was) return "";
    if (!was) return `the part now goes out through ${wall}, opening ${now}`;
    return now ? `openings in ${wall} are now ${now}, in the file ${was}` : `the part no longer goes out through ${wall}`;
  }).filter(Boolean);
  find("effect").textContent = told.length ? `With these values ${told.join("; ")}.` : "";
  find("effect").hidden = !told.length;
}

function busy(text) { find("busy").textContent = text; }

function refuse(error) {
  if (error) { busy(""); sayEffect([], true); }
  find("error").replaceChildren(...onPage(error ? wordsOf(error) : ""));
  find("error").hidden = !error;
  sayAtFields(error?.at);
}

// What is to be settled before the chamber is built, each until a click says that it is.
function fillSettle() {
  const open = state.changes.to_settle ?? state.file.to_settle.map((one) => one.text);
  const left = state.file.to_settle.filter((one) => open.includes(one.text)), fold = find("settle");
  const lists = byUrgency(left, (one) => {
    const done = element("button", { type: "button", textContent: "Mark as settled", title: "the design keeps it as settled, with the day, and the sheet tells it" });
    done.addEventListener("click", () => change({ to_settle: open.filter((text) => text !== one.text) }));
    const takes = one.takes.map(({ label, changes }) => {
      const [[name, wanted]] = Object.entries(changes), take = element("button", { type: "button", textContent: label, title: `sets ${name}`, disabled: value(name) === wanted });
      take.addEventListener("click", () => change(changes));
      return take;
    });
    const isMeant = one.meets.length > 0 && one.meets.every((name) => names("part.target").includes(name));
    const words = isMeant ? [`: ${one.meets.join(", ")} ${one.meets.length > 1 ? "are" : "is"} in the target now, so that this is settled.`] : onPage(one.words);
    return element("li", {}, element("span", {}, element("b", { textContent: one.mark }), ...words), ...takes, done);
  });
  const isOld = state.file.is_proposed && Object.keys(state.changes).some((name) => state.file.of_matters.includes(name.split(".")[0]));
  const note = isOld ? [element("p", { className: "warning", textContent: "Told of what was proposed, and you changed some of it: settle those that still hold." })] : [];
  fold.hidden = !left.length;
  fold.firstElementChild.textContent = `${left.length} to be looked at`;
  fold.lastElementChild.replaceChildren(...note, ...lists);
}

function sayOf({ facts, unpeened, warnings, notes }) {
  const at = facts.findIndex(([subject]) => subject === "simulated"); // none before what the balls reach is known
  if (state.file.intensity.length && !isUnsaved() && at >= 0) facts = facts.toSpliced(at, 0, ["Almen intensity, as proposed", state.file.intensity]);
  const list = (texts) => texts.map((text) => element("li", {}, ...onPage(text)));
  find("unpeened").replaceChildren(...unpeened.map((words) => element("p", { className: "warning" }, ...onPage(words))));
  find("warnings").replaceChildren(...warnings.map(warning));
  find("notes").replaceChildren(...list(notes));
  find("facts").replaceChildren(...facts.flatMap(([subject, told]) => [element("dt", { textContent: subject[0].toUpperCase() + subject.slice(1) }),
    ...told.map((words) => element("dd", {}, ...onPage(words)))]));
}

listen((what) => {
  if (what === "read") {
    find("file").textContent = `${state.file.folder.split(/[\\/]/).pop()}: ${state.file.file.replace(/\.toml$/, "")}`;
    find("file").title = `${state.file.file} in ${state.file.folder}`;
    document.title = `${state.file.file}: chamberopt`;
    shownOf = structure();
    inFile.clear();
    makeFields();
    fillTarget();
    fillRun();
    fillSteps();
    fillSettle();
    asked = null;
  } else if (what === "step") {
    fillSteps();
    setHandles("");
    asked = null;
    lookAnew();
  } else {
    showValues();
    fillSettle();
    followFields();
    fillSurfaces();
    showChosen();
  }
  if (state.showing) closeResults(); // so that the chamber is seen
  find("unsaved").textContent = state.showing || (isUnsaved() ? "not saved yet" : "");
  find("save").disabled = !isUnsaved();
  find("undo").disabled = !state.past.length;
  find("redo").disabled = !state.undone.length;
  followShape();
  followCavity();
});
addEventListener("beforeunload", (event) => { if (isUnsaved()) event.preventDefault(); });

find("undo").addEventListener("click", undo);
find("redo").addEventListener("click", redo);
addEventListener("keydown", (event) => { // in a field the keys undo what is typed there
  if (!(event.ctrlKey || event.metaKey) || event.target.matches("input:not([type=range]), select")) return;
  const act = { z: event.shiftKey ? redo : undo, y: redo }[event.key.toLowerCase()];
  if (act) { event.preventDefault(); act(); }
});
find("front").addEventListener("click", () => attempt(async () => {
  if (isUnsaved() && !confirm("Go to the parts of this folder? What is not saved is lost.")) return;
  state.changes = {};
  await ask("/close", {});
  location.reload();
}));
find("save").addEventListener("click", () => attempt(async () => {
  await read("/save", { changes: state.changes });
  say(`saved in ${state.file.file}`, true);
}));
async function showPartOf() { fillTarget.part = showPart(await ask("/part", {})); }
const begin = () => read("/read", {}, showPartOf);
find("reload").addEventListener("click", () => attempt(async () => {
  if (!isUnsaved() || confirm("Go on from the file as it is now? What is not saved is lost.")) await begin();
}));
attempt(begin).then(() => { document.body.dataset.ready = "yes"; attempt(follow); });
