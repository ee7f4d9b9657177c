// The page: what the cell tells is shown, what is pressed is asked for.

import { drawChart } from "./chart.js";
import { Controls } from "./controls.js";
import { Fingers } from "./fingers.js";
import "./help.js";
import { CellLink } from "./link.js";
import { drawPath } from "./path.js";
import { canDrawSolids, stageColour } from "./paint.js";
import { showRecords } from "./records.js";
import { Ring } from "./ring.js";
import { byId, degrees, make, millimetres, number, put, toRun, words } from "./text.js";

const MOODS = { EXECUTE: "good", STARTING: "good", COMPLETING: "good", UNHOLDING: "good", IDLE: "idle", COMPLETE: "good", RESETTING: "idle", CLEARING: "warn",
  HOLDING: "warn", HELD: "warn", STOPPING: "warn", STOPPED: "warn", ABORTING: "bad", ABORTED: "bad" };

const ELSEWHERE = ["rack", "bin", "seated", "on_plate"]; // places of the peg in which what an empty hand feels has no angle

const SLOW = 4000; // ms; over a connection on which the page takes longer, the 3D view is loaded by request only

const view = { hello: null, state: null, ring: null, fingers: null, scene: null, run: 0, touch: null, heard: 0, isDue: false };

const heard = {
  hello(data) {
    if (view.hello && key(view.hello) !== key(data)) location.reload();
    view.hello = data;
    view.ring = new Ring(data.names, data.points);
    view.fingers = new Fingers(byId("fingers"), data.scene);
    document.body.dataset.link = "live";
    put("link", "live");
    byId("lost").hidden = true;
    put("kind", data.simulated ? "simulated" : "");
    showStages(data.stages);
    controls.greet(data);
  },
  history(data) {
    begin(data.run);
    data.points.forEach((point) => view.ring.push(point));
    due();
  },
  live(data) {
    if (data.run !== view.run) begin(data.run);
    // A history that came in between has some of them already.
    data.points.filter((point) => !(point[0] <= view.ring.last("time"))).forEach((point) => view.ring.push(point));
    view.touch = data.touch;
    view.heard = performance.now();
    due();
  },
  state(data) {
    const before = view.state;
    view.state = data;
    showState(data, before);
    controls.showState(data);
    due();
    document.body.dataset.told = ""; // what would move while it is filled in is shown when it is
    if (!before) offerScene();
  },
  records: showRecords,
  own: (data) => controls.showOwn(data),
  full: (data) => controls.knock(data.why),
  refused: (data) => controls.say(`Refused: ${data.why}.`),
  locked: (data) => controls.locked(data.why),
  unlocked: (data) => controls.unlocked(data.source),
};

const link = new CellLink(
  (data) => heard[data.kind]?.(data),
  (reason) => {
    document.body.dataset.link = "lost";
    put("link", "lost");
    byId("lost").hidden = false;
    put("lost", `No connection to the cell${reason ? ` (${reason})` : ""}: what stands here is old. It comes back by itself.`);
    controls.lost();
  },
);
const controls = new Controls(link);

const key = ({ build, scene }) => JSON.stringify([build, scene]);

/** The 3D view comes after state and controls, into a place that is kept free for it; without WebGL the flat views stay alone. */
function offerScene() {
  const why = byId("scene-canvas").hidden ? "this browser has no WebGL" : performance.now() > SLOW ? "this connection is slow"
    : canDrawSolids(true) ? "" : "this computer would draw it without a graphics processor";
  if (!why) return setTimeout(loadScene, 0);
  put("why-no-scene", `The 3D view is not loaded: ${why}.`);
  byId("load-scene").onclick = loadScene;
  byId("load-scene").hidden = byId("scene-canvas").hidden;
}

async function loadScene() {
  put("why-no-scene", "");
  byId("load-scene").hidden = true;
  const { CellScene } = await import("./scene.js");
  view.scene = new CellScene(byId("scene-canvas"), view.hello.scene);
  due();
}

/** Where the peg is drawn: in the hand, seated in the hole that was found, or not at all. */
function pegOf(touch) {
  const { peg: { length, overhang, open }, hole } = view.hello.scene, { part, hole: found } = view.state ?? {};
  if (part === "seated" && found) return [...found, hole.centre[2] - hole.depth + (length + overhang) / 2, 1, 0, 0, 0];
  return touch.theta !== null && touch.width <= open ? "held" : null;
}

function begin(run) {
  view.run = run;
  view.ring.clear();
  put("run", run ? String(run) : "–");
}

function showStages(stages) {
  byId("stages").replaceChildren(...stages.map(({ number: n, name }) => {
    const item = make("li", words(name), { id: `stage-${name}`, "data-name": words(name) });
    item.style.setProperty("--stage", stageColour(n));
    return item;
  }));
}

