// Plots as SVG: a frame with axes, in which points with intervals, lines and bands are drawn.
export function svg(tag, attributes = {}, ...inner) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...inner);
  return made;
}

// Round numbers between two ends, about as many as asked for.
export function ticks(low, high, count) {
  const raw = (high - low) / count, size = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * size).find((one) => one >= 0.7 * raw) ?? 1;
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, k) => Number(((first + k) * step).toPrecision(12)));
}

// An axis: { label, low, high, texts, most }; the values of a choice are its texts, and none is larger than `most`.
export function scaleOf({ low, high, texts = [], most = null }, from, to, margin = 0) {
  const room = texts.length ? 0.3 : margin * (high - low), a = low - room, b = Math.min(high + room, most ?? Infinity);
  const scale = (value) => {
    const place = typeof value === "string" ? texts.indexOf(value) : value; // no place for a number that a shape has not
    return typeof value === "string" && place < 0 ? null : from + (to - from) * (b > a ? (place - a) / (b - a) : 0.5);
  };
  scale.ticks = (count) => texts.length ? texts : ticks(a, b, count);
  return scale;
}

const LINE = 14, LETTER = 6.5; // px, height of a line and usual width of a letter

// A text in as many lines as a length [px] takes.
function inLines(text, length) {
  const lines = [""];
  for (const word of text.split(" ")) {
    if (lines.at(-1) && LETTER * (lines.at(-1).length + word.length) > length) lines.push("");
    lines.push(`${lines.pop()} ${word}`.trim());
  }
  return lines;
}

export class Plot {
  static count = 0;

  constructor({ width, height, x, y, title }) {
    const right = 10, top = 8, bottom = 40, lines = inLines(y.label, height - bottom - top), left = 44 + LINE * lines.length;
    this.x = scaleOf(x, left, width - right, 0.04);
    this.y = scaleOf(y, height - bottom, top, y.name ? 0.04 : 0);
    this.floor = height - bottom - 5;
    const clip = `clip-${++Plot.count}`;
    this.inside = svg("g", { "clip-path": `url(#${clip})` });
    const axes = svg("g", { class: "axes" });
    for (const at of this.x.ticks(x.whole ? Math.min(8, x.high - x.low) : 4).filter((one) => !x.whole || Number.isInteger(one)))
      axes.append(svg("line", { x1: this.x(at), x2: this.x(at), y1: top, y2: height - bottom }), svg("text", { x: this.x(at), y: height - bottom + 14, "text-anchor": "middle" }, String(at)));
    for (const at of this.y.ticks(4))
      axes.append(svg("line", { x1: left, x2: width - right, y1: this.y(at), y2: this.y(at) }), svg("text", { x: left - 5, y: this.y(at) + 4, "text-anchor": "end" }, String(at)));
    axes.append(svg("text", { x: (left + width - right) / 2, y: height - 8, "text-anchor": "middle", class: "name" }, x.label),
      svg("text", { transform: `translate(13 ${(top + height - bottom) / 2}) rotate(-90)`, "text-anchor": "middle", class: "name" },
        ...lines.map((text, k) => svg("tspan", { x: 0, dy: k && LINE }, text))));
    const frame = svg("rect", { x: left, y: top, width: width - left - right, height: height - bottom - top, class: "frame" });
    this.drawing = svg("svg", { width, height, role: "img" }, svg("title", {}, title),
      svg("clipPath", { id: clip }, frame.cloneNode()), frame, axes, this.inside);
  }

  line(places, colour, options = {}) {
    this.inside.append(svg("polyline", { points: places.map(([x, y]) => `${this.x(x)},${this.y(y)}`).join(" "), fill: "none", stroke: colour, ...options }));
  }

  // A best-so-far line: level until the next place.
  steps(places, end, colour) {
    this.line(places.flatMap(([x, y], k) => [[x, y], [places[k + 1]?.[0] ?? end, y]]), colour, { "stroke-width": 1.5, opacity: 0.6 });
  }

