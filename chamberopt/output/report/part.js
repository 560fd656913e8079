// The part in 3D: colours it by a quantity or by the coverage at a time, and shows the numbers at a point.
"use strict";
addEventListener("beforeprint", () => {
  for (const fold of document.querySelectorAll("details.print")) fold.open = true;
});
(() => {
  const element = document.getElementById("parts");
  if (!element) return;
  const { quantities, scenes, scales } = JSON.parse(element.textContent);
  const find = (id) => document.getElementById(id);
  const controls = { quantity: find("quantity"), time: find("time"), fit: find("fit"), glass: find("glass") };
  const label = find("label");
  const SOLID = ["part", "few", "unreached", "rest"];

  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  for (const scene of scenes) {
    for (const table of [scene.columns, scene.own])
      for (const name of Object.keys(table)) table[name] = new Float32Array(bytes(table[name]));
    for (const name of ["triangle", "number", "element", "impacts"]) scene[name] = new Int32Array(bytes(scene[name]));
    const [part, few] = scene.figure; // few dents: the same points, without colours
    for (const axis of ["x", "y", "z"]) few[axis] = part[axis];
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

  // Range of the colours: 1st to 99th percentile of all results, widened to round numbers.
  function range(all) {
    if (chosen().unit === "%" && !controls.fit.checked) return [0, 100];
    const known = Float32Array.from(all.flatMap((one) => Array.from(one.filter(Number.isFinite)))).sort();
    if (!known.length) return [0, 1];
    const at = (share) => known[Math.round(share * (known.length - 1))];
    let [low, high] = [at(0.01), at(0.99)];
    const span = high > low ? high - low : Math.max(Math.abs(high), 1e-9);
    const step = 10 ** Math.floor(Math.log10(span)) / 2;
    low = low >= 0 && low < 0.4 * high ? 0 : step * Math.floor(low / step);
    high = Math.max(step * Math.ceil(high / step), low + step);
    return [low, chosen().unit === "%" ? Math.min(high, 100) : high];
  }

  // Style of the coloured trace of each scene; arrays are in arrays, as restyle wants them.
  function colouring() {
    const all = scenes.map(values), [low, high] = range(all);
    const colours = scales[chosen().colours], colorscale = colours.map((c, i) => [i / (colours.length - 1), c]);
    const colorbar = { title: { text: chosen().title, side: "right" }, thickness: 16, len: 0.8, outlinewidth: 0 };
    return all.map((one) => {
      const intensity = one.map((x) => Number.isFinite(x) ? Math.min(Math.max(x, low), high) : low);
      return { intensity: [intensity], cmin: low, cmax: high, colorscale: [colorscale], showscale: true, colorbar };
    });
  }

  function mean(scene) {
    const curve = [[0, 0, 0], ...scene.curve], at = seconds();
    const next = curve.findIndex(([time]) => time >= at);
    if (!scene.curve.length || next < 0) return "";
    const [t1, c1, h1] = curve[next], [t0, c0, h0] = curve[Math.max(next - 1, 0)];
    const share = t1 > t0 ? (at - t0) / (t1 - t0) : 1;
    const [value, halfWidth] = [c0 + share * (c1 - c0), h0 + share * (h1 - h0)].map((x) => (100 * x).toFixed(1));
    return `${value} ± ${halfWidth} %`;
  }

  function showTime() {
    const named = (scene) => mean(scene) && (scenes.length > 1 ? `${mean(scene)} (${scene.title})` : mean(scene));
    const means = scenes.map(named).filter(Boolean).join(", ");
    find("at").textContent = `${number(seconds())} s${means ? `: the target is covered to ${means} on average` : ""}`;
    find("times").hidden = !moves();
  }

  const plots = scenes.map((scene, i) => find(`part-${i}`));
  let waiting = false; // a slider moves faster than a large part can be coloured
  function recolour() {
    showTime();
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      colouring().forEach((style, i) => Plotly.restyle(plots[i], style, [0]));
    });
  }

  let mouse = { clientX: 0, clientY: 0 };
  addEventListener("pointermove", (event) => { mouse = event; }, { capture: true, passive: true });

  function show(event, i) {
    const point = event.points[0], scene = scenes[i], k = point.pointNumber;
    if (point.curveNumber > 1) return;
    const rows = quantities.map((one) => {
      const now = one.name === "coverage";
      const value = now ? covered(scene.columns.density[k], scene) : scene.columns[one.name][k];
      return [now ? `coverage after ${number(seconds())} s` : one.label, `${number(value)} ${one.unit}`];
    });
    const t = scene.triangle[k];
    rows.push([`coverage of the triangle after ${number(scene.treatment)} s`, `${number(scene.own.coverage[t])} %`],
      ["width of its 95 % interval", `${number(scene.own.interval[t])} %`],
      ["simulated impacts on the triangle", String(scene.impacts[t])]);
    const table = document.createElement("table");
    const caption = table.createCaption();
    caption.textContent = `element ${scene.element[t]}, triangle ${scene.number[t]} of the part`;
    for (const [name, value] of rows) {
      const row = table.insertRow();
      row.insertCell().textContent = name;
      row.insertCell().textContent = value;
    }
    label.replaceChildren(table);
    label.hidden = false;
    const gap = 18;
    const right = mouse.clientX + gap, width = label.offsetWidth;
    const left = right + width > innerWidth ? mouse.clientX - gap - width : right;
    const top = Math.min(mouse.clientY + gap, innerHeight - label.offsetHeight - 4);
    label.style.left = `${Math.max(left, 4)}px`;
    label.style.top = `${Math.max(top, 4)}px`;
  }

  // The chamber is transparent, so the pointer must reach the part behind it: plotly may pick only the part.
  function pickThePartOnly(plot) {
    const inside = plot._fullLayout.scene._scene;
    for (const trace of Object.values(inside.traces))
      if (!SOLID.includes(trace.data.name))
        for (const drawn of [trace.mesh, trace.linePlot]) if (drawn) drawn.drawPick = () => {};
    inside.glplot.update();
  }

  let turning = false;
  function turnTogether(i, event) {
    const camera = event["scene.camera"];
    if (!camera || turning) return;
    turning = true;
    const others = plots.filter((_, j) => j !== i).map((plot) => Plotly.relayout(plot, { "scene.camera": camera }));
    Promise.all(others).finally(() => { turning = false; });
  }

  const layout = {
    margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "rgba(0,0,0,0)", showlegend: false, font: { size: 13 },
    modebar: { bgcolor: "rgba(255,255,255,0.6)", color: "#56616a", activecolor: "#1c2226" },
  };
  const buttons = [["toImage", "resetCameraLastSave3d"]];
  const styles = colouring();
  const drawn = scenes.map((scene, i) => {
    const [part, few, ...others] = scene.figure, style = styles[i];
    const coloured = [{ ...part, ...style, intensity: style.intensity[0], colorscale: style.colorscale[0] }, few];
    const config = { displaylogo: false, responsive: true, modeBarButtons: buttons };
    return Plotly.newPlot(plots[i], [...coloured, ...others], { ...layout, scene: scene.view }, config).then((plot) => {
      pickThePartOnly(plot);
      plot.on("plotly_hover", (event) => show(event, i));
      plot.on("plotly_unhover", () => { label.hidden = true; });
      if (scenes.length > 1) for (const name of ["plotly_relayout", "plotly_relayouting"])
        plot.on(name, (event) => turnTogether(i, event));
    });
  });
  Promise.all(drawn).then(() => { document.body.dataset.drawn = "yes"; });
  showTime();

  // A printer cannot read what WebGL has drawn, so an image takes its place.
  addEventListener("beforeprint", () => {
    for (const plot of plots) {
      const image = document.createElement("img");
      image.className = "printed";
      image.alt = plot.getAttribute("aria-label");
      image.src = plot._fullLayout.scene._scene.toImage("png");
      plot.querySelector(".gl-container").append(image);
    }
  });
  addEventListener("afterprint", () => document.querySelectorAll("img.printed").forEach((image) => image.remove()));

  controls.quantity.addEventListener("change", recolour);
  controls.fit.addEventListener("change", recolour);
  controls.time.addEventListener("input", recolour);
  controls.glass.addEventListener("change", () => {
    for (const plot of plots) {
      const around = plot.data.flatMap((trace, k) => SOLID.includes(trace.name) ? [] : [k]);
      Plotly.restyle(plot, { visible: controls.glass.checked }, around).then(() => pickThePartOnly(plot));
    }
  });
})();