function showState(data, before) {
  const state = words(data.state.toLowerCase()).replace(/^./, (letter) => letter.toUpperCase());
  put("state", state);
  byId("now").dataset.mood = MOODS[data.state] ?? "idle";
  const result = data.result !== "none" ? `: ${data.result}${data.reason !== "none" ? `, ${words(data.reason)}` : ""}` : "";
  put("doing", data.program ? `${words(data.program)}${data.stage ? ` · ${words(data.stage)}` : ""}${result}` : " ");
  byId("progress").value = data.progress;
  put("percent", `${data.progress} %`);
  for (const item of byId("stages").children) {
    const name = item.id.slice("stage-".length), time = data.stage_times[name] ?? 0;
    const text = item.dataset.name + (time ? ` ${time.toFixed(1)} s` : "");
    if (item.textContent !== text) item.textContent = text;
    item.hidden = name === "recover" && name !== data.stage && !time; // a program of its own, no stage of an insertion
    item.classList.toggle("done", time > 0);
    if (name === data.stage) item.setAttribute("aria-current", "step");
    else item.removeAttribute("aria-current");
  }
  showFault(data.fault, data.run);
  byId("warnings").hidden = !data.warnings.length;
  byId("warnings").replaceChildren(...data.warnings.map((text) => make("li", `Warning: ${text}`)));
  put("next", data.next);
  put("part", words(data.part) + (data.evidence ? ` (${data.evidence})` : ""));
  if (!before || before.state !== data.state || before.stage !== data.stage) {
    put("said", `${state}${data.stage ? `, ${words(data.stage)}` : ""}. ${data.next}`);
  }
  document.title = `${state} · Tactile insertion cell`;
}

function showFault(fault, run) {
  const box = byId("fault");
  if (!fault) {
    box.hidden = true;
    return;
  }
  put("fault-title", `Fault ${fault.code}: ${fault.meaning}`);
  put("fault-message", fault.message);
  put("fault-cause", fault.cause);
  put("fault-remedy", fault.remedy);
  const link = run ? `Run ${run}: force curve, film and record` : "";
  if (byId("fault-run").textContent !== link) byId("fault-run").replaceChildren(...(link ? [toRun(run, link)] : [])); // a tap needs it to stay
  box.hidden = false;
}

function due() {
  if (view.isDue) return;
  view.isDue = true;
  requestAnimationFrame(draw);
}

function draw() {
  view.isDue = false;
  if (!view.hello) return;
  const { ring, hello, touch, state } = view;
  drawChart(byId("force-chart"), ring, "force", { ink: "force", scale: 1, low: 0, high: 12, limit: hello.force_limit });
  drawChart(byId("depth-chart"), ring, "depth", { ink: "depth", scale: 1000, low: -10, high: 1000 * hello.scene.hole.depth * 1.1, limit: 1000 * hello.scene.hole.depth });
  drawPath(byId("path"), ring, hello.scene.hole, state?.hole);
  put("force", number(ring.last("force"), 1, " N"));
  put("depth", millimetres(ring.last("depth")));
  put("place", ring.count ? `x ${millimetres(ring.last("x"), 2)}, y ${millimetres(ring.last("y"), 2)}` : "–");
  if (touch) showTouch(touch);
}

function showTouch(heard) {
  const touch = ELSEWHERE.includes(view.state?.part) ? { ...heard, theta: null, sigma: null, theta_age: null } : heard;
  view.fingers.draw(touch);
  view.scene?.pose({ ...touch, peg: pegOf(touch), hole: view.state?.hole, isSeated: touch.switch === "closed" });
  view.scene?.path(view.ring);
  view.scene?.draw();
  put("theta", touch.theta === null ? "no peg" : degrees(touch.theta));
  put("sigma", touch.sigma === null ? "–" : degrees(touch.sigma, 2));
  put("age", number(touch.age === null ? null : 1000 * touch.age, 0, " ms"));
  put("theta-age", touch.theta_age > 1 ? number(touch.theta_age, 1, " s") : number(touch.theta_age === null ? null : 1000 * touch.theta_age, 0, " ms"));
  put("highest", number(Math.max(...touch.values.flat()) / 1000, 1, " k counts"));
  const lost = touch.trusted.flat().filter((is) => !is).length;
  put("untrusted", lost ? `${lost} of ${touch.trusted.flat().length} taxels` : "none");
  put("switch", touch.switch);
}

/** After a fault of the software (4xxx) the scan is at rest, and the age of the frame says nothing about the skin. */
function isAtRest() {
  return String(view.state?.fault?.code ?? "").startsWith("4");
}

/** Dims the touch image while the cell shows none: an old one must not look like the present. */
setInterval(() => {
  const silent = (performance.now() - view.heard) / 1000; // since the last image, or since the page was opened
  byId("touch").classList.toggle("old", silent > 1);
  if (silent > 1) put("age", isAtRest() ? "scan at rest" : `no news for ${silent.toFixed(0)} s`);
}, 500);
byId("scene-canvas").hidden = !canDrawSolids();
addEventListener("resize", due);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", due);
