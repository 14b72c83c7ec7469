// The local packing fraction of a frame: of the ball that reaches a length beyond the surface of a particle, the share
// that particles fill. Parts of particles within the ball count as parts, the particle itself as well; what is beyond
// walls of the box is no part of the ball.

// How far balls reach beyond the surface, in mean radii: balls of equal particles have a radius of two diameters.
const DENSITY_REACH = 3;

// Packing fraction around each particle, as Float32Array. position: 3 coordinates each, in the box (z = 0 of disks);
// low, size: the extent; periodic, walls: flags of axes; shear: null or { flow, gradient, slide }; reach: a length.
// Runs in a worker as well, so it uses nothing from outside.
function localDensity({ dimension, position, radius, low, size, periodic, walls, shear, reach }) {
  const count = radius.length;
  const flat = dimension === 2;
  const largest = radius.reduce((a, b) => Math.max(a, b), 0);
  const mean = radius.reduce((a, b) => a + b, 0) / count;
  const cutoff = 2 * largest + reach;

  // What two balls share that cut each other, of radii R and r, their centers a distance apart. Volumes are in units of
  // that of a ball of radius 1.
  function shared(R, r, distance) {
    if (flat) {
      const p = (distance * distance + R * R - r * r) / (2 * distance);
      const q = distance - p;
      const half = (radius, x) => radius * radius * Math.acos(x / radius) - x * Math.sqrt(Math.max(radius * radius - x * x, 0));
      return (half(R, p) + half(r, q)) / Math.PI;
    }
    const depth = R + r - distance;
    const square = distance * (distance + 2 * (R + r)) - 3 * (R - r) * (R - r);
    return (depth * depth * square) / (16 * distance);
  }

  // All images that balls may reach; across the gradient axis first, since those are displaced along the flow.
  const [xs, ys, zs, owner] = [[], [], [], []];
  for (let i = 0; i < count; i++) {
    xs.push(position[3 * i]);
    ys.push(position[3 * i + 1]);
    zs.push(position[3 * i + 2]);
    owner.push(i);
  }
  const places = [xs, ys, zs];
  const order = [0, 1, 2].filter((k) => periodic[k]);
  if (shear) order.sort((a, b) => (b === shear.gradient) - (a === shear.gradient));
  for (const k of order) {
    const layers = Math.ceil(cutoff / size[k]);
    for (let row = 0, rows = owner.length; row < rows; row++) {
      for (let m = -layers; m <= layers; m++) {
        const at = places[k][row] + m * size[k];
        if (m === 0 || at < low[k] - cutoff || at > low[k] + size[k] + cutoff) continue;
        for (const c of [0, 1, 2]) {
          let value = c === k ? at : places[c][row];
          if (shear && k === shear.gradient && c === shear.flow) {
            value += m * shear.slide;
            value -= size[c] * Math.floor((value - low[c]) / size[c]);
          }
          places[c].push(value);
        }
        owner.push(owner[row]);
      }
    }
  }

  // Cells, of which there are not many more than images.
  const images = owner.length;
  const [base, cells] = [[0, 0, 0], [1, 1, 1]];
  const ends = places.map((values) => [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))]);
  let edge = 2 * mean + reach;
  for (;;) {
    ends.forEach(([from, to], k) => {
      base[k] = from;
      cells[k] = Math.floor((to - from) / edge) + 1;
    });
    if (cells[0] * cells[1] * cells[2] <= 4 * images + 1000) break;
    edge *= 1.3;
  }
  const cellOf = (value, k) => Math.min(Math.max(Math.floor((value - base[k]) / edge), 0), cells[k] - 1);
  const cell = new Int32Array(images);
  const starts = new Int32Array(cells[0] * cells[1] * cells[2] + 1);
  for (let row = 0; row < images; row++) {
    cell[row] = (cellOf(zs[row], 2) * cells[1] + cellOf(ys[row], 1)) * cells[0] + cellOf(xs[row], 0);
    starts[cell[row] + 1]++;
  }
  for (let c = 1; c < starts.length; c++) starts[c] += starts[c - 1];
  const filled = starts.slice();
  const sorted = new Float64Array(4 * images);
  for (let row = 0; row < images; row++) {
    const to = 4 * filled[cell[row]]++;
    sorted[to] = xs[row];
    sorted[to + 1] = ys[row];
    sorted[to + 2] = zs[row];
    sorted[to + 3] = radius[owner[row]];
  }

  // Points that fill a ball evenly: an additive sequence (M. Roberts' generalized golden ratios).
  const points = [];
  const ratio = flat ? 1.32471795724474602596 : 1.22074408460575947536;
  for (let n = 1; points.length < 1000; n++) {
    const point = [1, 2, 3].map((power) => (flat && power === 3 ? 0 : 2 * ((0.5 + n / ratio ** power) % 1) - 1));
    if (Math.hypot(...point) <= 1) points.push(point);
  }
  // Share of a ball between the walls.
  function inside(at, R) {
    const cut = [0, 1, 2].filter((k) => walls[k] && (at[k] - R < low[k] || at[k] + R > low[k] + size[k]));
    if (cut.length === 0) return 1;
    const within = (point) => cut.every((k) => at[k] + R * point[k] >= low[k] && at[k] + R * point[k] <= low[k] + size[k]);
    return Math.max(points.filter(within).length, 1) / points.length;
  }

  const found = new Float32Array(count);
  for (let i = 0; i < count; i++) {
    const at = [position[3 * i], position[3 * i + 1], position[3 * i + 2]];
    const [x0, y0, z0] = at;
    const R = radius[i] + reach;
    const [from, to] = [-1, 1].map((sign) => at.map((value, k) => cellOf(value + sign * (R + largest), k)));
    let sum = 0;
    for (let z = from[2]; z <= to[2]; z++) {
      for (let y = from[1]; y <= to[1]; y++) {
        const line = (z * cells[1] + y) * cells[0];
        // Cells along x are one after the other.
        for (let row = starts[line + from[0]]; row < starts[line + to[0] + 1]; row++) {
          const dx = sorted[4 * row] - x0;
          const dy = sorted[4 * row + 1] - y0;
          const dz = sorted[4 * row + 2] - z0;
          const r = sorted[4 * row + 3];
          const square = dx * dx + dy * dy + dz * dz;
          if (square >= (R + r) * (R + r)) continue;
          // Most particles are within the ball.
          if (square <= (R - r) * (R - r)) sum += r < R ? (flat ? r * r : r * r * r) : (flat ? R * R : R * R * R);
          else sum += shared(R, r, Math.sqrt(square));
        }
      }
    }
    found[i] = Math.min(sum / ((flat ? R * R : R * R * R) * inside(at, R)), 1);
  }
  return found;
}

