// Numbers and words as the page writes them.

export const byId = (id) => document.getElementById(id);

/** Writes a text only where it differs, so that a screen reader is not told the same again. */
export function put(id, text) {
  const element = byId(id);
  if (element.textContent !== text) element.textContent = text;
}

export function make(tag, text = "", attributes = {}) {
  const element = document.createElement(tag);
  element.textContent = text;
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

export const known = (value) => value !== null && value !== undefined && Number.isFinite(value);
export const words = (name) => name.replaceAll("_", " ");
export const number = (value, digits, unit = "") => (known(value) ? value.toFixed(digits) + unit : "–");
export const degrees = (radians, digits = 1) => number(known(radians) ? (radians * 180) / Math.PI : null, digits, "°");
export const millimetres = (metres, digits = 1) => number(known(metres) ? 1000 * metres : null, digits, " mm");

/** The local time of day with its zone, and the day where it is not today. */
export function clock(iso) {
  const then = new Date(iso);
  const time = then.toLocaleTimeString([], { timeStyle: "long" });
  return then.toDateString() === new Date().toDateString() ? time : `${then.toLocaleDateString()} ${time}`;
}

/** A link whose text and address are made here, from a whole number. */
export const toRun = (run, text) => make("a", text, { href: `/runs/${Number(run)}` });
