// Surfaces of the part: the colours of their states, and what a button names, shown while it is pointed at or has the focus.
import { attempt, unpack } from "./state.js";

// Colour the part's triangles by the state of each, and tell the legend which states there are.
export function colourByState(view, name, { states, kinds }, state) {
  const rgb = states.map((kind) => kinds[kind][1]).map((hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255));
  const colours = new Float32Array(3 * state.length);
  state.forEach((kind, k) => colours.set(rgb[kind], 3 * k));
  Object.assign(view.get(name).userData, { kind: "", kinds: [...new Set(state)].map((kind) => states[kind]) });
  view.colourTriangles(name, colours);
}

export const BODIES = ["block", "deflectors", "holder", "mask"]; // that not every chamber has

// Draw walls and sonotrode of a chamber, and of BODIES those that an answer has.
export function drawBodies(view, answer, edges, opacity = 1) {
  const surface = (name, kind, triangles, points = answer.points, own = undefined) => {
    if (triangles?.length) view.surface(name, { points: points.slice(), triangles: triangles.slice(), kind, opacity: own });
  };
  surface("block", "sonotrode", answer.block_triangles, answer.block_points);
  surface("walls", "wall", answer.walls);
  surface("deflectors", "wall", answer.deflectors);
  surface("sonotrode", "sonotrode", answer.sonotrode);
  for (const name of ["holder", "mask"]) surface(name, name, answer[`${name}_triangles`], answer[`${name}_points`], opacity);
  view.lines("edges", answer.edges.slice(), edges, "wall");
}

// `answer` gives the triangles of the surface that `named` names, or what the server answers of them.
export function lights(named, view, answer, colour) {
  let isOn = false, found = null;
  const show = () => attempt(async () => {
    isOn = true;
    const told = found ?? await answer();
    found = told instanceof ArrayBuffer ? unpack(told).triangles : told;
    if (isOn) view.highlight("part", found, colour());
  });
  const hide = () => {
    if (named.querySelector(":checked") && !view.get("walls")) return; // what is chosen stays lit, until a chamber shows it as its target
    isOn = false;
    view.highlight("part", null);
  };
  for (const name of ["pointerenter", "focusin"]) named.addEventListener(name, show);
  for (const name of ["pointerleave", "focusout"]) named.addEventListener(name, hide);
  return named;
}
