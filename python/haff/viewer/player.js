// Time, controls, camera, and the loop that draws.

const find = (id) => document.getElementById(id);
const COLORINGS = {
  speed: header.shear ? "speed relative to the flow" : "speed",
  species: "species",
  soFar: "energy lost so far",
  recent: "energy lost lately",
};
// How long a collision stays highlighted [s of wall time].
const GLOW = 0.18;
// Upper bounds of the number of particles highlighted at once, and of their fraction.
const LIT = { count: 8, share: 0.05 };
// Fraction of the free space that the scene fills at first.
const FILL = 0.93;

class Player {
  async start() {
    const [radius, species, held] = await unpack(header.bodies);
    this.bodies = { radius, species, held };
    // Not by spread arguments: there may be a hundred thousand values.
    this.largest = radius.reduce((a, b) => Math.max(a, b), 0);
    this.frames = new Frames(header.frames);
    await Promise.all([this.frames.load(0), this.frames.load(Math.min(1, this.frames.count - 1))]);
    this.events = null;
    if (header.collisions) {
      const [time, i, j] = await unpack(header.collisions);
      this.events = { time, i, j };
    }
    this.theme = "dark";
    this.playing = false;
    this.even = header.frames.even;
    this.last = this.frames.count - 1;
    // Present position: a frame and the fraction of the way to the next, as one number.
    this.at = 0;
    this.coloring = this.bodies.radius.length < 30 || header.species.length > 1 ? "species" : "speed";
    this.renderer = new THREE.WebGLRenderer({ canvas: find("stage"), antialias: true });
    this.renderer.sortObjects = false; // drawn in this order: particles, then transparent objects
    this.scene = new THREE.Scene();
    this.particles = new Particles(this.frames, this.bodies);
    this.scene.add(...this.particles.meshes);
    this.surroundings = new Surroundings(this.scene, this.theme);
    this.camera = header.dimension === 2 ? new THREE.OrthographicCamera() : new THREE.PerspectiveCamera(35);
    this.orbit = new THREE.OrbitControls(this.camera, this.renderer.domElement);
    this.orbit.enableRotate = header.dimension === 3;
    if (header.dimension === 2) this.orbit.mouseButtons.LEFT = 2; // drag moves
    this.orbit.addEventListener("change", () => this.wake());
    const starts = this.frames.time[0] <= 0 ? this.frames.time[1] : this.frames.time[0];
    this.curves = new Curves(find("curves"), !this.even && starts > 0, (time) => this.seek(time));
    this.controls();
    this.look();
    this.setTheme(this.theme);
    new ResizeObserver(() => this.resize()).observe(document.body);
    this.resize();
    this.frames.loadAll();
  }

  // --- time -------------------------------------------------------------------------------------

  get time() {
    const k = Math.min(Math.floor(this.at), this.last);
    const next = Math.min(k + 1, this.last);
    return this.frames.time[k] + (this.at - k) * (this.frames.time[next] - this.frames.time[k]);
  }

  // Position of a time among the frames.
  placeOf(time) {
    const times = this.frames.time;
    if (time <= times[0]) return 0;
    if (time >= times[this.last]) return this.last;
    const k = after(times, time) - 1;
    return k + (time - times[k]) / (times[k + 1] - times[k]);
  }

  seek(time) {
    this.goto(this.placeOf(time));
  }

  goto(at) {
    this.at = Math.min(Math.max(at, 0), this.last);
    this.wake();
  }

  // Simulated time per second at speed 1: the whole run in 8 to 30 s.
  get pace() {
    const seconds = Math.min(Math.max(this.last / 4, 8), 30);
    const span = this.even ? this.frames.time[this.last] - this.frames.time[0] : this.last;
    return (span / seconds) * 2 ** Number(find("speed").value);
  }

  advance(seconds) {
    const before = this.at;
    if (this.even) this.at = this.placeOf(this.time + this.pace * seconds);
    else this.at = Math.min(this.at + this.pace * seconds, this.last);
    // Waits for frames that are not unpacked yet.
    if (!this.there()) this.at = before;
    else if (this.at >= this.last) this.setPlaying(false);
  }

  there() {
    const k = Math.min(Math.floor(this.at), this.last);
    const next = Math.min(k + 1, this.last);
    const missing = [k, next].filter((frame) => !this.frames.found[frame]);
    for (const frame of missing) this.frames.load(frame).then(() => this.wake());
    return missing.length === 0;
  }

