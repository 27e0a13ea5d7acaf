"use strict";
// What is refused is told at its place, not swallowed.
document.addEventListener("htmx:beforeSwap", (event) => { if (event.detail.xhr.status >= 400) { event.detail.shouldSwap = true; event.detail.isError = false; } });
// Files may be dropped anywhere on the form that takes them.
function takes(event) { const form = event.target.closest?.("form"); return form?.querySelector("input[type=file]") && event.dataTransfer.types.includes("Files") ? form : null; }
document.addEventListener("dragover", (event) => { if (takes(event)) event.preventDefault(); });
document.addEventListener("drop", (event) => {
  const form = takes(event);
  if (!form) return;
  event.preventDefault();
  form.querySelector("input[type=file]").files = event.dataTransfer.files;
});
// A field without a place to go to is kept as it changes: Enter in it sends nothing more.
document.addEventListener("submit", (event) => { if (!event.target.hasAttribute("action")) event.preventDefault(); });
