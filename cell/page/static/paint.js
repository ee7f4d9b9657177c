// What canvases share: their size in pixels, the colours of the page, the axes.

export const STAGES = ["#9aa5ad", "#4477aa", "#55b4d4", "#228833", "#c2ab2f", "#ee6677", "#aa3377"];
export const stageColour = (number) => STAGES[(number || 0) % STAGES.length];

/** Makes the canvas as fine as the screen and returns its context, width and height in the page's own pixels. */
export function begin(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "12px system-ui, 'DejaVu Sans', sans-serif";
  return { context, width, height };
}

let inks = null;
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { inks = null; });

export function colours() {
  if (!inks) {
    const style = getComputedStyle(document.documentElement);
    const named = (name) => style.getPropertyValue(`--${name}`).trim();
    inks = Object.fromEntries(["ink", "faint", "rule", "grid", "accent", "force", "depth", "bad", "good", "card"].map((name) => [name, named(name)]));
  }
  return inks;
}

/** A round step that divides a range into about so many parts. */
export function step(range, parts) {
  const rough = range / parts, power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
}

/** Whether this browser has WebGL; with `isFast`, only where a graphics processor draws it. */
export const canDrawSolids = (isFast = false) => Boolean(document.createElement("canvas").getContext("webgl2", { failIfMajorPerformanceCaveat: isFast }));

/** A reading as it is drawn: noise is no touch. */
export const felt = ({ least }, counts) => (counts < least ? 0 : counts);

/** The colour of a reading: red, green, blue. */
export function touchColour({ most, palette }, counts) {
  const share = Math.min(counts / most, 1) * (palette.length - 1), below = Math.min(Math.floor(share), palette.length - 2);
  return palette[below].map((part, k) => part + (share - below) * (palette[below + 1][k] - part));
}
