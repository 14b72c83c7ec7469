// All particles as instances of one quad that faces the camera; the fragment shader ray-casts the spheres exactly. Large
// numbers are drawn as points, at a fourth of the cost; points are limited in size, so small numbers are not. Particles
// that reach through a periodic face are drawn once more at the opposite one, by the same shader.

const POINTS = 20000;

const VERTEX = `
precision highp float;
precision highp int;
uniform mat4 modelViewMatrix, projectionMatrix;
uniform vec3 origin, unit, roomOrigin, roomSize, periodic, gravity, across;
uniform float unit0, unit1, dt, s, top0, top1, tall;
// In a sheared box: axes of flow and gradient, shear rate, velocity of the images across the gradient axis, and their
// displacement along the flow now and at the next frame. Zero without shear.
uniform vec3 flow, gradient;
uniform float rate, speed, slide, slide1;
uniform int flight, coloring;
uniform highp sampler2D palette;
in vec2 corner;
in vec3 p0, p1, v0, v1, crossed;
in float radius, species, held, flash, loss0, loss1;
out vec3 center, color;
out float size, light;
#ifdef POINTS
out float reach;
#else
out vec3 at;
#endif

vec3 place(vec3 a, vec3 b, vec3 u, vec3 w, vec3 g) {
  float x = dt > 0.0 ? s / dt : 0.0;
  vec3 line = mix(a, b, x);
  if (flight == 0 || dt <= 0.0) return line;
  if (flight == 2) {
    float y = 1.0 - x;
    return (1.0 + 2.0 * x) * y * y * a + x * y * y * dt * u + x * x * (3.0 - 2.0 * x) * b - x * x * y * dt * w;
  }
  vec3 gap = a - b + w * dt - 0.5 * g * dt * dt;
  vec3 closing = u - w + g * dt;
  float square = dot(closing, closing);
  float meeting = square > 0.0 ? clamp(-dot(closing, gap) / square, 0.0, dt) : 0.0;
  if (length(gap + closing * meeting) > MEET * radius) return line;
  float left = dt - s;
  return s < meeting ? a + u * s + 0.5 * g * s * s : b - w * left + 0.5 * g * left * left;
}

// Number of the edge that holds a place, along each axis.
vec3 edges(vec3 at) {
  return floor((at - roomOrigin) / roomSize);
}

// Whether a particle reaches through no face on one of these axes.
bool enclosed(vec3 at, vec3 axes) {
  vec3 off = abs(at - roomOrigin - 0.5 * roomSize);
  return any(greaterThan(vec3(lessThan(off + radius, 0.5 * roomSize)) * axes, vec3(0.0)));
}

void main() {
  // Place and velocity at the next frame of the image that is in the box at this one.
  float rows = dot(crossed, gradient);
  vec3 u = v0 * unit0, w = v1 * unit1 + rows * speed * flow;
  vec3 a = origin + p0 * unit;
  vec3 b = origin + p1 * unit + crossed * roomSize + rows * slide1 * flow;
  vec3 where = place(a, b, u, w, held > 0.5 ? vec3(0.0) : gravity);
  // Back into the box, along the gradient first: the images there are displaced along the flow.
  where -= dot(edges(where), gradient) * (gradient * roomSize + slide * flow);
  where -= (periodic - gradient) * roomSize * edges(where);
#ifdef IMAGE
  // Of the particles that reach through a face on each of these axes, the gradient first.
  vec3 others = across - across * gradient;
  bool hidden = enclosed(where, across * gradient);
  float up = dot(across * gradient, sign(where - roomOrigin - 0.5 * roomSize));
  where -= up * (gradient * roomSize + slide * flow);
  where -= flow * roomSize * edges(where);
  if (hidden || enclosed(where, others)) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  where -= others * sign(where - roomOrigin - 0.5 * roomSize) * roomSize;
#endif

  float x = dt > 0.0 ? s / dt : 0.0;
  float shade;
  // Speeds are those relative to the flow.
  float fast0 = length(u - rate * dot(a, gradient) * flow), fast1 = length(w - rate * dot(b, gradient) * flow);
  if (coloring == 0) shade = mix(fast0, fast1, x) / max(mix(top0, top1, x), 1e-30);
  else shade = mix(loss0, loss1, x) / 255.0;
  color = coloring == 1 ? texelFetch(palette, ivec2(int(species), 1), 0).rgb
                        : texelFetch(palette, ivec2(int(clamp(shade, 0.0, 1.0) * 255.0), 0), 0).rgb;
  if (held > 0.5 && coloring != 1) color = vec3(0.55);
  light = flash;
  size = radius;

  vec3 eye = (modelViewMatrix * vec4(where, 1.0)).xyz;
  center = eye;
#ifdef DISKS
  float wide = radius * 1.12;
#else
  // The outline of a sphere is wider than its radius, the more so the closer it is.
  float away = length(eye);
  float wide = radius * 1.06 * away / sqrt(max(away * away - radius * radius, 1e-4 * away * away));
#endif
#if defined(POINTS)
#ifdef DISKS
  reach = wide;
  gl_PointSize = reach * projectionMatrix[1][1] * tall;
#else
  // Off the center of the view a sphere is seen as an ellipse.
  reach = wide * away / max(-eye.z, 1e-6 * away);
  gl_PointSize = reach * projectionMatrix[1][1] * tall / max(-eye.z, 1e-6 * away);
#endif
  gl_Position = projectionMatrix * vec4(eye, 1.0);
#elif defined(DISKS)
  at = eye + vec3(corner * wide, 0.0);
  gl_Position = projectionMatrix * vec4(at, 1.0);
#else
  vec3 towards = eye / away;
  vec3 right = normalize(cross(towards, vec3(0.0, 1.0, 0.001)));
  at = eye + (right * corner.x + cross(right, towards) * corner.y) * wide;
  gl_Position = projectionMatrix * vec4(at, 1.0);
#endif
}`;