// Finds densities of frames in a worker, once each, and keeps them as `frames.found[k].density`.
class Densities {
  constructor(frames, bodies) {
    this.frames = frames;
    this.bodies = bodies;
    this.reach = (DENSITY_REACH * bodies.radius.reduce((a, b) => a + b, 0)) / bodies.radius.length;
    this.pending = new Map();
    this.waiting = new Map();
  }

  // Resolves when the density of a frame is there.
  request(k) {
    if (!this.pending.has(k)) {
      this.pending.set(k, this.frames.load(k).then(() => this.compute(this.input(k), k)).then((found) => {
        Object.assign(this.frames.found[k], { density: found, densest: found.reduce((a, b) => Math.max(a, b), 0) });
      }));
    }
    return this.pending.get(k);
  }

  input(k) {
    const { dimension, room, periodic, boundary, shear } = header;
    const { unit } = this.frames.list;
    const stored = this.frames.found[k].position;
    const position = new Float64Array(3 * header.count);
    for (let i = 0; i < header.count; i++) {
      for (let c = 0; c < dimension; c++) {
        const value = stored[dimension * i + c];
        position[3 * i + c] = unit ? room.origin[c] + value * unit[c] : value;
      }
    }
    return {
      dimension,
      position,
      radius: this.bodies.radius,
      low: room.origin,
      size: room.size,
      periodic,
      walls: boundary.map((kind, c) => kind === "wall" && c < dimension),
      shear: shear && { flow: shear.flow, gradient: shear.gradient, slide: displacement(k, 0) },
      reach: this.reach,
    };
  }

  compute(input, k) {
    this.worker ??= this.start();
    if (!this.worker) return localDensity(input);
    return new Promise((resolve) => {
      this.waiting.set(k, { resolve, input });
      this.worker.postMessage({ k, input });
    });
  }

  // A worker of the function above; false where pages may have none.
  start() {
    const source = `${localDensity}; onmessage = ({ data: { k, input } }) => postMessage({ k, found: localDensity(input) });`;
    try {
      const worker = new Worker(URL.createObjectURL(new Blob([source], { type: "text/javascript" })));
      worker.onmessage = ({ data: { k, found } }) => {
        this.waiting.get(k).resolve(found);
        this.waiting.delete(k);
      };
      worker.onerror = () => {
        this.worker = false;
        for (const { resolve, input } of this.waiting.values()) resolve(localDensity(input));
        this.waiting.clear();
      };
      return worker;
    } catch {
      return false;
    }
  }
}
