// Both fingers' readings as one picture each, interpolated between the taxels, with their numbers and the peg's angle on them; the tip of the hand points down.

import { begin, felt, touchColour } from "./paint.js";

const EDGE = 0.0035; // m beyond the outermost taxels
const FINE = 2600; // pixels per m of the picture before it is stretched
const HEAD = 24, FOOT = 34; // pixels for the names and for the scale of colours
const SHADES = 256;

export class Fingers {
  constructor(canvas, { fingers, taxels, triangles, colours }) {
    this.canvas = canvas;
    this.names = fingers;
    this.taxels = taxels;
    this.colours = colours;
    this.shades = Array.from({ length: SHADES }, (_, n) => touchColour(colours, (colours.most * n) / (SHADES - 1)));
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
    const scale = Math.min((height - HEAD - FOOT) / (this.high[0] - this.low[0]), (width / 2 - 18) / (this.high[1] - this.low[1]));
    this.pads.forEach((pad, finger) => {
      const middle = (width / 4) * (1 + 2 * finger);
      const origin = [middle - ((this.low[1] + this.high[1]) / 2) * scale, (height + HEAD - FOOT) / 2 - ((this.low[0] + this.high[0]) / 2) * scale];
      const at = (x, y) => [origin[0] + y * scale, origin[1] + x * scale];
      this.fill(pad, values[finger].map((counts) => felt(this.colours, counts)));
      const [left, top] = at(this.low[0], this.low[1]);
      context.drawImage(pad.picture, left, top, (this.high[1] - this.low[1]) * scale, (this.high[0] - this.low[0]) * scale);
      this.marks(context, this.taxels[finger], trusted[finger], at);
      if (theta !== null) angle(context, theta, sigma, at);
      context.fillStyle = "#c9d3dc";
      context.textAlign = "center";
      context.fillText(`${this.names[finger]} finger`, middle, 17);
    });
    this.legend(context, width, height);
  }

  /** The scale of colours, from the noise upward. */
  legend(context, width, height) {
    const long = Math.min(width - 40, 260), left = (width - long) / 2, { least, most } = this.colours;
    for (let n = 0; n < long; n++) {
      const [red, green, blue] = touchColour(this.colours, felt(this.colours, (most * n) / long));
      context.fillStyle = `rgb(${red}, ${green}, ${blue})`;
      context.fillRect(left + n, height - 28, 1.5, 9);
    }
    context.fillStyle = "#c9d3dc";
    for (const [counts, text] of [[0, "0"], [most / 2, `${most / 2000}`], [most, `${most / 1000} k counts`]]) {
      context.textAlign = counts === most ? "right" : "center";
      context.fillText(text, left + (counts === most ? long + 16 : (long * counts) / most), height - 6);
    }
    context.textAlign = "left";
    context.fillText(`noise < ${least / 1000}`, left + 12, height - 6);
  }

  fill(pad, values) {
    const { corners, weights, data } = pad;
    for (let pixel = 0; pixel < this.rows * this.columns; pixel++) {
      let value = 0;
      for (let k = 3 * pixel; k < 3 * pixel + 3; k++) if (corners[k] >= 0) value += weights[k] * values[corners[k]];
      const shade = this.shades[Math.round(Math.min(value / this.colours.most, 1) * (SHADES - 1))];
      for (let k = 0; k < 3; k++) data.data[4 * pixel + k] = shade[k];
      data.data[4 * pixel + 3] = corners[3 * pixel] >= 0 ? 255 : 0;
    }
    pad.picture.getContext("2d").putImageData(data, 0, 0);
  }

  /** The number of each taxel, as in faults and exports; a cross before those that are not trusted. */
  marks(context, places, trusted, at) {
    context.textAlign = "center";
    context.textBaseline = "middle";
    places.forEach(([x, y], taxel) => {
      const [column, row] = at(x, y);
      context.strokeStyle = "#101014";
      context.lineWidth = 2.5;
      context.strokeText(taxel, column, row);
      context.fillStyle = trusted[taxel] ? "#d5dee6" : "#ff8a80";
      context.fillText(trusted[taxel] ? taxel : `×${taxel}`, column, row);
    });
    context.textBaseline = "alphabetic";
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
