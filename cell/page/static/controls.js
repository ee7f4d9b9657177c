// The controls: what may be pressed is what the state permits, and who holds the lease decides in the cell.

import { byId, make, put, words } from "./text.js";

const KEPT = "cell-token"; // in the browser's tab, until it is closed
const ANYBODY = ["stop", "abort"];

export class Controls {
  constructor(link) {
    this.link = link;
    this.isUnlocked = false;
    this.own = { lease: "free", answered: 0, refusal: "", steps: [] };
    this.asked = this.awaited = "";
    const given = new URLSearchParams(location.hash.slice(1)).get("token");
    if (given) {
      sessionStorage.setItem(KEPT, given);
      history.replaceState(null, "", location.pathname);
    }
    for (const button of document.querySelectorAll("[data-ask]")) this.listen(button);
    byId("release").addEventListener("click", () => this.link.ask("release"));
    byId("unlock").addEventListener("click", () => (this.isUnlocked ? this.lock() : this.open()));
    byId("cancel").addEventListener("click", () => byId("ask").close());
    byId("token-form").addEventListener("submit", (event) => { event.preventDefault(); this.show(byId("token").value.trim()); });
  }

  listen(button) {
    button.addEventListener("click", (event) => { event.preventDefault(); this.press(button); });
  }

  /** A new connection begins locked; the token that was shown before is shown again. */
  greet({ programs, recipes, cables }) {
    fill(byId("program"), programs, words);
    fill(byId("recipe"), recipes, String);
    byId("cables").hidden = !cables.length;
    byId("cable-buttons").replaceChildren(...cables.map((cable) => {
      const button = make("button", "", { type: "button", id: `cable-${cable}`, "data-cable": cable });
      button.addEventListener("click", () => this.pull(button));
      return button;
    }));
    this.own = { lease: "free", answered: 0, refusal: "" };
    this.isUnlocked = false;
    this.showKept();
    this.refresh();
  }

  /** All places are taken: a page with the token gets one all the same. */
  knock(why) {
    this.say(`No place: ${why}.`);
    this.showKept();
  }

  showKept() {
    const token = sessionStorage.getItem(KEPT);
    if (token) this.show(token);
  }

  lost() {
    this.isUnlocked = false;
    this.refresh();
  }

  open() {
    put("token-answer", "");
    byId("token").value = "";
    byId("ask").showModal();
  }

  show(token) {
    if (!isPrivate()) return this.locked("a token is sent only over https, or at the cell's own computer");
    this.candidate = token;
    this.link.ask("unlock", { token });
  }

  unlocked() {
    if (this.candidate) sessionStorage.setItem(KEPT, this.candidate);
    this.candidate = undefined;
    this.isUnlocked = true;
    byId("ask").close();
    this.refresh();
  }

  locked(why) {
    sessionStorage.removeItem(KEPT);
    put("token-answer", `Refused: ${why}.`);
    if (!byId("ask").open) this.say(`Refused: ${why}.`);
  }

  /** Forgets the token; the link ends with the connection, which comes back as one that may only look. */
  lock() {
    sessionStorage.removeItem(KEPT);
    this.link.socket.close();
  }

  showState(state) {
    const before = this.state?.unplugged.join(", "), now = state.unplugged.join(", ");
    if (before !== undefined && before !== now) this.say(now ? `Unplugged: ${now}. Watch what the cell does.` : "Every cable is plugged in.");
    this.state = state;
    this.tell();
    this.refresh();
  }

  /** The answer to a command is the state that followed it. */
  tell() {
    const { state, fault } = this.state ?? {};
    if (!this.awaited || !state || state.endsWith("ING")) return;
    const reached = words(state.toLowerCase()), isFaulted = ["reset", "clear"].includes(this.awaited) && fault;
    this.say(isFaulted ? `Not ${this.awaited === "reset" ? "reset" : "cleared"}: ${fault.message}.` : `${name(this.awaited)}: the state is ${reached}.`);
    if (!isFaulted || reached === "idle") this.awaited = "";
  }

