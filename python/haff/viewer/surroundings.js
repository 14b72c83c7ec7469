// The box, the walls, and the strings, rods and springs.

const EDGE = { dark: 0x7d8894, light: 0x8a949e };
const WALL = { dark: 0xb9a77f, light: 0x9a7b32 };
const JOINT = { dark: 0xf0f3f6, light: 0x20262c };
const COILS = 9;

// The extent, with margins along open axes.
function room() {
  const { origin, size, bounded } = header.room;
  const flat = header.dimension === 2;
  const low = [...origin];
  const high = origin.map((value, k) => value + size[k]);
  // The walls that are no planes.
  const [first, last] = header.shown;
  for (let k = 0; k < (flat ? 2 : 3); k++) {
    if (bounded[k]) continue;
    low[k] = Math.min(low[k], first[k]);
    high[k] = Math.max(high[k], last[k]);
  }
  for (const { ends } of header.joints) {
    for (const end of ends.filter(Array.isArray)) {
      end.forEach((value, k) => {
        low[k] = Math.min(low[k], value);
        high[k] = Math.max(high[k], value);
      });
    }
  }
  for (const wall of header.walls) {
    wall.point.forEach((value, k) => {
      if (bounded[k] || Math.abs(wall.normal[k]) < 0.9 * Math.hypot(...wall.normal)) return;
      low[k] = Math.min(low[k], value);
      high[k] = Math.max(high[k], value);
    });
  }
  const longest = Math.max(...high.slice(0, flat ? 2 : 3).map((value, k) => value - low[k]));
  for (let k = 0; k < (flat ? 2 : 3); k++) {
    // Not thinner than a fourth of the longest side, so that the scene of one falling ball is not a narrow strip.
    const more = bounded[k] ? 0 : Math.max(0.04 * longest, (longest / 4 - (high[k] - low[k])) / 2);
    low[k] -= more;
    high[k] += more;
  }
  return { low, high };
}

// Pieces of lines, by their ends in pairs: three numbers each, or all numbers in one array.
function lines(points, color, opacity) {
  const geometry = new THREE.BufferGeometry();
  const array = points instanceof Float32Array ? points : new Float32Array(points.flat());
  geometry.setAttribute("position", new THREE.BufferAttribute(array, 3));
  const material = new THREE.LineBasicMaterial({ color, transparent: opacity < 1, opacity });
  const found = new THREE.LineSegments(geometry, material);
  found.frustumCulled = false;
  return found;
}

// Three corners of each triangle of a convex polygon.
const fan = (points) => points.slice(2).flatMap((_, k) => [0, k + 1, k + 2]);

function surface(points, color, opacity, triangles = fan(points)) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(points.flat()), 3));
  geometry.setIndex(triangles);
  const material = new THREE.MeshBasicMaterial({
    color,
    transparent: true,
    opacity,
    side: THREE.DoubleSide,
    depthWrite: false,
  });
  const found = new THREE.Mesh(geometry, material);
  found.frustumCulled = false;
  return found;
}

const CORNERS = Array.from({ length: 8 }, (_, k) => [k & 1, (k >> 1) & 1, k >> 2]);
const corner = (bits, { low, high }) => bits.map((bit, k) => (bit ? high[k] : low[k]));

// Intersection of a plane with the extent, its corners in order around the center.
function cut(point, normal, space) {
  const side = (at) => at.reduce((sum, value, k) => sum + (value - point[k]) * normal[k], 0);
  const found = [];
  for (const a of CORNERS) {
    for (let k = 0; k < 3; k++) {
      if (a[k]) continue;
      const [from, to] = [corner(a, space), corner(a.map((bit, c) => (c === k ? 1 : bit)), space)];
      const [x, y] = [side(from), side(to)];
      if (x * y > 0 || x === y) continue;
      found.push(from.map((value, c) => value + ((to[c] - value) * x) / (x - y)));
    }
  }
  if (found.length < 3) return [];
  const middle = [0, 1, 2].map((k) => found.reduce((sum, at) => sum + at[k], 0) / found.length);
  const n = new THREE.Vector3(...normal).normalize();
  const u = new THREE.Vector3(...(Math.abs(n.x) < 0.9 ? [1, 0, 0] : [0, 1, 0])).cross(n).normalize();
  const v = n.clone().cross(u);
  const angle = (at) => {
    const r = new THREE.Vector3(...at.map((value, k) => value - middle[k]));
    return Math.atan2(r.dot(v), r.dot(u));
  };
  return found.sort((a, b) => angle(a) - angle(b));
}

