// A section through a view: a plane takes away what is before it, and fills the bodies that it cuts.
"use strict";
class Section {
  // The body that a surface bounds, and the kind whose colour fills it. A chamber's walls and sonotrode have no other
  // side in a design, so a shell behind them is filled; a deflector's surface lacks what lies on a wall.
  static SURFACES = { part: ["part", "rest"], remeshed: ["part", "rest"], few: ["part", "rest"], unreached: ["part", "rest"],
    rest: ["part", "rest"], holder: ["holder", "holder"], mask: ["mask", "mask"], deflectors: ["deflectors", "wall", "lid"],
    sonotrode: ["sonotrode", "sonotrode", "shell"], block: ["sonotrode", "sonotrode"], walls: ["walls", "wall", "shell"] };
  static BODIES = ["walls", "deflectors", "sonotrode", "mask", "holder", "part"]; // the last is in front
  static THICKNESS = 0.025; // of a shell, over the size of the view
  #fills = new Map();
  #outlines = new Map(); // ends of the lines that bound each body in the plane
  #stale = false;
  #spares = []; // bodies that stay whole, as a drawing does not cut a shaft

  constructor(view) {
    this.view = view;
    this.plane = new THREE.Plane(); // what is behind it, at a distance of 0 and more, is kept
    this.on = false;
  }

  // Cut by the plane of a unit normal at a distance from the origin; the normal points to what is kept. Bodies may stay whole.
  cut(normal, distance, spares = []) {
    this.plane.set(new THREE.Vector3(...normal), -distance);
    if (`${spares}` !== `${this.#spares}`) this.off();
    this.#spares = spares;
    if (!this.on) {
      this.on = true;
      for (const [name, mesh] of this.view.all()) this.take(name, mesh);
    }
    this.#stale = true;
    this.view.draw();
  }

