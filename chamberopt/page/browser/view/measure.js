// Measuring by clicks in views: the diameter of what is round, or the radius of less than half of it, the distance of two clicks with its parts, and how the
// faces clicked stand to each other.
"use strict";
class Measure {
  static NEAR = 9; // pixels from a corner or edge at which a click is moved onto it
  static SHARP = Math.cos(20 * Math.PI / 180); // between triangles at an edge
  static PARALLEL = Math.cos(0.5 * Math.PI / 180);
  static ASIDE = [[0, 0], [6, 0], [-6, 0], [0, 6], [0, -6]]; // where edges are looked for too: a click may just miss a body
  #first = null;

  // tell: called with what was measured, or what to do.
  constructor(views, tell) { Object.assign(this, { views, tell }); }

  start() {
    for (const view of this.views) view.tool = (event) => this.#click(view, event);
    this.tell("click two points for their distance, or a round surface for its diameter; Escape ends it");
  }

  end() {
    this.#forget();
    for (const view of this.views) view.tool = null;
    this.tell("");
  }

  // Begin anew in another scene, where what was measured in the one before holds no more.
  renew() {
    this.#forget();
    this.start();
  }

  #forget() {
    this.#first = null;
    for (const view of this.views) for (const name of ["measured", "measured text"]) view.remove(name);
  }

  #click(view, event) {
    const hit = Measure.place(view, event);
    if (!hit) { this.tell("nothing is there: click a surface"); return; }
    const first = this.#first?.view === view ? this.#first : null;
    const met = Measure.#met(view, event), round = met?.name ? Round.of(view.get(met.name), met.triangle, met.place) : null;
    if (round && !round.isFlat) hit.normal = null; // a facet's: the surface turns there
    this.#first = first ? null : { view, ...hit };
    const across = round ? [Measure.across(round)] : [], lines = first ? [...Measure.words(first, hit), ...across] : across;
    this.#show(view, first ? [first.place, hit.place] : [hit.place], lines, round);
    this.tell(first ? lines.join("; ") : [...across, `from ${hit.on} at ${Measure.at(hit.place)}: click the other point`].join("; "));
  }

  // The radius of less than half a circle, else its diameter.
  static across({ diameter, isArc, isRough }) {
    const size = isArc ? 0.5 * diameter : diameter;
    return `${isArc ? "R" : "⌀"} ${isRough ? `about ${Number(size.toPrecision(2))}` : Measure.number(size)} mm`;
  }

  #show(view, places, words, round) {
    const arm = 0.008 * view.home.size, ends = places.flatMap((one) => one.toArray()), parts = round ? 96 : 0;
    if (places.length < 2) ends.length = 0;
    for (let k = 0; k < parts; k++) for (const one of [k, k + 1]) ends.push(...round.at(one * 2 * Math.PI / parts).toArray());
    for (const one of places) for (const axis of ["x", "y", "z"])
      for (const way of [-arm, arm]) { const tip = one.clone(); tip[axis] += way; ends.push(...tip); }
    const lines = view.lines("measured", Float32Array.from(ends), "#d6006c");
    const middle = places.reduce((sum, one) => sum.add(one), new THREE.Vector3()).divideScalar(places.length);
    const texts = view.texts("measured text", words.map((text) => [text, middle]));
    texts.children.forEach((one, i) => { one.center.set(0.5, 1.1 * i - 0.2); });
    lines.material.depthTest = false;
    for (const one of [lines, ...texts.children]) Object.assign(one, { renderOrder: 90 }).material.transparent = true;
  }

  static number(x) { return String(Number(x.toFixed(Math.abs(x) < 1 ? 3 : 2)) + 0); }
  static at(place) { return `${place.toArray().map(Measure.number).join(", ")} mm`; }

  // Sentences on two places, and on their faces where neither lies at an edge: lowest line first.
  static words(one, two) {
    const way = two.place.clone().sub(one.place), [x, y, z] = way.toArray().map((part) => Measure.number(Math.abs(part)));
    const words = [`${Measure.number(way.length())} mm (x ${x}, y ${y}, z ${z})`];
    if (!one.normal || !two.normal) return words;
    const turn = Math.min(Math.abs(one.normal.dot(two.normal)), 1), apart = Math.abs(way.dot(one.normal));
    if (turn < Measure.PARALLEL) words.push(`faces at ${Measure.number(Math.acos(turn) * 180 / Math.PI)}°`);
    else if (apart > 1e-3) words.push(`parallel faces, ${Measure.number(apart)} mm apart`);
    return words;
  }

  // The place that a click means, on a corner or edge if one is near: { place, normal: null at an edge, on: what it is on }; null for none.
  static place(view, event) {
    const seen = Measure.ASIDE.map(([x, y]) => Measure.#met(view, { clientX: event.clientX + x, clientY: event.clientY + y }));
    const edges = seen.flatMap((hit) => hit ? Measure.#edges(view, hit) : []).map(({ place, isEnd, name }) => {
      const [x, y] = view.onScreen(place), away = Math.hypot(x - event.clientX, y - event.clientY);
      return { place, away, name, on: isEnd ? "a corner" : "an edge", order: isEnd ? away - Measure.NEAR : away }; // a corner near it is meant
    }).filter(({ place, away, name }) => away < Measure.NEAR && !view.section.hides(place, name)).sort((a, b) => a.order - b.order);
    return edges.length ? { place: edges[0].place, on: edges[0].on, normal: null } : seen[0] && { ...seen[0], on: "a face" };
  }

  // What a click meets: a body that is cut, or a surface. Walls and sonotrode are seen through from behind.
  static #met(view, event) {
    const { section } = view, ray = view.ray(event), cut = section.on ? ray.intersectPlane(section.plane, new THREE.Vector3()) : null;
    const hit = view.hits(event, Object.keys(Section.SURFACES).filter((name) => view.get(name)?.visible))
      .find(({ name, normal }) => Section.SURFACES[name][2] !== "shell" || normal.dot(ray.direction) > 0) ?? null;
    if (!cut || !(ray.direction.dot(section.plane.normal) > 0) || !section.bodyAt(cut)) return hit;
    const isBefore = hit && ray.origin.distanceTo(hit.place) < ray.origin.distanceTo(cut); // on a body that is left whole
    return isBefore ? hit : { place: cut, normal: section.plane.normal.clone() };
  }

  // Places on edges and on the outlines of a section, near what a click meets.
  static #edges(view, { name, place }) {
    const far = view.camera.position.distanceTo(place);
    const near = 4 * Measure.NEAR * Math.tan(view.camera.fov * Math.PI / 360) * far / view.element.clientHeight;
    const found = view.section.outlines.map((ends) => Measure.nearest(ends, place, near));
    if (name) {
      const { matrixWorld } = view.get(name), own = place.clone().applyMatrix4(matrixWorld.clone().invert());
      const edge = Measure.nearest(Measure.sharp(view.get(name)), own, near);
      if (edge) found.push({ ...edge, name, place: edge.place.applyMatrix4(matrixWorld) });
    }
    return found.filter(Boolean);
  }

  // The place on lines that is nearest to a place, at most `near` away; the end of a line goes first.
  static nearest(ends, place, near) {
    const a = new THREE.Vector3(), b = new THREE.Vector3();
    let best = null;
    for (let i = 0; i < ends.length; i += 6) {
      a.fromArray(ends, i);
      b.fromArray(ends, i + 3);
      const way = b.clone().sub(a), share = Math.min(Math.max(place.clone().sub(a).dot(way) / (way.lengthSq() || 1), 0), 1);
      for (const one of [a, b, way.multiplyScalar(share).add(a)]) {
        const isEnd = one !== way, away = one.distanceTo(place) + (isEnd ? 0 : near / 2);
        if (away < (isEnd ? near / 2 : 1.5 * near) && (!best || away < best.away)) best = { place: one.clone(), away, isEnd };
      }
    }
    return best;
  }

  // Ends of a surface's sharp edges and of its border, found once.
  static sharp(mesh) {
    if (mesh.userData.sharp) return mesh.userData.sharp;
    const { index } = mesh.userData, { normals, beside } = Round.facets(mesh), found = [];
    for (let k = 0; k < index.length; k += 3) for (let c = 0; c < 3; c++) {
      const other = beside[k + c];
      if (other < 0 || (other < k / 3 && normals[other].dot(normals[k / 3]) < Measure.SHARP)) found.push(index[k + c], index[k + (c + 1) % 3]);
    }
    return mesh.userData.sharp = Float32Array.from(found.flatMap((i) => Round.corner(mesh, i).toArray()));
  }
}
