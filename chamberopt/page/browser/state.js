// What the page knows: the file as read, changes not yet saved, and questions to the server.

const listeners = [];
export const state = { file: null, fields: [], surfaces: {}, steps: [], step: 0, changes: {}, past: [], undone: [], shown: {}, showing: "" };
export const listen = (hear) => listeners.push(hear);
const tell = (what) => { for (const hear of listeners) hear(what); };

// The key that the address brought: kept for reloads of this tab, and sent with every question.
if (location.hash.length > 1) {
  sessionStorage.setItem("key", location.hash.slice(1));
  history.replaceState(null, "", "/");
}

// Answer of the server, as JSON or as bytes, to a question or a file; throws an error with the server's words.
export async function ask(path, question) {
  const headers = { "x-chamberopt-key": sessionStorage.getItem("key") ?? "" };
  const body = question instanceof Blob ? question : JSON.stringify({ read: state.file?.read, ...question });
  const request = question === undefined ? { headers } : { method: "POST", headers, body };
  const answer = await fetch(path, request).catch(() => { throw new Error("the server has ended: start chamberopt edit again"); });
  const isBytes = answer.headers.get("content-type") === "application/octet-stream";
  if (isBytes) return answer.arrayBuffer();
  if (answer.status === 403) return refused(await answer.text());
  const told = await answer.json().catch(() => ({ error: `the server failed at this (${answer.status})` }));
  if (told.superseded || told.error) throw Object.assign(new Error(told.error), { superseded: Boolean(told.superseded), words: told.words, at: told.at });
  return told;
}

// A tab that the server does not know shows that alone, and goes on with nothing; one that it has served before keeps what is there.
async function refused(why) {
  if (document.body.dataset.ready) throw new Error(why);
  document.body.className = "refused";
  document.body.replaceChildren(element("h1", { textContent: "This tab cannot use the program" }),
    element("p", { textContent: "Its address lacks the token, or has that of a program that has ended. Go on in the tab that was opened first, or open the whole address that chamberopt edit has printed in the terminal, to the last letter of its token." }));
  return new Promise(() => {});
}

// A packed answer (see answers.py): its head, with the arrays by name.
export function unpack(buffer, at = 0) {
  const length = new DataView(buffer).getUint32(at, true), head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, at + 4, length)));
  const kinds = { "<f4": Float32Array, "<u4": Uint32Array, u1: Uint8Array };
  let place = at + 4 + length;
  for (const [name, [kind, count]] of Object.entries(head.arrays)) {
    head[name] = new kinds[kind](buffer, place, count);
    place += Math.ceil(head[name].byteLength / 4) * 4;
  }
  return head;
}

export async function read(path = "/read", question = {}, before = () => {}) {
  state.file = await ask(path, question);
  takeTold(state.file);
  await before();
  Object.assign(state, { changes: {}, past: [], undone: [] });
  showChanges();
  tell("read");
}

// Fields, picked surfaces and steps of the design with its changes, which may have another shape.
export function takeTold({ fields, surfaces, steps }) {
  Object.assign(state, { fields, surfaces, steps });
  if (state.step >= steps.length) state.step = 0;
}

// Show the chamber of another step.
export function showStep(step) {
  state.step = step;
  tell("step");
}

// What the file has, or where it has no such number, what the design with its shape or holder takes by default.
export const original = (name) => [...catalogue(), ...inFile(name), ...state.fields].find((one) => one.name === name)?.value ?? null;
const catalogue = () => state.fields.filter((one) => one.fixed); // numbers of the alloy that is named now
// Fields of the file by which a name stands for what it does now: not of a step where one is gone.
const inFile = (name) => "steps" in state.changes && name.startsWith("steps.") ? [] : state.file.fields;
export const value = (name) => name in state.changes ? state.changes[name] : original(name);

