// The view: part and chamber as the newest answers have them, and handles that turn and move the part.
import { change, endMove, state, unpack, value } from "./state.js";
import { BODIES, colourByState, drawBodies, drawDimensions, short } from "./surfaces.js";

export const view = new View3D(document.getElementById("view"));
const tools = new Tools([view], document.getElementById("tools"));
let bodies = null, through = false;
let part = null, handles = null, grip = null, placed = null, coloured = [];

export function showPart(buffer) {
  part = unpack(buffer);
  tools.legend(document.getElementById("legend"), part.kinds);
  view.surface("part", { points: part.points.slice(), triangles: part.triangles.slice(), open: !part.closed });
  placed = null;
  return part;
}

// What `shape` answers: at once, without the part taken out.
export function showShape(answer) {
  if (placed?.form === answer.form) { placed = answer; return; } // what is drawn holds until the newest cavity is there
  tools.renew();
  view.pose("part", answer.rotation, answer.shift);
  view.get("part").visible = true;
  for (const name of ["remeshed", ...BODIES]) view.remove(name); // until the cavity is cut anew
  view.awaited = answer.awaited;
  colour("part", answer.state);
  walls(answer);
  const first = !placed;
  placed = answer;
  if (first) { lookAtAll(); tools.open(); }
  else if (state.showing && isBeyond(answer.shape_mm)) lookAtAll(view.camera.position.clone().sub(view.orbit.target).normalize().toArray());
  drawDimensions(view, placed);
  if (grip && !handles.dragging) grip.position.set(...middle());
}

// What `cavity` answers: exactly what the shot flies in.
export function showCavity(answer) {
  for (const name of ["remeshed", ...BODIES]) view.remove(name); // of the cavity before
  view.awaited = [];
  walls(answer);
  if (answer.part_points) view.surface("remeshed", { points: answer.part_points.slice(), triangles: answer.part_triangles.slice(), open: !part.closed });
  view.show(["part"], !answer.part_points);
  showState(answer.state);
}

export function showState(state) { colour(view.get("remeshed") ? "remeshed" : "part", state); }

function colour(name, state) {
  const mesh = view.get(name);
  if (coloured[0] === mesh && coloured[1].every((kind, k) => kind === state[k])) return;
  coloured = [mesh, state];
  colourByState(view, name, part, state);
}

function walls(answer) {
  bodies = answer;
  drawBodies(view, answer, part.edges, through ? 0.35 : 1);
}

// Holder and mask are seen through while their faces are chosen.
export function seeThrough(now) {
  if (through === now) return;
  through = now;
  if (bodies) walls(bodies);
}

// The next shape, of another step, is looked at as a whole.
export function lookAnew() { placed = null; }

const mid = (a, b) => a.map((x, i) => 0.5 * (x + b[i]));
const middle = () => mid(...placed.part_mm);

let fitted = null; // lowest and highest corner of what was last looked at as a whole
const isBeyond = ([low, high]) => low.some((x, i) => x < fitted[0][i] - 0.1) || high.some((x, i) => x > fitted[1][i] + 0.1);
function lookAtAll(way = placed.way) {
  // A part that goes far out of its chamber is not seen to its end.
  const [inner, outer] = placed.shape_mm, room = 0.4 * Math.hypot(...outer.map((x, i) => x - inner[i]));
  const low = inner.map((x, i) => Math.min(x, Math.max(x - room, placed.part_mm[0][i])));
  const high = outer.map((x, i) => Math.max(x, Math.min(x + room, placed.part_mm[1][i])));
  const size = Math.hypot(...high.map((x, i) => x - low[i])), centre = mid(low, high);
  fitted = [low, high];
  view.look({ middle: centre, eye: centre.map((x, i) => x + 2.8 * size * way[i]), size });
}

view.renderer.domElement.addEventListener("dblclick", () => { if (placed) lookAtAll(); });

// Number of the part's triangle below the pointer, or null.
export function triangleAt(event) { return view.at(event, ["part"])?.triangle ?? null; }

