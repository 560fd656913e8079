// The circle of a bore, a shaft, a disc or a fillet that goes round, found from the triangles of the surface that a click meets.
"use strict";
class Round {
  static FLAT = Math.cos(0.5 * Math.PI / 180); // between triangles of one facet
  static SMOOTH = Math.cos(31 * Math.PI / 180); // between facets of one round surface
  static ALONG = 0.02; // of a facet's normal along the axis, sine
  static AWAY = 0.01; // of the radius, between a corner and the circle
  static EXACT = 0.001; // likewise, where the radius is the same all over; of a freeform surface it differs
  static SWEEP = Math.PI / 4; // least that a round surface turns
  static FACETS = 6; // least of a round surface, as any three points lie on a circle
  static CORNERS = 12; // least of a round border
  static OTHER = 0.005; // rad, between the normals of two facets
  static TRIED = 6; // facets beside the one that is met, each of which gives an axis
  static WAYS = 60; // planes across a surface that bends along two ways, in one of which it bends most
  static MOST = 400; // steps of the line in which a plane cuts a surface, to each side

  // Circle round the axis of the round surface at a triangle of a mesh, circle along which a torus or ball bends most
  // there, or round border of the flat face there that is nearest to a place: { diameter, isFlat: whether it is such a border, isArc: whether less than half of it is there, isRough: whether it is known
  // to two digits only, at(angle): a place on it }; null for neither.
  static of(mesh, triangle, place) {
    const { normals, beside } = Round.facets(mesh), own = place.clone().applyMatrix4(mesh.matrixWorld.clone().invert());
    const facet = (first) => Round.#flood(beside, [first], (k) => normals[k].dot(normals[first]) > Round.FLAT);
    const flat = facet(triangle), inside = new Set(flat);
    const next = [...new Set(flat.flatMap((k) => [0, 1, 2].map((c) => beside[3 * k + c])))]
      .filter((k) => k >= 0 && !inside.has(k) && normals[k].dot(normals[triangle]) > Round.SMOOTH);
    const round = next.slice(0, Round.TRIED).map((k) => Round.#surface(mesh, [...flat, ...facet(k)], normals[triangle].clone().cross(normals[k]), own));
    const bent = round.reduce((best, one) => one && one.count > (best?.count ?? 0) ? one : best, null) ?? Round.#tube(mesh, triangle, normals[triangle], own);
    const found = bent ?? Round.#border(mesh, flat, normals[triangle], own);
    return found && { diameter: 2 * found.radius, isFlat: !bent, isArc: Boolean(found.isArc), isRough: Boolean(found.isRough), at: (angle) => found.at(angle).applyMatrix4(mesh.matrixWorld) };
  }

  // Normal of each triangle of a mesh, and the triangle beside each of its sides, -1 at the border; found once.
  static facets(mesh) {
    const { index, points } = mesh.userData;
    if (mesh.userData.facets) return mesh.userData.facets;
    const sides = new Map(), normals = [], beside = new Int32Array(index.length).fill(-1), most = points.length / 3;
    for (let k = 0; k < index.length; k += 3) {
      const [a, b, c] = [0, 1, 2].map((i) => Round.corner(mesh, index[k + i]));
      normals.push(b.sub(a).cross(c.sub(a)).normalize());
      for (let i = 0; i < 3; i++) {
        const ends = [index[k + i], index[k + (i + 1) % 3]], key = Math.min(...ends) * most + Math.max(...ends), other = sides.get(key);
        if (other === undefined) { sides.set(key, k + i); continue; }
        sides.delete(key);
        beside[k + i] = Math.floor(other / 3);
        beside[other] = k / 3;
      }
    }
    return mesh.userData.facets = { normals, beside };
  }

  static corner(mesh, i) { return new THREE.Vector3().fromArray(mesh.userData.points, 3 * i); }

  static #flood(beside, first, belongs) {
    const found = [...first], seen = new Set(first);
    for (let i = 0; i < found.length; i++) for (let c = 0; c < 3; c++) {
      const k = beside[3 * found[i] + c];
      if (k < 0 || seen.has(k) || !belongs(k)) continue;
      seen.add(k);
      found.push(k);
    }
    return found;
  }

