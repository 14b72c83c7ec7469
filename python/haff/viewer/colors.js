// What the colors mean: the coloring, its range (that of the present frame, or a fixed one), and the legend.

const COLORINGS = {
  speed: header.shear ? "speed relative to the flow" : "speed",
  species: "species",
  soFar: "energy lost so far",
  recent: "energy lost lately",
  density: "local packing fraction",
};

// Shorter names for the control; the legend has the full ones.
const SHORT = { speed: "speed", density: "packing fraction" };

// Reads both ends of a range; returns { range } or { error }. `least`: what the lower end must exceed.
function readRange(low, high, least = -Infinity) {
  const range = [low, high].map((text) => (String(text).trim() === "" ? NaN : Number(text)));
  if (!range.every(Number.isFinite)) return { error: "both ends must be numbers" };
  if (!(range[0] > least)) return { error: `the lower end must exceed ${least}` };
  if (!(range[0] < range[1])) return { error: "the lower end must be below the upper one" };
  return { range };
}

class Colors {
  constructor(frames, species, changed) {
    this.frames = frames;
    this.changed = changed;
    this.names = Object.keys(COLORINGS).filter((name) => header.losses || (name !== "soFar" && name !== "recent"));
    this.coloring = header.coloring.name ?? (header.count < 30 || header.species.length > 1 ? "species" : "speed");
    // Fixed ranges by coloring.
    this.fixed = {};
    if (header.coloring.range) this.fixed[this.coloring] = header.coloring.range;
    this.opacity = new Array(256).fill(1);
    this.present = new Set(species);
    this.controls();
  }

  choose(name) {
    this.coloring = name;
    find("coloring").value = name;
    this.complain("");
    this.drawn = this.shown = null;
    this.changed();
  }

  next() {
    this.choose(this.names[(this.names.indexOf(this.coloring) + 1) % this.names.length]);
  }

  // The range that the file and the present time give.
  automatic(k, x) {
    if (this.coloring === "soFar") return [0, header.losses.largest[0]];
    if (this.coloring === "recent") {
      const recent = header.losses.largest[1];
      return [recent / 10 ** header.losses.decades, recent];
    }
    const next = Math.min(k + 1, this.frames.count - 1);
    const top = (frame) => (this.coloring === "density" ? this.frames.found[frame].densest : header.frames.speed[frame]);
    return [0, top(k) + (top(next) - top(k)) * x];
  }

  // The present range, in units of the quantity.
  range(k, x) {
    return this.fixed[this.coloring] ?? this.automatic(k, x);
  }

  // The same in units of the attributes of the shader.
  limits(k, x) {
    if (this.coloring === "species") return [0, 1];
    const range = this.range(k, x);
    const { losses } = header;
    if (this.coloring === "soFar") return range.map((value) => (255 * value) / losses.largest[0]);
    if (this.coloring === "recent") {
      return range.map((value) => 255 * (1 + Math.log10(value / losses.largest[1]) / losses.decades));
    }
    return range;
  }

  // Fixes the range at what the legend shows, or lets it follow the frames again.
  freeze(fixed) {
    if (fixed && this.shown) this.fixed[this.coloring] = this.shown;
    else delete this.fixed[this.coloring];
    this.complain("");
    this.changed();
  }

  enter() {
    const least = this.coloring === "recent" ? 0 : undefined;
    const { range, error } = readRange(find("lowest").value, find("highest").value, least);
    this.complain(error ?? "");
    if (error) return;
    this.fixed[this.coloring] = range;
    this.changed();
  }

  complain(error) {
    find("range-error").textContent = error;
    for (const id of ["lowest", "highest"]) find(id).setAttribute("aria-invalid", String(error !== ""));
  }

  controls() {
    for (const name of this.names) find("coloring").add(new Option(SHORT[name] ?? COLORINGS[name], name));
    find("coloring").value = this.coloring;
    find("coloring").onchange = (event) => this.choose(event.target.value);
    find("lowest").onchange = find("highest").onchange = () => this.enter();
    find("fixed").onchange = (event) => this.freeze(event.target.checked);
    const which = find("opaque");
    which.add(new Option("all", ""));
    for (const row of [...this.present].sort((a, b) => a - b)) which.add(new Option(header.species[row] ?? row, row));
    which.hidden = this.present.size < 2;
    which.onchange = () => {
      find("opacity").value = this.opacity[this.chosen[0]];
    };
    find("opacity").oninput = () => this.setOpacity(Number(find("opacity").value));
  }

  // Species to which the control of the opacity applies.
  get chosen() {
    const { value } = find("opaque");
    return value === "" ? [...this.present] : [Number(value)];
  }

  setOpacity(opacity) {
    const value = Math.min(Math.max(opacity, 0), 1);
    for (const row of this.chosen) this.opacity[row] = value;
    find("opacity").value = value;
    this.drawn = null;
    this.changed();
  }

  get translucent() {
    return [...this.present].some((row) => this.opacity[row] > 0 && this.opacity[row] < 1);
  }

  // `colored`: whether the values of the coloring are there.
  draw(k, x, colored) {
    const bySpecies = this.coloring === "species";
    if (this.drawn !== this.coloring) {
      find("entries").hidden = !bySpecies;
      find("range").hidden = bySpecies;
      if (bySpecies) this.listSpecies();
      this.drawn = this.coloring;
    }
    if (bySpecies) return;
    find("caption").textContent = COLORINGS[this.coloring] + (colored ? "" : " …");
    if (!colored) return;
    this.shown = this.range(k, x);
    find("fixed").checked = this.coloring in this.fixed;
    if (find("range-error").textContent) return; // what was entered stays until it is mended
    ["lowest", "highest"].forEach((id, row) => {
      const text = format(this.shown[row], 3);
      // Numbers that are being entered are not replaced.
      if (document.activeElement !== find(id) && find(id).value !== text) find(id).value = text;
    });
  }

  listSpecies() {
    find("entries").replaceChildren();
    for (const [row, name] of header.species.slice(0, 12).entries()) {
      const entry = document.createElement("span");
      const dot = document.createElement("i");
      entry.className = "species";
      dot.style.background = header.palette[row % header.palette.length];
      dot.style.opacity = this.opacity[row];
      entry.append(dot, name);
      find("entries").append(entry);
    }
  }
}

// The gradient of a bar, from its lower end to its upper one.
function gradient() {
  return header.speed_map.filter((_, row) => row % 15 === 0).map((rgb) => `rgb(${rgb})`);
}
