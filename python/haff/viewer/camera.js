// Where the scene is seen from: the first view, turns, zooms, and what is at a point of the window.

// Fraction of the free space that the scene fills at first.
const FILL = 0.93;

class View {
  // space: the extent of the surroundings; largest: the largest radius.
  constructor(canvas, space, largest, changed) {
    this.canvas = canvas;
    this.space = space;
    this.largest = largest;
    this.changed = changed;
    this.flat = header.dimension === 2;
    this.camera = this.flat ? new THREE.OrthographicCamera() : new THREE.PerspectiveCamera(35);
    this.orbit = new THREE.OrbitControls(this.camera, canvas);
    this.orbit.enableRotate = !this.flat;
    if (this.flat) this.orbit.mouseButtons.LEFT = 2; // drag moves
    this.orbit.addEventListener("change", changed);
  }

  // The extent, and the particles that reach through its periodic faces.
  get seen() {
    const { low, high } = this.space;
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
    if (this.flat) {
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
      this.towards = new THREE.Vector3(...view).normalize();
      this.middle = this.orbit.target.clone();
      this.away = this.fit();
      this.camera.position.copy(this.orbit.target).addScaledVector(this.towards, this.away);
      [this.camera.near, this.camera.far] = [far / 100, far * 12];
    }
    this.resize();
    this.orbit.update();
  }

  // Distance in the first view at which every corner of the extent is visible.
  fit() {
    const right = this.camera.up.clone().cross(this.towards).normalize();
    const over = this.towards.clone().cross(right);
    const slope = Math.tan((this.camera.fov * Math.PI) / 360) * FILL;
    const seen = this.seen;
    let away = 0;
    for (const bits of CORNERS) {
      const at = new THREE.Vector3(...corner(bits, seen)).sub(this.middle);
      const wide = Math.abs(at.dot(right)) / (slope * (this.width / this.height));
      const tall = Math.abs(at.dot(over)) / slope;
      away = Math.max(away, at.dot(this.towards) + Math.max(wide, tall));
    }
    return away;
  }

  // Size of the canvas [CSS pixels].
  get width() {
    return Math.max(this.canvas.clientWidth, 1);
  }

  get height() {
    return Math.max(this.canvas.clientHeight, 1);
  }

  // Fits the camera to the canvas; the scene keeps its size in it.
  resize() {
    if (this.flat) {
      const { low, high } = this.seen;
      const scale = Math.max((high[0] - low[0]) / this.width, (high[1] - low[1]) / this.height) / FILL;
      const [wide, tall] = [(this.width * scale) / 2, (this.height * scale) / 2];
      [this.camera.left, this.camera.right, this.camera.top, this.camera.bottom] = [-wide, wide, tall, -tall];
    } else {
      this.camera.aspect = this.width / this.height;
      const away = this.fit();
      this.approach(away / this.away);
      this.away = away;
    }
    this.camera.updateProjectionMatrix();
    this.changed();
  }

  // Multiplies the distance of the camera.
  approach(factor) {
    const offset = this.camera.position.clone().sub(this.orbit.target).multiplyScalar(factor);
    this.camera.position.copy(this.orbit.target).add(offset);
  }

  turn(across, upward) {
    const offset = this.camera.position.clone().sub(this.orbit.target);
    if (this.flat) {
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
    this.changed();
  }

  zoom(factor) {
    if (this.flat) {
      this.camera.zoom /= factor;
      this.camera.updateProjectionMatrix();
    } else {
      this.approach(factor);
    }
    this.orbit.update();
    this.changed();
  }

  // Coordinates of a point in the canvas [CSS pixels].
  project(position) {
    this.camera.updateMatrixWorld();
    const seen = new THREE.Vector3(...position).project(this.camera);
    return { x: ((seen.x + 1) / 2) * this.width, y: ((1 - seen.y) / 2) * this.height };
  }

  // Center and half of the width of a sphere in the canvas [CSS pixels]; a width of 0 behind the camera.
  outline(position, radius) {
    const depth = new THREE.Vector3(...position).sub(this.camera.position).dot(this.camera.getWorldDirection(new THREE.Vector3()));
    return { ...this.project(position), wide: depth > this.camera.near ? radius / this.pixel(depth) : 0 };
  }

  // Size of a pixel at a depth [length].
  pixel(depth) {
    if (this.flat) return (this.camera.right - this.camera.left) / this.camera.zoom / this.width;
    return (2 * depth * Math.tan((this.camera.fov * Math.PI) / 360)) / this.height;
  }

  // The ray through a point of the window, for `pick`.
  ray(clientX, clientY) {
    const box = this.canvas.getBoundingClientRect();
    this.camera.updateMatrixWorld();
    const at = [(2 * (clientX - box.left)) / box.width - 1, 1 - (2 * (clientY - box.top)) / box.height];
    const forward = this.camera.getWorldDirection(new THREE.Vector3());
    const origin = this.flat ? new THREE.Vector3(...at, -1).unproject(this.camera) : this.camera.position.clone();
    const direction = this.flat ? forward : new THREE.Vector3(...at, 0.5).unproject(this.camera).sub(origin).normalize();
    return {
      origin: origin.toArray(),
      direction: direction.toArray(),
      forward: forward.toArray(),
      near: this.flat ? 0 : this.camera.near,
      pixel: (depth) => this.pixel(depth),
    };
  }
}
