// All particles as instances of one quad that faces the camera; the fragment shader ray-casts the spheres exactly. Large
// numbers are drawn as points, at a fourth of the cost; points are limited in size, so small numbers are not. Particles
// that reach through a periodic face are drawn once more at the opposite one, by the same shader. Where spheres are
// partly transparent, fragments are left out at random (of each particle other ones), so that no order matters.

const VERTEX = `
precision highp float;
precision highp int;
uniform mat4 modelViewMatrix, projectionMatrix;
uniform vec3 origin, unit, roomOrigin, roomSize, periodic, gravity, across;
uniform float unit0, unit1, dt, s, tall;
// Values at both ends of the colors, in units of the attributes.
uniform float lowest, highest;
// In a sheared box: axes of flow and gradient, shear rate, velocity of the images across the gradient axis, and their
// displacement along the flow now and at the next frame. Zero without shear.
uniform vec3 flow, gradient;
uniform float rate, speed, slide, slide1;
uniform int flight, coloring;
uniform highp sampler2D palette;
in vec2 corner;
in vec3 p0, p1, v0, v1, crossed;
in float radius, species, held, flash, value0, value1;
out vec3 center, color;
out float size, light, opacity;
flat out uint number;
#ifdef POINTS
out float reach;
#else
out vec3 at;
#endif

vec3 place(vec3 a, vec3 b, vec3 u, vec3 w, vec3 g) {
  // It leaves before the next frame.
  if (any(isnan(b))) return a + u * s + 0.5 * g * s * s;
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
  // It is not there yet, or not any more.
  if (any(isnan(p0))) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
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
  // Speeds are those relative to the flow.
  float fast0 = length(u - rate * dot(a, gradient) * flow), fast1 = length(w - rate * dot(b, gradient) * flow);
  float value = coloring == 0 ? mix(fast0, fast1, x) : mix(value0, value1, x);
  float shade = (value - lowest) / max(highest - lowest, 1e-30);
  vec4 own = texelFetch(palette, ivec2(int(species), 1), 0);
  color = coloring == 1 ? own.rgb : texelFetch(palette, ivec2(int(clamp(shade, 0.0, 1.0) * 255.0), 0), 0).rgb;
  opacity = own.a;
  if (opacity == 0.0) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
#ifdef POINTS
  number = uint(gl_VertexID);
#else
  number = uint(gl_InstanceID);
#endif
  if (coloring == 3 || (held > 0.5 && coloring != 1)) color = vec3(0.55);
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
precision highp int;
uniform mat4 projectionMatrix;
uniform vec3 glow;
uniform int round;
in vec3 center, color;
in float size, light, opacity;
flat in uint number;
#ifdef POINTS
in float reach;
#else
in vec3 at;
#endif
out vec4 fragment;

// A random number from 0 to 1 of this particle at this pixel. The four of a block of pixels are one in each quarter, so
// that a block shows a particle about as often as its opacity says.
float threshold() {
  uvec2 pixel = uvec2(gl_FragCoord.xy);
  uint h = (pixel.x >> 1) * 0x9E3779B1u ^ (pixel.y >> 1) * 0x85EBCA77u ^ number * 0xC2B2AE3Du ^ uint(round) * 0x27D4EB2Fu;
  h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
  h = (h ^ (h >> 12)) * 0x297A2D39u;
  h ^= h >> 15;
  uint quarter = ((pixel.x & 1u) | ((pixel.y & 1u) << 1)) ^ (h & 3u);
  return (float(quarter) + float(h >> 8) / 16777216.0) / 4.0;
}

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
  fragment = vec4(shaded, inside * opacity);
#else
  vec3 ray = normalize(at);
  float along = dot(ray, center);
  vec3 off = center - ray * along;
  float inside = size * size - dot(off, off);
  float edge = length(vec2(dFdx(inside), dFdy(inside)));
  if (inside < 0.0) discard;
  if (opacity < 1.0 && threshold() >= opacity) discard;
  vec3 hit = ray * (along - sqrt(inside));
  vec3 normal = (hit - center) / size;
  float lit = 0.34 + 0.66 * max(dot(normal, normalize(vec3(0.35, 0.55, 0.76))), 0.0);
  vec3 shaded = mix(color * lit, glow, 0.85 * light) + 0.12 * pow(max(normal.z, 0.0), 12.0);
  fragment = vec4(shaded, clamp(inside / max(edge, 1e-9), 0.0, 1.0));
  vec4 clip = projectionMatrix * vec4(hit, 1.0);
  gl_FragDepth = 0.5 + 0.5 * clip.z / clip.w;
#endif
}`;
