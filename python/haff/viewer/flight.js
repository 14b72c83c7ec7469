// Where a particle is between two frames. The shader of particles.js does the same for all of them.
//   line: straight lines between key frames, of which there are many
//   arc:  bodies on strings, rods and springs: a Hermite arc through both positions and velocities
//   kink: free flight under gravity, with at most one collision where the flights from both ends meet; a straight
//         line if there were more collisions

const FLIGHTS = { line: 0, kink: 1, arc: 2 };
// Sides, edges and corners of a box: the sets of axes across which images are.
const SIDES = [1, 2, 3, 4, 5, 6, 7].map((bits) => [bits & 1, (bits >> 1) & 1, bits >> 2]);
// Flights that pass each other by less than this fraction of the radius count as meeting.
const MEET = 0.15;

// Both flights are parabolas of one gravity, so that their difference is linear in time. The time at which they meet;
// null if they pass each other, since there were more collisions.
function meetingTime(a, b, u, w, gravity, radius, dt) {
  const gap = a.map((value, k) => value - b[k] + w[k] * dt - 0.5 * gravity[k] * dt * dt);
  const rate = u.map((value, k) => value - w[k] + gravity[k] * dt);
  const square = rate.reduce((sum, value) => sum + value * value, 0);
  const product = rate.reduce((sum, value, k) => sum + value * gap[k], 0);
  const meeting = square > 0 ? Math.min(Math.max(-product / square, 0), dt) : 0;
  const missed = Math.hypot(...gap.map((value, k) => value + rate[k] * meeting));
  return missed > MEET * radius ? null : meeting;
}

// Position after the time s of dt; a, b: positions at both ends, unwrapped; u, w: velocities there; meeting: of kinks.
function place(flight, a, b, u, w, gravity, meeting, s, dt) {
  // It leaves before the next frame.
  if (b.some(Number.isNaN)) return a.map((value, k) => value + u[k] * s + 0.5 * gravity[k] * s * s);
  const x = dt > 0 ? s / dt : 0;
  const line = a.map((value, k) => value + (b[k] - value) * x);
  if (flight === "line" || dt <= 0) return line;
  if (flight === "arc") {
    const y = 1 - x;
    return a.map(
      (value, k) =>
        (1 + 2 * x) * y * y * value + x * y * y * dt * u[k] + x * x * (3 - 2 * x) * b[k] - x * x * y * dt * w[k],
    );
  }
  if (meeting === null) return line;
  const left = dt - s;
  return s < meeting
    ? a.map((value, k) => value + u[k] * s + 0.5 * gravity[k] * s * s)
    : b.map((value, k) => value - w[k] * left + 0.5 * gravity[k] * left * left);
}

// Velocity there: at a frame the recorded one, in between that of the path that is drawn.
function velocityAt(flight, a, b, u, w, gravity, meeting, s, dt) {
  if (dt <= 0 || (s === 0 && flight !== "line")) return u;
  const x = s / dt;
  if (flight === "arc") {
    const y = 1 - x;
    return a.map(
      (value, k) => (6 * x * y * (b[k] - value)) / dt + y * (1 - 3 * x) * u[k] + x * (3 * x - 2) * w[k],
    );
  }
  if (flight === "line" || meeting === null) return a.map((value, k) => (b[k] - value) / dt);
  return s < meeting
    ? u.map((value, k) => value + gravity[k] * s)
    : w.map((value, k) => value - gravity[k] * (dt - s));
}

// Displacement along the flow of the images across the upper face of the gradient axis, a time s after frame k; 0
// without shear. It grows evenly; those of two frames may differ by an edge more, since each is at most half an edge.
function displacement(k, s) {
  const { shear } = header;
  if (!shear) return 0;
  const edge = header.room.size[shear.flow];
  const at = shear.displacement[k] + shear.speed * s;
  return at - edge * Math.round(at / edge);
}

// Number of the edge that holds a place along an axis.
function edgeOf(value, k) {
  return Math.floor((value - header.room.origin[k]) / header.room.size[k]);
}

// Back into the box, along periodic axes; images across the gradient axis are displaced by `slide` along the flow.
function wrap(position, slide) {
  const { size } = header.room;
  const { shear } = header;
  const at = [...position];
  if (shear) {
    const rows = edgeOf(at[shear.gradient], shear.gradient);
    at[shear.gradient] -= rows * size[shear.gradient];
    at[shear.flow] -= rows * slide;
  }
  return at.map((value, k) =>
    header.periodic[k] && k !== shear?.gradient ? value - size[k] * edgeOf(value, k) : value,
  );
}

// A particle in the box and its images that reach through periodic faces: all places where the shader draws it.
function images(position, radius, slide) {
  const { origin, size } = header.room;
  const { shear } = header;
  const off = (at, k) => at[k] - origin[k] - 0.5 * size[k];
  const reaches = (at, k) => Math.abs(off(at, k)) + radius >= 0.5 * size[k];
  const found = [position];
  for (const across of SIDES) {
    if (across.some((bit, k) => bit && !header.periodic[k])) continue;
    const at = [...position];
    const others = [0, 1, 2].filter((k) => across[k] && k !== shear?.gradient);
    if (shear && across[shear.gradient]) {
      if (!reaches(at, shear.gradient)) continue;
      const up = Math.sign(off(at, shear.gradient));
      at[shear.gradient] -= up * size[shear.gradient];
      at[shear.flow] -= up * slide;
      at[shear.flow] -= size[shear.flow] * edgeOf(at[shear.flow], shear.flow);
    }
    if (!others.every((k) => reaches(at, k))) continue;
    for (const k of others) at[k] -= Math.sign(off(at, k)) * size[k];
    found.push(at);
  }
  return found;
}

// Position, velocity and radius of one particle, x of the way from frame k to the next; `meeting` is the time of its
// collision there, if it had one.
function body(frames, bodies, index, k, x) {
  const d = header.dimension;
  const next = Math.min(k + 1, frames.count - 1);
  const unit = frames.list.unit;
  const origin = header.room.origin;
  const read = (array, scale) => [0, 1, 2].map((c) => (c < d ? array[d * index + c] * scale : 0));
  const places = (f) =>
    read(frames.found[f].position, 1).map((value, c) => (unit && c < d ? origin[c] + value * unit[c] : value));
  const a = places(k);
  const b = places(next);
  const crossed = frames.found[next].crossed;
  if (next > k && crossed.length) for (let c = 0; c < d; c++) b[c] += crossed[d * index + c] * header.room.size[c];
  const u = read(frames.found[k].velocity, frames.velocityUnit(k));
  const w = read(frames.found[next].velocity, frames.velocityUnit(next));
  const dt = frames.time[next] - frames.time[k];
  const { shear } = header;
  if (shear && next > k && crossed.length) {
    // Place and velocity at frame k + 1 of the image that is in the box at frame k.
    const rows = crossed[d * index + shear.gradient];
    b[shear.flow] += rows * displacement(next, 0);
    w[shear.flow] += rows * shear.speed;
  }
  const gravity = bodies.held[index] ? [0, 0, 0] : header.gravity;
  const radius = bodies.radius[index];
  const meeting = header.flight === "kink" ? meetingTime(a, b, u, w, gravity, radius, dt) : null;
  const path = [header.flight, a, b, u, w, gravity, meeting, x * dt, dt];
  const at = place(...path);
  const velocity = [...velocityAt(...path)];
  // The image in the box moves with the flow there.
  if (shear) velocity[shear.flow] -= edgeOf(at[shear.gradient], shear.gradient) * shear.speed;
  return { position: wrap(at, displacement(k, x * dt)), velocity, radius, meeting };
}