// What a round hole leaves of a convex polygon: pairs of points, on the rim and on the edge of the polygon.
function pierced(corners, normal, { center, radius }) {
  const n = new THREE.Vector3(...normal).normalize();
  const u = new THREE.Vector3(...corners[0].map((value, k) => value - center[k])).projectOnPlane(n).normalize();
  const v = n.clone().cross(u);
  const flat = corners.map((at) => {
    const r = new THREE.Vector3(...at.map((value, k) => value - center[k]));
    return [r.dot(u), r.dot(v)];
  });
  const angles = Array.from({ length: 64 }, (_, k) => (k * Math.PI) / 32);
  angles.push(...flat.map(([x, y]) => (Math.atan2(y, x) + 2 * Math.PI) % (2 * Math.PI)));
  angles.sort((a, b) => a - b);
  const points = angles.flatMap((angle) => {
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    // Distance of the edge along the ray.
    let edge = 0;
    flat.forEach(([x, y], k) => {
      const [p, q] = flat[(k + 1) % flat.length];
      const [across, length] = [c * (q - y) - s * (p - x), x * (q - y) - y * (p - x)];
      const along = x * s - y * c;
      if (across !== 0 && length / across > 0 && along / across >= -1e-9 && along / across <= 1 + 1e-9) {
        edge = Math.max(edge, length / across);
      }
    });
    const at = (distance) => center.map((value, k) => value + distance * (c * u.getComponent(k) + s * v.getComponent(k)));
    return [at(Math.min(radius, edge)), at(edge)];
  });
  const triangles = angles.flatMap((_, k) => {
    const [a, b] = [2 * k, 2 * ((k + 1) % angles.length)];
    return [a, a + 1, b, b, a + 1, b + 1];
  });
  return { points, triangles };
}

// What a gap of twice the radius leaves of the line from a to b.
function gapped(a, b, { center, radius }) {
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
  const middle = ((center[0] - a[0]) * (b[0] - a[0]) + (center[1] - a[1]) * (b[1] - a[1])) / length;
  const at = (distance) => {
    const x = Math.min(Math.max(distance / length, 0), 1);
    return a.map((value, k) => value + (b[k] - value) * x);
  };
  return [
    [a, at(middle - radius)],
    [at(middle + radius), b],
  ];
}

// The shift of an oscillating wall along its normal.
function shift(motion, time) {
  const sine = Math.sin(2 * Math.PI * motion.frequency * time + (motion.phase || 0));
  return motion.amplitude * (motion.kind === "sine" ? sine : (2 / Math.PI) * Math.asin(sine));
}

// The displacement of a piston along its normal: flights of constant acceleration from knot to knot.
function pushed({ time: times, at, speed }, time) {
  let [low, high] = [0, times.length - 1];
  if (time <= times[0]) return at[0];
  if (time >= times[high]) return at[high];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  const [step, since] = [times[high] - times[low], time - times[low]];
  const bend = at[high] - at[low] - speed[low] * step;
  return at[low] + speed[low] * since + bend * (since / step) ** 2;
}

// The way of a wall from its point until a time.
function moved(wall, time) {
  const own = wall.piston ? pushed(wall.piston, time) : wall.motion ? shift(wall.motion, time) : 0;
  const along = ((wall.displacement || 0) + own) / Math.hypot(...wall.normal);
  return wall.velocity.map((value, k) => value * (time - (wall.since || 0)) + wall.normal[k] * along);
}

// Lines in a plane that turn with it about a point: spokes and a circle, where they stay in a polygon.
function spokes(corners, normal, point) {
  const n = new THREE.Vector3(...normal).normalize();
  const from = (at) => new THREE.Vector3(...at.map((value, k) => value - point[k]));
  const foot = n.clone().multiplyScalar(from(corners[0]).dot(n));
  const u = from(corners[0]).sub(foot);
  const reach = Math.min(
    ...corners.map((at, k) => {
      const [a, b] = [from(at).sub(foot), from(corners[(k + 1) % corners.length]).sub(foot)];
      return a.clone().cross(b).dot(n) / b.clone().sub(a).length();
    }),
  );
  // The corners run to the left about the normal; a point to the right of an edge is outside.
  if (!(reach > 0)) return [];
  u.setLength(reach);
  const v = n.clone().cross(u);
  const rim = (k) => u.clone().multiplyScalar(Math.cos((k * Math.PI) / 48)).addScaledVector(v, Math.sin((k * Math.PI) / 48));
  const found = Array.from({ length: 96 }, (_, k) => [rim(k), rim(k + 1)]);
  for (let k = 0; k < 96; k += 16) found.push([new THREE.Vector3(), rim(k)]);
  return found.flat().map((at) => at.add(foot).toArray().map((value, k) => value + point[k]));
}

