// Both fingers' readings as one picture each, interpolated between the taxels, with the peg's angle on them.

import { begin } from "./paint.js";

const EDGE = 0.0035; // m beyond the outermost taxels
const FINE = 2600; // pixels per m of the picture before it is stretched
const FULL = 4000; // counts; the highest reading is drawn brightest, but none below this
const FORGET = 0.995; // of the highest reading, from picture to picture
const MAP = [[0, 0, 4], [31, 12, 72], [85, 15, 109], [136, 34, 106], [186, 54, 85], [227, 89, 51], [249, 140, 10], [249, 201, 50], [252, 255, 164]];

export class Fingers {
  constructor(canvas, names, taxels, triangles) {
    this.canvas = canvas;
    this.names = names;
    this.taxels = taxels;
    this.highest = FULL;
    const all = taxels.flat();
    this.low = [0, 1].map((k) => Math.min(...all.map((place) => place[k])) - EDGE);
    this.high = [0, 1].map((k) => Math.max(...all.map((place) => place[k])) + EDGE);
    this.rows = Math.round((this.high[0] - this.low[0]) * FINE);
    this.columns = Math.round((this.high[1] - this.low[1]) * FINE);
    this.pads = taxels.map((places) => this.pad(places, triangles));
  }

  /** The three taxels about each pixel and their weights; no taxel outside all triangles. */
  pad(places, triangles) {
    const corners = new Int16Array(this.rows * this.columns * 3).fill(-1);
    const weights = new Float32Array(this.rows * this.columns * 3);
    const picture = new OffscreenCanvas(this.columns, this.rows);
    for (const [a, b, c] of triangles) {
      const [[xa, ya], [xb, yb], [xc, yc]] = [a, b, c].map((taxel) => places[taxel]);
      const area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya);
      for (let row = 0; row < this.rows; row++) {
        for (let column = 0; column < this.columns; column++) {
          const x = this.low[0] + (row + 0.5) / FINE, y = this.low[1] + (column + 0.5) / FINE;
          const wb = ((x - xa) * (yc - ya) - (xc - xa) * (y - ya)) / area;
          const wc = ((xb - xa) * (y - ya) - (x - xa) * (yb - ya)) / area;
          if (wb < -1e-9 || wc < -1e-9 || wb + wc > 1 + 1e-9) continue;
          const place = 3 * (row * this.columns + column);
          corners.set([a, b, c], place);
          weights.set([1 - wb - wc, wb, wc], place);
        }
      }
    }
    return { corners, weights, picture, data: new ImageData(this.columns, this.rows) };
  }

  draw({ values, trusted, theta, sigma }) {
    const { context, width, height } = begin(this.canvas);
    this.highest = Math.max(FULL, this.highest * FORGET, ...values.flat());
    const scale = Math.min((height - 34) / (this.high[0] - this.low[0]), (width / 2 - 18) / (this.high[1] - this.low[1]));
    this.pads.forEach((pad, finger) => {
      const middle = (width / 4) * (1 + 2 * finger);
      const origin = [middle - ((this.low[1] + this.high[1]) / 2) * scale, (height + 20) / 2 - ((this.low[0] + this.high[0]) / 2) * scale];
      const at = (x, y) => [origin[0] + y * scale, origin[1] + x * scale];
      this.fill(pad, values[finger]);
      const [left, top] = at(this.low[0], this.low[1]);
      context.drawImage(pad.picture, left, top, (this.high[1] - this.low[1]) * scale, (this.high[0] - this.low[0]) * scale);
      this.marks(context, this.taxels[finger], trusted[finger], at);
      if (theta !== null) angle(context, theta, sigma, at);
      context.fillStyle = "#c9d3dc";
      context.textAlign = "center";
      context.fillText(this.names[finger], middle, 17);
    });
  }

  fill(pad, values) {
    const { corners, weights, data } = pad;
    for (let pixel = 0; pixel < this.rows * this.columns; pixel++) {
      let value = 0;
      for (let k = 3 * pixel; k < 3 * pixel + 3; k++) if (corners[k] >= 0) value += weights[k] * values[corners[k]];
      const place = Math.min(Math.max(value / this.highest, 0), 1) * (MAP.length - 1);
      const below = Math.min(Math.floor(place), MAP.length - 2), part = place - below;
      for (let k = 0; k < 3; k++) data.data[4 * pixel + k] = MAP[below][k] * (1 - part) + MAP[below + 1][k] * part;
      data.data[4 * pixel + 3] = corners[3 * pixel] >= 0 ? 255 : 0;
    }
    pad.picture.getContext("2d").putImageData(data, 0, 0);
  }

  marks(context, places, trusted, at) {
    places.forEach(([x, y], taxel) => {
      const [column, row] = at(x, y);
      context.fillStyle = context.strokeStyle = trusted[taxel] ? "#9fb0bd" : "#ff8a80";
      context.beginPath();
      if (trusted[taxel]) {
        context.arc(column, row, 2, 0, 2 * Math.PI);
        context.fill();
      } else {
        context.lineWidth = 2;
        for (const sign of [1, -1]) {
          context.moveTo(column - 4, row - 4 * sign);
          context.lineTo(column + 4, row + 4 * sign);
        }
        context.stroke();
      }
    });
  }
}

/** The peg's axis through the finger's centre, and twice sigma to either side of it. */
function angle(context, theta, sigma, at) {
  const ray = (angle, length) => at(length * Math.cos(angle), length * Math.sin(angle));
  const reach = 0.024;
  if (sigma !== null) {
    context.fillStyle = "#6fe3ff40";
    for (const side of [1, -1]) {
      context.beginPath();
      context.moveTo(...at(0, 0));
      context.lineTo(...ray(theta - 2 * sigma, side * reach));
      context.lineTo(...ray(theta + 2 * sigma, side * reach));
      context.fill();
    }
  }
  for (const [width, ink] of [[5, "#101014"], [2, "#7fe9ff"]]) {
    context.lineWidth = width;
    context.strokeStyle = ink;
    context.beginPath();
    context.moveTo(...ray(theta, -reach));
    context.lineTo(...ray(theta, reach));
    context.stroke();
  }
}
