// A recorded run, scrubbed: the cell in 3D, touch, path and curves at one moment, drawn from the run's samples.

import { drawChart } from "./chart.js";
import { Fingers } from "./fingers.js";
import { drawPath } from "./path.js";
import { Ring } from "./ring.js";
import { byId, degrees, millimetres, number, put } from "./text.js";

const JOINTS = 7, POSE = 7;
const DEGREES = 180 / Math.PI;

/** Reads head and rows of a replay: see `scene.replay` of the server. */
function read(buffer) {
  const length = new DataView(buffer).getUint32(0, true), head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const samples = new Float32Array(buffer, 4 + length), width = samples.length / head.rows, ring = new Ring(head.names, head.rows);
  const rows = Array.from({ length: head.rows }, (_, n) => samples.subarray(n * width, (n + 1) * width));
  rows.forEach((row) => ring.push(row));
  return { ...head, ring, rows, taxels: (width - head.names.length - JOINTS - POSE) / 2 };
}

class Replay {
  constructor(data) {
    Object.assign(this, data);
    this.fingers = new Fingers(byId("fingers"), this.scene);
    this.end = this.ring.last("time");
    this.now = this.end;
    this.slider = byId("moment");
    this.slider.max = this.end;
    this.slider.value = this.end;
    this.slider.oninput = () => { this.stop(); this.show(Number(this.slider.value)); };
    byId("play").onclick = () => (this.began === undefined ? this.play() : this.stop());
    addEventListener("resize", () => this.show(this.now));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.show(this.now));
  }

  /** In real time, from the start again if it stands at the end. */
  play() {
    this.began = performance.now() - 1000 * (this.now < this.end ? this.now : 0);
    put("play", "Pause");
    const step = () => {
      if (this.began === undefined) return;
      this.show(Math.min((performance.now() - this.began) / 1000, this.end));
      if (this.now < this.end) requestAnimationFrame(step);
      else this.stop();
    };
    step();
  }

  stop() {
    this.began = undefined;
    put("play", "Play");
  }

  /** The last of so many samples, its readings under their names. */
  at(count) {
    const row = Array.from(this.rows[count - 1]), start = this.names.length + JOINTS + POSE;
    const named = Object.fromEntries(this.names.map((name, k) => [name, Number.isNaN(row[k]) ? null : row[k]]));
    const place = row.slice(this.names.length + JOINTS, start);
    return {
      ...named, joints: row.slice(this.names.length, this.names.length + JOINTS), sigma: null,
      peg: Number.isNaN(place[0]) ? named.theta !== null && "held" : place,
      values: [0, 1].map((finger) => row.slice(start + finger * this.taxels, start + (finger + 1) * this.taxels)),
    };
  }

  show(time) {
    const { ring, scene, hole } = this, count = Math.max(ring.upTo(time), 1), seen = this.at(count), depth = 1000 * scene.hole.depth;
    this.now = time;
    this.slider.value = time;
    this.slider.setAttribute("aria-valuetext", `${time.toFixed(1)} s`);
    drawChart(byId("force-chart"), ring, "force", { ink: "force", scale: 1, low: 0, high: 12, now: time });
    drawChart(byId("depth-chart"), ring, "depth", { ink: "depth", scale: 1000, low: -10, high: 1.1 * depth, limit: depth, now: time });
    drawChart(byId("theta-chart"), ring, "theta", { ink: "accent", scale: DEGREES, ...this.span("theta", DEGREES), now: time });
    drawPath(byId("path"), ring, scene.hole, hole, count);
    this.fingers.draw({ ...seen, trusted: seen.values.map((values) => values.map(() => true)) });
    put("time", `${time.toFixed(2)} s`);
    put("force", number(seen.force, 1, " N"));
    put("depth", millimetres(seen.depth));
    put("angle", degrees(seen.theta));
    this.view?.pose({ ...seen, hole, isSeated: seen.switch === 1 });
    this.view?.path(ring, count);
    this.view?.draw();
  }

  /** The range of a value that is above and below 0, at least 5 to either side. */
  span(name, scale) {
    let reach = 5;
    for (let n = 0; n < this.ring.count; n++) reach = Math.max(reach, Math.abs(this.ring.get(n, name) * scale) || 0);
    return { low: -reach, high: reach };
  }
}

/** Shows the run; without WebGL, only its flat views. */
export async function showReplay(run) {
  const canvas = byId("scene-canvas"), asked = fetch(`/runs/${run}/replay`);
  const solids = canvas.getContext("webgl2") && import("./scene.js"); // the scene draws in this context; both come together
  const answer = await asked;
  if (!answer.ok) return put("replay-note", "No samples of this run are on record, or they are from another version.");
  const replay = new Replay(read(await answer.arrayBuffer()));
  byId("replay-views").hidden = false;
  replay.show(replay.end);
  put("replay-note", "");
  if (!solids) return put("replay-note", "This browser shows no 3D: it has no WebGL.");
  const { CellScene } = await solids;
  replay.view = new CellScene(canvas, replay.scene);
  canvas.hidden = false;
  replay.show(replay.now);
}
