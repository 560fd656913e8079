// A view of surfaces in 3D, with z up: camera, light, colours, and what the pointer meets. Lengths in mm.
"use strict";
THREE.ColorManagement.enabled = false; // a colour on the screen is the one of the colour bar
const TEXT_HEIGHT = 0.0115; // over its distance: 2.2 % of the view's height
const TEXT_PX = 15; // least height on the screen, so that a text is read in a small view too
const OPACITY = { wall: 0.16, sonotrode: 0.9, block: 1 }; // of what is seen through, by kind; of a surface by its name
const MARKED = 0.5, BEHIND = 0.15; // opacity of what marks triangles, so that their own colour is seen; where they are hidden
const GREATER_DEPTH = 6; // THREE.GreaterDepth, which three.min.js leaves out: what is behind is drawn
const EDGED = ["part", "remeshed"], MOST_EDGED = 200000; // whose sharp edges are drawn, and up to how many triangles
const FROM_BELOW = 0.08; // opacity of the sonotrode before the part
const WIDE = 0.7; // width over height of a view that shows all, also what is as wide as its diagonal
const LENS = 30, PARALLEL = 0.1; // degrees of the view from bottom to top; of an eye so far away that lines of sight are parallel
const DEEP = 8; // sizes of what is looked at, before and behind its middle, within which all is drawn
const halfOf = (lens) => Math.tan(lens * Math.PI / 360);
const canScroll = (one) => one.scrollHeight > one.clientHeight;
const flows = (one, ways) => ways.includes(getComputedStyle(one).overflowY);
// Whether the page scrolls, or what an element is in.
function isScrolled(element) {
  for (let one = element.parentElement; one && one !== document.body; one = one.parentElement)
    if (canScroll(one) && flows(one, ["auto", "scroll"])) return true;
  return canScroll(document.documentElement) && !flows(document.body, ["hidden"]);
}
const END_ON = 0.97; // cosine between sight and a dimension from which on it is not drawn
class View3D {
  #meshes = new Map();
  #waiting = false;
  #press = null; // hears where the page is pressed
  #heard = [];
  #clicked = [];
  #kinds = { now: "", hear: null };
  #hidden = new Set(); // kinds of surfaces that are not to be seen