// Gives what a face of the part is, by its triangles, at a place in one of them: { text, isOfPlace }. The text has its area [mm²],
// and whether it is flat or how far round it goes.
export function faceInWords(triangles) {
  const mesh = view.get("part"), { normals } = Round.facets(mesh), first = normals[triangles[0]], { index } = mesh.userData;
  let area = 0;
  for (const k of triangles) {
    const [a, b, c] = [0, 1, 2].map((i) => Round.corner(mesh, index[3 * k + i]));
    area += b.sub(a).cross(c.sub(a)).length() / 2;
  }
  const isFlat = triangles.every((k) => normals[k].dot(first) > Measure.PARALLEL);
  return (triangle, place) => {
    const round = isFlat ? null : Round.of(mesh, triangle, place), isOfPlace = !isFlat && (round?.isRough ?? true);
    const bend = !round ? "curved" : round.isRough ? `curved, ${Measure.across(round)} here` : `round, ${Measure.across(round)}`;
    return { text: `${isFlat ? "flat" : bend}, ${short(area)} mm²`, isOfPlace };
  };
}

let toldOfFace = null; // gives words on the face that is met, and on what a click does with it
export function tellOfFace(tell) { toldOfFace = tell; }
// What is said of the place under the pointer: how the part's file names its surface, what face it is, whether it is in the target, and where.
const under = document.getElementById("under");
view.renderer.domElement.addEventListener("pointermove", (event) => {
  const hit = event.buttons || !placed ? null : view.at(event, ["part"]);
  under.hidden = !hit;
  if (!hit) return;
  const name = part.groups[part.surface?.[hit.triangle]], [kind] = part.kinds[part.states[placed.state[hit.triangle]]];
  const zone = placed.zones[placed.zone[hit.triangle] - 1], words = Tools.ON_PART[part.states[placed.state[hit.triangle]]] ?? kind;
  const [face, remedy] = toldOfFace?.(hit, part.states[placed.state[hit.triangle]]) ?? [];
  const said = [face?.startsWith(`${name},`) ? "" : name, face, words === "zone" ? `zone ${zone}` : words, `at ${Measure.at(hit.place)}`].filter(Boolean).join(", ");
  under.textContent = [said, remedy].filter(Boolean).join(": ");
});
view.renderer.domElement.addEventListener("pointerleave", () => { under.hidden = true; });

// Handles at the part's middle: "rotate", "translate" or "" for none.
export function setHandles(mode) {
  if (!handles) {
    handles = new THREE.TransformControls(view.camera, view.renderer.domElement);
    grip = new THREE.Object3D();
    view.scene.add(grip, handles.getHelper());
    handles.addEventListener("change", () => view.draw());
    handles.addEventListener("dragging-changed", (event) => { view.orbit.enabled = !event.value; endMove(); begin(); });
    handles.addEventListener("objectChange", moved);
    handles.setSize(0.8);
  }
  begin();
  if (mode) handles.attach(grip); else handles.detach();
  if (mode) handles.setMode(mode);
  handles.showZ = mode !== "translate";
  handles.setRotationSnap(Math.PI / 180);
  handles.setTranslationSnap(0.1);
  view.draw();
}

let begun = null;
function begin() {
  if (!placed) return;
  grip.position.set(...middle());
  grip.quaternion.identity();
  const r = placed.rotation;
  begun = { turn: new THREE.Matrix4().set(r[0], r[1], r[2], 0, r[3], r[4], r[5], 0, r[6], r[7], r[8], 0, 0, 0, 0, 1),
    at: grip.position.clone(), offset: [0, 1].map((k) => value(`part.offset_mm.${k}`) ?? 0) };
}

function moved() {
  if (handles.mode === "rotate") {
    const whole = new THREE.Matrix4().makeRotationFromQuaternion(grip.quaternion).multiply(begun.turn);
    const angle = new THREE.Euler().setFromRotationMatrix(whole, "ZYX"); // turned about x, then y, then z
    const turns = ["x", "y", "z"].map((name, k) => [`part.rotate_deg.${k}`, Number((angle[name] * 180 / Math.PI).toFixed(1)) + 0]);
    change(Object.fromEntries(turns), "turning");
  } else {
    const shift = grip.position.clone().sub(begun.at).toArray();
    change(Object.fromEntries([0, 1].map((k) => [`part.offset_mm.${k}`, Number((begun.offset[k] + shift[k]).toFixed(2))])), "moving");
  }
}
