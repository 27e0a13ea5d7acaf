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
// The one writer of this page. The server owns the text of the draft; what is typed goes there in one request at a
// time, each with the version that it was made from, and what the server kept comes back with its version. Fields
// that were changed go with every request until one is answered, so that no later text undoes them.
class Keeper {
  constructor(form) {
    this.form = form;
    this.version = form.elements.version.value;
    this.statements = new Map();
    this.dirty = this.busy = this.ended = false;
    this.number = 0;
    this.judged = null;
    this.mark(JSON.parse(form.dataset.faults));
  }
  get waits() { return this.dirty || this.statements.size > 0; }
  // Something was typed: keep it in a moment.
  typed(delay, name, text) {
    if (name === undefined) this.dirty = true; else this.statements.set(name, text);
    this.tell();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.keep(), delay);
  }
  state() {
    for (const input of document.querySelectorAll("input[name=version]")) input.value = this.version;
    for (const input of document.querySelectorAll("input[name=number]")) input.value = ++this.number;
    this.form.elements.statements.value = JSON.stringify([...this.statements]);
  }
  // Send what waits, until nothing does; a request that is under way is waited for.
  keep() {
    clearTimeout(this.timer);
    this.busy ||= this.send().finally(() => { this.busy = false; this.tell(); });
    return this.busy;
  }
  async send() {
    while (this.waits && !this.ended) {
      const sent = new Map(this.statements), text = this.form.elements.session;
      this.state();
      const body = new URLSearchParams(new FormData(this.form));
      this.dirty = false;
      // What the field says stands in the text once the answer came: until then nobody types there.
      text.readOnly ||= sent.size > 0;
      let response;
      try { response = await fetch(this.form.action, { method: "POST", headers: { "HX-Request": "true" }, body, keepalive: body.toString().length < 60000 }); }
      catch { this.dirty = true; text.readOnly = false; this.timer = setTimeout(() => this.keep(), 2000); return; }
      text.readOnly = false;
      for (const [name, value] of sent) if (this.statements.get(name) === value) this.statements.delete(name);
      // A field that was refused is not sent again; the text that went with it is.
      if (!response.ok) { this.dirty ||= sent.size > 0; this.refused(await response.text(), response.status); continue; }
      this.keptAs(await response.json());
    }
  }
  keptAs(answer) {
    this.version = answer.version;
    document.getElementById("conflict").replaceChildren();
    const text = this.form.elements.session, fields = document.getElementById("statements");
    if (!this.dirty && text.value !== answer.session) text.value = answer.session;
    // Fields in which somebody types are not drawn anew.
    if (answer.fields && !this.statements.size && !fields.contains(document.activeElement)) fields.outerHTML = answer.fields;
    this.mark(answer.faults);
    this.state();
    document.body.dispatchEvent(new Event("kept"));
  }
  // A change that was made from an older version, or of a draft that is gone, is never sent again unseen.
  refused(html, status) {
    if (status === 409 || status === 410) this.ended = true;
    const place = document.getElementById("conflict");
    place.innerHTML = html;
    place.scrollIntoView({ block: "nearest" });
  }
  mark(faults) {
    for (const input of document.querySelectorAll("#statements .value")) {
      const fault = faults[input.dataset.key];
      input.closest("label").querySelector(".bad")?.remove();
      input.toggleAttribute("aria-invalid", fault !== undefined);
      if (fault === undefined) continue;
      input.setAttribute("aria-invalid", "true");
      const note = document.createElement("small");
      note.className = "bad";
      note.textContent = fault;
      input.after(note);
    }
  }
  // Say which version is kept, and whether the results below are those of what stands above.
  tell() {
    const kept = document.getElementById("kept"), older = document.getElementById("older"), waits = this.waits || this.busy;
    if (kept) kept.textContent = this.ended ? kept.dataset.refused : waits ? kept.dataset.typed : words(kept.dataset.kept, { version: this.version.slice(0, 8) });
    const isOld = this.judged !== null && (waits || this.ended || this.judged !== this.version);
    if (older.hidden === isOld) {
      older.hidden = !isOld;
      document.getElementById("rehearsal").classList.toggle("older", isOld);
    }
    if (isOld) older.textContent = words(this.ended ? older.dataset.refused : older.dataset.words, { judged: this.judged.slice(0, 8) });
  }
  tried() {
    this.judged = document.querySelector("#rehearsal [data-version]")?.dataset.version ?? null;
    this.tell();
  }
}
const keeper = new Keeper(draft);
draft.addEventListener("input", () => keeper.typed(700));
document.addEventListener("input", (event) => { if (event.target.matches("#statements .value")) keeper.typed(300, event.target.dataset.key, event.target.value); });
document.addEventListener("change", (event) => { if (event.target.matches("#statements .value")) keeper.keep(); });
document.addEventListener("submit", async (event) => {
  const form = event.target;
  if (form.closest("#statements")) { event.preventDefault(); keeper.keep(); return; }
  if (form.closest("#conflict")) return;
  // A form that goes on with the draft waits for what was typed before it, and knows its version.
  if (keeper.waits || keeper.busy) {
    event.preventDefault();
    await keeper.keep();
    if (!keeper.ended && !keeper.waits) form.requestSubmit(event.submitter);
  } else keeper.state();
});
document.addEventListener("htmx:afterSwap", (event) => {
  const faults = JSON.parse(document.querySelector("#rehearsal [data-faults]")?.dataset.faults ?? "[]");
  grids.forEach((grid) => grid.mark(faults));
  if (event.detail.target.id === "rehearsal") keeper.tried();
});
// What was typed in the last moment before the page goes.
addEventListener("pagehide", () => {
  if (keeper.ended || !(keeper.waits || keeper.busy)) return;
  keeper.state();
  fetch(draft.action, { method: "POST", headers: { "HX-Request": "true" }, body: new URLSearchParams(new FormData(draft)), keepalive: true });
});
