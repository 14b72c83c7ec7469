// Time, controls, and the loop that draws.

// How long a collision stays highlighted [s of wall time].
const GLOW = 0.18;
// Upper bounds of the number of particles highlighted at once, and of their fraction.
const LIT = { count: 8, share: 0.05 };
// Numbers of particles up to which all are.
const ALL_LIT = 64;

class Player {
  async start() {
    const [radius, species, held, mass] = await unpack(header.bodies);
    this.bodies = { radius, species, held, mass };
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
    this.timeline = new Timeline(this.frames.time, header.frames.spacing);
    this.last = this.timeline.last;
    // Present position: a frame and the fraction of the way to the next, as one number.
    this.at = 0;
    this.colors = new Colors(this.frames, species, () => this.recolor());
    this.densities = new Densities(this.frames, this.bodies);
    this.renderer = new THREE.WebGLRenderer({ canvas: find("stage"), antialias: true });
    this.renderer.sortObjects = false; // drawn in this order: particles, then transparent objects
    this.scene = new THREE.Scene();
    this.particles = new Particles(this.frames, this.bodies);
    this.scene.add(...this.particles.meshes);
    this.surroundings = new Surroundings(this.scene, this.theme, await unpackShapes());
    this.marks = header.turns
      ? new Marks(this.scene, this.frames, this.bodies, await unpack(header.turns))
      : null;
    this.view = new View(find("stage"), this.surroundings.space, this.largest, () => this.wake());
    this.inspector = new Inspector(this);
    this.smooth = new Smooth(find("stage"), find("mean"), this.particles.uniforms.round, () => this.render());
    this.curves = new Curves(find("curves"), this.logarithmicCurves, (time) => this.seek(time));
    this.controls();
    this.view.look();
    this.setTheme(this.theme);
    const observer = new ResizeObserver(() => this.resize());
    observer.observe(find("stage"));
    observer.observe(find("curves"));
    this.settle();
    this.frames.loadAll();
  }

  get coloring() {
    return this.colors.coloring;
  }

  // --- time -------------------------------------------------------------------------------------

  get time() {
    return this.timeline.timeAt(this.at);
  }

  seek(time) {
    this.goto(this.timeline.placeOf(time));
  }

  goto(at) {
    this.at = Math.min(Math.max(at, 0), this.last);
    this.wake();
  }

  // Factor of the rate at which the page plays.
  get speed() {
    return 2 ** Number(find("speed").value);
  }

  advance(seconds) {
    const before = this.at;
    this.at = this.timeline.advance(before, seconds, this.speed);
    // Waits for frames that are not unpacked yet, and for their densities.
    if (!this.there() || !this.colored()) this.at = before;
    else if (this.at >= this.last) this.setPlaying(false);
  }

  // Whether the frames around the present position are there; those that are not are asked for.
  there() {
    const missing = this.around.filter((frame) => !this.frames.found[frame]);
    for (const frame of missing) this.frames.load(frame).then(() => this.wake());
    return missing.length === 0;
  }

  // The same for what their colors need.
  colored() {
    if (this.coloring !== "density") return true;
    const missing = this.around.filter((frame) => !this.frames.found[frame]?.density);
    for (const frame of missing) this.densities.request(frame).then(() => this.wake());
    return missing.length === 0;
  }

  get around() {
    const k = Math.min(Math.floor(this.at), this.last);
    return [k, Math.min(k + 1, this.last)];
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
    const colored = this.colored();
    this.particles.show(k, x, colored ? this.coloring : "none", colored ? this.colors.limits(k, x) : [0, 1]);
    const since = time - this.frames.time[0];
    const glow = GLOW * this.timeline.flow(this.at, this.speed);
    const most = header.count <= ALL_LIT ? Infinity : Math.max(LIT.count, LIT.share * header.count);
    const every = this.particles.light(find("flash").checked ? this.events : null, since - glow, since, most);
    if (this.events) this.tellShare(every * header.collisions.every);
    const where = (index) => body(this.frames, this.bodies, index, k, x).position;
    this.surroundings.move(time, where, find("box").checked);
    this.marks?.show(k, x, where, !this.colors.translucent);
    this.render();
    this.smooth.restart(this.grainy && !this.playing);
    if (find("show-curves").checked) this.curves.move(time);
    const scrub = find("scrub");
    scrub.value = this.timeline.share(this.at);
    const clock = `t = ${format(time, 6)}`;
    scrub.setAttribute("aria-valuetext", clock);
    const frame = header.flight === "line" ? "" : `  ·  frame ${k + 1} of ${this.frames.count}`;
    find("clock").textContent = `${clock}  ·  ${header.count.toLocaleString("en")} particle${header.count > 1 ? "s" : ""}${frame}`;
    this.colors.draw(k, x, colored);
    this.inspector.draw(k, x);
  }

  render() {
    this.renderer.render(this.scene, this.view.camera);
  }

