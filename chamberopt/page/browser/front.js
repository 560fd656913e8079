// The front page: a part's file, what is known of it, and the design that `new` proposes.
import { ask, attempt, element, onPage, say, wordsOf } from "./state.js";
import { bars, followed } from "./steps.js";

const find = (id) => document.getElementById(id);
const option = (one) => element("option", { value: [one].flat()[0], textContent: [one].flat().at(-1) }); // a text, or a pair with its words
const known = { part: "", unit: "" };

// Show what the folder has, with a part chosen, by default the one that the page begins with; give its name.
async function show(part) {
  const here = await ask("/front");
  find("folder").textContent = here.folder;
  find("file").accept = here.suffixes.join(",");
  find("part").replaceChildren(element("option", { value: "", textContent: "choose…" }), ...here.parts.map(option));
  find("here").hidden = !here.parts.length;
  find("part").value = part ?? here.first;
  for (const [id, names] of [["material", here.alloys], ["shot", here.balls], ["shape", here.shapes], ["shop", here.shops],
    ["calibration", here.calibrations]]) {
    const chosen = find(id).value; // stays, as a proposal for it may be shown below
    find(id).replaceChildren(find(id).options[0], ...names.map(option));
    find(id).value = chosen;
  }
  find("of-shop").hidden = !here.shops.length;
  find("of-calibration").hidden = !here.calibrations.length;
  find("designs").hidden = !here.designs.length;
  find("designs").querySelector("ul").replaceChildren(...here.designs.map((name) => {
    const button = element("button", { textContent: "Open" });
    button.addEventListener("click", () => attempt(() => open(name)));
    return element("li", {}, button, ` ${name}`);
  }));
  return find("part").value;
}

async function open(design) {
  await ask("/open", { design });
  location.reload();
}

// Read a part, to say its size, and to ask for its unit where the file states none.
async function look(part, unit = "") {
  Object.assign(known, { part, unit });
  find("propose").disabled = find("sizes").hidden = find("names").hidden = true;
  find("known").textContent = part ? `reading ${part} …` : "";
  document.body.dataset.known = "";
  if (!part) return;
  try {
    const seen = await ask("/look", { part, unit });
    if (known.part !== part || known.unit !== unit) return;
    const sizes = Object.entries(seen.sizes);
    find("sizes").hidden = !sizes.length;
    find("sizes").replaceChildren(find("sizes").firstElementChild, ...sizes.map(([name, size]) => {
      const button = element("button", { textContent: `${size} (numbers in ${name === "in" ? "inches" : name})` });
      button.addEventListener("click", () => attempt(() => look(part, name)));
      return element("span", {}, button, " ");
    }));
    find("names").hidden = !seen.names.length;
    find("names").replaceChildren(find("names").firstElementChild, ...seen.names.map(([name, text]) =>
      element("label", {}, element("input", { type: "checkbox", value: name }), ` ${name}: ${text}`)));
    find("known").textContent = sizes.length ? "" : `${part} measures ${seen.size}.`;
    find("propose").disabled = sizes.length > 0;
    document.body.dataset.known = sizes.length ? "sizes" : "all";
  } catch (error) {
    find("known").textContent = "";
    throw error;
  }
}

async function bring(file) {
  if (!file) return;
  find("known").textContent = `copying ${file.name} …`;
  try {
    const { part } = await ask(`/upload?name=${encodeURIComponent(file.name)}`, file);
    await show(part);
    await look(part);
  } finally { find("file").value = ""; }
}

const drop = find("drop");
for (const name of ["dragenter", "dragover"]) drop.addEventListener(name, (event) => { event.preventDefault(); drop.classList.add("over"); });
for (const name of ["dragleave", "drop"]) drop.addEventListener(name, (event) => { event.preventDefault(); drop.classList.remove("over"); });
drop.addEventListener("drop", (event) => attempt(() => bring(event.dataTransfer.files[0])));
find("file").addEventListener("change", () => attempt(() => bring(find("file").files[0])));
find("part").addEventListener("change", () => attempt(() => look(find("part").value)));

function tell({ steps, lines, warnings, fault, exit }) {
  find("stop").hidden = exit !== null;
  find("progress").replaceChildren(...bars(steps));
  find("warnings").replaceChildren(...warnings.map((words) => element("li", {}, ...onPage(words))));
  find("printed").textContent = lines.join("\n");
  find("printed-fold").hidden = !lines.length;
  find("error").hidden = !exit;
  find("error").replaceChildren(...fault.flatMap((words) => [...onPage(words), "\n"]));
}

const WISHES = ["material", "intensity", "coverage", "shop", "calibration", "shot", "ball-mm", "pose", "shape"]; // options of `new`
const NUMBERS = ["intensity", "coverage", "ball-mm"];

// Say a message beside the field of the option that it begins with; give whether there is such a field.
function besideField(text, words) {
  for (const one of document.querySelectorAll(".wrong")) one.remove();
  for (const id of WISHES) find(id).removeAttribute("aria-invalid");
  const id = /^--([\w-]+): /.exec(text)?.[1], field = find(id), fold = field?.closest("details");
  if (!WISHES.includes(id)) return false;
  if (fold) fold.open = true;
  field.setAttribute("aria-invalid", "true");
  field.after(element("span", { className: "wrong", role: "alert" }, ...onPage(words)));
  field.focus();
  return true;
}

async function started() {
  const target = [...find("names").querySelectorAll("input:checked")].map((one) => one.value);
  const wishes = Object.fromEntries(WISHES.map((id) => [id, find(id).value.trim()]));
  for (const id of NUMBERS) wishes[id] = wishes[id].replace(/(\d),(?=\d)/g, "$1."); // a decimal comma
  besideField("");
  try { return await ask("/propose", { ...known, ...wishes, target, pilot: find("pilot").checked }); } catch (error) {
    if (!besideField(error.message, wordsOf(error))) throw error;
    return null;
  }
}

find("propose").addEventListener("click", () => attempt(async () => {
  const begun = await started();
  if (!begun) return;
  const design = `${begun.out}/design.toml`;
  find("made").hidden = false;
  find("next").hidden = find("picture").hidden = find("propose").disabled = true;
  find("made").scrollIntoView({ behavior: "smooth" });
  const ended = await followed(tell, begun);
  find("propose").disabled = false;
  if (ended.exit !== 0) {
    find("made").hidden = besideField(ended.lines.at(-1) ?? "", ended.fault.at(-1));
    return;
  }
  find("picture").src = `/files/${begun.out.split("/").map(encodeURIComponent).join("/")}/design.png`;
  find("next").hidden = find("picture").hidden = false;
  find("printed-fold").open = true; // what is proposed, why, and what is to be settled
  find("open-made").onclick = () => attempt(() => open(design));
  find("open-made").focus();
  await show(known.part);
}));
find("stop").addEventListener("click", () => attempt(() => ask("/stop", {})));
attempt(async () => look(await show())).then(() => { document.body.dataset.ready = "yes"; });
