// The numbers of one particle, which follow it in time, and rings around it and its images.

class Inspector {
  constructor(player) {
    this.player = player;
    this.index = null;
    find("chosen").max = header.count - 1;
    find("chosen").onchange = (event) => this.choose(event.target.value === "" ? null : Number(event.target.value));
    find("close").onclick = () => this.choose(null);
    find("inspect").onclick = () => this.open();
    this.listen(find("stage"));
  }

  // A click is a press of one finger or of the first button that does not drag.
  listen(stage) {
    let down = null;
    stage.addEventListener("pointerdown", (event) => {
      down = event.isPrimary && event.button === 0 ? [event.clientX, event.clientY] : null;
    });
    stage.addEventListener("pointercancel", () => (down = null));
    stage.addEventListener("pointerup", (event) => {
      if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 5) {
        this.choose(this.player.pickAt(event.clientX, event.clientY));
      }
      down = null;
    });
  }

  // By number, for the keyboard.
  open() {
    if (this.index === null) this.choose(0);
    find("chosen").focus();
    find("chosen").select();
  }

  choose(index) {
    const valid = Number.isInteger(index) && index >= 0 && index < header.count;
    const moved = valid !== (this.index !== null);
    this.index = valid ? index : null;
    find("particle").hidden = !valid;
    if (valid) find("chosen").value = index;
    if (!valid) find("rings").replaceChildren();
    if (moved) this.player.settle();
    this.player.wake();
  }

  // Names and values, at x of the way from frame k to the next.
  facts(k, x) {
    const { frames, bodies } = this.player;
    const next = Math.min(k + 1, frames.count - 1);
    const { index } = this;
    const { position, velocity, radius, meeting } = body(frames, bodies, index, k, x);
    const d = header.dimension;
    const digits = frames.list.unit ? 4 : 6;
    const vector = (values) => values.slice(0, d).map((value) => format(value, digits)).join(", ");
    const mass = bodies.mass[index];
    const species = bodies.species[index];
    const found = [
      ["species", header.species[species] ?? String(species)],
      ["radius", format(radius, 6)],
      ["mass", Number.isFinite(mass) ? format(mass, 6) : "fixed or driven"],
      ["position", vector(position)],
      ["velocity", vector(velocity)],
    ];
    const { shear } = header;
    const peculiar = [...velocity];
    if (shear) peculiar[shear.flow] -= shear.rate * position[shear.gradient];
    found.push([shear ? "speed relative to the flow" : "speed", format(Math.hypot(...peculiar), digits)]);
    // Rows of what comes later are there at once, so that nothing moves.
    if (frames.list.chunks[0].spin) {
      const there = frames.found[k].spin && frames.found[next].spin;
      found.push(["spin", there ? vectorOrNone(this.spin(k, next, x, meeting), digits) : "…"]);
    }
    const [a, b] = [k, next].map((frame) => frames.found[frame].density?.[index]);
    const there = a !== undefined && b !== undefined;
    found.push(["local packing fraction", there ? format(a + (b - a) * x, 3) : "…"]);
    return found;
  }

  // Angular velocity: between two frames it changes with the collision; after several, that of the nearer frame.
  spin(k, next, x, meeting) {
    const { frames } = this.player;
    const dt = frames.time[next] - frames.time[k];
    const later = header.flight !== "line" && (meeting === null ? x >= 0.5 : x > 0 && x * dt >= meeting);
    const frame = later ? next : k;
    const { spin } = frames.found[frame];
    const parts = header.dimension === 2 ? 1 : 3;
    const unit = frames.list.unit ? frames.list.spin_unit[frame] : 1;
    return Array.from(spin.slice(parts * this.index, parts * (this.index + 1)), (value) => value * unit);
  }

  // What is not there yet comes later: spins are unpacked and densities computed for a chosen particle only.
  complete(k) {
    const { frames, densities, playing } = this.player;
    for (const frame of new Set([k, Math.min(k + 1, frames.count - 1)])) {
      const wake = () => this.player.wake();
      if (frames.list.chunks[0].spin && !frames.found[frame].spin) frames.loadSpin(frame).then(wake);
      // While the page plays, each new frame would be one more to wait for.
      if (!playing && !frames.found[frame].density) densities.request(frame).then(wake);
    }
  }

  draw(k, x) {
    if (this.index === null) return;
    this.complete(k);
    const rows = this.facts(k, x).map(([name, value]) => {
      const [row, term, number] = ["div", "dt", "dd"].map((tag) => document.createElement(tag));
      term.textContent = name;
      number.textContent = value;
      row.append(term, number);
      return row;
    });
    find("facts").replaceChildren(...rows);
    this.drawRings(k, x);
  }

  drawRings(k, x) {
    const { frames, bodies, view } = this.player;
    const { position, radius } = body(frames, bodies, this.index, k, x);
    const next = Math.min(k + 1, frames.count - 1);
    const slide = displacement(k, x * (frames.time[next] - frames.time[k]));
    const rings = images(position, radius, slide).flatMap((center) => {
      const { x: left, y: top, wide } = view.outline(center, radius);
      if (!(wide > 0)) return [];
      const ring = document.createElement("div");
      const size = wide + 4;
      ring.className = "ring";
      Object.assign(ring.style, { left: `${left - size}px`, top: `${top - size}px`, width: `${2 * size}px`, height: `${2 * size}px` });
      return [ring];
    });
    find("rings").replaceChildren(...rings);
  }
}

function vectorOrNone(values, digits) {
  return values.every(Number.isFinite) ? values.map((value) => format(value, digits)).join(", ") : "–";
}
