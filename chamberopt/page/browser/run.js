// Running the commands on what is saved, and writing a study from the sliders.
import { ask, attempt, element, isUnsaved, read, say, state } from "./state.js";
import { ends, varied } from "./fields.js";
import { bars, followed, sinceBegin } from "./steps.js";

const find = (id) => document.getElementById(id);

export function fillRun() {
  const chosen = find("of").value;
  const names = state.file.files.map((one) => one.name);
  find("of").replaceChildren(...state.file.files.map(({ name, words }) => element("option", { value: name, textContent: `${name}: ${words}` })));
  find("of").value = names.includes(chosen) ? chosen : state.file.file;
  const free = (k) => `study-of-sliders${k > 1 ? `-${k}` : ""}.toml`;
  let k = 1;
  while (names.includes(free(k))) k += 1;
  find("study-name").value = free(k);
  allow();
  tellDuration();
  showVaried();
}

let isRunning = false;
// A design is simulated; a study is searched or mapped.
function allow() {
  const { kind, words } = state.file.files.find((one) => one.name === find("of").value) ?? {};
  find("of-words").textContent = kind === "study" ? words : "";
  for (const button of document.querySelectorAll("[data-command], #search-sliders")) button.disabled = isRunning;
  for (const one of document.querySelectorAll(".of-design, .of-study")) one.hidden = one.className !== `of-${kind}`;
}
find("of").addEventListener("change", () => { allow(); tellDuration(); });

// How long the file will take, where the server knows that from results.
async function tellDuration() {
  const of = find("of").value, known = await ask("/duration", { of }).catch(() => null);
  if (find("of").value === of) find("lasts").textContent = known?.words ? `It will take ${known.words}.` : "";
}
document.querySelector("[data-tab=run]").addEventListener("click", tellDuration);

function showVaried() {
  const items = [...varied].map((name) => element("li", { title: name, textContent: `${state.fields.find((one) => one.name === name)?.in_full}: ${ends.get(name).join(" … ")}` }));
  find("varied").replaceChildren(...(items.length ? items : [element("li", { textContent: "nothing is ticked yet" })]));
}
document.addEventListener("varied", showVaried);

// Start a command, follow it to its end, and give its exit status, and the folder of its result.
export async function start(command, of) {
  const started = await ask("/start", { command, of, points: find("points").value });
  return { exit: await follow(started), result: started.result };
}

// Follow a command to its end, and tell what it has left.
export async function followToEnd(started) {
  const exit = await follow(started);
  tellDuration();
  showResult(exit === 0 ? started.result : "");
}
const showResult = (result) => document.dispatchEvent(new CustomEvent("ended", { detail: result }));

// Folder of the study that runs now, or "".
export const running = () => study;
let study = "";

// Show a command that runs, by default what the server has started last, and give its exit status.
export const follow = async (started) => (await followed(show, started))?.exit ?? null;

function show({ command, result, steps, seconds, lines, exit }) {
  if (exit !== null && command.startsWith("chamberopt new ")) return; // of the front page
  const before = study;
  study = exit === null && isStudy(command) ? result : "";
  if (study && study !== before) showStudy(study);
  find("stop").disabled = exit !== null;
  isRunning = exit === null;
  allow();
  const now = exit === null ? sinceBegin(seconds) : exit === 0 ? "finished" : exit === 130 ? "stopped" : `ended with exit status ${exit}`;
  find("progress").replaceChildren(element("p", { title: command }, element("b", { textContent: now })), ...bars(steps), ...toResult(command, result, exit));
  find("printed").textContent = lines.join("\n");
  find("printed-fold").hidden = !lines.length;
  if (exit) find("printed-fold").open = true;
}

// A page that was loaded anew meanwhile has not shown what the command has found.
function toResult(command, result, exit) {
  if (!result || exit === null) return [];
  const button = (textContent, act) => {
    const made = element("button", { type: "button", textContent, title: result });
    made.addEventListener("click", act);
    return made;
  };
  return [...(exit === 0 ? [button("Show the result", () => showResult(result)), " "] : []),
    ...(isStudy(command) ? [button("See its candidates", () => showStudy(result))] : [])];
}
const isStudy = (command) => command.startsWith("chamberopt run ");
const showStudy = (folder) => document.dispatchEvent(new CustomEvent("study", { detail: folder }));

for (const button of document.querySelectorAll("[data-command]")) button.addEventListener("click", () => attempt(async () => {
  if (isUnsaved()) throw new Error("there are unsaved changes: commands use the saved file, so save or undo them first");
  await followToEnd(await ask("/start", { command: button.dataset.command, of: find("of").value, points: find("points").value }));
}));
find("stop").addEventListener("click", () => attempt(() => ask("/stop", {})));
// Write the study of the sliders, and run it.
find("search-sliders").addEventListener("click", () => attempt(async () => {
  if (isUnsaved()) throw new Error("there are unsaved changes: the study begins from the saved design, so save or undo them first");
  const vary = Object.fromEntries([...varied].map((name) => [name, ends.get(name)]));
  const { study } = await ask("/study", { vary, name: find("study-name").value, evaluations: Number(find("evaluations").value) });
  await read();
  find("of").value = study;
  allow();
  say(`written: ${study}`, true);
  await followToEnd(await ask("/start", { command: "run", of: study }));
}));