class Surroundings {
  // shapes: what `unpackShapes` has unpacked.
  constructor(scene, theme, shapes) {
    this.scene = scene;
    this.shapes = shapes;
    this.space = room();
    this.parts = [];
    this.moving = [];
    this.turning = [];
    this.joints = null;
    this.draw(theme);
  }

  draw(theme) {
    for (const part of this.parts) {
      this.scene.remove(part);
      part.geometry.dispose();
      part.material.dispose();
    }
    this.parts = [];
    this.moving = [];
    this.turning = [];
    const flat = header.dimension === 2;
    const { bounded } = header.room;
    const axes = flat ? [0, 1] : [0, 1, 2];
    if (axes.some((k) => bounded[k])) {
      const edges = [];
      for (const a of CORNERS) {
        if (flat && a[2]) continue;
        for (const k of axes) {
          if (a[k]) continue;
          const b = a.map((bit, c) => (c === k ? 1 : bit));
          edges.push(corner(a, this.space), corner(b, this.space));
        }
      }
      this.parts.push(lines(flat ? edges.map(([x, y]) => [x, y, 0]) : edges, EDGE[theme], 0.8));
    }
    const thick = 0.006 * Math.max(...axes.map((k) => this.space.high[k] - this.space.low[k]));
    const planes = [];
    for (const k of axes) {
      if (header.boundary[k] !== "wall") continue;
      for (const sign of [1, -1]) {
        const point = sign > 0 ? this.space.low : this.space.high;
        const normal = [0, 1, 2].map((c) => (c === k ? sign : 0));
        const name = "xyz"[k] + (sign > 0 ? "-" : "+");
        const motion = header.motions[name];
        const displacement = header.displacements[name] || 0;
        const rotation = header.rotations[name];
        planes.push({ point, normal, velocity: [0, 0, 0], motion, displacement, rotation });
      }
    }
    for (const wall of [...planes, ...header.walls]) {
      const found = cut(wall.point, wall.normal, this.space);
      if (found.length < 3) continue;
      const faint = wall.passes ? PASSED : 1;
      let part;
      if (flat) {
        // Seen from above a wall is a line: drawn as a strip on its outer side, a partition on both.
        const length = Math.hypot(...wall.normal);
        const out = wall.normal.map((value) => (-value / length) * thick);
        const ends = found.filter((at) => at[2] > 0).map(([x, y]) => [x, y, 0]);
        if (ends.length < 2) continue;
        const strips = wall.hole ? gapped(...ends, wall.hole) : [ends];
        const inner = wall.partition ? -0.5 : 0;
        const corners = strips.flatMap(([a, b]) =>
          [[a, inner], [b, inner], [b, inner + 1], [a, inner + 1]].map(([at, by]) => at.map((v, k) => v + by * out[k])),
        );
        const triangles = strips.flatMap((_, k) => [0, 1, 2, 0, 2, 3].map((corner) => 4 * k + corner));
        part = surface(corners, WALL[theme], faint, triangles);
      } else if (wall.hole) {
        const { points, triangles } = pierced(found, wall.normal, wall.hole);
        part = surface(points, WALL[theme], 0.28 * faint, triangles);
      } else {
        part = surface(found, WALL[theme], header.walls.includes(wall) ? 0.28 * faint : 0.1);
        if (wall.rotation) this.turn(found, wall, theme);
      }
      this.parts.push(part);
      const moves = wall.motion || wall.piston || wall.displacement || wall.velocity.some((value) => value);
      if (moves) this.moving.push([part, wall]);
    }
    for (const shape of this.shapes) {
      for (const part of shapeParts(shape, theme, thick)) {
        this.parts.push(part);
        this.moving.push([part, shape]);
      }
      if (!shape.rotation || !shape.marks.length) continue;
      const { point, axis, rate } = shape.rotation;
      this.addTurning(shape.marks, point, axis, rate, theme);
    }
    if (header.joints.length) {
      const points = header.joints.reduce((sum, joint) => sum + 2 * this.pieces(joint), 0);
      this.joints = lines(new Array(points).fill([0, 0, 0]), JOINT[theme], 1);
      this.parts.push(this.joints);
    }
    for (const part of this.parts) this.scene.add(part);
  }

