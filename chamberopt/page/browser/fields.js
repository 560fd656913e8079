// A slider and a field for every number of the design, grouped by its tables; the ends of sliders bound a study.
import { attempt, change, element, endMove, onPage, original, restructure, state, value } from "./state.js";

const OPEN = ["chamber", "shot", "sonotrode"], POSE = ["part.rotate_deg", "part.offset_mm"];
const rows = new Map();
export const ends = new Map(); // low and high of each slider, by name: those that were set, and wide enough for the value
const wanted = new Map(); // those that were set
export const varied = new Set();

export function makeFields() {
  const groups = new Map(), pose = document.getElementById("pose-fields"), numbers = document.getElementById("numbers");
  const opened = new Map([...numbers.querySelectorAll("details")].map((one) => [one.id, one.open])), focused = document.activeElement?.id;
  const folded = (id, open, summary, title = "") => element("details", { id, open: opened.get(id) ?? open }, element("summary", { textContent: summary, title }));
  rows.clear();
  pose.replaceChildren();
  for (const field of state.fields) {
    const isPose = POSE.some((name) => field.name.startsWith(name));
    if (isPose && state.file.is_drawn) continue; // where its file has it
    const { table } = field;
    const row = field.choices ? choiceRow(field) : field.suggestions ? nameRow(field) : numberRow(field);
    if (isPose) { pose.append(row); continue; }
    if (!groups.has(table)) groups.set(table, { group: folded(`of-${table}`, OPEN.includes(table), field.group, `[${table}]`), unset: [] });
    if (isUnset(field)) groups.get(table).unset.push(row);
    else groups.get(table).group.append(row);
  }
  for (const [table, { group, unset }] of groups) if (unset.length) {
    const rest = folded(`unset-of-${table}`, false, `${unset.length} more, not set`);
    rest.className = "unset";
    rest.append(...unset);
    group.append(rest);
  }
  numbers.replaceChildren(...[...groups.values()].map(({ group }) => group));
  document.getElementById(focused)?.focus();
  for (const name of varied) if (!rows.has(name)) varied.delete(name);
  document.dispatchEvent(new Event("varied"));
  showValues();
}

// A number that the design does without is folded away: often the file has another one in its place.
const isUnset = (field) => !field.choices && !field.suggestions && value(field.name) === null;

// What a number is, in words, and why the file has it; its key is the tip.
const label = (field) => element("label", { title: `${field.name} in the file`, htmlFor: field.name },
  element("b", { textContent: field.label }), " ", ...onPage(field.text),
  ...(field.reason.length ? [element("small", {}, element("span", { className: "changed-by" }), element("span", { className: "reason" }, ...onPage(field.reason)))] : []));

// The reason of a number is that of the number in the file, and is dim where that was changed: it may say what the number is, too.
function showReason(row, field, now) {
  const [changed, reason] = [".changed-by", ".reason"].map((name) => row.querySelector(name)), was = original(field.name);
  if (!reason || reason.textContent.startsWith("changed by you")) return;
  const isChanged = now !== was;
  changed.textContent = isChanged ? `changed by you; ${state.file.is_proposed ? "proposed was" : "in the file it is"} ${was ?? "none"}. ` : "";
  reason.classList.toggle("past", isChanged);
}

function choiceRow(field) {
  const select = element("select", { id: field.name }, ...field.choices.map(([value, textContent]) => element("option", { value, textContent })));
  select.addEventListener("change", () => {
    if (!field.is_structure) change({ [field.name]: select.value });
    else attempt(() => restructure(field.name, select.value)).then(showValues); // as it was where it is refused
  });
  const row = element("div", { className: "field" }, label(field), select);
  rows.set(field.name, { show: (now) => { select.value = now; showReason(row, field, now); }, row });
  return row;
}

// A name of a catalogue, of which it suggests what begins or is called like what is typed.
function nameRow(field) {
  const list = element("datalist", { id: `suggested-for-${field.name}` }, ...field.suggestions.map(([value, label]) => element("option", { value, label })));
  const box = element("input", { id: field.name, placeholder: "type to search" });
  box.setAttribute("list", list.id);
  box.addEventListener("change", () => change({ [field.name]: box.value.trim() }));
  const row = element("div", { className: "field named" }, label(field), box, list);
  const show = (now) => {
    if (document.activeElement !== box) box.value = now ?? "";
    row.classList.toggle("changed", now !== original(field.name));
    showReason(row, field, now);
  };
  rows.set(field.name, { show, row });
  return row;
}

// Ends that a slider begins with: half and one and a half times the value, within what the schema allows.
function firstEnds(field) {
  if (field.name.includes("rotate_deg")) return [-180, 180];
  const at = field.value ?? 0, most = field.most ?? Infinity, least = field.least ?? -Infinity;
  const room = Math.abs(at) / 2 || (field.name.endsWith("_mm.0") || field.name.endsWith("_mm.1") ? 20
    : Math.min(Number.isFinite(most) ? most / 10 : 10, 10));
  const round = (x) => field.whole ? Math.round(x) : Number(x.toPrecision(3));
  return [Math.max(least, round(at - room)), Math.min(most, round(at + room))];
}

