"""How few particles with spin have turned, for the marks that a page draws on them."""

from __future__ import annotations

import numpy as np

from ..files.layout import Array
from .keyframes import Keyframes

FEW = 64
"""Particles up to which they are marked."""
MOST = 200_000
"""Orientations that a page holds."""


def find(keys: Keyframes, count: int) -> Array | None:
    """``[K, N, 7]``: quaternions x, y, z, w of the rotations since the first state, and the spins from there on.

    A particle turns about the axis of its spin until the next state. ``None`` without spin, and of many.
    """
    if keys.spin is None or count > FEW or len(keys.time) * count > MOST:
        return None
    spins = np.stack([keys.spin(k) for k in range(len(keys.time))]).astype(float)
    # Where a spin is not known, that before.
    for k in range(len(spins)):
        unknown = np.isnan(spins[k])
        spins[k][unknown] = spins[k - 1][unknown] if k else 0.0
    if not spins.any():
        return None
    turns = np.zeros((*spins.shape[:2], 7), np.float32)
    turns[..., 4:] = spins
    now = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    turns[0, :, :4] = now
    for k, step in enumerate(np.diff(keys.time)):
        now = _product(_rotation(spins[k] * step), now)
        turns[k + 1, :, :4] = now
    return turns


def _rotation(angle: Array) -> Array:
    """``[N, 4]`` quaternions of rotations by vectors ``[N, 3]`` [rad]."""
    size = np.linalg.norm(angle, axis=1, keepdims=True)
    axis = np.divide(angle, size, out=np.zeros_like(angle), where=size > 0)
    return np.concatenate([np.sin(size / 2) * axis, np.cos(size / 2)], axis=1)


def _product(p: Array, q: Array) -> Array:
    """``[N, 4]`` the rotations ``q``, then ``p``, of length 1."""
    (a, s), (b, t) = (p[:, :3], p[:, 3:]), (q[:, :3], q[:, 3:])
    both = np.concatenate([s * b + t * a + np.cross(a, b), s * t - np.sum(a * b, axis=1, keepdims=True)], axis=1)
    return both / np.linalg.norm(both, axis=1, keepdims=True)
