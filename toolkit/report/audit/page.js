"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const body = document.querySelector("#files tbody"), count = document.getElementById("count");
const search = document.getElementById("search"), more = document.getElementById("more");
const chips = [...document.querySelectorAll("button.chip")];
let order = 0, down = false, shown = 200;
const text = data.rows.map(row => row.join(" ").toLowerCase());
function cell(row, value, kind) {
  const td = document.createElement("td");
  if (kind === "grade") {
    const tag = document.createElement("span");
    tag.className = "g"; tag.textContent = value; tag.dataset.grade = value;
    td.append(tag);
  } else if (kind === "number") {
    td.className = "n"; td.textContent = value === null ? "" : Number(value).toFixed(value < 1 ? 4 : 1);
  } else {
    if (kind === "date") td.className = "d";
    td.textContent = value === null ? "" : value;
  }
  row.append(td);
}
function draw() {
  const on = new Set(chips.filter(c => c.getAttribute("aria-pressed") !== "false").map(c => c.dataset.grade));
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  let found = data.rows.map((row, i) => i).filter(i => on.has(data.rows[i][1]) && words.every(w => text[i].includes(w)));
  found.sort((a, b) => {
    const x = data.rows[a][order], y = data.rows[b][order];
    const by = x === y ? a - b : x === null ? 1 : y === null ? -1 : x < y ? -1 : 1;
    return down && x !== null && y !== null ? -by : by;
  });
  body.replaceChildren(...found.slice(0, shown).map(i => {
    const tr = document.createElement("tr");
    data.rows[i].forEach((value, at) => cell(tr, value, data.kinds[at]));
    return tr;
  }));
  count.textContent = found.length + " of " + data.rows.length + " files" + (found.length > shown ? ", " + shown + " shown" : "");
  more.hidden = found.length <= shown;
}
chips.forEach(c => c.addEventListener("click", () => { c.setAttribute("aria-pressed", c.getAttribute("aria-pressed") === "false"); shown = 200; draw(); }));
document.querySelectorAll("#files th").forEach((th, at) => th.addEventListener("click", () => { down = order === at ? !down : data.kinds[at] === "number"; order = at; draw(); }));
search.addEventListener("input", () => { shown = 200; draw(); });
more.addEventListener("click", () => { shown += 1000; draw(); });
draw();
// On paper nothing can be opened: what is closed is open there.
const closed = [];
window.addEventListener("beforeprint", () => document.querySelectorAll("details:not([open])").forEach(one => { one.open = true; closed.push(one); }));
window.addEventListener("afterprint", () => { closed.splice(0).forEach(one => { one.open = false; }); });