  // The round surface about an axis that goes on from two of its facets.
  static #surface(mesh, seeds, axis, place) {
    const { normals, beside } = Round.facets(mesh), { index } = mesh.userData, plane = Round.#plane(axis.normalize());
    const corners = (k) => [0, 1, 2].map((i) => plane.of(Round.corner(mesh, index[3 * k + i])));
    const first = Round.#circle(seeds.flatMap(corners));
    const belongs = (k) => Math.abs(normals[k].dot(axis)) < Round.ALONG && Round.#lie(first, corners(k));
    if (!first || !seeds.every(belongs)) return null;
    const all = Round.#flood(beside, seeds, belongs), circle = Round.#circle(all.flatMap(corners));
    const turns = all.map((k) => { const [x, y] = plane.of(normals[k]); return Math.atan2(y, x); }).sort((a, b) => a - b);
    const gap = turns.reduce((most, turn, i) => Math.max(most, (turns[i + 1] ?? turns[0] + 2 * Math.PI) - turn), 0);
    const facets = turns.filter((turn, i) => !i || turn - turns[i - 1] > Round.OTHER).length;
    return 2 * Math.PI - gap < Round.SWEEP || facets < Round.FACETS ? null
      : { ...plane.on(circle, place.dot(axis)), count: all.length, isArc: gap > Math.PI, isRough: !Round.#lie(circle, all.flatMap(corners), Round.EXACT) };
  }

