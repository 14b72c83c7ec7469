"""A small ray caster for spheres: exact visibility and smooth shading of any number of opaque spheres.

Matplotlib sorts whole patches by depth, which gets touching spheres wrong and has no shading. Here every
pixel finds its nearest sphere; shading follows from the sphere's normal, with dark creases where depth jumps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

Array = NDArray[np.float64]

LIGHT = np.array([-0.45, 0.55, 0.75]) / np.linalg.norm([-0.45, 0.55, 0.75])


class Camera(NamedTuple):
    """Parallel projection: rows of ``axes`` are right, up and towards the viewer."""

    axes: Array

    @classmethod
    def looking(cls, azimuth: float = 32.0, elevation: float = 22.0) -> Camera:
        """From a direction given in degrees, z up."""
        a, b = np.radians(azimuth), np.radians(elevation)
        towards = np.array([np.cos(b) * np.sin(a), -np.cos(b) * np.cos(a), np.sin(b)])
        right = np.array([np.cos(a), np.sin(a), 0.0])
        return cls(np.stack([right, np.cross(towards, right), towards]))

    def project(self, points: Array) -> Array:
        """``[…, 3]`` coordinates right, up, towards the viewer [length]."""
        return points @ self.axes.T


class Picture(NamedTuple):
    """A rendered picture."""

    rgba: Array
    """``[height, width, 4]``, row 0 at the top."""
    extent: tuple[float, float, float, float]
    """Left, right, bottom, top in camera coordinates [length], as ``imshow`` takes it."""


def spheres(
    centres: Array, radius: Array, color: Array, camera: Camera, window: tuple[float, float, float, float], pixels: int
) -> Picture:
    """Renders spheres.

    Parameters
    ----------
    centres, radius, color
        ``[N, 3]`` [length], ``[N]`` [length], ``[N, 3]`` RGB in [0, 1].
    window
        Left, right, bottom, top in camera coordinates [length].
    pixels
        Size of the longer side; the picture is computed twice as fine and averaged.
    """
    left, right, bottom, top = window
    scale = 2 * pixels / max(right - left, top - bottom)  # fine pixels per length
    width, height = (2 * int(np.ceil((b - a) * scale / 2)) for a, b in ((left, right), (bottom, top)))
    eye = camera.project(centres)
    x, y = (eye[:, 0] - left) * scale, (eye[:, 1] - bottom) * scale
    depth, owner = _nearest(x, y, eye[:, 2] * scale, radius * scale, width, height)

    seen = owner >= 0
    who = owner[seen]
    rows, columns = np.nonzero(seen)
    normal = np.empty((len(who), 3))
    normal[:, 0] = (columns + 0.5 - x[who]) / (radius[who] * scale)
    normal[:, 1] = (rows + 0.5 - y[who]) / (radius[who] * scale)
    normal[:, 2] = np.sqrt(np.clip(1 - normal[:, 0] ** 2 - normal[:, 1] ** 2, 0, 1))

    diffuse = np.clip(normal @ LIGHT, 0, 1)
    half = LIGHT + np.array([0, 0, 1.0])
    gloss = np.clip(normal @ (half / np.linalg.norm(half)), 0, 1) ** 40
    shade = 0.42 + 0.62 * diffuse
    # Creases: a pixel well below its surroundings gets less light from the sky.
    reach = max(2.0, 0.9 * float(np.median(radius)) * scale)
    filled = np.where(seen, depth, depth[seen].min() if seen.any() else 0.0)
    below = (gaussian_filter(filled, reach / 2) - filled)[seen] / (reach * 2)
    shade *= 1 - 0.5 * np.clip(below, 0, 1)
    # Distance: the far side fades a little towards the paper.
    near, far = eye[:, 2].max(), eye[:, 2].min()
    fade = 0.28 * (near * scale - depth[seen]) / max((near - far) * scale, 1e-300) if near > far else 0.0
    lit = np.clip(color[who] * shade[:, None] + 0.22 * gloss[:, None], 0, 1)
    fade = np.broadcast_to(np.clip(fade, 0, 1), (len(who),))[:, None]
    rgba = np.zeros((height, width, 4))
    rgba[seen, :3] = lit * (1 - fade) + fade
    rgba[seen, 3] = 1
    # Average 2 × 2 with premultiplied alpha, so that edges do not darken.
    rgba[..., :3] *= rgba[..., 3:]
    small = rgba.reshape(height // 2, 2, width // 2, 2, 4).mean(axis=(1, 3))
    small[..., :3] /= np.maximum(small[..., 3:], 1e-9)
    return Picture(small[::-1], (left, left + width / scale, bottom, bottom + height / scale))


def _nearest(x: Array, y: Array, z: Array, r: Array, width: int, height: int) -> tuple[Array, NDArray[np.int64]]:
    """Depth [fine pixels] of the nearest surface and its sphere (−1: none) at every pixel."""
    depth = np.full((height, width), -np.inf)
    owner = np.full((height, width), -1, np.int64)
    for k in np.argsort(-z):  # near spheres first: hidden ones then write few pixels
        low_x, high_x = max(0, int(x[k] - r[k])), min(width, int(x[k] + r[k]) + 2)
        low_y, high_y = max(0, int(y[k] - r[k])), min(height, int(y[k] + r[k]) + 2)
        if low_x >= high_x or low_y >= high_y:
            continue
        dx = np.arange(low_x, high_x) + 0.5 - x[k]
        dy = np.arange(low_y, high_y) + 0.5 - y[k]
        square = r[k] ** 2 - dx[None, :] ** 2 - dy[:, None] ** 2
        surface = z[k] + np.sqrt(np.maximum(square, 0))
        part = depth[low_y:high_y, low_x:high_x]
        wins = (square > 0) & (surface > part)
        part[wins] = surface[wins]
        owner[low_y:high_y, low_x:high_x][wins] = k
    return depth, owner
