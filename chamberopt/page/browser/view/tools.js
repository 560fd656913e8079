// The tools of views in 3D: a section with its slider, measuring, sides to look from, and the legend of the kinds that
// are there, each of which can be hidden.
"use strict";
class Tools {
  static CHAMBER = ["wall", "sonotrode", "holder", "mask"]; // kinds that are no part
  static ON_PART = { holder: "clamped by the holder", mask: "covered by the mask" }; // faces of the part
  // Names of views, and the way from what is looked at to the eye. A little aside, as z is up.
  static WAYS = { Front: [[0, -1, 0], "along y"], Back: [[0, 1, 0], "against y"], Left: [[-1, 0, 0], "along x"],
    Right: [[1, 0, 0], "against x"], Top: [[0, -1e-4, 1], "from above"], Bottom: [[0, -1e-4, -1], "from below"],
    Isometric: ["corner", "from the corner that sees most of what is looked at"], Fit: [undefined, "all that is shown, from where the eye is"] };
  #cut = { normal: [0, -1, 0], low: -1, high: 1 };
  #isFlipped = false;
  #isChosen = false; // whether a user chose across which axis
  #isOpened = false; // whether the chamber was cut open for a first look

  // Views that a section and measuring serve together; the controls are put into `place`.
  constructor(views, place) {
    const make = (tag, properties, ...inner) => {
      const made = Object.assign(document.createElement(tag), properties);
      made.append(...inner);
      return made;
    };
    this.views = views;
    this.section = make("button", { textContent: "Section", title: "cut the view by a plane" });
    this.measure = make("button", { textContent: "Measure", title: "distance of two clicks, or diameter of what is round; Escape ends it" });
    this.by = make("select", { title: "across which axis, or through which face" },
      ...[["x", "across x"], ["y", "across y"], ["z", "across z"], ["face", "through a face"]].map(([value, textContent]) => make("option", { value, textContent })));
    this.slider = make("input", { type: "range", ariaLabel: "place of the section" });
    this.at = make("input", { type: "number", step: "any", ariaLabel: "place of the section in mm" });
    this.flip = make("button", { textContent: "Flip", title: "show the other side" });
    this.cutsPart = make("input", { type: "checkbox", checked: true });
    this.cutsPart.addEventListener("change", () => this.#apply());
    this.told = make("output", {});
    this.parallel = make("button", { textContent: "Parallel", title: "parallel lines of sight, so that equal lengths are equal in the view; or as the eye sees" });
    this.parallel.addEventListener("click", () => {
      this.parallel.ariaPressed = String(this.parallel.ariaPressed !== "true");
      for (const view of this.views) view.parallel(this.parallel.ariaPressed === "true");
    });
    this.from = make("span", { className: "joined", role: "group", ariaLabel: "view" }, ...Object.entries(Tools.WAYS).map(([textContent, [way, title]]) => {
      const button = make("button", { textContent, title });
      button.addEventListener("click", () => { for (const view of this.views) view.from(way); });
      return button;
    }));
    this.chamber = make("input", { type: "checkbox", checked: true });
    this.chamber.addEventListener("change", () => this.#hide(Tools.CHAMBER, !this.chamber.checked));
    const chamber = make("label", { hidden: true }, this.chamber, " show the chamber");
    this.controls = make("span", { hidden: true, className: "cut" }, this.by, this.slider, make("label", {}, this.at, " mm"), this.flip, make("label", {}, this.cutsPart, " cut the part"));
    this.element = make("div", { className: "tools" }, this.section, this.measure, this.from, this.parallel, chamber, this.controls, this.told);
    this.ruler = new Measure(views, (text) => { this.told.textContent = text; });
    for (const button of [this.section, this.measure, this.parallel]) button.setAttribute("aria-pressed", "false");
    this.section.addEventListener("click", () => { this.cutsPart.checked = true; this.#turn(this.section.ariaPressed !== "true"); });
    this.measure.addEventListener("click", () => this.#measure(this.measure.ariaPressed !== "true"));
    this.by.addEventListener("change", () => { this.#isChosen = true; this.#begin(); });
    this.slider.addEventListener("input", () => { this.at.value = Tools.rounded(this.slider.value); this.#apply(); });
    this.at.addEventListener("input", () => { this.slider.value = this.at.value; this.#apply(); });
    this.flip.addEventListener("click", () => { this.#isFlipped = !this.#isFlipped; this.#apply(); });
    place.append(this.element);
    const hear = (event) => {
      if (!this.element.isConnected) removeEventListener("keydown", hear);
      else if (event.key === "Escape") this.#measure(false);
    };
    addEventListener("keydown", hear);
  }

  #measure(on) {
    this.measure.ariaPressed = String(on);
    if (on && this.by.value === "face" && !this.#cut.place) this.by.value = "y"; // no face is waited for
    if (on) this.ruler.start(); else this.ruler.end();
  }

  // Another scene is drawn: a distance to a place in the one before would mean nothing.
  renew() { if (this.measure.ariaPressed === "true") this.ruler.renew(); }

  #turn(on) {
    this.section.ariaPressed = String(on);
    this.controls.hidden = !on;
    if (on) {
      this.by.value = this.#isChosen ? this.by.value : Tools.#across(this.views[0]);
      this.#begin();
    } else for (const view of this.views) view.section.off();
  }

  // The level axis that is most along sight: a plane across the other would be seen edge on.
  static #across({ camera, orbit }) {
    const sight = camera.position.clone().sub(orbit.target);
    return Math.abs(sight.x) > Math.abs(sight.y) ? "x" : "y";
  }

  // Cut a chamber that is new open round its whole part, so that part, walls, holder and sonotrode are seen at once; unless the user has closed the one before.
  open() {
    if (this.#isOpened && (this.section.ariaPressed !== "true" || this.cutsPart.checked)) return;
    this.#isOpened = true;
    this.cutsPart.checked = false;
    this.#turn(true);
  }

  // Cut nothing: the chamber is gone.
  close() {
    this.#isOpened = false;
    this.#turn(false);
  }

  // Cut in the middle, so that the eye sees the section, or wait for the click on a face. A chamber that is cut round its part is cut in its own middle.
  #begin() {
    const { by } = this, [first] = this.views, axis = ["x", "y", "z"].indexOf(by.value);
    this.#isFlipped = false;
    if (axis < 0) { this.#waitForFace(); return; }
    const normal = [0, 0, 0], { low, high } = first.extent(this.cutsPart.checked || !first.get("walls") ? undefined : ["walls"]);
    normal[axis] = first.camera.position.getComponent(axis) > first.orbit.target.getComponent(axis) ? -1 : 1;
    this.#cut = { normal, sign: normal[axis], from: 0 };
    this.#range(low[axis], high[axis], (low[axis] + high[axis]) / 2);
  }

  #waitForFace() {
    this.#measure(false);
    this.#cut.place = null;
    this.told.textContent = "click a face";
    for (const view of this.views) view.tool = (event) => {
      const hit = Measure.place(view, event);
      if (!hit?.normal) { this.told.textContent = "no face is there: click inside one"; return; }
      for (const one of this.views) one.tool = null;
      this.told.textContent = "";
      const normal = hit.normal.clone().multiplyScalar(hit.normal.dot(view.ray(event).direction) > 0 ? 1 : -1), { size } = view.home;
      this.#cut = { normal: normal.toArray(), sign: 1, from: normal.dot(hit.place) + 1e-4 * size, place: hit.place }; // just behind the face
      this.#range(-size / 2, size / 2, 0);
    };
  }

  // A place to 0.01 mm, and without the sign of -0.
  static rounded(at) { return Math.round(100 * at) / 100 + 0; }

  #range(low, high, at) {
    Object.assign(this.slider, { min: low, max: high, step: 10 ** Math.floor(Math.log10((high - low) / 200)) });
    this.slider.value = this.at.value = Tools.rounded(at);
    this.#apply();
  }

  #apply() {
    const { normal, sign, from } = this.#cut, way = this.#isFlipped ? -1 : 1;
    const distance = from + sign * Number(this.at.value);
    for (const view of this.views) view.section.cut(normal.map((x) => way * x), way * distance, this.cutsPart.checked ? [] : ["part", "mask"]); // plugs are in the part
  }

  // A button that hides the surfaces of a kind in all views, and shows them again.
  #hider(kind, ...inner) {
    const button = Object.assign(document.createElement("button"), { title: "hide it, or show it again" });
    button.dataset.kind = kind;
    button.append(...inner);
    button.addEventListener("click", () => this.#hide([kind], !this.views[0].hides(kind)));
    return button;
  }

  #hide(kinds, isHidden) {
    for (const view of this.views) for (const kind of kinds) view.hide(kind, isHidden);
  }

  // Write the kinds that the views have now into a list, and keep it so.
  legend(list, kinds) {
    const now = this.views.map(() => []);
    let listed = null;
    this.views.forEach((view, i) => {
      view.kinds = kinds;
      view.hearKinds((names) => {
        now[i] = names;
        const there = Object.keys(kinds).filter((name) => now.flat().includes(name));
        const awaited = view.awaited.filter((name) => !view.isSurface(name)).map((name) => `the ${name} is drawn once the chamber is built`);
        const told = [...there.map((name) => this.#label(name, kinds[name][0])), ...awaited];
        if (told.join() !== listed) list.replaceChildren(...there.map((name) => this.#item(name, kinds[name])), ...awaited.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
        listed = told.join();
        for (const button of list.querySelectorAll("button")) button.ariaPressed = String(!view.hides(button.dataset.kind));
        this.#showSwitch(there.filter((name) => Tools.CHAMBER.includes(name)));
      });
    });
  }

  #isSurface(kind) { return this.views.some((one) => one.isSurface(kind)); }

  // What a kind is called: of a holder or mask that is not drawn there are its faces on the part alone.
  #label(kind, label) { return this.#isSurface(kind) ? label : Tools.ON_PART[kind] ?? label; }

  #item(name, [label, colour]) {
    const item = document.createElement("li"), patch = document.createElement("i");
    patch.style.background = colour;
    item.append(...(this.#isSurface(name) ? [this.#hider(name, patch, label)] : [patch, this.#label(name, label)]));
    return item;
  }

  #showSwitch(there) {
    const hidden = there.filter((kind) => this.views[0].hides(kind)).length;
    this.chamber.parentElement.hidden = !there.length;
    Object.assign(this.chamber, { checked: hidden < there.length, indeterminate: hidden > 0 && hidden < there.length });
  }
}