  showOwn(own) {
    const isAnswer = own.answered !== this.own.answered;
    this.own = own;
    if (isAnswer && this.asked) {
      this.say(own.refusal ? `${name(this.asked)} refused: ${own.refusal}.` : `${name(this.asked)}: accepted.`);
      this.awaited = own.refusal ? "" : this.asked;
      this.asked = "";
      this.tell();
    }
    this.refresh();
  }

  say(text) {
    put("answer", text);
  }

  press(button) {
    const what = button.dataset.ask, why = this.whyNot(what);
    if (why) {
      this.say(`${name(what)} is not possible: ${why}.`);
      return;
    }
    const chosen = () => ({ program: byId("program").value, recipe: Number(byId("recipe").value), serial: byId("serial").value });
    const { program } = button.dataset, more = what !== "start" ? {} : program ? { program, recipe: 0, serial: "" } : chosen();
    this.asked = what;
    this.say(`${name(what)} …`);
    this.link.ask(what, more);
  }

  /** Only simulated devices have such buttons; what the page asks for, the cell says it has done. */
  pull(button) {
    const cable = button.dataset.cable, isOut = this.state?.unplugged.includes(cable), why = this.whyLocked();
    if (why) this.say(`The cable stays as it is: ${why}.`);
    else this.link.ask(isOut ? "plug" : "unplug", { cable });
  }

  whyLocked() {
    if (document.body.dataset.link !== "live") return "there is no connection to the cell";
    return this.isUnlocked ? "" : "this page may only look; unlock the controls first";
  }

  whyNot(what) {
    const locked = this.whyLocked();
    if (locked) return locked;
    const isOut = what === "start" && ["IDLE", "COMPLETE"].includes(this.state?.state) && this.state.unplugged.length;
    if (isOut) return `plug in what was pulled out first: ${this.state.unplugged.join(", ")}`;
    if (!this.state?.permitted.includes(what)) return `not in the state ${words((this.state?.state ?? "").toLowerCase())}`;
    if (this.own.lease === "taken" && !ANYBODY.includes(what)) return `${this.state.holder || "somebody else"} holds the lease`;
    return "";
  }

  /** One button for each next step; only the first one that is permitted stands out. */
  showSteps() {
    const steps = [...(this.state?.steps ?? []), ...(this.own.steps ?? [])], key = JSON.stringify(steps);
    if (byId("steps").dataset.key !== key) {
      byId("steps").dataset.key = key;
      byId("steps").replaceChildren(...steps.map(({ ask, label, program }) => {
        const button = make("button", label, { type: "button", "data-ask": ask, ...(program && { "data-program": program }) });
        this.listen(button);
        return button;
      }));
    }
    let isFirst = true;
    for (const button of byId("steps").children) {
      const why = this.whyNot(button.dataset.ask);
      button.title = why;
      button.classList.toggle("go", !why && isFirst);
      if (!why) isFirst = false;
    }
    byId("start").classList.toggle("go", isFirst);
  }

  refresh() {
    this.showSteps();
    for (const button of document.querySelectorAll("[data-ask]")) {
      button.setAttribute("aria-disabled", String(Boolean(this.whyNot(button.dataset.ask))));
    }
    for (const button of document.querySelectorAll("[data-cable]")) {
      const cable = button.dataset.cable, isOut = Boolean(this.state?.unplugged.includes(cable));
      put(button.id, isOut ? `Plug the ${cable} in` : `Unplug the ${cable}`);
      button.classList.toggle("go", isOut);
      button.setAttribute("aria-disabled", String(Boolean(this.whyLocked())));
    }
    byId("locked").style.visibility = this.isUnlocked ? "hidden" : "";
    put("unlock", this.isUnlocked ? "Lock controls" : "Unlock controls");
    byId("release").hidden = this.own.lease !== "yours";
    put("lease", this.isUnlocked && this.own.lease === "yours" ? "this page" : this.state?.holder || "free");
  }
}

const SAID = { cleared: "Peg taken away", refilled: "Rack filled" };
const isPrivate = () => location.protocol === "https:" || /^(localhost|127\.[\d.]+|\[::1\])$/.test(location.hostname);
const name = (what) => SAID[what] ?? what.replace(/^./, (letter) => letter.toUpperCase());

function fill(select, values, show) {
  if (select.options.length === values.length) return;
  select.replaceChildren(...values.map((value) => make("option", show(String(value)), { value })));
}
