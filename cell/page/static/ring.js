// Points of a trace in a ring of fixed size: nothing grows, however long the page stays open.

export class Ring {
  constructor(names, size) {
    this.names = names;
    this.width = names.length;
    this.size = size;
    this.values = new Float32Array(size * this.width);
    this.clear();
  }

  clear() {
    this.count = 0;
    this.next = 0;
  }

  push(point) {
    for (let k = 0; k < this.width; k++) this.values[this.next * this.width + k] = point[k] ?? NaN;
    this.next = (this.next + 1) % this.size;
    this.count = Math.min(this.count + 1, this.size);
  }

  /** The value `name` of point `n`, the oldest being 0. */
  get(n, name) {
    const place = (this.next - this.count + n + this.size) % this.size;
    return this.values[place * this.width + this.names.indexOf(name)];
  }

  /** The number of points up to a time. */
  upTo(time) {
    let n = 0;
    while (n < this.count && this.get(n, "time") <= time + 1e-6) n++;
    return n;
  }

  last(name) {
    return this.count ? this.get(this.count - 1, name) : NaN;
  }
}
