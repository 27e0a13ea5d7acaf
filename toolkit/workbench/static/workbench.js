"use strict";
// Charts: an element with the class "chart" holds its content in data-chart; the table beside it says the same.
const charts = [];
function colour(name) { return getComputedStyle(document.documentElement).getPropertyValue(name).trim(); }
function draw(element) {
  const content = JSON.parse(element.dataset.chart);
  const ink = colour("--soft"), grid = { stroke: colour("--grid"), width: 1 };
  const sign = new Intl.NumberFormat(document.documentElement.lang, { maximumSignificantDigits: 4, useGrouping: false });
  const axis = (label) => ({ label, values: (_, ticks) => ticks.map((tick) => sign.format(tick)), stroke: ink, grid, ticks: grid, labelSize: 22, font: "11px system-ui", labelFont: "12px system-ui" });
  const marks = (series, at) => ({
    label: series.label, stroke: colour(at ? "--other" : "--curve"),
    width: series.line ? 1.5 : 0, dash: series.dash ? [5, 4] : undefined, paths: series.line ? undefined : () => null,
    points: { show: !series.line, size: 6, fill: colour(at ? "--other" : "--curve") },
  });
  const plot = new uPlot({
    width: Math.max(element.clientWidth, 200), height: 240,
    scales: { x: { time: false } }, legend: { live: true },
    cursor: { drag: { x: true, y: true, uni: 20 } },
    axes: [axis(content.x_label), Object.assign(axis(content.y_label), { size: 62 })],
    series: [{ label: content.x_label }, ...content.series.map(marks)],
  }, content.data, element);
  charts.push([element, plot]);
}
function drawAll(root) {
  charts.splice(0, charts.length, ...charts.filter(([element]) => element.isConnected));
  if (typeof uPlot === "undefined") return;
  root.querySelectorAll(".chart[data-chart]:empty").forEach(draw);
}
function drawAgain() {
  charts.splice(0).forEach(([element, plot]) => { plot.destroy(); element.replaceChildren(); });
  drawAll(document);
}
document.addEventListener("htmx:afterSwap", (event) => drawAll(event.target));
// What is refused is told at its place, not swallowed.
document.addEventListener("htmx:beforeSwap", (event) => { if (event.detail.xhr.status >= 400) { event.detail.shouldSwap = true; event.detail.isError = false; } });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAgain);
let waiting = 0;
addEventListener("resize", () => { clearTimeout(waiting); waiting = setTimeout(() => charts.forEach(([element, plot]) => plot.setSize({ width: Math.max(element.clientWidth, 200), height: 240 })), 100); });
drawAll(document);
// Files may be dropped anywhere on the form that takes them.
function takes(event) { const form = event.target.closest?.("form"); return form?.querySelector("input[type=file]") && event.dataTransfer.types.includes("Files") ? form : null; }
document.addEventListener("dragover", (event) => { if (takes(event)) event.preventDefault(); });
document.addEventListener("drop", (event) => {
  const form = takes(event);
  if (!form) return;
  event.preventDefault();
  form.querySelector("input[type=file]").files = event.dataTransfer.files;
});