function numberRow(field) {
  const box = element("input", { type: "text", inputMode: "decimal", id: field.name, placeholder: "not set", disabled: field.fixed });
  const slider = element("input", { type: "range", disabled: field.fixed, ariaLabel: field.name });
  const [low, high] = [0, 1].map(() => element("input", { type: "number", step: "any", ariaLabel: `end of the slider of ${field.name}` }));
  if (!wanted.has(field.name)) wanted.set(field.name, firstEnds(field));
  const holding = (now, [least, most]) => now === null ? [least, most] : [Math.min(now, least), Math.max(now, most)];
  ends.set(field.name, holding(value(field.name), wanted.get(field.name)));
  const scale = () => {
    [low.value, high.value] = [slider.min, slider.max] = ends.get(field.name);
    const span = slider.max - slider.min;
    slider.step = field.whole ? 1 : 10 ** Math.floor(Math.log10(span / 100)) || "any";
  };
  const bound = ([least, most]) => { // gives why other ends than these are taken, or ""
    const now = value(field.name);
    if (least < most) wanted.set(field.name, holding(now, [least, most]));
    show(now);
    scale(); // also where nothing is taken
    if (!(least < most)) return `${least} is not less than ${most}: change the other end first.`;
    return now !== null && (now < least || now > most) ? `The design has ${now}, which is to lie between the ends.` : "";
  };
  const show = (now) => {
    const own = holding(now, wanted.get(field.name)); // a study between the ends has the value too
    if (String(own) !== String(ends.get(field.name))) {
      ends.set(field.name, own);
      scale();
      if (varied.has(field.name)) document.dispatchEvent(new Event("varied"));
    }
    if (document.activeElement !== box) box.value = now ?? "";
    slider.value = now ?? slider.min;
    row.classList.toggle("changed", now !== original(field.name));
    showReason(row, field, now);
  };
  slider.addEventListener("input", () => change({ [field.name]: Number(slider.value) }, field.name));
  slider.addEventListener("change", endMove);
  box.addEventListener("change", () => {
    const text = box.value.trim().replace(",", "."), now = text === "" ? null : Number(text);
    if (!Number.isNaN(now)) { change({ [field.name]: now }); return; }
    sayOwn(row, `${box.value} is no number: what was there stays.`);
    box.value = value(field.name) ?? "";
  });
  for (const end of [low, high]) end.addEventListener("change", () => {
    sayOwn(row, bound([Number(low.value), Number(high.value)]));
  });
  const more = element("div", { className: "ends" }, low, "…", high), vary = [];
  if (field.varies && !field.fixed) {
    const tick = element("input", { type: "checkbox", checked: varied.has(field.name) });
    tick.addEventListener("change", () => {
      varied[tick.checked ? "add" : "delete"](field.name);
      document.dispatchEvent(new Event("varied"));
    });
    vary.push(element("label", { className: "vary", title: "let a search change it, between the ends of its slider" }, tick, " vary"));
  }
  const unit = element("small", { textContent: field.fixed ? "catalogue" : field.unit });
  const row = element("div", { className: "field" }, label(field), ...vary, slider, box, unit, more);
  row.addEventListener("input", () => sayOwn(row, ""));
  more.hidden = true;
  row.addEventListener("focusin", () => { more.hidden = false; });
  row.addEventListener("pointerenter", () => { more.hidden = false; });
  row.addEventListener("pointerleave", () => { more.hidden = !varied.has(field.name) && !row.contains(document.activeElement); });
  scale();
  rows.set(field.name, { show, row, bound });
  return row;
}

export function showValues() {
  for (const [name, { show, row }] of rows) {
    show(value(name));
    sayOwn(row, "");
  }
}

// Say in the row of a number what was not taken of what was typed there, until something is typed or changed.
function sayOwn(row, words) {
  row.querySelector(".own")?.remove();
  if (words) row.append(element("p", { className: "wrong own", role: "alert", textContent: words }));
}

// Let a search change these numbers, between these ends, and no others.
export function varyOnly(asked) {
  varied.clear();
  for (const [name, between] of Object.entries(asked)) {
    if (!state.fields.some((one) => one.name === name && one.varies && !one.fixed)) continue;
    wanted.set(name, between);
    varied.add(name);
  }
  makeFields();
}
export const bound = (name, wanted) => rows.get(name).bound(wanted);

// Say what is wrong at the fields of the keys that a message names; a pair of numbers at its first.
export function sayAtFields(faults = {}) {
  for (const old of document.querySelectorAll(".field > .wrong:not(.own)")) old.remove();
  for (const [name, words] of Object.entries(faults)) {
    const { row } = rows.get(name) ?? rows.get(`${name}.0`) ?? {};
    row?.append(element("p", { className: "wrong", role: "alert" }, ...onPage(words)));
    for (let fold = row?.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
  }
}
