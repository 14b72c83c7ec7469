// All particles on the graphics card, and what of them changes with time, colors and highlights.

// Numbers of particles from which on they are drawn as points.
const POINTS = 20000;

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
    this.palette = new THREE.DataTexture(colors, 256, 2);
    this.palette.needsUpdate = true;

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
        lowest: 0,
        highest: 1,
        tall: 1,
        flight: FLIGHTS[header.flight],
        coloring: 0,
        round: 0,
        palette: this.palette,
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
    for (const across of SIDES) {
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

  // The values of a frame that a coloring shows; densities come later than the frame.
  values(k, coloring) {
    const sent = this.attributes(k);
    const { density } = this.frames.found[k];
    if (coloring === "density" && density && !sent.density) sent.density = this.each(density, 1);
    return sent[coloring] ?? sent.soFar;
  }

  // The opacity of a species, from 0 to 1; at 0 its particles are not drawn.
  setOpacity(species, opacity) {
    this.palette.image.data[4 * (256 + species) + 3] = Math.round(255 * opacity);
    this.palette.needsUpdate = true;
  }

  // Shows x of the way from frame k to the next; [lowest, highest] are the values at both ends of the colors.
  show(k, x, coloring, [lowest, highest]) {
    const next = Math.min(k + 1, this.frames.count - 1);
    const [from, to] = [this.attributes(k), this.attributes(next)];
    if (this.edge && this.shown !== k) this.findEdge(k, next);
    this.shown = k;
    for (const [name, attribute] of [
      ["p0", from.position],
      ["p1", to.position],
      ["v0", from.velocity],
      ["v1", to.velocity],
      ["crossed", next > k ? to.crossed : this.still],
      ["value0", this.values(k, coloring)],
      ["value1", this.values(next, coloring)],
    ]) {
      for (const geometry of this.geometries) {
        if (geometry.getAttribute(name) !== attribute) geometry.setAttribute(name, attribute);
      }
    }
    const set = (name, value) => (this.uniforms[name].value = value);
    const dt = this.frames.time[next] - this.frames.time[k];
    set("unit0", this.frames.velocityUnit(k));
    set("unit1", this.frames.velocityUnit(next));
    set("lowest", lowest);
    set("highest", highest);
    set("dt", dt);
    set("s", x * dt);
    set("slide", displacement(k, x * dt));
    set("slide1", displacement(next, 0));
    set("coloring", { speed: 0, species: 1, none: 3 }[coloring] ?? 2);
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
