// Choosing the target and zones by clicking faces, or by names of the file, and turning a face down.
import { ask, attempt, change, element, say, state, unpack } from "./state.js";
import { faceInWords, seeThrough, setHandles, tellOfFace, triangleAt, view } from "./scene.js";
import { lights } from "./surfaces.js";

const find = (id) => document.getElementById(id);
const KEYS = ["surface", "faces", "direction", "angle_deg", "box_mm", "radius_mm"];
const FIXTURES = ["holder.at", "mask.at"], WHOLE = { "holder.at": "what reaches farthest along its axis" };
let newZone = false;

export function fillTarget() {
  fillSurfaces();
  find("names").replaceChildren(...fillTarget.part.names.map(([name, text]) => {
    const button = element("button", { textContent: name, title: "add it, or take it away, as a click does" });
    button.addEventListener("click", () => choose(name));
    lights(button, view, () => ask("/surface", { name }), () => fillTarget.part.pointed);
    return element("li", {}, button, ` ${text}`);
  }));
  if (!fillTarget.part.names.length) find("names").append(element("li", { textContent: "none" }));
  showBorders();
  showChosen();
}

export function fillSurfaces() {
  const surfaces = { ...state.surfaces }, chosen = find("surface").value;
  for (const [name, zone] of Object.entries(state.changes)) if (/^zones\.\d+$/.test(name)) surfaces[`${name}.target`] = `zone ${zone.name}`;
  find("surface").replaceChildren(...Object.entries(surfaces).map(([table, name]) => element("option", { value: table, textContent: name })));
  if (chosen in surfaces) find("surface").value = chosen;
  return Object.keys(surfaces);
}

// What the file will say of the target, as far as the page has changed it.
export function showChosen() {
  const table = find("surface").value, added = state.changes[table.replace(/\.target$/, "")]?.target;
  const kept = { ...(added ?? state.file.chosen[table]) };
  find("whole").textContent = WHOLE[table] ?? "the whole surface";
  find("whole").hidden = table === "mask.at"; // no mask is a kind of mask, among the numbers
  seeThrough(FIXTURES.includes(table) && !find("target").hidden);
  for (const key of KEYS) {
    const now = state.changes[`${table}.${key}`];
    if (now === null) delete kept[key]; else if (now !== undefined) kept[key] = now;
  }
  const named = names();
  for (const button of find("names").querySelectorAll("button")) button.ariaPressed = String(named.includes(button.textContent));
  showPicked(table, kept);
  find("chosen").textContent = [`[${table}]`, ...Object.entries(kept).map(([key, now]) => `${key} = ${JSON.stringify(now)}`)].join("\n");
}

// What is picked, face by face: pointed at, it lights up on the part, and its cross takes it back.
let listed = "";
const NARROWER = ["direction", "box_mm", "radius_mm"];
async function showPicked(table, kept) {
  const now = JSON.stringify([table, kept]);
  if (now === listed || find("target").hidden) return;
  listed = now;
  const told = await ask("/picked", { changes: state.changes, table }).then(unpack, () => ({ rows: [] })); // the shape says what is wrong
  if (now !== listed) return;
  view.highlight("part", null); // of a row that is gone
  find("picked").replaceChildren(...told.rows.map(({ name, size, place, by_name }, k) => {
    const out = element("button", { type: "button", textContent: "✕", title: "take it back", ariaLabel: `Take ${name} back` });
    out.addEventListener("click", () => by_name ? withoutName(name) : withoutFace(table, kept.faces, k));
    return lights(element("li", { title: place, tabIndex: 0 }, element("span", {}, element("b", { textContent: name }), ` ${size}`), out), view, async () => told[`face_${k}`], () => fillTarget.part.pointed);
  }), ...(NARROWER.some((key) => key in kept) ? [element("li", { className: "soft", textContent: `${told.rows.length ? "of these " : ""}what a direction, a box or a radius leaves, as the file says` })] : []));
}
function withoutFace(table, faces, k) {
  const left = faces.filter((_, i) => i !== k);
  if (left.length) change({ [`${table}.faces`]: left });
  else if (table === "holder.at") only({});
  else say("nothing would be left: click another face first");
}
function withoutName(name) {
  const left = names().filter((one) => one !== name);
  if (left.length) only({ surface: left }); else say("nothing would be left: add another name first");
}

// The names that the target, or another table, is chosen by, as far as it is chosen by names.
export function names(table = find("surface").value) {
  const now = state.changes[`${table}.surface`];
  const kept = now === undefined ? state.file.chosen[table]?.surface : now;
  return [kept ?? []].flat().filter((name) => name !== "all");
}

// Add a name of the file to the target, or take it away, as a click on a face does.
function choose(name) {
  const takes = document.querySelector("input[name=act]:checked").value === "take";
  if (takes) withoutName(name); else only({ surface: [...new Set([...names(), name])] });
}

// Choose by these keys alone.
function only(keys) {
  const table = find("surface").value, none = table === "holder.at" && !Object.keys(keys).length ? { [table]: null } : {};
  change({ ...Object.fromEntries(KEYS.map((key) => [`${table}.${key}`, keys[key] ?? null])), ...none });
}
find("whole").addEventListener("click", () => only({}));
find("surface").addEventListener("change", showChosen);
for (const tab of document.querySelectorAll("nav button")) tab.addEventListener("click", () => setTimeout(showChosen)); // once the tab is shown