  // A curve with its band, [x, mean, half-width] or null each; where it is null nothing is drawn.
  curve(rows, colour) {
    const runs = [[]];
    for (const row of rows) if (row) runs.at(-1).push(row); else runs.push([]);
    for (const run of runs.filter((one) => one.length > 1)) {
      const edge = [...run.map(([x, y, h]) => [x, y + h]), ...run.toReversed().map(([x, y, h]) => [x, y - h])];
      this.inside.append(svg("polygon", { points: edge.map(([x, y]) => `${this.x(x)},${this.y(y)}`).join(" "), fill: colour, opacity: 0.15, class: "band" }));
      this.line(run.map(([x, y]) => [x, y]), colour, { "stroke-width": 1.5, class: "curve" });
    }
  }

  // A candidate at [x, y] with the half-width of y; hollow where that is null, as y is not resolved; without y it lies on the floor of the plot, as a cross.
  candidate(one, x, interval, { colour, cross = false, ring = "" }) {
    const at = this.x(x), y = interval ? this.y(interval[0]) : this.floor;
    if (at === null || y === null) return;
    const half = interval?.[1] ? Math.abs(this.y(interval[0] + interval[1]) - y) : 0;
    const mark = svg("g", { class: "candidate", "data-number": one.number, stroke: colour, fill: colour });
    if (half) mark.append(svg("line", { x1: at, x2: at, y1: y - half, y2: y + half }));
    if (cross) mark.append(svg("path", { d: `M${at - 3.5} ${y - 3.5}l7 7m0 -7l-7 7`, "stroke-width": 1.4 }));
    else mark.append(svg("circle", { cx: at, cy: y, r: 4, ...(interval?.[1] === null ? { fill: "white", "stroke-width": 1.5 } : {}) }));
    if (ring) mark.append(svg("circle", { cx: at, cy: y, r: 7, fill: "none", stroke: ring, "stroke-width": 2 }));
    mark.append(svg("circle", { cx: at, cy: y, r: 9, class: "target" }), svg("title", {}, one.tip));
    this.inside.append(mark);
  }
}

// Parallel coordinates: an axis for each number, and a line for each candidate.
export function parallel({ width, height, axes, candidates, valueOf, colourOf, chosen }) {
  const top = 46, bottom = height - 22, across = (k) => 20 + k * (width - 60) / Math.max(1, axes.length - 1);
  const drawing = svg("svg", { width, height, role: "img" }, svg("title", {}, "all numbers of each candidate"));
  const scales = axes.map((one) => scaleOf(one, bottom, top));
  for (const one of candidates) {
    const places = axes.map(({ name }, k) => [across(k), scales[k](valueOf(one, name))]).filter(([, y]) => y !== null);
    const path = { points: places.map((place) => place.join(",")).join(" "), fill: "none" };
    drawing.append(svg("g", { class: "candidate", "data-number": one.number, stroke: colourOf(one) },
      svg("polyline", { ...path, "stroke-width": one.number === chosen ? 4 : 1.3, ...(one.objective ? {} : { "stroke-dasharray": "3 3" }) }),
      svg("polyline", { ...path, class: "target" }), svg("title", {}, one.tip)));
  }
  axes.forEach((one, k) => {
    drawing.append(svg("line", { x1: across(k), x2: across(k), y1: top, y2: bottom, class: "axis" }),
      svg("text", { x: across(k), y: k % 2 ? 25 : 11, "text-anchor": k === 0 ? "start" : k === axes.length - 1 ? "end" : "middle", class: "name" }, one.label));
    for (const at of one.texts?.length ? one.texts : [one.low, one.high])
      drawing.append(svg("text", { x: across(k) + 4, y: scales[k](at) + (at === one.low ? 12 : -3) }, String(Number.isFinite(at) ? Number(at.toPrecision(4)) : at)));
  });
  return drawing;
}
