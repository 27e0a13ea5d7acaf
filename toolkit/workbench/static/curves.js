"use strict";
// Curves: an element with the class "curves" holds its series in data-curves, each with its own x and y.
// Switches of the form around it (load, rotation) hide series; a value is told where the pointer or the keys are.
(() => {
const drawn = new Map();
const zooms = new Map();  // by the name of a chart: what is drawn anew under that name keeps its zoom
const ink = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const figures = new Intl.NumberFormat(document.documentElement.lang, { maximumSignificantDigits: 6, useGrouping: false });
const uncertain = new Intl.NumberFormat(document.documentElement.lang, { maximumSignificantDigits: 2, useGrouping: false });

const TONES = { file: "--file", nominal: "--file", refitted: "--load-4", record: "--right", augmented: "--right" };
function stroke(series, at) { return ink(TONES[series.label] || "--load-" + (series.condition ? series.condition.load : at) % 7); }
// Draws one series of uPlot's mode in which each has its own x: a line, or symbols with their U.
function paths(content, element) {
  return (plot, at) => {
    const series = content.series[at - 1], pixels = devicePixelRatio, reverse = series.condition?.rotation === "reverse";
    uPlot.orient(plot, at, (_, xs, ys, scaleX, scaleY, toX, toY, left, top, width, height) => {
      const ctx = plot.ctx, X = (value) => toX(value, scaleX, width, left), Y = (value) => toY(value, scaleY, height, top);
      ctx.save();
      ctx.beginPath(); ctx.rect(left, top, width, height); ctx.clip();
      ctx.strokeStyle = ctx.fillStyle = stroke(series, at - 1);
      ctx.lineWidth = (series.label === "file" ? 2.4 : 1.4) * pixels;
      ctx.setLineDash(series.dash || series.line && reverse ? [5 * pixels, 4 * pixels] : []);
      const [x, y] = plot.data[at];
      if (series.line) {
        ctx.beginPath();
        x.forEach((value, i) => i ? ctx.lineTo(X(value), Y(y[i])) : ctx.moveTo(X(value), Y(y[i])));
        ctx.stroke();
      } else x.forEach((value, i) => {
        ctx.beginPath();
        if (series.U) { ctx.moveTo(X(value), Y(y[i] - series.U[i])); ctx.lineTo(X(value), Y(y[i] + series.U[i])); ctx.stroke(); }
        if (series.U_x) { ctx.beginPath(); ctx.moveTo(X(value - series.U_x[i]), Y(y[i])); ctx.lineTo(X(value + series.U_x[i]), Y(y[i])); ctx.stroke(); }
        ctx.beginPath(); ctx.arc(X(value), Y(y[i]), 3.2 * pixels, 0, 2 * Math.PI);
        if (reverse) { ctx.save(); ctx.fillStyle = ink("--paper"); ctx.fill(); ctx.restore(); ctx.stroke(); } else ctx.fill();
      });
      const told = element.told;
      if (told && told[0] === at - 1) {
        ctx.beginPath(); ctx.setLineDash([]); ctx.arc(X(x[told[1]]), Y(y[told[1]]), 7 * pixels, 0, 2 * Math.PI); ctx.stroke();
      }
      ctx.restore();
    });
    return null;
  };
}
function range(of) {
  return (plot, low, high) => {
    if (low === null || low === undefined) return [0, 1];
    if (plot.zoomed) return [low, high];
    const pad = (high - low || Math.abs(high) || 1) * 0.04;
    return of || [low - pad, high + pad];
  };
}
function draw(element) {
  const content = JSON.parse(element.dataset.curves), small = element.classList.contains("small");
  // Colours are asked for at each drawing: a scheme that changes redraws the same chart, under the pointer that is on it.
  const soft = () => ink("--soft"), grid = { stroke: () => ink("--grid"), width: 1 };
  const axis = (label) => ({ label: small ? undefined : label, values: (_, ticks) => ticks.map((tick) => figures.format(tick)), stroke: soft, grid, ticks: grid, labelSize: 20, font: "11px system-ui", labelFont: "12px system-ui" });
  const plot = new uPlot({
    mode: 2, width: Math.max(element.clientWidth, 160), height: small ? 130 : 300, legend: { show: false },
    scales: { x: { time: false, range: range(content.x_range) }, y: { range: range(content.y_range) } },
    cursor: { points: { show: false }, dataIdx: () => null, drag: { x: true, y: true, uni: 20 } },
    axes: [Object.assign(axis(content.x_label), { size: 34 }), Object.assign(axis(content.y_label), { size: (_, ticks) => 18 + 6.2 * Math.max(4, ...(ticks || []).map((tick) => tick.length)) })],
    series: [{}, ...content.series.map((series, at) => ({ stroke: () => stroke(series, at), facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }], paths: paths(content, element) }))],
  }, [null, ...content.series.map((series) => [series.x, series.y])], element);
  drawn.set(element, { plot, content });
  plot.over.addEventListener("mousemove", (event) => tell(element, nearest(element, event)));
  const name = element.dataset.name, zoom = zooms.get(name);
  plot.over.addEventListener("dblclick", () => { plot.zoomed = false; zooms.delete(name); });
  plot.over.addEventListener("mouseup", () => {
    plot.zoomed = true;
    if (name) setTimeout(() => { if (plot.zoomed) zooms.set(name, ["x", "y"].map((key) => ({ min: plot.scales[key].min, max: plot.scales[key].max }))); });
  });
  if (zoom) { plot.zoomed = true; plot.setScale("x", zoom[0]); plot.setScale("y", zoom[1]); }
  plot.hooks.setScale = [() => { element.dataset.shows = ["x", "y"].map((key) => plot.scales[key].min + " " + plot.scales[key].max).join(" "); }];
  if (!element.dataset.keys) { element.dataset.keys = "yes"; element.addEventListener("keydown", step); }
  shown(element);
}
function visible(element, at) { return drawn.get(element).plot.series[at + 1].show; }
function nearest(element, event) {
  const { plot, content } = drawn.get(element), box = plot.over.getBoundingClientRect();
  const px = event.clientX - box.left, py = event.clientY - box.top;
  let best = null, least = 900;
  content.series.forEach((series, at) => {
    if (!visible(element, at)) return;
    series.x.forEach((x, i) => {
      const dx = plot.valToPos(x, "x") - px, dy = plot.valToPos(series.y[i], "y") - py;
      const apart = dx * dx + dy * dy + (series.line ? 40 : 0);
      if (apart < least) { least = apart; best = [at, i]; }
    });
  });
  return best;
}
function tell(element, at) {
  const { plot, content } = drawn.get(element), words = JSON.parse(element.dataset.words);
  const output = element.parentElement.querySelector("output.readout") || element.nextElementSibling;
  if (String(at) === String(element.told)) return;
  element.told = at;
  plot.redraw(false);
  if (!at) return;
  const series = content.series[at[0]], i = at[1], unit = (label) => label.replace(/^.*\[(.*)\]$/, "$1"), name = (label) => label.replace(/ \[.*$/, "");
  const value = (label, number, U) => name(label) + " = " + figures.format(number) + (U ? " ± " + uncertain.format(U) : "") + (label.includes("[") ? "\u00a0" + unit(label) : "");
  const who = series.label ? words[series.label] || series.label : figures.format(Math.round(series.condition.load_N)) + "\u00a0N, " + words[series.condition.rotation] + (series.line ? ", " + words.fitted : "");
  output.textContent = who + ": " + value(content.x_label, series.x[i], series.U_x && series.U_x[i]) + ", " + value(content.y_label, series.y[i], series.U && series.U[i]);
  output.dataset.value = series.y[i];
}
function step(event) {
  const by = { ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowDown: [1, 0], ArrowUp: [-1, 0] }[event.key];
  if (!by) return;
  event.preventDefault();
  const element = event.currentTarget, { content } = drawn.get(element);
  const seen = content.series.map((_, at) => at).filter((at) => visible(element, at));
  if (!seen.length) return;
  const told = element.told || [seen[0], -1];
  const place = Math.max(0, seen.indexOf(told[0])), at = seen[(place + by[0] + seen.length) % seen.length];
  const length = content.series[at].x.length;
  tell(element, [at, Math.min(Math.max(told[1] + by[1], 0), length - 1)]);
}
function shown(element) {
  const form = element.closest("form.switches");
  if (!form) return;
  const on = (name) => new Set([...form.querySelectorAll(`input[name=${name}]:checked`)].map((input) => input.value));
  const loads = on("load"), rotations = on("rotation"), { plot, content } = drawn.get(element);
  plot.batch(() => content.series.forEach((series, at) => {
    const show = !series.condition || loads.has(String(series.condition.load)) && rotations.has(series.condition.rotation);
    if (plot.series[at + 1].show !== show) plot.setSeries(at + 1, { show });
  }));
}
function drawCurves(root) {
  [...drawn].forEach(([element, { plot }]) => { if (!element.isConnected) { plot.destroy(); drawn.delete(element); } });
  root.querySelectorAll(".curves[data-curves]:empty").forEach(draw);
}
function redraw() { drawn.forEach(({ plot }) => plot.redraw(false, true)); }
document.addEventListener("change", (event) => {
  const form = event.target.closest("form.switches");
  if (form) form.querySelectorAll(".curves").forEach((element) => drawn.has(element) && shown(element));
});
document.addEventListener("htmx:afterSwap", (event) => drawCurves(event.target));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
matchMedia("print").addEventListener("change", redraw);
let pause = 0;
addEventListener("resize", () => { clearTimeout(pause); pause = setTimeout(() => drawn.forEach(({ plot }, element) => plot.setSize({ width: Math.max(element.clientWidth, 160), height: element.classList.contains("small") ? 130 : 300 })), 100); });
drawCurves(document);
})();