  // Whether spheres are partly transparent; disks are blended.
  get grainy() {
    return header.dimension === 3 && this.colors.translucent;
  }

  // Takes over opacities and the coloring.
  recolor() {
    this.colors.opacity.forEach((opacity, species) => this.particles.setOpacity(species, opacity));
    if (this.renderer.getPixelRatio() !== this.pixelRatio) this.resize();
    this.wake();
  }

  // Partly transparent spheres are drawn with twice as many pixels, so that their grain is fine.
  get pixelRatio() {
    const fine = this.grainy && !this.particles.points;
    return Math.min(devicePixelRatio, 2) * (fine ? 2 : 1);
  }

  // Draws what parts beside the scene show, and fits the scene to the room that they leave.
  settle() {
    this.draw();
    this.resize();
    this.draw();
  }

  resize() {
    const { width, height } = this.view;
    this.renderer.setPixelRatio(this.pixelRatio);
    this.renderer.setSize(width, height, false);
    this.particles.uniforms.tall.value = this.renderer.domElement.height;
    this.view.resize();
    this.curves.fit();
  }

  // --- controls ---------------------------------------------------------------------------------

  controls() {
    find("bar").style.setProperty("--colors", gradient().join(","));
    find("flash-label").hidden = find("flash-share").hidden = !this.events;
    find("curves-label").hidden = !header.curves;
    find("curves").hidden = !header.curves;
    find("show-curves").checked = Boolean(header.curves);
    find("notes").textContent = header.notes.join("; ");
    find("served").textContent = header.served;
    if (this.last === 0) for (const id of ["play", "scrub", "speed"]) find(id).disabled = true;
    find("play").onclick = () => this.setPlaying(!this.playing);
    find("scrub").oninput = (event) => this.goto(this.timeline.position(Number(event.target.value)));
    find("speed").oninput = () => this.tellPace();
    for (const scale of this.timeline.scales) find("scale").add(new Option(TIME_SCALES[scale], scale));
    find("scale").value = this.timeline.scale;
    find("scale-label").hidden = this.timeline.scales.length < 2;
    find("scale").onchange = (event) => this.setScale(event.target.value);
    find("flash").onchange = find("box").onchange = () => this.wake();
    find("show-curves").onchange = (event) => {
      find("curves").hidden = !event.target.checked;
      if (event.target.checked) this.curves.draw();
      this.resize();
    };
    find("theme").onclick = () => this.setTheme(this.theme === "dark" ? "light" : "dark");
    find("reset").onclick = () => this.view.look();
    find("help").onclick = () => find("keys").showModal();
    find("more").onclick = () => this.showMore(!document.body.classList.contains("more"));
    document.addEventListener("keydown", (event) => press(this, event));
    this.tellPace();
  }

  // One in how many collisions is lit; where all are, the line is blank, so that nothing moves.
  tellShare(every) {
    const line = find("flash-share");
    line.textContent = `1 in ${every.toLocaleString("en")} collisions lit`;
    line.style.visibility = every > 1 ? "visible" : "hidden";
  }

  // In narrow windows the other controls are shown on demand.
  showMore(shown) {
    document.body.classList.toggle("more", shown);
    find("more").setAttribute("aria-expanded", String(shown));
    this.resize();
  }

  tellPace() {
    const { value, unit } = this.timeline.rate(this.speed);
    find("rate").textContent = `${format(value, 3)} ${unit}/s`;
    this.wake();
  }

  // The scale of the slider and of playback.
  setScale(scale) {
    this.timeline.scale = scale;
    find("scale").value = scale;
    this.curves.setLogarithmic(this.logarithmicCurves);
    this.tellPace();
  }

  nextScale() {
    const { scales, scale } = this.timeline;
    this.setScale(scales[(scales.indexOf(scale) + 1) % scales.length]);
  }

  get logarithmicCurves() {
    return this.timeline.scale !== "linear" && this.timeline.scales.includes("log");
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

  setSpeed(change) {
    find("speed").value = Number(find("speed").value) + change;
    this.tellPace();
  }

  // --- for scripts ------------------------------------------------------------------------------

  // The particle at a point of the window; null if there is none, or its frame is not unpacked yet.
  pickAt(clientX, clientY) {
    if (!this.there()) return null;
    const k = Math.min(Math.floor(this.at), this.last);
    const visible = this.colors.opacity.map((opacity) => opacity > 0);
    return pick(this.frames, this.bodies, k, this.at - k, this.view.ray(clientX, clientY), visible);
  }

  // Coordinates of a particle in the window [CSS pixels], and its position.
  locate(index) {
    const k = Math.min(Math.floor(this.at), this.last);
    const { position, radius } = body(this.frames, this.bodies, index, k, this.at - k);
    return { position, radius, ...this.pixel(position) };
  }

  // Coordinates of a point in the window.
  pixel(position) {
    const box = find("stage").getBoundingClientRect();
    const { x, y } = this.view.project(position);
    return { x: x + box.left, y: y + box.top };
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