  off() {
    if (!this.on) return;
    this.on = false;
    for (const [name, mesh] of this.view.all()) {
      if (this.#cuts(name)) this.#clipAll(mesh, null);
      for (const one of [...mesh.children]) if (one.userData.stencil) this.#drop(one);
    }
    for (const fill of this.#fills.values()) this.#drop(fill);
    this.#fills.clear();
    this.#outlines.clear();
    this.view.remove("outline");
    this.view.draw();
  }

  // Say that surfaces are gone, hidden or elsewhere.
  change() { this.#stale = true; }

  // Whether the section takes away a place, or a place of a surface.
  hides(place, name = "") { return this.on && this.#cuts(name) && this.plane.distanceToPoint(place) < -1e-6 * this.view.home.size; }

  // Cut a surface or lines that the view has got.
  take(name, mesh) {
    if (!this.on || !this.#cuts(name)) return;
    this.#stale = true;
    this.#clipAll(mesh, [this.plane]);
    const [body, , how] = Section.SURFACES[name] ?? [];
    if (!body || mesh.userData.open || name === "sonotrode" && this.view.get("block")) return; // the block is the body below it
    const shape = how === "shell" ? Section.shell(mesh.geometry, Section.THICKNESS * this.view.home.size)
      : how === "lid" ? Section.lid(mesh.geometry) : mesh.geometry;
    for (const [side, count] of [[THREE.BackSide, THREE.IncrementWrapStencilOp], [THREE.FrontSide, THREE.DecrementWrapStencilOp]]) {
      const one = new THREE.Mesh(shape, new THREE.MeshBasicMaterial({ side, clippingPlanes: [this.plane], colorWrite: false,
        depthWrite: false, depthTest: false, stencilWrite: true, stencilFunc: THREE.AlwaysStencilFunc, stencilFail: count,
        stencilZFail: count, stencilZPass: count }));
      one.userData.stencil = true;
      one.renderOrder = this.#order(body);
      mesh.add(one);
    }
  }

  // Kinds of the bodies that are filled.
  kinds() { return [...this.#outlines.keys()].map((body) => this.#kindOf(body)); }

  // The body that is cut at a place of the plane, the one in front, or null.
  bodyAt(place) {
    const [u, v] = this.#axes(), x = u.dot(place), y = v.dot(place), end = new THREE.Vector3();
    const inside = (ends) => {
      let odd = false;
      for (let i = 0; i < ends.length; i += 6) {
        const [x1, y1] = [u.dot(end.fromArray(ends, i)), v.dot(end)], [x2, y2] = [u.dot(end.fromArray(ends, i + 3)), v.dot(end)];
        if (y1 > y !== y2 > y && x < x1 + (y - y1) / (y2 - y1) * (x2 - x1)) odd = !odd;
      }
      return odd;
    };
    return Section.BODIES.findLast((body) => this.#outlines.has(body) && inside(this.#outlines.get(body))) ?? null;
  }

  get outlines() { return [...this.#outlines.values()]; }

  // Bring fills and outlines up to date; the view calls it before it draws.
  refresh() {
    if (!this.on || !this.#stale) return;
    this.#stale = false;
    this.#outlines.clear();
    const found = {};
    for (const [name, mesh] of this.view.all()) {
      const [body] = Section.SURFACES[name] ?? [], own = mesh.children.find((one) => one.userData.stencil);
      if (!body || !mesh.visible || !own) continue;
      mesh.updateWorldMatrix(true, false);
      (found[body] ??= []).push(Section.outline(own.geometry, mesh.matrixWorld, this.plane));
    }
    for (const [body, parts] of Object.entries(found)) {
      const ends = parts.flat();
      if (ends.length) this.#outlines.set(body, Float32Array.from(ends));
    }
    const lines = this.view.lines("outline", Float32Array.from(this.outlines.flatMap((ends) => [...ends])), "#1c2226");
    lines.renderOrder = this.#order() + 2;
    for (const body of Section.BODIES) this.#fill(body);
  }

  #cuts(name) { return name in Section.SURFACES ? !this.#spares.includes(Section.SURFACES[name][0]) : ["", "edges", "rim"].includes(name); }
  #kindOf(body) { return Object.values(Section.SURFACES).find(([one]) => one === body)[1]; }
  #order(body = "part") { return 10 + 2 * Section.BODIES.indexOf(body); }
  #clip(material, planes) { Object.assign(material, { clippingPlanes: planes, needsUpdate: true }); }
  #clipAll(mesh, planes) { // with its sharp edges
    for (const one of [mesh, ...mesh.children.filter((child) => child.userData.isEdge)]) this.#clip(one.material, planes);
  }

  #drop(mesh) {
    mesh.removeFromParent();
    mesh.geometry.dispose();
    mesh.material.dispose();
  }

  #axes() {
    const n = this.plane.normal, u = new THREE.Vector3(Math.abs(n.x) < 0.9 ? 1 : 0, Math.abs(n.x) < 0.9 ? 0 : 1, 0).cross(n).normalize();
    return [u, n.clone().cross(u)];
  }

  // A large square in the plane, drawn where the stencil says that a body is cut.
  #fill(body) {
    const fill = this.#fills.get(body);
    if (!this.#outlines.has(body)) { if (fill) fill.visible = false; return; }
    const [u, v] = this.#axes(), { size, middle } = this.view.home;
    const centre = this.plane.projectPoint(new THREE.Vector3(...middle), new THREE.Vector3());
    const corner = (a, b) => centre.clone().addScaledVector(u, a * 2 * size).addScaledVector(v, b * 2 * size).toArray();
    const corners = new THREE.BufferAttribute(Float32Array.from([corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)].flat()), 3);
    if (fill) {
      fill.visible = true;
      fill.geometry.setAttribute("position", corners);
      fill.geometry.computeBoundingSphere();
      return;
    }
    const geometry = new THREE.BufferGeometry().setAttribute("position", corners);
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    const made = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ color: this.view.kinds[this.#kindOf(body)][1],
      side: THREE.DoubleSide, stencilWrite: true, stencilRef: 0, stencilFunc: THREE.NotEqualStencilFunc,
      stencilFail: THREE.ReplaceStencilOp, stencilZFail: THREE.ReplaceStencilOp, stencilZPass: THREE.ReplaceStencilOp,
      polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 })); // behind its outline
    made.renderOrder = this.#order(body) + 1;
    made.onAfterRender = (renderer) => renderer.clearStencil();
    this.#fills.set(body, made);
    this.view.scene.add(made);
  }

  // Ends of the lines in which a plane cuts a surface that stands at a place.
  static outline(geometry, matrix, plane) {
    const points = geometry.getAttribute("position").array, index = geometry.index?.array, ends = [];
    const count = index ? index.length : points.length / 3, own = plane.clone().applyMatrix4(matrix.clone().invert());
    const { x, y, z } = own.normal, away = new Float64Array(points.length / 3), place = new THREE.Vector3();
    for (let i = 0; i < away.length; i++) away[i] = x * points[3 * i] + y * points[3 * i + 1] + z * points[3 * i + 2] + own.constant;
    for (let k = 0; k < count; k += 3) {
      const corners = index ? [index[k], index[k + 1], index[k + 2]] : [k, k + 1, k + 2];
      if (corners.every((i) => away[i] >= 0) || corners.every((i) => away[i] < 0)) continue;
      corners.forEach((a, c) => {
        const b = corners[(c + 1) % 3];
        if (away[a] >= 0 === away[b] >= 0) return;
        const share = away[a] / (away[a] - away[b]), at = (axis) => points[3 * a + axis] + share * (points[3 * b + axis] - points[3 * a + axis]);
        ends.push(...place.set(at(0), at(1), at(2)).applyMatrix4(matrix));
      });
    }
    return ends;
  }

  // Border of a surface: pairs of points, in the order of the triangle that has each.
  static border(index) {
    const sides = new Map(), most = index.reduce((best, i) => Math.max(best, i), 0) + 1;
    for (let k = 0; k < index.length; k += 3) for (let c = 0; c < 3; c++) {
      const a = index[k + c], b = index[k + (c + 1) % 3];
      if (!sides.delete(b * most + a)) sides.set(a * most + b, [a, b]);
    }
    return [...sides.values()];
  }

  // The closed shell between a surface and the same surface moved along its normals.
  static shell(geometry, thickness) {
    const points = geometry.getAttribute("position").array, index = geometry.index.array, count = points.length / 3;
    const normals = new Map(), corner = (i) => new THREE.Vector3().fromArray(points, 3 * i);
    for (let k = 0; k < index.length; k += 3) {
      const [a, b, c] = [0, 1, 2].map((i) => corner(index[k + i]));
      const normal = b.sub(a).cross(c.sub(a));
      for (let i = 0; i < 3; i++) { // one sum for all facets of a round wall, others for the walls that it meets
        if (!normals.has(index[k + i])) normals.set(index[k + i], []);
        const known = normals.get(index[k + i]), alike = known.find((one) => one.dot(normal) > 0.8 * one.length() * normal.length());
        if (alike) alike.add(normal); else known.push(normal.clone());
      }
    }
    const moved = new Float32Array(2 * points.length);
    moved.set(points);
    for (const [i, known] of normals) {
      const sum = new THREE.Vector3();
      for (const one of known) sum.add(one.normalize());
      sum.normalize(); // so far that each wall is as thick
      const far = known.reduce((total, one) => total + one.dot(sum), 0) / known.length;
      moved.set(corner(i).addScaledVector(sum, thickness / Math.max(far, 0.4)).toArray(), 3 * (count + i));
    }
    const made = [];
    for (let k = 0; k < index.length; k += 3) {
      const [a, b, c] = [index[k], index[k + 1], index[k + 2]];
      made.push(c, b, a, a + count, b + count, c + count);
    }
    for (const [a, b] of Section.border(index)) made.push(b + count, a + count, a, b + count, a, b);
    return Section.#solid(moved, made);
  }

  // A surface closed at each loop of its border, by triangles to the loop's middle.
  static lid(geometry) {
    const points = [...geometry.getAttribute("position").array], index = [...geometry.index.array];
    const next = new Map(Section.border(index));
    for (const start of [...next.keys()]) {
      if (!next.has(start)) continue;
      const loop = [];
      for (let at = start; next.has(at);) { loop.push(at); const to = next.get(at); next.delete(at); at = to; }
      const middle = points.length / 3;
      for (let axis = 0; axis < 3; axis++) points.push(loop.reduce((sum, i) => sum + points[3 * i + axis], 0) / loop.length);
      loop.forEach((a, i) => index.push(loop[(i + 1) % loop.length], a, middle));
    }
    return Section.#solid(Float32Array.from(points), index);
  }

  static #solid(points, index) {
    const made = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(points, 3));
    return made.setIndex(new THREE.BufferAttribute(Uint32Array.from(index), 1));
  }
}
