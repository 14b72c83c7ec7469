// Which particle is under a point of the window: an exact test of a ray with the spheres that are drawn.

// A click that hits no particle takes the one whose outline is nearest, within this distance [CSS pixels].
const NEAR_MISS = 5;

// Of all visible particles and their images the first that a ray hits; null if there is none.
// ray: origin, direction (of length 1), forward (axis of the camera), near (distance from which on is drawn), and
// pixel(depth), the size of a pixel there. visible: by species.
function pick(frames, bodies, k, x, ray, visible) {
  const next = Math.min(k + 1, frames.count - 1);
  const slide = displacement(k, x * (frames.time[next] - frames.time[k]));
  const { origin, direction, forward } = ray;
  let best = null;
  let close = null;
  for (let index = 0; index < header.count; index++) {
    if (!visible[bodies.species[index]]) continue;
    const { position, radius } = body(frames, bodies, index, k, x);
    for (const center of images(position, radius, slide)) {
      const off = [center[0] - origin[0], center[1] - origin[1], center[2] - origin[2]];
      const dot = (a) => off[0] * a[0] + off[1] * a[1] + off[2] * a[2];
      const depth = dot(forward);
      if (depth < ray.near) continue;
      const along = dot(direction);
      const missed = Math.hypot(...off.map((value, c) => value - along * direction[c]));
      if (missed <= radius) {
        const distance = along - Math.sqrt(radius * radius - missed * missed);
        // Of equal ones the last, which is drawn over the others.
        if (distance > 0 && (!best || distance <= best.distance)) best = { index, distance };
      } else if (!best) {
        const pixels = (missed - radius) / ray.pixel(depth);
        if (along > 0 && pixels < NEAR_MISS && (!close || pixels < close.pixels)) close = { index, pixels };
      }
    }
  }
  return (best ?? close)?.index ?? null;
}