  // The circle of the cut in which a surface bends most at a place of a triangle: of a torus, round its tube.
  static #tube(mesh, triangle, normal, place) {
    const around = Round.#plane(normal).on({ x: 0, y: 0, radius: 1 }, 0);
    let best = null;
    for (let way = 0; way < Round.WAYS; way++) {
      const axis = normal.clone().cross(around.at(way * Math.PI / Round.WAYS)).normalize(), plane = Round.#plane(axis), height = place.dot(axis);
      const [before, after] = Round.#cut(mesh, triangle, axis, height).map((side) => side.map(plane.of));
      const circle = Round.#along(before, after);
      if (circle && circle.radius < (best?.radius ?? Infinity)) best = { ...plane.on(circle, height), isArc: circle.isArc, isRough: true };
    }
    return best;
  }

  // The points in which a plane cuts the sides of triangles, from one triangle to both of its sides as far as it goes on smoothly.
  static #cut(mesh, triangle, axis, height) {
    const { normals, beside } = Round.facets(mesh), { index } = mesh.userData;
    const met = (k, c) => {
      const [a, b] = [c, (c + 1) % 3].map((i) => Round.corner(mesh, index[3 * k + i])), [from, to] = [a, b].map((one) => one.dot(axis) - height);
      return (from < 0) === (to < 0) ? null : a.lerp(b, from / (from - to));
    };
    return [0, 1, 2].filter((c) => met(triangle, c)).map((side) => {
      const points = [];
      for (let k = triangle, c = side; points.length < Round.MOST;) {
        points.push(met(k, c));
        const next = beside[3 * k + c], back = [0, 1, 2].find((i) => beside[3 * next + i] === k);
        if (next < 0 || next === triangle || back === undefined || normals[next].dot(normals[k]) < Round.SMOOTH) break;
        c = [0, 1, 2].find((i) => i !== back && met(next, i));
        if (c === undefined) break;
        k = next;
      }
      return points;
    });
  }

  // The circle on which a line lies as far as it can be followed to both sides; null for what turns too little.
  static #along(before, after) {
    if (!before?.length || !after?.length) return null;
    const line = [...before.toReversed(), ...after], middle = before.length;
    let low = Math.max(0, middle - 3), high = Math.min(line.length, middle + 3), circle = null;
    const fits = (from, to) => {
      const points = line.slice(from, to), found = points.length < 4 ? null : Round.#circle(points);
      return found && Round.#lie(found, points) ? found : null;
    };
    if (!(circle = fits(low, high))) return null;
    for (let grows = true; grows;) {
      grows = false;
      for (const [from, to] of [[low - 1, high], [low, high + 1]]) {
        const more = from < 0 || to > line.length ? null : fits(from, to);
        if (more) [low, high, circle, grows] = [from, to, more, true];
      }
    }
    const turns = line.slice(low, high).map(([x, y]) => Math.atan2(y - circle.y, x - circle.x));
    const turn = Math.abs(turns.slice(1).reduce((sum, one, i) => sum + Math.atan2(Math.sin(one - turns[i]), Math.cos(one - turns[i])), 0));
    return turn < Round.SWEEP || high - low <= Round.FACETS ? null : { ...circle, isArc: turn < Math.PI };
  }

  // The border of a flat face that is nearest to a place, if it is round.
  static #border(mesh, flat, normal, place) {
    const { index } = mesh.userData, next = new Map(Section.border(flat.flatMap((k) => [0, 1, 2].map((i) => index[3 * k + i]))));
    let nearest = [], least = Infinity;
    for (const start of [...next.keys()]) {
      const loop = [];
      for (let at = start; next.has(at);) { loop.push(Round.corner(mesh, at)); const to = next.get(at); next.delete(at); at = to; }
      const away = loop.reduce((best, one) => Math.min(best, one.distanceTo(place)), Infinity);
      if (away < least) [nearest, least] = [loop, away];
    }
    const plane = Round.#plane(normal), flatly = nearest.map(plane.of), circle = Round.#circle(flatly);
    return nearest.length < Round.CORNERS || !circle || !Round.#lie(circle, flatly) ? null : plane.on(circle, place.dot(normal));
  }

  // Coordinates in planes across an axis, and circles in them.
  static #plane(axis) {
    const u = new THREE.Vector3(Math.abs(axis.x) < 0.9 ? 1 : 0, Math.abs(axis.x) < 0.9 ? 0 : 1, 0).cross(axis).normalize(), v = axis.clone().cross(u);
    const at = (x, y, height) => axis.clone().multiplyScalar(height).addScaledVector(u, x).addScaledVector(v, y);
    return { of: (one) => [one.dot(u), one.dot(v)], on: ({ x, y, radius }, height) => ({ radius,
      at: (angle) => at(x + radius * Math.cos(angle), y + radius * Math.sin(angle), height) }) };
  }

  static #lie({ x, y, radius }, points, away = Round.AWAY) { return points.every((one) => Math.abs(Math.hypot(one[0] - x, one[1] - y) - radius) < away * radius); }

  // The circle nearest to points by least squares of x² + y² = 2 a x + 2 b y + c, about their middle; null for a line.
  static #circle(points) {
    const [mx, my] = [0, 1].map((k) => points.reduce((sum, one) => sum + one[k], 0) / points.length);
    const sums = { xx: 0, xy: 0, yy: 0, x: 0, y: 0, all: 0 };
    for (const [px, py] of points) {
      const x = px - mx, y = py - my, square = x * x + y * y;
      Object.assign(sums, { xx: sums.xx + x * x, xy: sums.xy + x * y, yy: sums.yy + y * y, x: sums.x + x * square, y: sums.y + y * square, all: sums.all + square });
    }
    const share = sums.xx * sums.yy - sums.xy ** 2;
    if (share < 1e-9 * sums.all ** 2) return null;
    const a = (sums.x * sums.yy - sums.y * sums.xy) / (2 * share), b = (sums.y * sums.xx - sums.x * sums.xy) / (2 * share);
    return { x: mx + a, y: my + b, radius: Math.sqrt(a * a + b * b + sums.all / points.length) };
  }
}