const FRAGMENT = `
precision highp float;
uniform mat4 projectionMatrix;
uniform vec3 glow;
in vec3 center, color;
in float size, light;
#ifdef POINTS
in float reach;
#else
in vec3 at;
#endif
out vec4 fragment;

void main() {
#ifdef POINTS
  vec3 at = center + reach * vec3(2.0 * gl_PointCoord.x - 1.0, 1.0 - 2.0 * gl_PointCoord.y, 0.0);
#endif
#ifdef DISKS
  float r = length(at.xy - center.xy) / size;
  float soft = length(vec2(dFdx(r), dFdy(r)));
  float inside = clamp((1.0 - r) / soft + 0.5, 0.0, 1.0);
  if (inside <= 0.0) discard;
  float rim = soft < 0.12 ? smoothstep(1.0 - 2.5 * soft, 1.0 - 1.2 * soft, r) * 0.55 : 0.0;
  vec3 shaded = mix(color, glow, 0.85 * light) * (1.0 - rim);
  fragment = vec4(shaded, inside);
#else
  vec3 ray = normalize(at);
  float along = dot(ray, center);
  vec3 off = center - ray * along;
  float inside = size * size - dot(off, off);
  float edge = length(vec2(dFdx(inside), dFdy(inside)));
  if (inside < 0.0) discard;
  vec3 hit = ray * (along - sqrt(inside));
  vec3 normal = (hit - center) / size;
  float lit = 0.34 + 0.66 * max(dot(normal, normalize(vec3(0.35, 0.55, 0.76))), 0.0);
  vec3 shaded = mix(color * lit, glow, 0.85 * light) + 0.12 * pow(max(normal.z, 0.0), 12.0);
  fragment = vec4(shaded, clamp(inside / max(edge, 1e-9), 0.0, 1.0));
  vec4 clip = projectionMatrix * vec4(hit, 1.0);
  gl_FragDepth = 0.5 + 0.5 * clip.z / clip.w;
#endif
}`;

