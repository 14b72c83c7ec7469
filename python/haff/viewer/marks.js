// Marks that turn with the particles: two great circles of each sphere, a radius of each disk.

const ARC = 40; // pieces of a circle

class Marks {
  // turns: of each frame and particle a quaternion x, y, z, w, and the angular velocity from there on.
  constructor(scene, frames, bodies, [turns]) {
    this.frames = frames;
    this.bodies = bodies;
    this.turns = turns;
    const [x, y, z] = [0, 1, 2].map((k) => [0, 1, 2].map((c) => Number(c === k)));
    this.shape = header.dimension === 2 ? [[0, 0, 0], x] : [...circle(x, y), ...circle(y, z)];
    this.lines = lines(new Array(this.shape.length * header.count).fill([0, 0, 0]), 0xffffff, 0.85);
    scene.add(this.lines);
  }

  // Turns and moves the marks: x of the way from frame k to the next.
  show(k, x, where, visible) {
    this.lines.visible = visible;
    if (!visible) return;
    const next = Math.min(k + 1, this.frames.count - 1);
    const s = x * (this.frames.time[next] - this.frames.time[k]);
    const positions = this.lines.geometry.getAttribute("position");
    let row = 0;
    for (let index = 0; index < header.count; index++) {
      const at = 7 * (k * header.count + index);
      const turn = product(rotation([...this.turns.subarray(at + 4, at + 7)], s), this.turns.subarray(at, at + 4));
      const center = where(index);
      const radius = this.bodies.radius[index] * (header.dimension === 2 ? 1 : 1.004);
      for (const point of this.shape) {
        positions.setXYZ(row++, ...turned(point, turn).map((value, c) => center[c] + radius * value));
      }
    }
    positions.needsUpdate = true;
  }
}

// The quaternion of a rotation with an angular velocity for a time.
function rotation(spin, time) {
  const speed = Math.hypot(...spin);
  const half = 0.5 * speed * time;
  const size = speed > 0 ? Math.sin(half) / speed : 0;
  return [...spin.map((value) => value * size), Math.cos(half)];
}

const cross = (a, b) => [0, 1, 2].map((c) => a[(c + 1) % 3] * b[(c + 2) % 3] - a[(c + 2) % 3] * b[(c + 1) % 3]);

// The rotation q, then p.
function product(p, q) {
  const across = cross(p, q);
  const vector = across.map((value, c) => value + p[3] * q[c] + q[3] * p[c]);
  return [...vector, p[3] * q[3] - p[0] * q[0] - p[1] * q[1] - p[2] * q[2]];
}

function turned(point, q) {
  const across = cross(q, point).map((value) => 2 * value);
  const twice = cross(q, across);
  return point.map((value, c) => value + q[3] * across[c] + twice[c]);
}

// Ends in pairs of the pieces of a circle through two perpendicular directions.
function circle(a, b) {
  const at = (n) => {
    const angle = (2 * Math.PI * n) / ARC;
    return a.map((value, c) => Math.cos(angle) * value + Math.sin(angle) * b[c]);
  };
  return Array.from({ length: ARC }, (_, n) => [at(n), at(n + 1)]).flat();
}
