// The yield of the shift, the last runs and the alarms.

import { loadAlarms } from "./alarms.js";
import { byId, clock, make, put, toRun, words } from "./text.js";

const percent = (share, digits = 1) => `${(100 * share).toFixed(digits)} %`;

export function showRecords({ runs, shift }) {
  put("shift-hours", String(shift.hours));
  put("yield", shift.yield === null ? "–" : percent(shift.yield, 1));
  put("yield-words", shift.runs ? `${shift.runs} runs; 95 % interval ${percent(shift.low)} to ${percent(shift.high)}` : "No run has ended yet.");
  byId("interval").hidden = shift.yield === null;
  const [range, middle] = byId("interval").children;
  range.style.left = `${100 * shift.low}%`;
  range.style.width = `${100 * (shift.high - shift.low)}%`;
  middle.style.left = `${100 * (shift.yield ?? 0)}%`;
  byId("counts").replaceChildren(...Object.entries(shift.counts).map(([outcome, count]) => {
    const pair = make("div");
    pair.append(make("dt", outcome), make("dd", String(count)));
    return pair;
  }));
  byId("run-rows").replaceChildren(...runs.map(row));
  loadAlarms();
}

function row(run) {
  const line = make("tr");
  const link = make("td");
  link.append(toRun(run.run, `Run ${run.run}`));
  const why = run.fault ? (run.outcome === "fault" ? run.fault : `fault ${run.fault}`) : run.reason ? words(run.reason) : "";
  const outcome = make("td");
  outcome.append(make("span", run.outcome, { class: `outcome ${run.outcome}` }), ` ${why}`);
  line.append(link, make("td", clock(run.started)), make("td", words(run.program)), make("td", run.serial), make("td", run.cycle_time === null ? "" : `${run.cycle_time.toFixed(1)} s`), make("td", run.source), outcome);
  return line;
}