class Particles {
  constructor(frames, bodies) {
    this.frames = frames;
    this.bodies = bodies;
    const d = header.dimension;
    this.points = header.count > POINTS;
    const geometry = this.points ? new THREE.BufferGeometry() : new THREE.InstancedBufferGeometry();
    const each = (array, width) => this.each(array, width);
    if (this.points) {
      geometry.setAttribute("position", each(bodies.radius, 1)); // tells their number
    } else {
      geometry.instanceCount = header.count;
      geometry.setIndex([0, 1, 2, 2, 1, 3]);
      geometry.setAttribute("corner", new THREE.BufferAttribute(new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), 2));
    }
    geometry.setAttribute("radius", each(bodies.radius, 1));
    geometry.setAttribute("species", each(bodies.species, 1));
    geometry.setAttribute("held", each(bodies.held, 1));
    this.flash = each(new Float32Array(header.count), 1);
    this.flash.setUsage(THREE.DynamicDrawUsage);
    geometry.setAttribute("flash", this.flash);
    this.lit = [];
    this.none = each(new Uint8Array(header.count), 1);
    this.still = each(new Int8Array(header.count * d), d);
    this.sent = new Map();

    const colors = new Uint8Array(4 * 256 * 2).fill(255);
    header.speed_map.forEach((rgb, k) => colors.set(rgb, 4 * k));
    for (let k = 0; k < 256; k++) {
      const text = header.palette[k % header.palette.length];
      colors.set([1, 3, 5].map((start) => parseInt(text.slice(start, start + 2), 16)), 4 * (256 + k));
    }
    const palette = new THREE.DataTexture(colors, 256, 2);
    palette.needsUpdate = true;

