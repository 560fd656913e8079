// The part in 3D: colours it by a quantity or by the coverage at a time, and shows the numbers at a point.
"use strict";
// Fills the panels #part-0, #part-1 ... of a page with scenes, which the controls on it serve together.
function showParts({ quantities, scenes, scales, kinds }) {
  const find = (id) => document.getElementById(id);
  const controls = { quantity: find("quantity"), time: find("time"), fit: find("fit") };
  const label = find("label");
  const CARD = ["coverage", "time-98", "impacts", "speed"]; // beside the pointer; all numbers are in the list of kept places
  const FIRST = ["coverage", "interval", "speed", "impacts", "angle", "time-98"]; // of a kept place; the others are folded
  const DOUBTED = ["coverage", "interval", "time-98"]; // told with a doubt where too few dents were simulated
  const SOLID = ["part", "few", "unreached", "rest"];

  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  for (const scene of scenes) {
    for (const table of [scene.columns, scene.own])
      for (const name of Object.keys(table)) table[name] = new Float32Array(bytes(table[name]));
    for (const name of ["triangle", "number", "element", "impacts", "zone", "surface"]) scene[name] = new Int32Array(bytes(scene[name]));
    for (const surface of Object.values(scene.surfaces)) {
      if (surface.points) surface.points = new Float32Array(bytes(surface.points));
      surface.triangles = new Uint32Array(bytes(surface.triangles));
    }
    scene.surfaces.few.points = scene.surfaces.part.points;
  }

  // Three significant digits; rounding errors around 0 are shown as 0.
  const number = (x) => !Number.isFinite(x) ? "–" : Math.abs(x) < 1e-12 ? "0" : Math.abs(x) >= 1e4
    ? Math.round(x).toString() : String(Number(x.toPrecision(3)));
  const seconds = () => Number(controls.time.value);
  const chosen = () => quantities[controls.quantity.selectedIndex];
  const moves = () => chosen().name === "coverage";
  const covered = (density, scene) => -100 * Math.expm1(-density * seconds() / scene.treatment);

  function values(scene) {
    return moves() ? scene.columns.density.map((d) => covered(d, scene)) : scene.columns[chosen().name];
  }

  // Range of the colours: of coverage that of the pictures at the treatment time, and all at another time; if fitted, and
  // of what is no share, 1st to 99th percentile of all results, widened to round numbers, which 0 may be, but
  // for times: no place is covered at once.
  function range(all) {
    if (chosen().unit === "%" && !controls.fit.checked) {
      return moves() && scenes.every(isTreated) ? [0, 1].map((k) => Math[k ? "max" : "min"](...scenes.map(({ limits }) => limits[k]))) : [0, 100];
    }
    const known = Float32Array.from(all.flatMap((one) => Array.from(one.filter(Number.isFinite)))).sort();
    if (!known.length) return [0, 1];
    const at = (share) => known[Math.round(share * (known.length - 1))];
    let [low, high] = [at(0.01), at(0.99)];
    const span = high > low ? high - low : Math.max(Math.abs(high), 1e-9);
    const step = 10 ** Math.floor(Math.log10(span)) / 2, digit = 10 ** Math.floor(Math.log10(low));
    low = chosen().name === "time-98" ? digit * Math.floor(low / digit) : low >= 0 && low < 0.4 * high ? 0 : step * Math.floor(low / step);
    high = Math.max(step * Math.ceil(high / step), low + step);
    return [low, chosen().unit === "%" ? Math.min(high, 100) : high];
  }

  const isTreated = (scene) => Math.abs(seconds() - scene.treatment) < 1e-3 * scene.treatment;
  function mean(scene) {
    const curve = [[0, 0, 0], ...scene.curve], at = seconds();
    const next = curve.findIndex(([time]) => time >= at);
    if (!scene.curve.length || next < 0) return "";
    const [t1, c1, h1] = curve[next], [t0, c0, h0] = curve[Math.max(next - 1, 0)];
    const share = t1 > t0 ? (at - t0) / (t1 - t0) : 1;
    const told = isTreated(scene) && scene.mean.length ? scene.mean : [c0 + share * (c1 - c0), h0 + share * (h1 - h0)];
    const [value, halfWidth] = told.map((x) => (100 * x).toFixed(1));
    if (halfWidth > 0) return `${value} ± ${halfWidth} %`;
    return value >= 100 ? "more than 99.9 %" : `${value} %`; // known to the last digit
  }

  function showTime() {
    const named = (scene) => mean(scene) && (scenes.length > 1 ? `${mean(scene)} (${scene.title})` : mean(scene));
    const means = scenes.map(named).filter(Boolean).join(", ");
    find("at").textContent = `${number(seconds())} s${means ? `: the target is covered to ${means} on average` : ""}`;
    find("times").hidden = !moves();
  }

  // The scale of colours with its ends and three values between, and what it shows. An end beyond which there are values
  // is an arrow.
  function showBar(bar, low, high, known) {
    const scale = document.createElement("i"), ticks = document.createElement("span"), title = document.createElement("b");
    scale.style.background = `linear-gradient(to top, ${scales[chosen().colours].join(", ")})`;
    title.textContent = chosen().title;
    const within = 1e-6 * (high - low), ends = { 0: known.some((x) => x < low - within) ? "≤ " : "", 1: known.some((x) => x > high + within) ? "≥ " : "" };
    scale.className = [ends[0] && "below", ends[1] && "above"].filter(Boolean).join(" ");
    for (const share of [1, 0.75, 0.5, 0.25, 0]) {
      const tick = document.createElement("em");
      tick.textContent = `${ends[share] ?? ""}${number(low + share * (high - low))}`;
      ticks.append(tick);
    }
    bar.replaceChildren(scale, ticks, title);
  }

  const panels = scenes.map((_, i) => find(`part-${i}`));
  const bars = panels.map((panel) => {
    const bar = document.createElement("div");
    bar.className = "bar";
    panel.append(bar);
    return bar;
  });
  const views = scenes.map((scene, i) => {
    const stage = document.createElement("div");
    stage.className = "stage";
    panels[i].append(stage);
    const view = new View3D(stage);
    view.kinds = kinds;
    for (const [name, surface] of Object.entries(scene.surfaces)) if (name === "part" || surface.triangles.length)
      view.surface(name, { ...surface, scale: name === "part", open: SOLID.includes(name) && !scene.whole });
    view.lines("edges", new Float32Array(bytes(scene.edges.ends)), scene.edges.colour, "wall");
    view.look(scene.view);
    return view;
  });
  new Tools(views, controls.quantity.closest(".controls")).legend(find("kinds"), kinds);

  let waiting = false; // a slider moves faster than a large part can be coloured
  function recolour() {
    showTime();
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      const all = scenes.map(values), [low, high] = range(all);
      all.forEach((one, i) => {
        const share = one.map((x) => Number.isFinite(x) ? Math.min(Math.max((x - low) / (high - low), 0), 1) : 0);
        views[i].paint("part", share, scales[chosen().colours]);
        showBar(bars[i], low, high, one);
      });
      document.body.dataset.drawn = "yes";
    });
  }

  // What is known where the pointer is on the target of a scene: names and values; null elsewhere.
  function known(event, i) {
    const hit = event.buttons || views[i].tool ? null : views[i].at(event, SOLID), scene = scenes[i];
    if (!hit || !["part", "few"].includes(hit.name)) return null;
    const k = hit.corner, t = scene.triangle[k];
    const shown = [], first = [], others = [];
    for (const one of quantities) {
      const now = one.name === "coverage";
      const value = now ? covered(scene.columns.density[k], scene) : scene.columns[one.name][k];
      const row = [now ? `coverage after ${number(seconds())} s` : one.label, `${number(value)} ${one.unit}${DOUBTED.includes(one.name) ? scene.doubt : ""}`];
      if (CARD.includes(one.name) || one === chosen()) shown.push(row);
      if (FIRST.includes(one.name)) first[FIRST.indexOf(one.name)] = row; else others.push(row);
    }
    const surface = scene.names[scene.surface[t]] ?? "no name", zone = scene.zones[scene.zone[t] - 1] ?? "none";
    const where = [...(scene.zones.length ? [["zone", zone]] : []), ...(scene.names.length ? [["surface", surface]] : [])];
    shown.unshift(...where);
    others.push([`coverage of the triangle after ${number(scene.treatment)} s`, `${number(scene.own.coverage[t])} %`],
      ["width of the triangle's 95 % interval", `${number(scene.own.interval[t])} %`],
      ["simulated impacts on the triangle", String(scene.impacts[t])],
      ["triangle", `element ${scene.element[t]}, triangle ${scene.number[t]} of the part`]);
    others.unshift(["place x, y, z", Measure.at(hit.place)]);
    return { first: [...first.filter(Boolean), ...where], others, shown, place: hit.place };
  }

  function point(event, i) {
    const { first, others, shown } = known(event, i) ?? {};
    label.hidden = !shown;
    if (label.hidden) return;
    const table = document.createElement("table");
    table.createCaption().textContent = `a click lists all ${first.length + others.length} numbers`;
    for (const [name, value] of shown) {
      const row = table.insertRow();
      row.insertCell().textContent = name;
      row.insertCell().textContent = value;
    }
    label.replaceChildren(table);
    const gap = 18;
    const right = event.clientX + gap, width = label.offsetWidth;
    const left = right + width > innerWidth ? event.clientX - gap - width : right;
    const top = Math.min(event.clientY + gap, innerHeight - label.offsetHeight - 4);
    label.style.left = `${Math.max(left, 4)}px`;
    label.style.top = `${Math.max(top, 4)}px`;
  }

  // Places that were clicked, a row each with the number that marks it in the view, and buttons to copy and to empty their list.
  const kept = [], places = find("places"), parts = ["h3", "div", "button", "button", "button"].map((tag) => document.createElement(tag));
  const [title, wide, more, copy, empty] = parts;
  [title, copy, empty].forEach((one, i) => { one.textContent = ["Places kept", "Copy the list", "Empty it"][i]; });
  wide.className = "wide";
  places.replaceChildren(title, wide, more, " ", copy, " ", empty);
  function showKept() {
    const named = (how) => [...new Set(kept.flatMap((one) => one[how].map(([name]) => name)))], first = named("first"), others = named("others");
    const table = document.createElement("table"), head = table.createTHead().insertRow(), body = table.createTBody();
    const folded = (cell, k) => { if (k >= first.length) cell.className = "more"; return cell; };
    [...first, ...others].forEach((name, k) => head.append(folded(Object.assign(document.createElement("th"), { textContent: name }), k)));
    for (const one of kept) {
      const row = body.insertRow(), values = new Map([...one.first, ...one.others]);
      [...first, ...others].forEach((name, k) => { folded(row.insertCell(), k).textContent = values.get(name) ?? ""; });
    }
    wide.replaceChildren(table);
    more.textContent = wide.classList.contains("all") ? "Show the first numbers alone" : `Show ${others.length} more numbers`;
    places.hidden = !kept.length;
    views.forEach((view, i) => { // a mark is cut away with the part that it is on
      view.texts("kept", kept.flatMap((one) => one.scene === i ? [[one.mark, one.place.toArray()]] : [])).userData.on = "part";
    });
  }
  function keep(event, i) {
    const { first, others, place } = known(event, i) ?? {}, mark = String(kept.length + 1);
    if (!first) return;
    const result = scenes.length > 1 ? [["result", scenes[i].title]] : [];
    kept.push({ scene: i, place, mark, first: [["mark", mark], ...result, ...first], others });
    showKept();
  }
  more.addEventListener("click", () => { wide.classList.toggle("all"); showKept(); });
  empty.addEventListener("click", () => { kept.length = 0; showKept(); });
  copy.addEventListener("click", () => { // as a sheet of numbers takes it; a page of a file may have no clipboard
    const text = [...wide.querySelectorAll("tr")].map((row) => [...row.cells].map((cell) => cell.textContent).join("\t")).join("\n");
    const area = Object.assign(document.createElement("textarea"), { value: text });
    places.append(area);
    area.select();
    if (document.execCommand("copy")) area.remove(); // else it stays, to be copied by hand
  });

  views.forEach((view, i) => {
    view.hearClicks((event) => keep(event, i));
    panels[i].addEventListener("pointermove", (event) => point(event, i));
    panels[i].addEventListener("pointerleave", () => { label.hidden = true; });
    panels[i].addEventListener("dblclick", () => view.look(scenes[i].view));
    for (const other of views) if (other !== view) view.follow(other);
  });
  controls.quantity.addEventListener("change", recolour);
  controls.fit.addEventListener("change", recolour);
  controls.time.addEventListener("input", recolour);
  recolour();
  return views;
}

(() => {
  const parts = document.getElementById("parts");
  const views = parts ? showParts(JSON.parse(parts.textContent)) : [];
  // A printer cannot read what WebGL has drawn, so an image takes its place.
  addEventListener("beforeprint", () => {
    for (const fold of document.querySelectorAll("details.print")) fold.open = true;
    for (const view of views) {
      const image = document.createElement("img");
      image.className = "printed";
      image.alt = view.element.parentElement.getAttribute("aria-label");
      image.src = view.image();
      view.element.append(image);
    }
  });
  addEventListener("afterprint", () => document.querySelectorAll("img.printed").forEach((image) => image.remove()));
})();