  setPlaying(playing) {
    if (playing && this.at >= this.last) this.at = 0;
    this.playing = playing;
    find("play").textContent = playing ? "❚❚" : "▶";
    find("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    this.then = performance.now();
    this.wake();
  }

  // --- drawing ----------------------------------------------------------------------------------

  wake() {
    if (!this.waiting) this.waiting = requestAnimationFrame((now) => this.tick(now));
  }

  tick(now) {
    this.waiting = 0;
    if (this.playing) {
      this.advance(Math.min(0.1, Math.max(0, (now - this.then) / 1000)));
      this.then = now;
    }
    this.draw();
    if (this.playing) this.wake();
  }

  draw() {
    if (!this.there()) return;
    const k = Math.min(Math.floor(this.at), this.last);
    const x = this.at - k;
    const time = this.time;
    this.particles.show(k, x, this.coloring);
    const since = time - this.frames.time[0];
    const glow = GLOW * (this.even ? this.pace : this.pace * this.interval(k));
    const most = Math.max(LIT.count, LIT.share * header.count);
    const every = this.particles.light(find("flash").checked ? this.events : null, since - glow, since, most);
    find("flash-share").textContent = every > 1 ? ` (1 in ${(every * header.collisions.every).toLocaleString("en")})` : "";
    const where = (index) => body(this.frames, this.bodies, index, k, x).position;
    this.surroundings.move(time, where, find("box").checked);
    this.renderer.render(this.scene, this.camera);
    if (find("show-curves").checked) this.curves.move(time);
    const scrub = find("scrub");
    scrub.value = this.even ? since / (this.frames.time[this.last] - this.frames.time[0] || 1) : this.at / (this.last || 1);
    const clock = `t = ${format(time, 6)}`;
    scrub.setAttribute("aria-valuetext", clock);
    const frame = header.flight === "line" ? "" : `  ·  frame ${k + 1} of ${this.frames.count}`;
    find("clock").textContent = `${clock}  ·  ${header.count.toLocaleString("en")} particle${header.count > 1 ? "s" : ""}${frame}`;
    this.legend(k, x);
  }

  interval(k) {
    const next = Math.min(k + 1, this.last);
    return next > k ? this.frames.time[next] - this.frames.time[k] : this.frames.time[k] - this.frames.time[k - 1] || 0;
  }

  legend(k, x) {
    const element = find("legend");
    if (this.coloring === "species") {
      if (this.shown === "species") return;
      element.replaceChildren();
      for (const [row, name] of header.species.slice(0, 12).entries()) {
        const entry = document.createElement("span");
        const dot = document.createElement("i");
        entry.className = "species";
        dot.style.background = header.palette[row % header.palette.length];
        entry.append(dot, name);
        element.append(entry);
      }
    } else {
      if (this.shown !== this.coloring) {
        const stops = header.speed_map.filter((_, row) => row % 15 === 0).map((rgb) => `rgb(${rgb})`);
        element.innerHTML = '<div class="caption"></div><div class="bar"></div><div class="ends"><span></span><span></span></div>';
        element.querySelector(".bar").style.background = `linear-gradient(to right, ${stops})`;
        element.querySelector(".caption").textContent = COLORINGS[this.coloring];
      }
      const speed = header.frames.speed;
      const top = speed[k] + (speed[Math.min(k + 1, this.last)] - speed[k]) * x;
      let ends = ["0", format(top, 3)];
      if (this.coloring !== "speed") {
        const [total, recent] = header.losses.largest;
        const least = recent / 10 ** header.losses.decades;
        ends = this.coloring === "soFar" ? ["0", format(total, 3)] : [format(least, 2), format(recent, 3)];
      }
      element.querySelectorAll(".ends span").forEach((end, row) => (end.textContent = ends[row]));
    }
    this.shown = this.coloring;
  }

  // --- camera -----------------------------------------------------------------------------------

  // The extent, and the particles that reach through its periodic faces.
  get seen() {
    const { low, high } = this.surroundings.space;
    const reach = 2 * this.largest;
    const more = high.map((value, k) => (header.periodic[k] ? Math.min(reach, 0.1 * (value - low[k])) : 0));
    return { low: low.map((value, k) => value - more[k]), high: high.map((value, k) => value + more[k]) };
  }

  look() {
    const { low, high } = this.seen;
    const size = high.map((value, k) => value - low[k]);
    const middle = low.map((value, k) => value + size[k] / 2);
    const far = Math.hypot(...size);
    this.orbit.target.set(...middle);
    if (header.dimension === 2) {
      this.camera.up.set(0, 1, 0);
      this.camera.position.set(middle[0], middle[1], far);
      [this.camera.near, this.camera.far, this.camera.zoom] = [0, 2 * far, 1];
    } else {
      // Gravity points down. A plane motion is seen from the front, everything else from above a corner.
      const pull = header.gravity.findIndex((value) => value !== 0);
      const up = pull < 0 ? 2 : pull;
      const sign = pull >= 0 && header.gravity[up] > 0 ? -1 : 1;
      const reach = 2.5 * this.largest;
      const thin = header.room.size.findIndex((value, k) => k !== up && value <= reach && !header.room.bounded[k]);
      const direction = [0.62, -1, 0.42];
      const view = [0, 0, 0];
      view[up] = sign * direction[2];
      const others = [0, 1, 2].filter((k) => k !== up);
      if (thin >= 0) {
        view[up] *= 0.25;
        view[thin] = -1;
      } else {
        [view[others[0]], view[others[1]]] = direction;
      }
      this.camera.up.set(...[0, 1, 2].map((k) => (k === up ? sign : 0)));
      // Distance at which every corner of the extent is visible.
      const towards = new THREE.Vector3(...view).normalize();
      const right = this.camera.up.clone().cross(towards).normalize();
      const over = towards.clone().cross(right);
      const free = this.free();
      const slope = (Math.tan((this.camera.fov * Math.PI) / 360) * FILL) / innerHeight;
      let away = 0;
      for (const bits of CORNERS) {
        const at = new THREE.Vector3(...corner(bits, { low, high })).sub(this.orbit.target);
        const wide = Math.abs(at.dot(right)) / (slope * free.width);
        const tall = Math.abs(at.dot(over)) / (slope * free.height);
        away = Math.max(away, at.dot(towards) + Math.max(wide, tall));
      }
      this.camera.position.copy(this.orbit.target).addScaledVector(towards, away);
      [this.camera.near, this.camera.far] = [far / 100, far * 12];
    }
    this.resize();
    this.orbit.update();
  }

  // Size and center of the area not covered by title, curves and controls [CSS pixels].
  free() {
    const panel = find("curves");
    const above = document.querySelector("header").offsetHeight + 14;
    const below = document.querySelector("footer").offsetHeight;
    const width = Math.max(200, innerWidth - (panel.hidden ? 0 : panel.offsetWidth));
    const height = Math.max(150, innerHeight - above - below);
    return { width, height, x: width / 2, y: above + height / 2 };
  }

  resize() {
    const [width, height] = [innerWidth, innerHeight];
    // The controls take two lines in a narrow window.
    const below = document.querySelector("footer").offsetHeight;
    document.documentElement.style.setProperty("--below", `${below}px`);
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.particles.uniforms.tall.value = this.renderer.domElement.height;
    const free = this.free();
    // The target is drawn at the center of the free area.
    if (header.dimension === 2) {
      const { low, high } = this.seen;
      const scale = Math.max((high[0] - low[0]) / free.width, (high[1] - low[1]) / free.height) / FILL;
      [this.camera.left, this.camera.right] = [-free.x * scale, (width - free.x) * scale];
      [this.camera.top, this.camera.bottom] = [free.y * scale, (free.y - height) * scale];
    } else {
      this.camera.aspect = width / height;
      this.camera.setViewOffset(width, height, width / 2 - free.x, height / 2 - free.y, width, height);
    }
    this.camera.updateProjectionMatrix();
    this.wake();
  }

  // --- controls ---------------------------------------------------------------------------------

  controls() {
    const losses = this.frames.found[0].soFar.length > 0;
    for (const [name, label] of Object.entries(COLORINGS)) {
      if (!losses && (name === "soFar" || name === "recent")) continue;
      find("coloring").add(new Option(label, name));
    }
    find("coloring").value = this.coloring;
    find("flash-label").hidden = !this.events;
    find("curves-label").hidden = !header.curves;
    find("curves").hidden = !header.curves;
    find("show-curves").checked = Boolean(header.curves);
    find("notes").textContent = header.notes.join("; ");
    find("served").textContent = header.served;
    if (this.last === 0) for (const id of ["play", "scrub", "speed"]) find(id).disabled = true;
    find("play").onclick = () => this.setPlaying(!this.playing);
    find("scrub").oninput = (event) => {
      const value = Number(event.target.value);
      const [start, end] = [this.frames.time[0], this.frames.time[this.last]];
      this.goto(this.even ? this.placeOf(start + value * (end - start)) : value * this.last);
    };
    find("speed").oninput = () => this.tellPace();
    find("coloring").onchange = (event) => {
      this.coloring = event.target.value;
      this.wake();
    };
    find("flash").onchange = find("box").onchange = () => this.wake();
    find("show-curves").onchange = (event) => {
      find("curves").hidden = !event.target.checked;
      if (event.target.checked) this.curves.draw();
      this.resize();
    };
    find("theme").onclick = () => this.setTheme(this.theme === "dark" ? "light" : "dark");
    find("reset").onclick = () => this.look();
    find("help").onclick = () => find("keys").showModal();
    document.addEventListener("keydown", (event) => this.key(event));
    this.tellPace();
  }

  tellPace() {
    find("rate").textContent = `${format(this.pace, 3)} ${this.even ? "time" : "frames"}/s`;
    this.wake();
  }

  setTheme(theme) {
    this.theme = theme;
    document.documentElement.className = theme;
    this.scene.background = new THREE.Color(theme === "dark" ? 0x11151a : 0xffffff);
    this.particles.uniforms.glow.value.set(...(theme === "dark" ? [1, 0.96, 0.75] : [1, 0.35, 0.1]));
    this.surroundings.draw(theme);
    this.curves.draw();
    this.wake();
  }

  key(event) {
    const { target } = event;
    if (event.ctrlKey || event.altKey || event.metaKey || find("keys").open) return;
    // Keys that the focused control handles itself are not intercepted.
    if (target.tagName === "SELECT" || (target.type === "range" && /^(Arrow|Home|End|Page)/.test(event.key))) return;
    if (event.key === " " && (target.tagName === "BUTTON" || target.type === "checkbox")) return;
    const check = (id) => !find(id).closest("[hidden]") && find(id).click();
    const step = event.shiftKey ? 10 : 1;
    const actions = {
      " ": () => this.setPlaying(!this.playing),
      ArrowLeft: () => this.goto(Math.ceil(this.at) - step),
      ArrowRight: () => this.goto(Math.floor(this.at) + step),
      Home: () => this.goto(0),
      End: () => this.goto(this.last),
      "-": () => this.setSpeed(-0.5),
      "+": () => this.setSpeed(0.5),
      "=": () => this.setSpeed(0.5),
      c: () => this.nextColoring(),
      a: () => this.turn(-1, 0),
      d: () => this.turn(1, 0),
      w: () => this.turn(0, 1),
      s: () => this.turn(0, -1),
      q: () => this.zoom(1 / 1.1),
      e: () => this.zoom(1.1),
      r: () => this.look(),
      b: () => check("box"),
      f: () => check("flash"),
      g: () => check("show-curves"),
      t: () => find("theme").click(),
      "?": () => find("keys").showModal(),
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  }

  setSpeed(change) {
    find("speed").value = Number(find("speed").value) + change;
    this.tellPace();
  }

  nextColoring() {
    const select = find("coloring");
    select.selectedIndex = (select.selectedIndex + 1) % select.length;
    select.onchange({ target: select });
  }

  turn(across, upward) {
    const offset = this.camera.position.clone().sub(this.orbit.target);
    if (header.dimension === 2) {
      const by = (0.05 * (this.camera.right - this.camera.left)) / this.camera.zoom;
      const move = new THREE.Vector3(across * by, upward * by, 0);
      this.orbit.target.add(move);
      this.camera.position.add(move);
    } else {
      const up = this.camera.up.clone().normalize();
      const side = offset.clone().cross(up).normalize();
      offset.applyAxisAngle(up, 0.12 * across);
      const tilted = offset.clone().applyAxisAngle(side, 0.12 * upward);
      // Not over the pole.
      if (tilted.angleTo(up) > 0.1 && tilted.angleTo(up) < Math.PI - 0.1) offset.copy(tilted);
      this.camera.position.copy(this.orbit.target).add(offset);
    }
    this.orbit.update();
    this.wake();
  }

  zoom(factor) {
    if (header.dimension === 2) {
      this.camera.zoom /= factor;
      this.camera.updateProjectionMatrix();
    } else {
      const offset = this.camera.position.clone().sub(this.orbit.target).multiplyScalar(factor);
      this.camera.position.copy(this.orbit.target).add(offset);
    }
    this.orbit.update();
    this.wake();
  }

  // Screen coordinates of a particle [CSS pixels], and its position: for scripts.
  locate(index) {
    const k = Math.min(Math.floor(this.at), this.last);
    const { position, radius } = body(this.frames, this.bodies, index, k, this.at - k);
    return { position, radius, ...this.pixel(position) };
  }

  // Screen coordinates of a point.
  pixel(position) {
    const seen = new THREE.Vector3(...position).project(this.camera);
    return { x: ((seen.x + 1) / 2) * innerWidth, y: ((1 - seen.y) / 2) * innerHeight };
  }
}

// For scripts: `await haffView.ready`, then `haffView.player`.
const haffView = { player: new Player() };
globalThis.haffView = haffView;
haffView.ready = haffView.player.start().catch((error) => {
  find("failure").hidden = false;
  find("failure").textContent = `This page could not start: ${error.message}. It needs a browser with WebGL 2 and DecompressionStream (2023 or newer).`;
  throw error;
});
