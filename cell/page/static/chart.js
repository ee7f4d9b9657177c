// One value of a ring over the time of the run, with the stages behind it.

import { begin, colours, stageColour, step } from "./paint.js";

const LEFT = 34, RIGHT = 8, TOP = 6, BOTTOM = 22, LEAST = 10;

export function drawChart(canvas, ring, name, { ink, scale, low, high, limit, now }) {
  const { context, width, height } = begin(canvas);
  const tint = colours();
  const end = Math.max(ring.count ? ring.last("time") : 0, LEAST);
  const start = ring.count > 1 && ring.count === ring.size ? ring.get(0, "time") : 0;
  let bottom = low, top = high;
  for (let n = 0; n < ring.count; n++) {
    const value = ring.get(n, name) * scale;
    if (value > top) top = value;
  }
  const column = (time) => LEFT + ((time - start) / (end - start)) * (width - LEFT - RIGHT);
  const row = (value) => height - BOTTOM - ((Math.max(value, bottom) - bottom) / (top - bottom)) * (height - TOP - BOTTOM);

  stages(context, ring, column, TOP, height - BOTTOM);
  context.lineWidth = 1;
  context.fillStyle = tint.faint;
  context.strokeStyle = tint.grid;
  context.textBaseline = "middle";
  context.textAlign = "right";
  const rows = step(top - bottom, 4);
  for (let value = Math.ceil(bottom / rows) * rows; value <= top + 1e-9; value += rows) {
    line(context, LEFT, row(value), width - RIGHT, row(value));
    context.fillText(`${+value.toFixed(3)}`, LEFT - 7, row(value));
  }
  context.textBaseline = "alphabetic";
  context.textAlign = "center";
  const columns = step(end - start, 6);
  for (let time = Math.ceil(start / columns) * columns; time < end - columns / 3; time += columns) {
    context.fillText(`${+time.toFixed(2)}`, column(time), height - 6);
  }
  context.textAlign = "right";
  context.fillText("s", width - RIGHT, height - 6);
  if (limit !== undefined && limit <= top) {
    context.setLineDash([5, 4]);
    context.strokeStyle = tint.bad;
    line(context, LEFT, row(limit), width - RIGHT, row(limit));
    context.setLineDash([]);
  }
  if (now !== undefined) {
    context.strokeStyle = tint.ink;
    line(context, column(now), TOP, column(now), height - BOTTOM);
  }
  context.strokeStyle = tint[ink];
  context.lineWidth = 1.8;
  context.lineJoin = "round";
  context.beginPath();
  for (let n = 0, pen = false; n < ring.count; n++) {
    const value = ring.get(n, name) * scale;
    if (Number.isNaN(value)) { pen = false; continue; }
    context[pen ? "lineTo" : "moveTo"](column(ring.get(n, "time")), row(value));
    pen = true;
  }
  context.stroke();
}

function line(context, x1, y1, x2, y2) {
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x2, y2);
  context.stroke();
}

function stages(context, ring, column, top, bottom) {
  for (let n = 0; n < ring.count;) {
    const stage = ring.get(n, "stage");
    let end = n;
    while (end < ring.count && ring.get(end, "stage") === stage) end++;
    const left = column(ring.get(n, "time")), right = column(ring.get(Math.min(end, ring.count - 1), "time"));
    context.globalAlpha = 0.16;
    context.fillStyle = stageColour(stage);
    context.fillRect(left, top, right - left, bottom - top);
    context.globalAlpha = 1;
    context.fillRect(left, bottom - 3, right - left, 3);
    n = end;
  }
}
