// Results below the design's folder: in 3D, one or two side by side, with report and process sheet.
import { ask, attempt, element, onPage } from "./state.js";
import { start } from "./run.js";
import { closeStudy, followStudy } from "./study/study.js";

const find = (id) => document.getElementById(id), list = find("result-list");
const FILES = [["report", "report.html", "report"], ["sheet", "process_sheet.pdf", "process sheet"]];

async function refresh() {
  const rows = await ask("/results");
  list.replaceChildren(...rows.map((row) => {
    const tick = element("input", { type: "checkbox", value: row.folder, disabled: Boolean(row.unusable) });
    const item = element("li", {}, element("label", {}, tick, ` ${row.folder}`), element("small", {}, ...onPage(row.words)));
    if (row.is_study) {
      const button = element("button", { textContent: "see its candidates" });
      button.addEventListener("click", () => { closeResults(); followStudy(row.folder); });
      item.append(button, " ");
    }
    for (const [command, file, name] of row.unusable ? [] : FILES) {
      const button = element("button", { textContent: row[file] ? name : `make the ${name}` });
      button.addEventListener("click", async () => {
        const before = button.textContent;
        if (!row[file]) Object.assign(button, { disabled: true, className: "at-work", textContent: `making the ${name} …` });
        await attempt(() => open(command, row.folder, file, row[file]));
        Object.assign(button, { disabled: false, className: "", textContent: before }); // where it could not be made
      });
      item.append(button, " ");
    }
    return item;
  }));
  if (!rows.length) list.append(element("li", { textContent: "none yet: simulate, or run a study" }));
}

async function open(command, folder, file, isThere) {
  if (!isThere && (await start(command, folder)).exit !== 0) throw new Error(find("printed").textContent);
  await refresh();
  window.open(`/files/${`${folder}/${file}`.split("/").map(encodeURIComponent).join("/")}`, "_blank", "noopener");
}

find("show-results").addEventListener("click", () => attempt(() => show()));
async function show() {
  const folders = [...list.querySelectorAll("input:checked")].map((one) => one.value).reverse(); // the older first
  if (!folders.length || folders.length > 2) throw new Error("tick one result, or two to compare");
  const { html, content } = await ask("/shown", { folders });
  closeStudy();
  closeResults();
  find("shown").innerHTML = html; // the server's own, as in a report; names in it are escaped
  find("shown").hidden = find("close-results").hidden = false;
  views = showParts(content);
}

let views = [];
export function closeResults() {
  for (const view of views) view.dispose();
  views = [];
  find("shown").hidden = find("close-results").hidden = true;
  find("shown").replaceChildren();
}
find("close-results").addEventListener("click", closeResults);
find("refresh").addEventListener("click", () => attempt(refresh));
document.querySelector("[data-tab=results]").addEventListener("click", () => attempt(refresh));
// What a command has found is shown at its end.
document.addEventListener("ended", ({ detail }) => attempt(async () => {
  if (detail) document.querySelector("[data-tab=results]").click();
  await refresh();
  const tick = [...list.querySelectorAll("input")].find((one) => one.value === detail);
  if (!tick) return;
  tick.checked = true;
  await show();
  for (const one of list.querySelectorAll("input")) one.checked = one.value === detail; // the tab has listed them anew
}));