// Change values by dotted name; null takes a key out of the file. A slider's moves are undone as one.
export function change(values, move = "") {
  say("");
  if (!move || state.move !== move) state.past.push(state.changes);
  Object.assign(state, { move, undone: [] });
  state.changes = { ...state.changes, ...values };
  for (const name of Object.keys(values))
    if (inFile(name).some((one) => one.name === name) && state.changes[name] === original(name)) delete state.changes[name];
  showChanges();
  tell("changed");
}

// Change the chamber's shape or the holder, with the keys that go with it, to which the server gives values.
export const restructure = (name, wanted) => changeBy("/structure", { name, value: wanted });

// Add a copy of the step that is shown, and show the copy.
let added = Infinity; // number of a step that is not shown yet
export async function addStep(name) {
  const count = Math.max(state.steps.length, 1);
  await changeBy("/step", { name, step: state.step });
  added = count;
}
export function showAdded() {
  if (added >= state.steps.length) return;
  showStep(added);
  added = Infinity;
}

export async function removeStep(step) {
  await changeBy("/remove", { step });
  if (state.step >= step) showStep(state.step - 1);
}

async function changeBy(path, asked) {
  const before = state.changes, made = await ask(path, { changes: before, ...asked });
  if (state.changes !== before) return; // something else was changed meanwhile
  say("");
  state.past.push(before);
  Object.assign(state, { changes: made, move: "", undone: [] });
  showChanges();
  tell("changed");
}

export function endMove() { state.move = ""; }

// Go back to the changes before the last one, or on to those that were undone.
export const undo = () => goTo(state.past, state.undone), redo = () => goTo(state.undone, state.past);
function goTo(from, to) {
  if (!from.length) return;
  say("");
  to.push(state.changes);
  Object.assign(state, { changes: from.pop(), move: "" });
  showChanges();
  tell("changed");
}

// What the view shows: the design with its changes, or with other values for a look, which change nothing.
function showChanges() { Object.assign(state, { shown: state.changes, showing: "" }); }
export function show(values, words = "") {
  if (!values && !state.showing) return;
  if (values) Object.assign(state, { shown: { ...state.changes, ...values }, showing: words });
  else showChanges();
  tell("changed");
}

export const isUnsaved = () => Object.keys(state.changes).length > 0;

const SAID = 4000, REFUSED = 20000; // ms that a message stays
let fading = 0;
// Text, or a message of the server: texts, and pairs of words with what they are in a file as a tip; or elements.
export const onPage = (words) => [words].flat().map((one) => typeof one === "string" || one instanceof Node ? one
  : element("abbr", { textContent: one[0], title: one[1] }));
export const asLines = (messages) => messages.flatMap((words) => [...onPage(words), "\n"]);
// A warning as one line, which opens on a click.
export const warning = (words) => element("details", { className: "warned" }, element("summary", {}, ...onPage(words)));
// A heading and a list of the matters of each urgency.
export const byUrgency = (matters, item) => Object.entries(Object.groupBy(matters, (one) => one.urgency))
  .flatMap(([urgency, found]) => [element("h3", { textContent: urgency }), element("ol", {}, ...found.map(item))]);
export const wordsOf = (error) => error.words ?? error.message;

export function say(text, good = false) {
  const box = document.getElementById("message");
  const close = element("button", { textContent: "✕", ariaLabel: "Close the message" }), hide = () => { box.hidden = true; };
  close.addEventListener("click", hide);
  box.replaceChildren(...onPage(text), close);
  box.className = good ? "good" : "";
  box.hidden = !text;
  clearTimeout(fading);
  if (text) fading = setTimeout(hide, good && typeof text === "string" ? SAID : REFUSED);
}

// Run an act; what goes wrong is said in an element beside its button, or over the page.
export async function attempt(act, place = null) {
  const tell = (words) => { if (!place) { say(words); return; } place.replaceChildren(...onPage(words)); if (words) place.scrollIntoView({ block: "nearest" }); };
  try { say(""); tell(""); return await act(); } catch (error) { tell(wordsOf(error)); return undefined; }
}

export function element(tag, properties = {}, ...inner) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...inner);
  return made;
}
