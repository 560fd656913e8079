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

const ALONG = { box: null, width: [1, 0, 0], depth: [0, 1, 0], height: [0, 0, 1] }; // axis of each dimension; it is not drawn where the eye looks along it
export const DIMENSIONS = Object.keys(ALONG).flatMap((name) => [name, `${name}, lines`]);
export const short = (x) => String(Number(x.toPrecision(4)));

// Sizes of the chamber and the part's height over the sonotrode, and the part's box, beside what is seen first: from `way` on.
export function drawDimensions(view, { shape, shape_mm: [low, high], part_mm: [a, b], distance_mm, way }) {
  const size = Math.hypot(...high.map((x, i) => x - low[i]));
  const gap = 0.06 * size;
  const ends = [];
  for (const [i, j] of [[0, 1], [1, 3], [3, 2], [2, 0], [4, 5], [5, 7], [7, 6], [6, 4], [0, 4], [1, 5], [2, 6], [3, 7]])
    for (const k of [i, j]) ends.push([k & 1 ? b[0] : a[0], k & 2 ? b[1] : a[1], k & 4 ? b[2] : a[2]]);
  const show = (name, lines, texts) => {
    const along = ALONG[name];
    view.lines(`${name}, lines`, Float32Array.from(lines.flat()), along ? "#56616a" : "#b4bcc2", along ? "wall" : "", along);
    view.texts(name, texts, along ? "wall" : "", along);
  };
  // So high that it is over the part's farther edge too, as seen from 20 degrees above.
  const above = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), b[2] + 0.04 * size + 0.3 * Math.min(b[0] - a[0], b[1] - a[1])];
  show("box", ends, [["part " + b.map((x, i) => short(x - a[i])).join(" × ") + " mm", above]]);
  const wide = high[0] - low[0], across = high[1] - low[1], isRound = shape !== "box" && Math.abs(wide - across) < 1e-3 * size;
  const sign = shape === "cylinder" ? "⌀ " : "";
  // The sides at which the eye is not in x, and is in y; gaps go outward there.
  const isRight = way[0] >= 0, isFront = way[1] <= 0;
  const x0 = isRight ? low[0] : high[0], x1 = low[0] + high[0] - x0, right = isRight ? gap : -gap;
  const y0 = isFront ? low[1] : high[1], y1 = low[1] + high[1] - y0, front = isFront ? -gap : gap;
  show("width", dimension([x0, y0, 0], [x1, y0, 0], [0, front, 0], size), [[`${sign}${short(wide)} mm`, [0.5 * (x0 + x1), y0 + front, -0.4 * gap]]]);
  show("depth", isRound ? [] : dimension([x0, y0, 0], [x0, y1, 0], [-right, 0, 0], size),
    isRound ? [] : [[`${short(across)} mm`, [x0 - right, 0.5 * (y0 + y1), -0.4 * gap]]]);
  // What of the part is outside of the walls may be lower: then the distance is at an edge of the chamber.
  const set = Number(distance_mm ?? a[2]), isOwn = Math.abs(set - a[2]) < 0.05;
  const [x, y] = isOwn ? [isRight ? b[0] : a[0], isFront ? a[1] : b[1]] : [x0, y0];
  const side = isRound ? 0.5 * (y0 + y1) : y1;
  show("height", [...dimension([x1, side, 0], [x1, side, high[2]], [right, 0, 0], size),
    ...dimension([x, y, 0], [x, y, set], [0, 0, 0], size)],
  [[`height ${short(high[2])} mm`, [x1 + right, side, 0.8 * high[2]]], [`distance ${short(set)} mm`, [x, y, 0.5 * set]]]);
}

// Ends of the lines of a dimension between two places: arrows, aside by a way, and a line from each place to its arrow.
function dimension(from, to, aside, size) {
  const add = (place, way, by = 1) => place.map((x, i) => x + by * way[i]), far = Math.hypot(...aside);
  const along = to.map((x, i) => x - from[i]), length = Math.hypot(...along), head = Math.min(0.02 * size, 0.3 * length);
  const across = far ? aside.map((x) => x / far) : [1, 0, 0], [start, end] = [add(from, aside), add(to, aside)];
  const lines = [start, end];
  for (const [tip, sign] of [[start, 1], [end, -1]]) {
    const back = add(tip, along, sign * head / Math.max(length, 1e-9));
    for (const side of [-0.3, 0.3]) lines.push(tip, add(back, across, side * head));
  }
  if (far) lines.push(from, add(start, aside, 0.2), to, add(end, aside, 0.2));
  return lines;
}

// `answer` gives the triangles of the surface that `named` names, or what the server answers of them.
export function lights(named, view, answer, colour) {
  let isOn = false, found = null;
  const isChosen = () => named.querySelector(":checked") && !view.get("walls"); // it stays lit with all that is chosen, until a chamber shows it as its target
  const show = () => attempt(async () => {
    isOn = true;
    const told = found ?? await answer();
    found = told instanceof ArrayBuffer ? unpack(told).triangles : told;
    if (isOn && !isChosen()) view.highlight("part", found, colour());
  });
  const hide = () => {
    if (isChosen()) return;
    isOn = false;
    view.highlight("part", null);
  };
  for (const name of ["pointerenter", "focusin"]) named.addEventListener(name, show);
  for (const name of ["pointerleave", "focusout"]) named.addEventListener(name, hide);
  return named;
}
