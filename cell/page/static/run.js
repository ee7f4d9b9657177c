// One run on record: how it ended, its picture, its film.

import { byId, clock, make, put, words } from "./text.js";

const PICTURES = 25, EFFORT = 0.5; // pictures of a second, and s of processor time for one

const run = Number(location.pathname.split("/").pop());
put("title", `Run ${run}`);
document.title = `Run ${run} · Tactile insertion cell`;

function show(data) {
  put("ending", [data.program && words(data.program), data.outcome, data.reason && words(data.reason)].filter(Boolean).join(", "));
  const facts = {
    "Started": clock(data.started), "Asked by": data.source, "Recipe": data.recipe, "Serial number": data.serial,
    "Fault": data.fault ? `${data.fault} ${data.message}` : "", "Last stage": words(data.stage),
    "Cycle time": data.cycle_time === null ? "" : `${data.cycle_time.toFixed(2)} s from command to answer`,
    "Largest force": data.peak_force === null ? "" : `${data.peak_force.toFixed(1)} N`,
    "Retries": data.retries || "",
  };
  for (const [name, value] of Object.entries(facts)) {
    if (value !== "") byId("facts").append(make("dt", name), make("dd", String(value)));
  }
  byId("stage-rows").replaceChildren(...data.stages.map(stage));
  byId("event-rows").replaceChildren(...data.events.map(happening));
  byId("config").href = `/runs/${run}/config`;
  if (data.files.includes("picture.png")) picture();
  else put("picture-note", "No samples of an ended run are on record.");
  if (data.files.includes("film.mp4")) film(data.cycle_time);
  else put("film-note", "No samples of an ended run are on record.");
}

function picture() {
  const image = byId("picture"), link = byId("picture-link");
  put("picture-note", "Drawing …");
  image.onload = () => { put("picture-note", ""); link.hidden = false; };
  image.onerror = () => put("picture-note", `The picture cannot be drawn here; \`cell show ${run}\` says why.`);
  image.src = link.href = `/runs/${run}/picture.png`;
}

function film(length) {
  const button = byId("make-film"), video = byId("film");
  const minutes = Math.max(1, Math.round((length * PICTURES * EFFORT) / 60));
  if (length) put("film-note", `Drawing the film takes this computer about ${minutes} min at the least; it is kept afterwards.`);
  button.hidden = false;
  button.onclick = () => {
    button.hidden = true;
    put("film-note", "Drawing the film …");
    video.onloadeddata = () => { put("film-note", ""); video.hidden = false; };
    video.onerror = () => put("film-note", `The film cannot be drawn here; \`cell film ${run} --out FILE\` says why.`);
    video.src = `/runs/${run}/film.mp4`;
  };
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

const answer = await fetch(`/runs/${run}/data`);
if (answer.ok) show(await answer.json());
else put("ending", await answer.text());
