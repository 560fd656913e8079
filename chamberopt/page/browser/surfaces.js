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

// Unit vector to the eye from which most of the target faces it, of twelve from above and as many from below.
export function wayToTarget(part, { rotation: r, state }) {
  const corners = part.geometry.getAttribute("position").array, ways = [];
  for (const up of [0.33, -0.33]) for (let k = 0; k < 12; k++) {
    const turn = (k - 1.95) * Math.PI / 6;
    ways.push([0.94 * Math.cos(turn), 0.94 * Math.sin(turn), up]);
  }
  const worth = ways.map(() => 0);
  for (let k = 0; k < state.length; k++) {
    if (state[k] !== 1) continue;
    const [a, b, c] = [0, 3, 6].map((i) => new THREE.Vector3().fromArray(corners, 9 * k + i));
    const own = b.sub(a).cross(c.sub(a)), normal = [0, 1, 2].map((i) => r[3 * i] * own.x + r[3 * i + 1] * own.y + r[3 * i + 2] * own.z);
    ways.forEach((way, i) => { worth[i] += Math.max(0, way[0] * normal[0] + way[1] * normal[1] + way[2] * normal[2]); });
  }
  const best = (first) => { // the usual way where much the same is seen from all sides
    const most = Math.max(...worth.slice(first, first + 12));
    return worth[first] > 0.9 * most ? first : worth.indexOf(most, first);
  };
  const above = best(0), below = best(12);
  const [x, y, z] = ways[worth[below] > 2 * worth[above] ? below : above]; // the floor hides least from above
  const aside = [1.1 * x + 0.5 * ways[0][0], 1.1 * y + 0.5 * ways[0][1]], long = 0.94 / Math.hypot(...aside);
  return [long * aside[0], long * aside[1], z]; // a little aside shows its depth
}

// `answer` gives what the server answers of the triangles of the surface that `named` names.
export function lights(named, view, answer, colour) {
  let isOn = false, found = null;
  const show = () => attempt(async () => {
    isOn = true;
    found ??= unpack(await answer()).triangles;
    if (isOn) view.highlight("part", found, colour());
  });
  const hide = () => {
    if (named.querySelector(":checked")) return; // what is chosen stays lit
    isOn = false;
    view.highlight("part", null);
  };
  for (const name of ["pointerenter", "focusin"]) named.addEventListener(name, show);
  for (const name of ["pointerleave", "focusout"]) named.addEventListener(name, hide);
  return named;
}