    const vector = (values) => new THREE.Vector3(...values);
    const unit = frames.list.unit;
    const flat = (values) => [...values.slice(0, d), 0].slice(0, 3);
    const size = header.room.size.map((value) => value || 1);
    const { shear } = header;
    const axis = (k) => vector([0, 1, 2].map((c) => Number(shear !== null && c === k)));
    this.uniforms = Object.fromEntries(
      Object.entries({
        origin: vector(unit ? flat(header.room.origin) : [0, 0, 0]),
        unit: vector(unit ? flat(unit) : [1, 1, 1]),
        roomOrigin: vector(header.room.origin),
        roomSize: vector(size),
        periodic: vector(header.periodic.map(Number)),
        across: vector([0, 0, 0]),
        gravity: vector(header.gravity),
        flow: axis(shear?.flow),
        gradient: axis(shear?.gradient),
        rate: shear?.rate ?? 0,
        speed: shear?.speed ?? 0,
        slide: 0,
        slide1: 0,
        unit0: 1,
        unit1: 1,
        dt: 0,
        s: 0,
        top0: 1,
        top1: 1,
        tall: 1,
        flight: FLIGHTS[header.flight],
        coloring: 0,
        palette,
        glow: new THREE.Vector3(1, 0.96, 0.75),
      }).map(([name, value]) => [name, { value }]),
    );
    const defines = { MEET };
    if (d === 2) defines.DISKS = 1;
    if (this.points) defines.POINTS = 1;
    this.meshes = [];
    this.add(geometry, this.uniforms, defines);
    this.geometries = [geometry];
    let near = geometry;
    if (this.points) {
      // For many particles, images are drawn only of those near a face, whose rows are in `edge`.
      near = new THREE.BufferGeometry();
      for (const [name, attribute] of Object.entries(geometry.attributes)) near.setAttribute(name, attribute);
      this.edge = new THREE.BufferAttribute(new Uint32Array(header.count), 1);
      this.edge.setUsage(THREE.DynamicDrawUsage);
      near.setIndex(this.edge);
      this.geometries.push(near);
    }
    // Sides, edges and corners: one image for each set of periodic axes.
    for (const across of CORNERS.slice(1)) {
      if (across.some((bit, k) => bit && !header.periodic[k])) continue;
      this.add(near, { ...this.uniforms, across: { value: vector(across) } }, { ...defines, IMAGE: 1 });
    }
  }

  // Particles once more, with other uniforms.
  add(geometry, uniforms, defines) {
    const flat = header.dimension === 2;
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      uniforms,
      defines,
      transparent: flat,
      depthTest: !flat,
      depthWrite: !flat,
      alphaToCoverage: !flat,
    });
    const mesh = this.points ? new THREE.Points(geometry, material) : new THREE.Mesh(geometry, material);
    mesh.frustumCulled = false;
    this.meshes.push(mesh);
  }

  each(array, width) {
    return this.points ? new THREE.BufferAttribute(array, width) : new THREE.InstancedBufferAttribute(array, width);
  }

  // Attributes of a frame on the graphics card: sent once.
  attributes(k) {
    if (!this.sent.has(k)) {
      const d = header.dimension;
      const frame = this.frames.found[k];
      const each = (array, width, otherwise) => (array.length ? this.each(array, width) : otherwise);
      this.sent.set(k, {
        position: each(frame.position, d),
        velocity: each(frame.velocity, d),
        crossed: each(frame.crossed, d, this.still),
        soFar: each(frame.soFar, 1, this.none),
        recent: each(frame.recent, 1, this.none),
      });
    }
    return this.sent.get(k);
  }

  // Shows x of the way from frame k to the next.
  show(k, x, coloring) {
    const next = Math.min(k + 1, this.frames.count - 1);
    const [from, to] = [this.attributes(k), this.attributes(next)];
    if (this.edge && this.shown !== k) this.findEdge(k, next);
    this.shown = k;
    const loss = coloring === "recent" ? "recent" : "soFar";
    for (const [name, attribute] of [
      ["p0", from.position],
      ["p1", to.position],
      ["v0", from.velocity],
      ["v1", to.velocity],
      ["crossed", next > k ? to.crossed : this.still],
      ["loss0", from[loss]],
      ["loss1", to[loss]],
    ]) {
      for (const geometry of this.geometries) {
        if (geometry.getAttribute(name) !== attribute) geometry.setAttribute(name, attribute);
      }
    }
    const set = (name, value) => (this.uniforms[name].value = value);
    const dt = this.frames.time[next] - this.frames.time[k];
    set("unit0", this.frames.velocityUnit(k));
    set("unit1", this.frames.velocityUnit(next));
    set("top0", this.frames.list.speed[k]);
    set("top1", this.frames.list.speed[next]);
    set("dt", dt);
    set("s", x * dt);
    set("slide", displacement(k, x * dt));
    set("slide1", displacement(next, 0));
    set("coloring", { speed: 0, species: 1, soFar: 2, recent: 3 }[coloring]);
  }

  // Finds the particles that may reach through a periodic face between two frames: those that cross it, or whose speed
  // could bring them there.
  findEdge(k, next) {
    const d = header.dimension;
    const { list, found, time } = this.frames;
    const dt = time[next] - time[k];
    const [u, w] = [this.frames.velocityUnit(k) * dt, this.frames.velocityUnit(next) * dt];
    const [a, b] = [found[k], found[next]];
    const axes = [0, 1, 2].filter((c) => header.periodic[c]);
    const unit = axes.map((c) => (list.unit ? list.unit[c] : 1));
    const low = axes.map((c) => (list.unit ? 0 : header.room.origin[c]));
    const { radius } = this.bodies;
    let count = 0;
    for (let i = 0; i < header.count; i++) {
      for (let n = 0; n < axes.length; n++) {
        const at = d * i + axes[n];
        const [x, y] = [(a.position[at] - low[n]) * unit[n], (b.position[at] - low[n]) * unit[n]];
        const reach = radius[i] + Math.max(Math.abs(a.velocity[at] * u), Math.abs(b.velocity[at] * w));
        const far = header.room.size[axes[n]] - reach;
        if (x < reach || y < reach || x > far || y > far || (next > k && b.crossed[at])) {
          this.edge.array[count++] = i;
          break;
        }
      }
    }
    this.geometries[1].setDrawRange(0, count);
    this.edge.needsUpdate = true;
  }

  // Highlights the particles of the events between two times, the last ones brightest; if there are more than `most`,
  // those of every n-th event; returns n.
  light(events, from, until, most) {
    const values = this.flash.array;
    for (const index of this.lit) values[index] = 0;
    let changed = this.lit.length > 0;
    this.lit = [];
    let every = 1;
    if (events && until > from) {
      const [first, end] = [after(events.time, from), after(events.time, until)];
      while ((2 * (end - first)) / every > most) every *= 2;
      for (let row = Math.ceil(first / every) * every; row < end; row += every) {
        const brightness = (events.time[row] - from) / (until - from);
        for (const index of [events.i[row], events.j[row]]) {
          values[index] = Math.max(values[index], brightness);
          this.lit.push(index);
        }
        changed = true;
      }
    }
    if (changed) this.flash.needsUpdate = true;
    return every;
  }
}

// First row whose value is greater.
function after(values, value) {
  let low = 0;
  let high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low;
}
