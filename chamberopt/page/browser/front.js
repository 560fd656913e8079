// The front page: a part's file, what is known of it, and the design that `new` proposes.
import { asLines, ask, attempt, byUrgency, element, onPage, unpack, warning } from "./state.js";
import { followed, sinceBegin, stage } from "./steps.js";
import { BODIES, colourByState, DIMENSIONS, drawBodies, drawDimensions, lights } from "./surfaces.js";

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
  find("example").hidden = here.parts.length > 0;
  find("part").value = part ?? here.first;
  find("alloys").replaceChildren(...here.alloys.map(([value, label]) => element("option", { value, label })));
  for (const [id, items] of [["shot", here.balls.map(option)], ["shape", here.shapes.map(option)],
    ["shop", here.shops.map(option)], ["calibration", here.calibrations.map(option)]]) {
    const chosen = find(id).value; // stays, as a proposal for it may be shown below
    find(id).replaceChildren(find(id).options[0], ...items);
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

const view = new View3D(find("view")), tools = new Tools([view], find("tools"));
let drawnPart = "", pointed = "", seen = null;
const CHAMBER = ["walls", "sonotrode", "edges", "remeshed", ...BODIES, ...DIMENSIONS];

// Draw the part beside its size, where the names of its surfaces are pointed at.
async function draw(part) {
  find("place").append(find("seen"));
  find("place").hidden = !part;
  const drawn = part && `${part} in ${known.unit}`; // its numbers have another size in another unit
  if (drawn === drawnPart && !view.get("walls")) return;
  view.highlight("part", null);
  for (const name of ["part", ...CHAMBER]) view.remove(name);
  tools.renew();
  tools.close();
  view.awaited = [];
  drawnPart = drawn;
  if (!part) return;
  const told = unpack(await ask("/view", { part, unit: known.unit }));
  if (drawn !== drawnPart) return;
  seen = told;
  tools.legend(find("legend"), seen.kinds);
  pointed = seen.pointed;
  view.surface("part", { points: seen.points, triangles: seen.triangles, kind: "rest", open: !seen.closed });
  view.get("part").userData.kinds = []; // no target is known yet
  lookAt(view.extent());
  document.body.dataset.drawn = part;
}

function lookAt({ low, high }, way = [0.49, -0.79, 0.35]) {
  const size = Math.hypot(...high.map((x, i) => x - low[i])), middle = low.map((x, i) => (x + high[i]) / 2);
  view.look({ middle, eye: middle.map((x, i) => x + 2 * size * way[i]), size });
}

// Put the part into the chamber that is proposed, as far as it is known.
async function drawChamber(isDraft) {
  const isFirst = !find("place-of-chamber").contains(find("seen"));
  find("place-of-chamber").append(find("seen"));
  if (isFirst) find("made").scrollIntoView({ behavior: "smooth" });
  const answer = unpack(await ask("/chamber", {}));
  if (!seen || answer.state.length !== seen.triangles.length / 3) return; // of another part
  tools.renew();
  view.highlight("part", null); // the target has its own colour
  view.pose("part", answer.rotation, answer.shift);
  colourByState(view, "part", seen, answer.state);
  for (const name of CHAMBER) view.remove(name); // of the proposal before
  view.show(["part"], true);
  view.awaited = answer.awaited;
  drawBodies(view, answer, seen.edges);
  drawDimensions(view, answer);
  const [low, high] = answer.shape_mm;
  const box = { low: low.map((x, i) => Math.min(x, answer.part_mm[0][i])), high: high.map((x, i) => Math.max(x, answer.part_mm[1][i])) };
  lookAt(box, answer.way);
  tools.open();
  document.body.dataset.chamber = isDraft ? "draft" : "proposal";
  await drawCavity(isDraft);
}
// What the shot flies in, without part, holder and mask, which takes longer to find; unless another proposal is shown by then.
async function drawCavity(isDraft) {
  const shown = view.get("walls"), cavity = await ask("/chamber", { exact: true }).then(unpack, () => null); // the proposal says what is wrong
  if (!cavity || view.get("walls") !== shown) return;
  view.awaited = [];
  drawBodies(view, cavity, seen.edges);
  const own = cavity.part_points ? "remeshed" : "part";
  if (own === "remeshed") view.surface(own, { points: cavity.part_points.slice(), triangles: cavity.part_triangles.slice(), open: !seen.closed });
  view.show(["part"], own === "part");
  colourByState(view, own, seen, cavity.state);
  document.body.dataset.cavity = isDraft ? "draft" : "proposal";
}
view.renderer.domElement.addEventListener("dblclick", () => { if (view.home) view.look(view.home); });
const shows = (named, name) => lights(named, view, () => ask("/face", { part: known.part, unit: known.unit, name }), () => pointed);

// What can be peened, ticked by name or by clicks on faces of the part; what is ticked is lit, until a chamber shows its target.
let choosable = null; // number of each triangle's face, and the names of faces
const MOST_LISTED = 12; // names that the file has not; a click takes others
function box(name, text = choosable?.sizes[name]) {
  const there = ticked().find((one) => one.value === name), made = there ?? element("input", { type: "checkbox", value: name });
  if (!there) {
    made.addEventListener("change", () => attempt(lightTicked));
    find("names").append(shows(element("label", {}, made, element("span")), name));
    find("names").hidden = false;
  }
  if (text) made.nextSibling.dataset.size = text;
  made.nextSibling.textContent = [` ${name}`, made.nextSibling.dataset.size].filter(Boolean).join(": ");
  return made;
}
// Scroll the list of names, and not the page, to where one is seen.
function scrollToBox(made) {
  const list = find("names"), { offsetTop, offsetHeight } = made.parentElement;
  list.scrollTop = Math.min(offsetTop, Math.max(list.scrollTop, offsetTop + offsetHeight - list.clientHeight));
}
async function findSurfaces(part, unit) {
  choosable = null;
  const told = unpack(await ask("/surfaces", { part, unit }));
  if (known.part !== part || known.unit !== unit) return;
  choosable = told;
  const named = new Set(ticked().map((one) => one.value));
  for (const [name, text] of told.rows.filter(([one]) => !named.has(one)).slice(0, MOST_LISTED)) box(name, text);
  for (const one of ticked()) box(one.value); // those of before have their sizes now
  document.body.dataset.choosable = part;
}
const lit = new Map(); // triangles by part and name
async function lightTicked() {
  const names = ticked().filter((one) => one.checked).map((one) => one.value), key = (name) => `${known.part} ${name}`;
  for (const name of names) if (!lit.has(key(name))) lit.set(key(name), unpack(await ask("/face", { ...known, name })).triangles);
  if (!view.get("walls")) view.highlight("part", names.length ? names.flatMap((name) => [...lit.get(key(name))]) : null, pointed);
}
find("names").addEventListener("pointerleave", () => { if (ticked().some((one) => one.checked)) attempt(lightTicked); });
// The name of the face that a pointer event meets, "" for a face without one; null for none, or while the chamber is shown.
function nameAt(event) {
  const hit = choosable && !view.get("walls") ? view.at(event, ["part"]) : null;
  return hit && (choosable.names[choosable.face[hit.triangle]] ?? "");
}
const noName = () => `this face cannot be chosen here, as ${choosable.unnamed}; the tab Target of an open design takes it by a click`;
function tellOf(event) {
  const name = event.buttons || view.tool ? null : nameAt(event), takes = ticked().some((one) => one.value === name && one.checked);
  find("under").textContent = name === null ? "" : !name ? noName() : `${name}, ${choosable.sizes[name]}: a click ${takes ? "leaves it out" : "chooses it to be peened"}`;
}
view.renderer.domElement.addEventListener("pointermove", tellOf);
view.renderer.domElement.addEventListener("pointerleave", () => { find("under").textContent = ""; });
view.hearClicks((event) => attempt(async () => {
  const name = nameAt(event);
  if (name === "") throw new Error(noName());
  if (!name) return;
  const one = box(name);
  one.checked = !one.checked;
  if (one.checked) scrollToBox(one);
  tellOf({ clientX: event.clientX, clientY: event.clientY });
  await lightTicked();
}));

// Read a part, to say its size, and to ask for its unit where the file states none.
async function look(part, unit = "") {
  if (part !== known.part) find("sizes").hidden = true;
  Object.assign(known, { part, unit });
  find("propose").disabled = find("names").hidden = true;
  find("known").textContent = part ? `reading ${part} …` : "";
  document.body.dataset.known = "";
  if (!part) { draw(""); return; }
  try {
    const seen = await ask("/look", { part, unit });
    if (known.part !== part || known.unit !== unit) return;
    const sizes = Object.entries(seen.sizes);
    if (!unit || sizes.length) find("sizes").hidden = !sizes.length; // a unit that was chosen can be chosen anew
    if (sizes.length) find("sizes").replaceChildren(find("sizes").firstElementChild, ...sizes.map(([name, size]) => {
      const button = element("button", { value: name, textContent: `${size} (numbers in ${name === "in" ? "inches" : name})` });
      button.addEventListener("click", () => attempt(() => look(part, name)));
      return element("span", {}, button, " ");
    }));
    for (const button of find("sizes").querySelectorAll("button")) button.ariaPressed = String(button.value === unit);
    find("names").hidden = !seen.names.length;
    find("names").replaceChildren(find("names").firstElementChild);
    for (const [name, text] of seen.names) box(name, text);
    find("known").textContent = sizes.length ? "" : `${part} measures ${seen.size}.`;
    find("propose").disabled = sizes.length > 0;
    document.body.dataset.known = sizes.length ? "sizes" : "all";
    await draw(part);
    if (!sizes.length) attempt(() => findSurfaces(part, unit));
  } catch (error) {
    find("known").textContent = "";
    throw error;
  }
}

async function bring(file) {
  if (!file) return;
  find("known").textContent = `reading ${file.name} …`;
  document.body.dataset.known = "";
  try { await take(await ask(`/upload?name=${encodeURIComponent(file.name)}`, file)); } finally {
    find("file").value = "";
    if (!document.body.dataset.known) find("known").textContent = ""; // it was refused
  }
}

async function take({ part }) {
  await show(part);
  await look(part);
}
find("example").addEventListener("click", () => attempt(async () => take(await ask("/example", {}))));

const drop = find("drop");
for (const name of ["dragenter", "dragover"]) drop.addEventListener(name, (event) => { event.preventDefault(); drop.classList.add("over"); });
for (const name of ["dragleave", "drop"]) drop.addEventListener(name, (event) => { event.preventDefault(); drop.classList.remove("over"); });
drop.addEventListener("drop", (event) => attempt(() => bring(event.dataTransfer.files[0])));
find("file").addEventListener("change", () => attempt(() => bring(find("file").files[0])));
find("part").addEventListener("change", () => attempt(() => look(find("part").value)));

// Show the command that proposes a chamber: how far it is, and in the end what it proposes.
let drawn = 0, told = ""; // when the picture that is shown was drawn; the proposal that is shown
function tell({ steps, stage: at, seconds, printed, warnings, fault, exit, picture, result, proposal }) {
  find("made").hidden = false;
  find("stop-line").hidden = exit !== null;
  find("busy").textContent = exit !== null ? "" : sinceBegin(seconds);
  const isStopped = exit === 130, atEnd = isStopped ? ["Stopped."] : [];
  if (exit !== null || at || steps.length) find("progress").replaceChildren(...(exit === null ? stage(steps, at, seconds) : atEnd));
  find("warnings").replaceChildren(...warnings.map(warning));
  find("printed").replaceChildren(...asLines(printed));
  find("printed-fold").hidden = exit === null || !printed.length;
  find("error").hidden = !exit || isStopped;
  find("error").replaceChildren(...asLines(fault));
  find("picture-fold").hidden = !picture;
  if (picture && picture[1] !== drawn) {
    find("picture").href = `/files/${picture[0].split("/").map(encodeURIComponent).join("/")}?${drawn = picture[1]}`;
    find("picture").firstElementChild.src = find("picture").href;
  }
  find("proposal").hidden = find("sentence").hidden = !proposal;
  find("rows-fold").hidden = !proposal;
  find("another").hidden = !proposal || !known.part;
  const isDraft = exit === null, now = JSON.stringify([proposal, result, isDraft]);
  if (proposal && drawnPart && now !== told) attempt(() => drawChamber(isDraft));
  find("draft").hidden = !isDraft || !proposal;
  find("made-end").hidden = isDraft;
  if (!proposal || now === told) return; // its buttons stay while one is pointed at
  told = now;
  showProposal(proposal, `${result}/design.toml`);
  find("to-settle").hidden ||= isDraft; // what the pilots change is not to be settled
}

function showProposal({ sentence, rows, tables, matters, choices }, design) {
  find("sentence").replaceChildren(...onPage(sentence));
  find("to-settle").hidden = !matters.length;
  find("to-settle").replaceChildren(...byUrgency(matters, ({ mark, text, balls }) => element("li", {}, element("b", { textContent: mark }), ...onPage(text), ...balls.map(withBalls))));
  find("rows").replaceChildren(...rows.map(({ name, value, reasons }) => element("tr", {},
    element("th", { textContent: name[0].toUpperCase() + name.slice(1) }),
    element("td", {}, element("b", {}, ...onPage(value)), ...reasons.map((words) => element("p", {}, ...onPage(words)))))));
  find("tables").replaceChildren(...tables.map(({ caption, head, rows: cells }) => element("details", {}, element("summary", { textContent: caption }),
    element("table", {}, ...[head, ...cells].map(([first, ...others], k) => element("tr", {}, element("th", { textContent: first }), ...others.map((textContent) => element(k ? "td" : "th", { textContent }))))))));
  find("choices").replaceChildren(...choices.map(({ name, text, place, alone, is_target }) => {
    const title = [place && `at ${place} mm in the part's file`, alone].filter(Boolean).join("; ");
    const button = element("button", { title, ariaPressed: String(is_target) }, name, element("small", { textContent: ` ${text}` }));
    button.addEventListener("click", () => attempt(() => propose([name])));
    return known.part ? shows(button, name) : button;
  }));
  find("open-made").onclick = () => attempt(() => open(design));
}

// A button that proposes anew with balls of a size, for the same target.
function withBalls(size) {
  const button = element("button", { textContent: `propose with balls of ${size} mm`, hidden: !known.part });
  button.addEventListener("click", () => attempt(() => {
    find("more").open = true;
    find("ball-mm").value = size;
    return propose(proposed);
  }));
  return button;
}

const WISHES = ["material", "intensity", "coverage", "shop", "calibration", "shot", "ball-mm", "pose", "shape"]; // options of `new`
const NUMBERS = ["intensity", "coverage", "ball-mm"];

// Say what is wrong of each option beside its field, the first of which gets the focus; give whether there is one.
function besideFields(at) {
  for (const id of WISHES) unsay(id);
  const wrong = WISHES.filter((id) => id in at).reverse();
  for (const id of wrong) {
    const field = find(id), fold = field.closest("details");
    if (fold) fold.open = true;
    field.setAttribute("aria-invalid", "true");
    field.after(element("span", { className: "wrong", role: "alert" }, ...onPage(at[id])));
    field.focus();
  }
  return wrong.length > 0;
}

function unsay(id) {
  if (!find(id).hasAttribute("aria-invalid")) return;
  find(id).removeAttribute("aria-invalid");
  find(id).nextSibling.remove();
}

// What is wrong of a field is no longer said once the field has changed.
for (const id of WISHES) for (const name of ["input", "change"]) find(id).addEventListener(name, () => unsay(id));

const ticked = () => [...find("names").querySelectorAll("input")];
async function started(target) {
  const wishes = Object.fromEntries(WISHES.map((id) => [id, find(id).value.trim()]));
  for (const id of NUMBERS) wishes[id] = wishes[id].replace(/(\d),(?=\d)/g, "$1."); // a decimal comma
  besideFields({});
  try { return await ask("/propose", { ...known, ...wishes, target, pilot: find("pilot").checked }); } catch (error) {
    if (!besideFields(error.at ?? {})) throw error;
    return null;
  }
}

// Propose a chamber that peens these surfaces, by default the likeliest one.
let proposed = [];
async function propose(target) {
  if (following) { // a draft, of which another surface was chosen
    await ask("/stop", {});
    await following;
  }
  const begun = await started(target);
  if (!begun) return;
  proposed = target;
  for (const name of target) box(name);
  for (const one of ticked()) one.checked = target.includes(one.value);
  find("made").hidden = false;
  find("made").scrollIntoView({ behavior: "smooth" });
  await follow(begun);
  await show(known.part);
}

// Follow the command that proposes a chamber to its end.
let following = null;
async function follow(begun) {
  find("propose").disabled = true;
  following = followed(tell, begun);
  const ended = await following;
  following = null;
  find("propose").disabled = !known.part;
  if (ended.exit !== 0) find("made").hidden = besideFields(ended.at);
  else find("open-made").focus({ preventScroll: true });
}

find("propose").addEventListener("click", () => attempt(() => propose(ticked().filter((one) => one.checked).map((one) => one.value))));
find("stop").addEventListener("click", () => attempt(() => ask("/stop", {})));
attempt(async () => {
  const now = await ask("/status"), { part, unit, target = [], ...wishes } = now.asked ?? {}; // of before a reload, or before a design was opened
  const chosen = await show(part);
  await attempt(() => look(chosen, unit));
  proposed = target;
  for (const id of WISHES) if (wishes[id]) find(id).value = wishes[id];
  for (const name of target) box(name);
  for (const one of ticked()) one.checked = target.includes(one.value);
  document.body.dataset.ready = "yes";
  if (now.asked) await follow(now);
});
