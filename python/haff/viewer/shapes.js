// Walls that are no planes: their surfaces, edges, and in two dimensions lines. Containers are open towards the viewer.

// Opacities: of containers, of obstacles, of surfaces with particles on both sides; of lines along surfaces.
const FILLED = { inside: 0.28, outside: 0.5, both: 0.2 };
const LINED = { edges: 0.8, wires: 0.3 };
// Factor of the opacity of walls through which some particles pass.
const PASSED = 0.4;
// Sides of triangles that are drawn, in numbers of three.js: the front, the back or both.
const FACES = { inside: 1, outside: 0, both: 2 };

const SHELL_VERTEX = `
precision highp float;
uniform mat4 modelViewMatrix, projectionMatrix;
in vec3 position;
out vec3 at;
void main() {
  at = (modelViewMatrix * vec4(position, 1.0)).xyz;
  gl_Position = projectionMatrix * vec4(at, 1.0);
}`;

// A surface is more opaque where it is seen from the side, which shows its form.
const SHELL_FRAGMENT = `
precision highp float;
uniform vec3 color;
uniform float opacity;
in vec3 at;
out vec4 fragment;
void main() {
  float facing = abs(dot(normalize(cross(dFdx(at), dFdy(at))), normalize(at)));
  float aside = (1.0 - facing) * (1.0 - facing);
  fragment = vec4(color * (0.75 + 0.25 * facing), min(opacity * (1.0 + aside), 1.0));
}`;

// The arrays of all shapes; once, since their texts are freed.
async function unpackShapes() {
  return Promise.all(
    header.shapes.map(async (shape) => {
      const [vertices, triangles, edges, wires, marks, strips, away] = await unpack(shape.arrays);
      return { ...shape, vertices, triangles, edges, wires, marks, strips, away };
    }),
  );
}

// The parts of a shape that move with it; `thick` is the width of lines in two dimensions.
function shapeParts(shape, theme, thick) {
  const faint = shape.passes ? PASSED : 1;
  const parts = [];
  if (shape.triangles.length) parts.push(shell(shape, WALL[theme], faint * (FILLED[shape.side] ?? FILLED.both)));
  if (shape.strips.length) parts.push(strip(shape, WALL[theme], faint, thick));
  for (const [name, opacity] of Object.entries(LINED)) {
    if (shape[name].length) parts.push(lines(shape[name], WALL[theme], faint * opacity));
  }
  return parts;
}

// The triangles of a shape: in space those that its side shows, in a plane all.
function shell({ vertices, triangles, side }, color, opacity) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(vertices, 3));
  geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
  const material = new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: SHELL_VERTEX,
    fragmentShader: SHELL_FRAGMENT,
    uniforms: {
      color: { value: new THREE.Vector3(color >> 16, (color >> 8) & 255, color & 255).divideScalar(255) },
      opacity: { value: opacity },
    },
    transparent: true,
    depthWrite: false,
    side: header.dimension === 2 ? FACES.both : (FACES[side] ?? FACES.both),
  });
  const found = new THREE.Mesh(geometry, material);
  found.frustumCulled = false;
  return found;
}

// A wall in a plane: strips along its lines, on the side without particles.
function strip({ strips, away, side }, color, opacity, thick) {
  const inner = side === "inside" || side === "outside" ? 0 : -0.5;
  const corners = [];
  const triangles = [];
  for (let k = 0; k < strips.length; k += 4) {
    // From (x, y) to (p, q), and the directions at both ends.
    const [[x, y, p, q], [ax, ay, bx, by]] = [strips.slice(k, k + 4), away.slice(k, k + 4)];
    const first = corners.length;
    for (const share of [inner * thick, (inner + 1) * thick]) {
      corners.push([x + share * ax, y + share * ay, 0], [p + share * bx, q + share * by, 0]);
    }
    triangles.push(...[0, 1, 2, 1, 3, 2].map((corner) => first + corner));
  }
  return surface(corners, color, opacity, triangles);
}
