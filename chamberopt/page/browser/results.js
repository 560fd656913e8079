// Results below the design's folder: in 3D, one or two side by side, with report and process sheet.
import { asLines, ask, attempt, change, element, listen, onPage, say, state } from "./state.js";
import { followStudy } from "./study/study.js";

const find = (id) => document.getElementById(id), list = find("result-list");
const FILES = [["report", "report.html", "report"], ["sheet", "process_sheet.pdf", "process sheet"]];
const ticked = () => [...list.querySelectorAll("input:checked")].map((one) => one.value);
let seen = []; // folders of the results that are shown

const button = (textContent, act) => {
  const made = element("button", { type: "button", textContent });
  made.addEventListener("click", act);
  return made;
};
const link = (folder, file, name) => element("a", { href: `/files/${`${folder}/${file}`.split("/").map(encodeURIComponent).join("/")}`, target: "_blank", rel: "noopener", textContent: name });

async function refresh(tick = ticked) {
  const rows = await ask("/results", { changes: state.changes }), kept = tick();
  list.replaceChildren(...rows.map((row) => {
    const box = element("input", { type: "checkbox", value: row.folder, disabled: Boolean(row.unusable), checked: kept.includes(row.folder) });
    const item = element("li", {}, element("label", {}, box, ` ${row.folder}`), element("small", {}, ...onPage(row.words)));
    if (row.stopped) item.append(element("small", { className: "warning", textContent: row.stopped }));
    if (row.stale) item.append(element("small", { className: "warning", textContent: `${row.stale} Its report and process sheet have what it had.` }), ...onward(row));
    if (row.is_study) item.append(button("see its candidates", () => followStudy(row.folder)), " ");
    for (const [paper, file, name] of row.unusable ? [] : FILES)
      item.append(row[file] ? link(row.folder, file, `open the ${name}`) : maker(paper, row.folder, file, name), " ");
    return item;
  }));
  if (!rows.length) list.append(element("li", { textContent: "none yet: simulate, or run a study" }));
  allow();
  const stale = rows.filter((row) => row.stale && seen.includes(row.folder));
  find("stale").replaceChildren(...stale.map((row) => element("p", { className: "warning", textContent: `${row.folder}: ${row.stale}` }, ...onward(row))));
}

// What can be done about a result of another design: take its numbers, or simulate the design as it is.
function onward({ folder, back }) {
  const take = button("Take its numbers into the design", () => { change(back); say(`The design has the numbers of ${folder} now: save it, or undo.`, true); });
  take.dataset.take = folder;
  const simulate = button("Simulate the design as it is now", () => document.querySelector("[data-tab=run]").click());
  return [" ", ...Object.keys(back ?? {}).length ? [take, " "] : [], simulate, " "];
}

function maker(paper, folder, file, name) {
  const made = button(`make the ${name}`, () => make(paper, folder, file, name));
  made.dataset.make = `${paper} ${folder}`;
  return made;
}

// One report or sheet is made at a time, beside a command that runs.
const EVERY = 500; // ms between looks at it
let making = ""; // paper and folder
function allow() {
  for (const one of list.querySelectorAll("[data-make]")) {
    const isIt = one.dataset.make === making;
    Object.assign(one, { disabled: Boolean(making), className: isIt ? "at-work" : "", textContent: one.textContent.replace(/^mak(e|ing)/, isIt ? "making" : "make") });
  }
}

async function make(paper, folder, file, name) {
  making = `${paper} ${folder}`;
  allow();
  await attempt(async () => {
    let now = await ask("/make", { paper, of: folder });
    while (now.exit === null) {
      await new Promise((done) => { setTimeout(done, EVERY); });
      now = await ask("/made", {});
    }
    if (now.exit !== 0) throw Object.assign(new Error(), { words: asLines(now.fault) });
    making = "";
    await refresh();
    say([`The ${name} of ${folder} is made: `, link(folder, file, "open it")], true);
  });
  making = "";
  allow();
}

find("show-results").addEventListener("click", () => attempt(() => show()));
async function show() {
  const folders = ticked().reverse(); // the older first
  if (!folders.length || folders.length > 2) throw new Error("tick one result, or two to compare");
  const { html, content, longer, places } = await ask("/shown", { folders });
  if (find("results").hidden && find("study-view").hidden) return; // another tab was opened meanwhile
  closeResults();
  seen = folders;
  find("shown").innerHTML = html; // the server's own, as in a report; names in it are escaped
  find("shown").prepend(element("div", { id: "stale" }));
  find("shown").hidden = find("close-results").hidden = false;
  find("shown").scrollTop = 0; // where the one before was scrolled to says nothing of this one
  if (longer.times) find("shown").querySelector("section").append(element("p", {}, simulateLonger(longer)));
  views = showParts(content);
  await refresh();
  if (places) await showDifference(folders);
}

// A button that makes the simulated time of the design longer, and leads to where it is simulated.
function simulateLonger({ times, values, tells }) {
  const [seconds] = Object.values(values);
  const longer = button(`Simulate ${times} times as long, to tell ${tells}`, () => {
    change(values);
    document.querySelector("[data-tab=run]").click();
    say(`Each replica is ${seconds} s long now, ${times} times the time of this result: simulate the design again.`, true);
  });
  longer.id = "longer";
  longer.title = `${times} times the simulated time: ${seconds} s in each replica`;
  return longer;
}

// Where the second result covers more or less than the first, as the command compare draws it.
async function showDifference(folders) {
  const place = element("section", { id: "difference" }, element("h2", { textContent: "Difference of coverage" }), "drawing where they differ …");
  find("shown").querySelector(".map").after(place);
  const { picture, why } = await ask("/difference", { folders }).catch(({ message }) => ({ why: message }));
  place.lastChild.replaceWith(picture ? element("img", { src: picture, alt: "the part with the difference of coverage at each place" }) : why);
}

let views = [];
export function closeResults() {
  for (const view of views) view.dispose();
  views = seen = [];
  find("shown").hidden = find("close-results").hidden = true;
  find("shown").replaceChildren(element("div", { id: "stale" }));
}
find("close-results").addEventListener("click", closeResults);
find("refresh").addEventListener("click", () => attempt(() => refresh()));
document.querySelector("[data-tab=results]").addEventListener("click", () => attempt(() => refresh()));
listen((what) => { if (what === "changed" && seen.length) refresh().catch(() => {}); }); // the shape says what is wrong

// Show what a command has found.
const showFolder = (folder) => attempt(async () => {
  if (find("study-view").hidden) document.querySelector("[data-tab=results]").click(); // a study stays beside its result
  await refresh(() => [folder]);
  if (ticked().length) await show();
});
document.addEventListener("result", ({ detail }) => showFolder(detail));
// At the end of a command it is shown to who waits for it, and else offered: nobody is taken away from what he looks at.
document.addEventListener("ended", ({ detail }) => attempt(async () => {
  if (detail && !find("run").hidden && find("study-view").hidden) await showFolder(detail);
  else await refresh();
  if (detail && !seen.includes(detail)) say([`${detail} is finished. `, button("Show the result", () => showFolder(detail))], true);
}));
