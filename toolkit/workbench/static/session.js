"use strict";
// A grid over each table that is typed. The table is the text of its <textarea>, cells between tabs: the grid only
// shows and changes that text, so that without this script the text is typed.
function words(template, values) { return template.replace(/\{(\w+)\}/g, (_, name) => values[name]); }
function split(text) { return text.replace(/\r\n?/g, "\n").replace(/\n+$/, "").split("\n").map((line) => line.split("\t")); }
function isHeader(row) { return row.some((cell) => cell.includes("[") || /^(run|direction)$/i.test(cell.trim())); }
class Grid {
  constructor(area) {
    this.area = area;
    this.rows = split(area.value);
    this.table = document.createElement("table");
    this.table.id = "grid-" + area.name;
    const frame = document.createElement("div");
    frame.className = "scroll";
    frame.append(this.table);
    area.after(frame);
    area.hidden = true;
    this.table.addEventListener("input", (event) => this.typed(event.target));
    this.table.addEventListener("paste", (event) => this.pasted(event));
    this.table.addEventListener("keydown", (event) => this.moved(event));
    if (!area.readOnly) {
      const more = document.createElement("button");
      more.type = "button";
      more.textContent = area.dataset.more;
      more.addEventListener("click", () => { this.rows.push([""]); this.draw(); this.cell(this.rows.length - 1, 0).focus(); });
      frame.after(more);
      if (this.rows.length < 2) this.rows.push([""]);
    }
    this.draw();
  }
  draw() {
    const width = Math.max(...this.rows.map((row) => row.length));
    this.table.replaceChildren(...this.rows.map((row, at) => {
      while (row.length < width) row.push("");
      const line = document.createElement("tr");
      line.append(...row.map((text, column) => {
        const cell = document.createElement(at ? "td" : "th"), input = document.createElement("input");
        input.value = text;
        input.readOnly = this.area.readOnly;
        input.dataset.row = at;
        input.dataset.column = column;
        input.setAttribute("aria-label", words(at ? this.area.dataset.cell : this.area.dataset.header, { row: at, column: at ? this.rows[0][column] : column + 1 }));
        cell.append(input);
        return cell;
      }));
      return line;
    }));
  }
  cell(row, column) { return this.table.rows[row]?.cells[column]?.firstChild; }
  write() { this.area.value = this.rows.map((row) => row.join("\t")).join("\n"); }
  typed(input) {
    this.rows[input.dataset.row][input.dataset.column] = input.value;
    this.write();
  }
  pasted(event) {
    const text = event.clipboardData.getData("text/plain");
    if (!/[\t\n]/.test(text.trim()) || this.area.readOnly) return;
    event.preventDefault();
    const row = Number(event.target.dataset.row), column = Number(event.target.dataset.column), rows = split(text);
    const first = isHeader(rows[0]) ? 0 : Math.max(row, 1);
    rows.forEach((cells, down) => {
      while (this.rows.length <= first + down) this.rows.push([]);
      cells.forEach((cell, right) => {
        const target = this.rows[first + down];
        while (target.length <= column + right) target.push("");
        target[column + right] = cell.trim();
      });
    });
    this.draw();
    this.write();
    this.area.dispatchEvent(new Event("input", { bubbles: true }));
    this.cell(first, column).focus();
  }
  moved(event) {
    const step = { Enter: 1, ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    const row = Number(event.target.dataset.row) + step, column = Number(event.target.dataset.column);
    if (event.key === "Enter" && row === this.rows.length && !this.area.readOnly) { this.rows.push([""]); this.draw(); }
    this.cell(row, column)?.focus();
  }
  mark(faults) {
    this.table.querySelectorAll("[aria-invalid]").forEach((input) => { input.removeAttribute("aria-invalid"); input.removeAttribute("aria-describedby"); });
    for (const fault of faults) {
      if (fault.table !== this.area.name) continue;
      const row = this.table.rows[fault.line - 1];
      const cells = fault.column === null ? row?.querySelectorAll("input") ?? [] : [this.cell(fault.line - 1, fault.column)];
      for (const input of cells) if (input) { input.setAttribute("aria-invalid", "true"); input.setAttribute("aria-describedby", "fault"); }
    }
  }
}
const draft = document.getElementById("draft");
const grids = [...draft.querySelectorAll("textarea.grid")].map((area) => new Grid(area));
document.addEventListener("htmx:afterSwap", () => {
  const faults = JSON.parse(document.querySelector("#rehearsal [data-faults]")?.dataset.faults ?? "[]");
  grids.forEach((grid) => grid.mark(faults));
});
// What was typed in the last moment before the page goes.
addEventListener("pagehide", () => { fetch(draft.dataset.save, { method: "POST", body: new URLSearchParams(new FormData(draft)), keepalive: true }); });
// Fields in which somebody types are not drawn anew.
document.addEventListener("htmx:oobBeforeSwap", (event) => { if (event.detail.target.contains(document.activeElement)) event.detail.shouldSwap = false; });