// Whether a click takes a face as the CAD file has it, not up to a crease.
const byCadFaces = () => Boolean(fillTarget.part?.cad_face) && find("cad-face").checked;

function showBorders() {
  find("of-cad").hidden = !fillTarget.part.cad_face;
  find("of-crease").hidden = byCadFaces();
}
find("cad-face").addEventListener("change", showBorders);
find("crease").addEventListener("input", () => {
  const { value, min, max } = find("crease"), isRight = find("crease").validity.valid && value !== "";
  find("crease-fault").textContent = isRight ? "" : `given ${value || "no number"}; allowed: from ${min} to ${max}°`;
});

// Number of the face of each triangle that a click takes; null until the server has found faces up to these creases. Their names follow.
let creased = {};
function faces() {
  const { part } = fillTarget, crease_deg = Number(find("crease").value);
  const ends = byCadFaces() ? null : crease_deg;
  if (creased.part !== part || creased.ends !== ends) {
    const asked = creased = { part, ends, of: ends === null ? part.cad_face : null };
    const found = ends === null ? Promise.resolve() : ask("/faces", { crease_deg }).then((answer) => { asked.of = unpack(answer).face; });
    found.then(() => ask("/names", { crease_deg: ends })).then(({ names }) => { asked.names = names; }, () => {}); // a click tells what is wrong
  }
  return creased.of;
}

// The face under the pointer lights up while clicks choose faces.
let lit = null;
function light(event) {
  const isOn = !event?.buttons && (!find("target").hidden || isFaceDown()), of = isOn && event ? faces() : null;
  const triangle = of ? triangleAt(event) : null, face = triangle === null ? null : of[triangle];
  if (face === lit) return;
  lit = face;
  const own = [];
  if (face !== null) of.forEach((one, k) => { if (one === face) own.push(k); });
  view.highlight("part", own.length ? own : null, fillTarget.part.pointed, false);
}
view.renderer.domElement.addEventListener("pointermove", light);
view.renderer.domElement.addEventListener("pointerleave", () => light(null));
// What the face under the pointer is, as a name and words, and what a click does with it. The face that was told of last is kept,
// its words too unless they are of the place alone.
let told = { of: null };
tellOfFace(({ triangle, place }, kind) => {
  const of = faces();
  if (of && (told.of !== of || told.face !== of[triangle])) {
    const own = [];
    of.forEach((one, k) => { if (one === of[triangle]) own.push(k); });
    told = { of, face: of[triangle], triangle, inWords: faceInWords(own) };
    told.words = told.inWords(triangle, place);
  } else if (of && told.triangle !== triangle && told.words.isOfPlace) Object.assign(told, { triangle, words: told.inWords(triangle, place) });
  return [of ? [creased.names?.[told.face], told.words.text].filter(Boolean).join(", ") : "", whatAClickDoes(["target", "unreached", "outside"].includes(kind))];
});
function whatAClickDoes(isTarget) {
  if (isFaceDown()) return "a click turns it down";
  if (find("target").hidden) return `in the tab Target a click ${isTarget ? "takes it away" : "adds it"}`;
  const where = find("surface").selectedOptions[0].textContent, takes = document.querySelector("input[name=act]:checked").value === "take";
  if (takes) return `a click takes it away from ${where}`;
  return isTarget && find("surface").value === "part.target" ? "choose “takes it away” to click it out" : `a click adds it to ${where}`;
}
const isFaceDown = () => find("down").getAttribute("aria-pressed") === "true";

let clicks = Promise.resolve(); // one after the other, each on what the one before has made
async function click(event) {
  const down = isFaceDown();
  if (!down && find("target").hidden) return;
  const triangle = triangleAt(event), crease_deg = byCadFaces() ? null : Number(find("crease").value);
  if (triangle === null) throw new Error("no face of the part is there");
  const made = state.changes;
  document.body.dataset.picked = triangle;
  const act = down ? "down" : document.querySelector("input[name=act]:checked").value;
  const where = { changes: state.changes, triangle, crease_deg, alike: find("alike").checked };
  if (newZone && !down) {
    const name = find("zone").value.trim();
    const faces = await ask("/pick", { ...where, act: "face" }), table = `zones.${fillSurfaces().length - 1}`;
    change({ [table]: { name, target: faces } });
    fillSurfaces();
    find("surface").value = `${table}.target`;
    showChosen();
    newZone = false;
    find("add-zone").setAttribute("aria-pressed", "false");
    return;
  }
  const answer = await ask("/pick", { ...where, table: find("surface").value, act });
  if (state.changes === made) change(answer); // unless it was undone meanwhile
  find("down").setAttribute("aria-pressed", "false");
}

view.hearClicks((event) => { clicks = clicks.then(() => attempt(() => click(event))); });
find("down").addEventListener("click", () => find("down").setAttribute("aria-pressed", !isFaceDown()));
find("add-zone").addEventListener("click", () => attempt(async () => {
  if (!find("zone").value.trim()) throw new Error("give the new zone a name first");
  newZone = !newZone;
  find("add-zone").setAttribute("aria-pressed", newZone);
}));
for (const one of document.querySelectorAll("input[name=handles]")) one.addEventListener("change", () => setHandles(one.value));
