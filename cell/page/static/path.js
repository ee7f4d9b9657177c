// The way of the peg's tip over the plate, seen from above, with the area that contains the hole.

import { begin, colours, stageColour, step } from "./paint.js";

const NEAR = -0.012; // m above the plate: the way there would dwarf what happens on it
const MARGIN = 22;
const WORDS = 20; // pixels at the lower edge that hold the words

/** `count` points of the ring are drawn. */
export function drawPath(canvas, ring, hole, found, count = ring.count) {
  const { context, width, height } = begin(canvas);
  const tint = colours();
  const [cx, cy] = hole.centre, [ax, ay] = hole.area;
  let reach = Math.max(ax, ay, 0.01) * 0.7;
  for (let n = 0; n < ring.count; n++) {
    if (ring.get(n, "depth") > NEAR) reach = Math.max(reach, Math.abs(ring.get(n, "x") - cx), Math.abs(ring.get(n, "y") - cy));
  }
  reach = Math.min(reach, 0.15);
  const scale = (Math.min(width, height) - 2 * MARGIN) / (2 * reach);
  const at = (x, y) => [width / 2 - (y - cy) * scale, height / 2 - (x - cx) * scale];

  grid(context, tint, width, height, scale);
  context.strokeStyle = tint.faint;
  context.setLineDash([4, 4]);
  const [left, top] = at(cx + ax / 2, cy + ay / 2);
  context.strokeRect(left, top, ay * scale, ax * scale);
  context.setLineDash([]);
  context.lineWidth = 1.8;
  context.lineJoin = "round";
  let stage = NaN, pen = false;
  for (let n = 0; n < count; n++) {
    const isNear = ring.get(n, "depth") > NEAR;
    const point = at(ring.get(n, "x"), ring.get(n, "y"));
    if (isNear && pen && ring.get(n, "stage") === stage) {
      context.lineTo(...point);
    } else {
      if (pen) context.stroke();
      stage = ring.get(n, "stage");
      context.strokeStyle = stageColour(stage);
      context.beginPath();
      context.moveTo(...point);
    }
    pen = isNear;
  }
  if (pen) context.stroke();
  if (found) cross(context, tint.bad, at(...found));
  if (count) {
    const [x, y] = at(ring.get(count - 1, "x"), ring.get(count - 1, "y"));
    context.fillStyle = tint.ink;
    context.beginPath();
    context.arc(Math.min(Math.max(x, 6), width - 6), Math.min(Math.max(y, 6), height - WORDS), 5, 0, 2 * Math.PI);
    context.fill();
  }
}

function grid(context, tint, width, height, scale) {
  const pitch = step(Math.min(width, height) / scale, 4);
  context.strokeStyle = tint.grid;
  context.lineWidth = 1;
  context.beginPath();
  for (let d = 0; d * scale < Math.max(width, height) / 2; d += pitch) {
    for (const sign of d ? [1, -1] : [1]) {
      context.moveTo(width / 2 + sign * d * scale, 0);
      context.lineTo(width / 2 + sign * d * scale, height);
      context.moveTo(0, height / 2 + sign * d * scale);
      context.lineTo(width, height / 2 + sign * d * scale);
    }
  }
  context.stroke();
  context.fillStyle = tint.faint;
  context.textAlign = "right";
  context.fillText(`grid ${+(1000 * pitch).toFixed(2)} mm`, width - 4, height - 6);
  context.textAlign = "left";
  context.fillText("x ↑  ← y", 4, height - 6);
}

function cross(context, ink, [x, y]) {
  context.strokeStyle = ink;
  context.lineWidth = 2.5;
  context.beginPath();
  context.moveTo(x - 7, y - 7);
  context.lineTo(x + 7, y + 7);
  context.moveTo(x + 7, y - 7);
  context.lineTo(x - 7, y + 7);
  context.stroke();
}
