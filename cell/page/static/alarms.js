// Past alarms by period and by code or word, and the report of the same period.

import { byId, clock, make, number, put, toRun } from "./text.js";

let alarms = [];

byId("alarm-period").addEventListener("change", loadAlarms);
byId("alarm-search").addEventListener("input", show);
byId("report").addEventListener("click", report);

export async function loadAlarms() {
  const answer = await fetch(`alarms?since=${byId("alarm-period").value}`).catch(() => null);
  if (answer?.ok) alarms = await answer.json();
  show();
}

function show() {
  const wanted = byId("alarm-search").value.trim().toLowerCase();
  const found = alarms.filter((alarm) => Object.values(alarm).join(" ").toLowerCase().includes(wanted));
  byId("fault-list").replaceChildren(...(found.length ? found.map(item) : [make("li", "None on record.", { class: "note" })]));
}

function item({ code, name, meaning, text, time, duration, state, run }) {
  const line = make("li", "", { title: text }), what = String(code || name);
  line.append(run ? toRun(run, what) : make("strong", what), ` ${[meaning, clock(time), number(duration, 0, " s"), state, run && `run ${run}`].filter(Boolean).join(" · ")}`);
  return line;
}

async function report() {
  put("report-note", "Counting …");
  const headers = { Authorization: `Bearer ${sessionStorage.getItem("cell-token")}` };
  const answer = await fetch(`report.html?since=${byId("alarm-period").value}`, { method: "POST", headers }).catch(() => null);
  if (answer?.ok) location.href = "/report.html";
  else put("report-note", answer?.status === 401 ? "Unlock the controls to have the report made." : "The report cannot be made here; run `cell report` for the reason.");
}