  // Marks of a plane that rotates, whose corners are those of a polygon.
  turn(corners, wall, theme) {
    const { axis, point, rate } = wall.rotation;
    const three = (given) => [...given, 0, 0, 0].slice(0, 3);
    const about = axis ? three(axis) : wall.normal;
    // By default about any point; that of a wall of the box is its middle.
    const middle = [0, 1, 2].map((k) => corners.reduce((sum, at) => sum + at[k], 0) / corners.length);
    const center = three(point || (header.walls.includes(wall) ? wall.point : middle));
    this.addTurning(spokes(corners, wall.normal, center).flat(), center, about, rate, theme);
  }

  // Lines, as numbers of their ends in pairs, that turn about an axis through a point.
  addTurning(array, point, axis, rate, theme) {
    const part = lines(new Float32Array(array.map((value, k) => value - point[k % 3])), WALL[theme], 0.8);
    this.parts.push(part);
    this.turning.push([part, point, new THREE.Vector3(...axis).normalize(), rate]);
  }

  pieces(joint) {
    return joint.kind === "rod" ? 1 : joint.kind === "spring" ? 4 * COILS + 2 : 16;
  }

  // Moves walls and joints; `where(index)` is the position of a particle.
  move(time, where, visible) {
    for (const part of this.parts) part.visible = visible || part === this.joints;
    for (const [part, wall] of this.moving) {
      part.position.set(...moved(wall, time));
      // A container shrinks with its box, about the corner of that.
      if (wall.shrinks) part.scale.setScalar((1 - wall.shrinks * time) / (1 - wall.shrinks * wall.since));
    }
    for (const [part, point, axis, rate] of this.turning) {
      part.position.set(...point);
      part.quaternion.setFromAxisAngle(axis, (rate * time) % (2 * Math.PI));
    }
    if (!this.joints) return;
    const positions = this.joints.geometry.getAttribute("position");
    let row = 0;
    for (const joint of header.joints) {
      const [a, b] = joint.ends.map((end) => (Array.isArray(end) ? end : where(end)));
      const path = this.path(joint, a, b);
      for (let k = 0; k + 1 < path.length; k++) {
        positions.setXYZ(row++, ...path[k]);
        positions.setXYZ(row++, ...path[k + 1]);
      }
    }
    positions.needsUpdate = true;
  }

  path(joint, a, b) {
    const count = this.pieces(joint);
    const along = b.map((value, k) => value - a[k]);
    const distance = Math.hypot(...along) || 1e-30;
    const at = (x, aside = [0, 0, 0]) => a.map((value, k) => value + along[k] * x + aside[k]);
    if (joint.kind === "spring") {
      // A zigzag in the plane of view: perpendicular to the spring, and to the axis of least extent.
      const size = this.space.high.map((value, k) => value - this.space.low[k]);
      const thin = header.dimension === 2 ? 2 : size.indexOf(Math.min(...size));
      const depth = new THREE.Vector3(...[0, 1, 2].map((k) => (k === thin ? 1 : 0)));
      const aside = new THREE.Vector3(...along).cross(depth).normalize().toArray();
      const wide = 0.02 * Math.max(...size);
      return Array.from({ length: count + 1 }, (_, k) => {
        const swing = k === 0 || k === count ? 0 : [0, 1, 0, -1][k % 4] * wide;
        return at(k / count, aside.map((value) => value * swing));
      });
    }
    // A slack string sags by about the excess of its length over the distance.
    const spare = joint.kind === "string" && joint.length ? Math.max(0, joint.length ** 2 - distance ** 2) : 0;
    const down = Math.hypot(...header.gravity) || 1;
    const sag = spare > 1e-6 * distance ** 2 ? Math.sqrt((3 / 16) * spare) : 0;
    return Array.from({ length: count + 1 }, (_, k) => {
      const x = k / count;
      return at(x, header.gravity.map((value) => (value / down) * sag * 4 * x * (1 - x)));
    });
  }
}
