// The one connection to the cell: it comes back by itself, and says when it is lost.

const SHORTEST = 300, LONGEST = 3000; // ms between two tries

export class CellLink {
  constructor(hear, lost) {
    this.hear = hear;
    this.lost = lost;
    this.wait = SHORTEST;
    this.open();
  }

  open() {
    this.socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
    this.socket.onmessage = (event) => {
      this.wait = SHORTEST;
      this.hear(JSON.parse(event.data));
    };
    this.socket.onclose = (event) => {
      this.lost(event.reason);
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, LONGEST);
    };
  }

  ask(what, more = {}) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({ ask: what, ...more }));
    return true;
  }
}
