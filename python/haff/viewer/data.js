// The arrays of the page: base64, deflated; unpacked when they are needed.

const find = (id) => document.getElementById(id);
const header = JSON.parse(document.getElementById("header").textContent);

async function unpack(entry) {
  const element = document.getElementById(`blob-${entry.blob}`);
  const text = element.textContent;
  const bytes = Uint8Array.fromBase64
    ? Uint8Array.fromBase64(text)
    : Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  element.textContent = ""; // read once: the text can be freed
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const buffer = await new Response(stream).arrayBuffer();
  return entry.arrays.map(([type, offset, length]) => new globalThis[type](buffer, offset, length));
}

// Frames by number; those of one chunk are unpacked together.
class Frames {
  constructor(list) {
    this.time = list.time;
    this.list = list;
    this.found = new Array(list.time.length);
    this.pending = new Map();
  }

  get count() {
    return this.time.length;
  }

  chunk(k) {
    const chunks = this.list.chunks;
    let low = 0;
    let high = chunks.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (chunks[middle].first <= k) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  // Unpacks the chunk of a frame; resolves when `found[k]` is there.
  load(k) {
    const c = this.chunk(k);
    if (!this.pending.has(c)) {
      const chunk = this.list.chunks[c];
      const done = unpack(chunk).then((arrays) => {
        for (let f = 0; 5 * f < arrays.length; f++) {
          const [position, velocity, crossed, soFar, recent] = arrays.slice(5 * f, 5 * f + 5);
          this.found[chunk.first + f] = { position, velocity, crossed, soFar, recent };
        }
      });
      this.pending.set(c, done);
    }
    return this.pending.get(c);
  }

  // Unpacks the spins of a chunk, which only single particles need.
  loadSpin(k) {
    const chunk = this.list.chunks[this.chunk(k)];
    this.spins ??= new Map();
    if (!this.spins.has(chunk)) {
      const done = Promise.all([this.load(k), unpack(chunk.spin)]).then(([, arrays]) => {
        arrays.forEach((spin, f) => (this.found[chunk.first + f].spin = spin));
      });
      this.spins.set(chunk, done);
    }
    return this.spins.get(chunk);
  }

  async loadAll() {
    for (const chunk of this.list.chunks) await this.load(chunk.first);
  }

  velocityUnit(k) {
    return this.list.unit ? this.list.velocity_unit[k] : 1;
  }
}
