// The flat charts: each figure's own data and layout, drawn into the element that names it.
"use strict";
for (const source of document.querySelectorAll("script.chart")) {
  const { data, layout } = JSON.parse(source.textContent);
  Plotly.newPlot(source.dataset.into, data, layout, { displayModeBar: false, responsive: true });
}
addEventListener("beforeprint", () => {
  for (const fold of document.querySelectorAll("details.print")) fold.open = true;
});
