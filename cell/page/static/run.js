// One run on record: how it ended, its replay, its film.

import { showReplay } from "./replay.js";
import { byId, clock, make, put, words } from "./text.js";

const PICTURES = 25, EFFORT = 0.045; // pictures of a second, and s of processor time for one
const LOOK = 2000; // ms between two looks for a film that is being drawn

const LOCKED = "Not drawn yet; unlock the controls on the cell's page to have it drawn.";
const token = sessionStorage.getItem("cell-token"), headers = { Authorization: `Bearer ${token}` };

const run = Number(location.pathname.split("/").pop());
put("title", `Run ${run}`);
document.title = `Run ${run} · Tactile insertion cell`;

function show(data) {
  put("ending", [data.program && words(data.program), data.outcome, data.reason && words(data.reason)].filter(Boolean).join(", "));
  const facts = {
    "Started": clock(data.started), "Asked by": data.source, "Recipe": data.recipe, "Serial number": data.serial,
    "Fault": data.fault ? `${data.fault} ${data.message}` : "", "Last stage": words(data.stage),
    "Meaning": data.why?.meaning ?? "", "Usual causes": data.why?.cause ?? "", "What to do": data.why?.remedy ?? "",
    "Cycle time": data.cycle_time === null ? "" : `${data.cycle_time.toFixed(2)} s from command to answer`,
    "Largest force": data.peak_force === null ? "" : `${data.peak_force.toFixed(1)} N`,
    "Retries": data.retries || "",
  };
  for (const [name, value] of Object.entries(facts)) {
    if (value !== "") byId("facts").append(make("dt", name), make("dd", String(value)));
  }
  byId("stage-rows").replaceChildren(...data.stages.map(stage));
  byId("event-rows").replaceChildren(...data.events.map(happening));
  config();
  film(data);
}

async function config() {
  const answer = token && (await fetch(`/runs/${run}/config`, { headers })), link = byId("config");
  if (!answer?.ok) return;
  link.href = URL.createObjectURL(await answer.blob());
  link.download = `run-${run}.json`;
  link.hidden = false;
}

function film({ cycle_time: length, film: state }) {
  const minutes = Math.max(1, Math.round((length * PICTURES * EFFORT) / 60));
  byId("make-film").onclick = () => draw(minutes);
  if (state === "made") play();
  else if (state === "drawing") wait(minutes);
  else if (state === "none") put("film-note", "No samples of an ended run are on record.");
  else if (!token) put("film-note", LOCKED);
  else offer(length ? `Drawing the film takes this computer about ${minutes} min at the least; it is kept afterwards.` : "");
}

function offer(note) {
  put("film-note", note);
  byId("make-film").hidden = false;
}

async function draw(minutes) {
  byId("make-film").hidden = true;
  put("film-note", "Drawing the film …");
  const answer = await fetch(`/runs/${run}/film.mp4`, { method: "POST", headers }).catch(() => null);
  if (answer?.status === 202) wait(minutes);
  else if (answer?.ok) play();
  else offer(answer ? `The film cannot be drawn: ${(await answer.text()).trim()}.` : "No connection to the cell: the film was not asked for.");
}

/** Asks again and again whether the film is there, so that no request is open for minutes. */
async function wait(minutes) {
  for (const began = performance.now(); ; await new Promise((wake) => setTimeout(wake, LOOK))) {
    const answer = await fetch(`/runs/${run}/data`).catch(() => null), data = answer?.ok ? await answer.json() : null;
    if (data?.film === "made") return play();
    if (data && data.film !== "drawing") return offer(`The film was not drawn to its end; run \`cell film ${run} --out FILE\` for the reason.`);
    const since = ((performance.now() - began) / 60000).toFixed(1);
    put("film-note", data ? `Drawing the film, for ${since} min here; it takes about ${minutes} min at the least, and goes on when this page is left.`
      : "No connection to the cell; the film is looked for again.");
  }
}

function play() {
  const video = byId("film");
  byId("make-film").hidden = true;
  video.onloadedmetadata = () => put("film-note", "");
  video.onerror = () => put("film-note", `The film cannot be shown here; \`cell film ${run} --out FILE\` draws it anew.`);
  video.hidden = false;
  video.src = `/runs/${run}/film.mp4`;
}

function stage(tried) {
  const degrees = (value, digits) => (value === null ? "–" : `${((value * 180) / Math.PI).toFixed(digits)}°`);
  const cells = [words(tried.name), tried.counted === null ? "–" : `${tried.counted.toFixed(2)} s`, `${(tried.ended - tried.began).toFixed(2)} s`,
    degrees(tried.theta, 1), degrees(tried.sigma, 2), tried.peak_force === null ? "–" : `${tried.peak_force.toFixed(1)} N`,
    [tried.outcome, tried.reason && words(tried.reason), tried.retried ? "tried again" : ""].filter(Boolean).join(", ")];
  return row(cells);
}

function happening(event) {
  return row([clock(event.time), event.kind, words(event.name.toLowerCase()), event.source, event.text]);
}

function row(cells) {
  const line = make("tr");
  line.append(...cells.map((text) => make("td", text)));
  return line;
}

showReplay(run);
const answer = await fetch(`/runs/${run}/data`);
if (answer.ok) show(await answer.json());
else put("ending", await answer.text());