  // The element is filled by the view, and has its size.
  constructor(element) {
    this.element = element;
    const renderer = this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, stencil: true });
    renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    renderer.autoClear = false;
    renderer.localClippingEnabled = true;
    renderer.setPixelRatio(devicePixelRatio);
    element.append(renderer.domElement);
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(LENS, 1, 1, 1000);
    this.camera.up.set(0, 0, 1);
    const sun = new THREE.DirectionalLight(0xffffff, 0.9);
    sun.position.set(-0.4, 0.5, 1);
    this.camera.add(sun);
    this.scene.add(this.camera, new THREE.AmbientLight(0xffffff, 2.4));
    this.#takeWheel(renderer.domElement);
    this.orbit = new THREE.OrbitControls(this.camera, renderer.domElement);
    this.orbit.addEventListener("change", () => { this.draw(); for (const hear of this.#heard) hear(); });
    this.triad = new THREE.Scene();
    for (const [name, colour, at] of [["x", "#b3261e", [1, 0, 0]], ["y", "#1b7a3a", [0, 1, 0]], ["z", "#1f4fa3", [0, 0, 1]]]) {
      this.triad.add(View3D.lineOf([[0, 0, 0], at], colour), View3D.textOf(name, at.map((x) => 1.3 * x), 0.55, colour));
    }
    this.triadCamera = new THREE.PerspectiveCamera(30, 1, 0.1, 20);
    this.triadCamera.up.set(0, 0, 1);
    this.section = new Section(this);
    this.kinds = {}; // label and colour of each kind of surface
    this.awaited = []; // kinds of surfaces that are drawn later
    this.tool = null; // what takes a click instead of those who wait for clicks
    let from = null; // a click is not a turn of the view
    renderer.domElement.addEventListener("pointerdown", (event) => { from = [event.clientX, event.clientY]; });
    renderer.domElement.addEventListener("pointerup", (event) => {
      if (event.button !== 0 || !from || Math.hypot(event.clientX - from[0], event.clientY - from[1]) >= 4) return;
      for (const hear of this.tool ? [this.tool] : this.#clicked) hear(event);
    });
    new ResizeObserver(() => this.#resize()).observe(element);
    this.#resize();
  }

  // Where the page scrolls, the wheel zooms after a click in the view or with Ctrl only.
  #takeWheel(canvas) {
    let isOurs = false;
    this.#press = (event) => { isOurs = event.target === canvas; };
    document.addEventListener("pointerdown", this.#press, { capture: true });
    canvas.addEventListener("wheel", (event) => {
      if (!isOurs && !event.ctrlKey && isScrolled(canvas)) event.stopImmediatePropagation();
    }, { capture: true, passive: true });
  }

  static lineOf(points, colour) {
    const geometry = new THREE.BufferGeometry().setAttribute("position",
      new THREE.BufferAttribute(Float32Array.from(points.flat()), 3));
    return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: colour }));
  }

  // A text that faces the eye, with a height in the scene's units, or as a share of its distance where that is fixed.
  static textOf(text, at, height, colour = "#1c2226", isFixed = false) {
    const canvas = document.createElement("canvas"), pen = canvas.getContext("2d"), font = "600 48px system-ui, sans-serif";
    pen.font = font;
    canvas.width = Math.ceil(pen.measureText(text).width) + 16;
    canvas.height = 64;
    Object.assign(pen, { font, fillStyle: "rgba(255,255,255,0.8)", textBaseline: "middle" }); // clear of lines behind it
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.fillStyle = colour;
    pen.fillText(text, 8, 34);
    const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthTest: false, sizeAttenuation: !isFixed }));
    sprite.scale.set(height * canvas.width / canvas.height, height, 1);
    sprite.position.set(...at);
    return sprite;
  }

  // Replace a surface. triangles: three numbers of points each; colours: of each triangle, as [r, g, b] in 0..1 one after
  // the other. Where `scale` is set, values between 0 and 1 at the points are its colours (see `paint`).
  // Else its kind gives its colour. A section does not fill the body of an open surface.
  surface(name, { points, triangles, kind = "", opacity = OPACITY[name] ?? OPACITY[kind] ?? 1, scale = false, open = false }) {
    const colour = this.kinds[kind]?.[1] ?? "#ffffff";
    this.remove(name);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
    geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    const see = opacity < 1;
    const material = new THREE.MeshLambertMaterial({ color: colour, opacity, transparent: see, depthWrite: !see,
      side: THREE.DoubleSide, flatShading: true });
    // Where surfaces lie on each other, the solid one is in front.
    if (see) Object.assign(material, { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    if (scale) geometry.setAttribute("uv", new THREE.BufferAttribute(new Float32Array(points.length / 3 * 2).fill(0.5), 2));
    const mesh = new THREE.Mesh(geometry, material);
    Object.assign(mesh.userData, { kinds: kind ? [kind] : [], open, points, index: triangles });
    if (name === "sonotrode") this.#rim(points, triangles, colour);
    if (EDGED.includes(name) && !scale && triangles.length < 3 * MOST_EDGED) this.#edge(mesh);
    return this.#keep(name, this.#along(kind, mesh));
  }

  // Draw the sharp edges of a surface, as a drawing does. It is pushed back a little, so that they are seen on it.
  #edge(mesh) {
    const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(Measure.sharp(mesh), 3));
    const lines = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: "#1c2226", transparent: true, opacity: 0.5 }));
    lines.userData.isEdge = true;
    Object.assign(mesh.material, { polygonOffset: true, polygonOffsetFactor: 0.5, polygonOffsetUnits: 0.5 });
    mesh.add(lines);
  }

  // The border of the sonotrode in its colour, which hardly shows where the part is seen through it.
  #rim(points, triangles, colour) {
    const ends = Section.border(triangles).flatMap((side) => side.flatMap((i) => [...points.subarray(3 * i, 3 * i + 3)]));
    this.lines("rim", Float32Array.from(ends), colour, "sonotrode").renderOrder = 2; // over the edges of the walls
  }

  // Colour each triangle of a surface; it then has three points of its own.
  colourTriangles(name, colours) {
    const { mesh } = this.#meshes.get(name);
    if (mesh.geometry.index) mesh.geometry = mesh.geometry.toNonIndexed();
    const each = new Float32Array(9 * colours.length / 3);
    for (let k = 0; k < colours.length; k += 3) {
      for (let corner = 0; corner < 9; corner += 3) each.set(colours.subarray(k, k + 3), 3 * k + corner);
    }
    mesh.geometry.setAttribute("color", new THREE.BufferAttribute(each, 3));
    mesh.material.vertexColors = true;
    mesh.material.needsUpdate = true;
    this.draw();
  }

  // Colour a surface by values between 0 and 1 at its points, along a scale of colours "#rrggbb".
  paint(name, values, scale) {
    const mesh = this.get(name);
    if (!mesh) return; // the view was given up before its colours came
    const uv = mesh.geometry.getAttribute("uv"), n = scale.length;
    for (let i = 0; i < values.length; i++) uv.array[2 * i] = (0.5 + values[i] * (n - 1)) / n;
    uv.needsUpdate = true;
    if (mesh.userData.scale !== scale) {
      const texels = Uint8Array.from(scale.flatMap((c) => [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16)).concat(255)));
      mesh.material.map = new THREE.DataTexture(texels, n, 1);
      mesh.material.map.needsUpdate = mesh.material.needsUpdate = true;
      mesh.userData.scale = scale;
    }
    this.draw();
  }

  // Replace lines: ends of one after the other, [x, y, z, x, y, z, ...]. They are hidden with a kind of surfaces, and where
  // the eye looks along a unit vector [x, y, z].
  lines(name, ends, colour, kind = "", along = null) {
    this.remove(name);
    const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(ends, 3));
    return this.#keep(name, this.#along(kind, new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: colour })), along));
  }

  // Replace texts: [text, [x, y, z]] each. They are as large near as far, and are hidden as lines are, and where they would
  // overlap others.
  texts(name, texts, kind = "", along = null) {
    this.remove(name);
    const group = new THREE.Object3D();
    for (const [text, at] of texts) group.add(View3D.textOf(text, at, TEXT_HEIGHT, undefined, true));
    for (const one of group.children) one.renderOrder = 80; // in front of what is seen through
    group.userData.isText = true;
    return this.#keep(name, this.#along(kind, group, along));
  }

  #along(kind, mesh, along = null) {
    Object.assign(mesh.userData, { kind, along });
    mesh.visible = !this.#hidden.has(kind);
    return mesh;
  }

  #keep(name, mesh) {
    this.#meshes.set(name, { mesh });
    this.scene.add(mesh);
    this.section.take(name, mesh);
    this.draw();
    return mesh;
  }

  // Put a surface elsewhere, by a rotation of nine numbers, row by row, and a shift.
  pose(name, r, s) {
    const mesh = this.get(name);
    mesh.matrixAutoUpdate = false;
    mesh.matrix.set(r[0], r[1], r[2], s[0], r[3], r[4], r[5], s[1], r[6], r[7], r[8], s[2], 0, 0, 0, 1);
    mesh.matrixWorldNeedsUpdate = true;
    this.#lay(name);
    this.draw();
  }

  // Put what marks a surface where the surface is.
  #lay(name) {
    const marked = this.get("highlight");
    if (marked?.userData.of !== name) return;
    marked.matrixAutoUpdate = false;
    marked.matrix.copy(this.get(name).matrix);
    marked.matrixWorldNeedsUpdate = true;
  }

  // Mark triangles of a surface, faintly also where they are hidden, or only where they are seen; null for none.
  highlight(name, triangles, colour, isThrough = true) {
    this.remove("highlight");
    const mesh = this.get(name);
    if (!mesh || !triangles) { delete this.element.dataset.highlight; return; }
    this.element.dataset.highlight = triangles.length;
    const { points, index } = mesh.userData, own = new Uint32Array(3 * triangles.length);
    triangles.forEach((k, i) => own.set(index.subarray(3 * k, 3 * k + 3), 3 * i));
    const marked = this.surface("highlight", { points, triangles: own, opacity: MARKED });
    marked.material.color.set(colour);
    Object.assign(marked.material, { polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -4 });
    marked.renderOrder = 1;
    if (isThrough) {
      const behind = new THREE.Mesh(marked.geometry, Object.assign(marked.material.clone(), { depthFunc: GREATER_DEPTH, opacity: BEHIND }));
      marked.add(Object.assign(behind, { renderOrder: 1 }));
    }
    marked.userData.of = name;
    this.#lay(name);
  }

  // Names and surfaces, lines and texts.
  all() { return [...this.#meshes].map(([name, { mesh }]) => [name, mesh]); }

  // Box round the surfaces of these names, by default those that a section cuts: { low, high }.
  extent(names = Object.keys(Section.SURFACES)) {
    const low = new THREE.Vector3(Infinity, Infinity, Infinity), high = low.clone().negate(), corner = new THREE.Vector3();
    for (const [name, mesh] of this.all()) {
      if (!names.includes(name) || !mesh.visible) continue;
      if (!mesh.geometry.boundingBox) mesh.geometry.computeBoundingBox();
      const ends = [mesh.geometry.boundingBox.min, mesh.geometry.boundingBox.max];
      mesh.updateWorldMatrix(true, false);
      for (let k = 0; k < 8; k++) {
        corner.set(ends[k & 1].x, ends[k >> 1 & 1].y, ends[k >> 2].z).applyMatrix4(mesh.matrixWorld);
        low.min(corner);
        high.max(corner);
      }
    }
    return { low: low.toArray(), high: high.toArray() };
  }

  // Call with each click into the view that no tool takes.
  hearClicks(hear) { this.#clicked.push(hear); }

  // Call with the kinds that are there, now and whenever they are others, or others are hidden.
  hearKinds(hear) {
    this.#kinds = { now: "", hear };
    this.draw();
  }

  get(name) { return this.#meshes.get(name)?.mesh; }

  remove(name) {
    const mesh = this.get(name);
    if (!mesh) return;
    mesh.traverse((one) => { one.geometry?.dispose(); one.material?.map?.dispose(); one.material?.dispose(); });
    mesh.removeFromParent();
    this.#meshes.delete(name);
    if (name in Section.SURFACES) this.section.change();
    this.draw();
  }

  show(names, visible) {
    for (const name of names) if (this.get(name)) this.get(name).visible = visible;
    this.section.change();
    this.draw();
  }

  // Whether a surface is all of one kind, so that it can be hidden.
  isSurface(kind) { return this.all().some(([, mesh]) => mesh.userData.kind === kind); }

  hides(kind) { return this.#hidden.has(kind); }

  // Hide all surfaces of a kind, now and when they are replaced, or show them again.
  hide(kind, isHidden) {
    if (isHidden) this.#hidden.add(kind); else this.#hidden.delete(kind);
    this.show(this.all().filter(([, mesh]) => mesh.userData.kind === kind).map(([name]) => name), !isHidden);
  }

  #caster(event) {
    const box = this.renderer.domElement.getBoundingClientRect(), caster = new THREE.Raycaster();
    caster.setFromCamera(new THREE.Vector2((event.clientX - box.left) / box.width * 2 - 1,
      1 - (event.clientY - box.top) / box.height * 2), this.camera);
    return caster;
  }

  ray(event) { return this.#caster(event).ray; }

  // Where a place is in the window: [clientX, clientY].
  onScreen(place) {
    const box = this.renderer.domElement.getBoundingClientRect(), at = place.clone().project(this.camera);
    return [box.left + (at.x + 1) / 2 * box.width, box.top + (1 - at.y) / 2 * box.height];
  }

  // What a pointer event meets of the surfaces of these names that a section leaves, the nearest first:
  // { name, triangle, corner: its closest point, place, normal }.
  hits(event, names) {
    const meshes = names.map((name) => this.get(name)).filter(Boolean);
    return this.#caster(event).intersectObjects(meshes, false).map((hit) => [hit, names.find((one) => this.get(one) === hit.object)]).filter(([{ point }, name]) => !this.section.hides(point, name)).map(([hit, name]) => {
      const position = hit.object.geometry.getAttribute("position");
      const place = hit.object.worldToLocal(hit.point.clone());
      const far = (i) => new THREE.Vector3().fromBufferAttribute(position, i).distanceTo(place);
      const corner = [hit.face.a, hit.face.b, hit.face.c].reduce((best, i) => far(i) < far(best) ? i : best);
      const normal = hit.face.normal.clone().transformDirection(hit.object.matrixWorld);
      return { name, triangle: hit.faceIndex, corner, place: hit.point, normal };
    });
  }

  // The surface of these names that a pointer event meets first, as of `hits`, or null.
  at(event, names) { return this.hits(event, names)[0] ?? null; }

  // Look at a place from an eye; what is within `size` of it fills the view.
  look({ middle, eye, size }) {
    this.home = { middle, eye, size };
    this.#aim(this.home);
  }

  #aim({ middle, eye, size }) {
    const far = Math.max(1, WIDE / this.camera.aspect) * halfOf(LENS) / halfOf(this.camera.fov);
    this.orbit.target.set(...middle);
    this.camera.position.set(...middle.map((x, i) => x + far * (eye[i] - x)));
    this.orbit.update();
    this.draw();
  }

  // Draw along parallel lines of sight, in which equal lengths are equal, or as the eye sees; what is in the middle keeps its size.
  parallel(isOn) {
    const { camera, orbit } = this, lens = isOn ? PARALLEL : LENS, nearer = halfOf(camera.fov) / halfOf(lens);
    if (camera.fov === lens) return;
    camera.fov = lens;
    camera.position.sub(orbit.target).multiplyScalar(nearer).add(orbit.target);
    orbit.update();
    this.draw();
  }

  // Draw all that is about the middle, however far the eye is.
  #reach() {
    const { camera } = this, size = this.home?.size ?? 1, away = camera.position.distanceTo(this.orbit.target);
    camera.near = Math.max(size / 200, away - DEEP * size);
    camera.far = away + 2 * DEEP * size;
    camera.updateProjectionMatrix();
  }

  // The corner [x, y, z], of ones, that is nearest to the eye of the home view, which sees most of the target.
  #corner() {
    const { middle, eye } = this.home ?? { middle: [0, 0, 0], eye: [1, -1, 1] };
    return eye.map((x, i) => x < middle[i] ? -1 : 1);
  }

  // Look at all surfaces that are to be seen, from the side to which a way [x, y, z] leads, or from a "corner", by default from
  // where the eye is.
  from(side = this.camera.position.clone().sub(this.orbit.target).toArray()) {
    const way = side === "corner" ? this.#corner() : side;
    const { low, high } = this.extent(), size = Math.hypot(...high.map((x, i) => x - low[i]));
    if (!Number.isFinite(size)) return; // nothing is to be seen
    const middle = low.map((x, i) => (x + high[i]) / 2), far = 2.4 * size / Math.hypot(...way);
    this.#aim({ middle, size, eye: middle.map((x, i) => x + far * way[i]) });
  }

  // Turn as another view does.
  follow(other) {
    let busy = false;
    other.#heard.push(() => {
      if (busy || this.camera.position.equals(other.camera.position)) return;
      busy = true;
      this.camera.fov = other.camera.fov;
      this.camera.position.copy(other.camera.position);
      this.orbit.target.copy(other.orbit.target);
      this.orbit.update();
      busy = false;
    });
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (!width || !height) return;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.#render(); // at once: a canvas of a new size is empty
  }

  draw() {
    if (this.#waiting) return;
    this.#waiting = true;
    requestAnimationFrame(() => { this.#waiting = false; this.#render(); });
  }

  #render() {
    if (!this.renderer.domElement.isConnected) return;
    this.section.refresh();
    this.#reach();
    this.#tellKinds();
    this.#show();
    const { renderer, camera } = this, { clientWidth: width, clientHeight: height } = this.element, corner = 84;
    renderer.setViewport(0, 0, width, height);
    renderer.clear();
    renderer.render(this.scene, camera);
    renderer.clearDepth();
    renderer.setViewport(4, 4, corner, corner);
    this.triadCamera.position.copy(camera.position).sub(this.orbit.target).setLength(7);
    this.triadCamera.lookAt(0, 0, 0);
    renderer.render(this.triad, this.triadCamera);
  }

  // Show what the eye can make out: the part through the sonotrode and without what is below it but where a section cuts that, dimensions from aside, and of texts that overlap the first.
  #show() {
    const sight = this.camera.getWorldDirection(new THREE.Vector3()), taken = [], all = this.all().map(([, mesh]) => mesh);
    const sonotrode = this.get("sonotrode"), isBelow = this.camera.position.z < 0;
    if (sonotrode) sonotrode.material.opacity = isBelow ? FROM_BELOW : OPACITY.sonotrode;
    for (const mesh of all) {
      const { along } = mesh.userData, isEndOn = along && Math.abs(sight.dot(new THREE.Vector3(...along))) > END_ON;
      const isUnseen = isEndOn || isBelow && mesh === this.get("block");
      mesh.traverse((one) => { one.layers.set(isUnseen && !one.userData.stencil ? 1 : 0); }); // the camera sees the layer 0
    }
    const usual = TEXT_HEIGHT * this.element.clientHeight / (2 * halfOf(LENS));
    const height = Math.max(usual, TEXT_PX), scale = 2 * halfOf(this.camera.fov) * height / this.element.clientHeight;
    const box = this.renderer.domElement.getBoundingClientRect();
    const texts = all.filter(({ userData, visible }) => userData.isText && visible).flatMap(({ children }) => children);
    for (const one of texts.sort((a, b) => b.renderOrder - a.renderOrder)) {
      one.scale.set(scale * one.scale.x / one.scale.y, scale, 1);
      const width = height * one.scale.x / one.scale.y, [x, y] = this.onScreen(one.position);
      const centre = one.userData.centre ??= one.center.x, isInside = x > box.left && x < box.right;
      const left = isInside ? Math.max(box.left + 2, Math.min(x - centre * width, box.right - width - 2)) : x - centre * width;
      one.center.x = (x - left) / width; // all of a text is in the window if what it names is
      const top = y - (1 - one.center.y) * height;
      const isOver = taken.some(([l, t, w]) => left < l + w && l < left + width && top < t + height && t < top + height);
      const isCut = one.parent.userData.on && this.section.hides(one.position, one.parent.userData.on);
      if (isOver || isCut) one.layers.set(1);
      else if (one.layers.mask === 1) taken.push([left, top, width]);
    }
  }

  #tellKinds() {
    const isThere = ({ visible, userData }) => visible || this.#hidden.has(userData.kind);
    const there = this.all().filter(([, mesh]) => isThere(mesh)).flatMap(([, mesh]) => mesh.userData.kinds ?? []);
    const kinds = [...new Set([...there, ...this.section.kinds()])], now = [...kinds.sort(), "", ...kinds.filter((kind) => this.isSurface(kind)), "", ...this.awaited, "", ...this.#hidden].join();
    if (!this.#kinds.hear || now === this.#kinds.now) return;
    this.#kinds.now = now;
    this.#kinds.hear(kinds);
  }

  // Give up what the view holds of the graphics card: a browser allows a page a few views.
  dispose() {
    for (const name of [...this.#meshes.keys()]) this.remove(name);
    this.orbit.dispose();
    document.removeEventListener("pointerdown", this.#press, { capture: true });
    this.renderer.dispose();
    this.renderer.forceContextLoss();
    this.renderer.domElement.remove();
  }

  // What is drawn, as the address of a picture.
  image() {
    this.#render();
    return this.renderer.domElement.toDataURL("image/png");
  }
}
