// The catalogue of faults, loaded once when the help is opened, and searched by code or word.

import { byId, make } from "./text.js";

let faults = [];

byId("help-drawer").addEventListener("toggle", async () => {
  if (faults.length || !byId("help-drawer").open) return;
  faults = await (await fetch("faults")).json();
  show();
});
byId("fault-search").addEventListener("input", show);

function show() {
  const wanted = byId("fault-search").value.trim().toLowerCase();
  const found = faults.filter((fault) => Object.values(fault).join(" ").toLowerCase().includes(wanted));
  byId("catalogue").replaceChildren(...(found.length ? found.map(item) : [make("li", "No such fault.", { class: "note" })]));
}

function item({ code, meaning, cause, remedy }) {
  const line = make("li");
  line.append(make("strong", `${code}: ${meaning}`), make("br"), `Cause: ${cause}. To do: ${remedy}.`);
  return line;
}
