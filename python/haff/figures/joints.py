"""Strings, rods and springs in pictures of particles, as pages of ``haff view`` draw them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection

from ..analysis import experiment
from ..files import joints
from ..files.layout import Array
from .style import BLACK
from .walls import fine, in_front

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..files.frames import Frame
    from .render import Camera, Picture

COILS = 9
PIECES = 24
"""Pieces of a slack string."""
WIDE = 0.02
"""Amplitude of the zigzag of a spring, in units of the size of the picture."""


def draw_flat(axes: Axes, frame: Frame) -> None:
    """Joints of two dimensions."""
    low, high = axes.get_xlim()
    drawn = [line[:, :2] for line in _lines(frame, np.array([0.0, 0.0, 1.0]), high - low)]
    axes.add_collection(LineCollection(drawn, colors=BLACK, linewidths=1.0, zorder=0.9), autolim=False)


def draw_solid(axes: Axes, frame: Frame, camera: Camera, picture: Picture) -> None:
    """Joints of three dimensions, hidden by particles of the picture as walls are."""
    left, right, _, _ = picture.extent
    drawn = [camera.project(line) for line in _lines(frame, camera.axes[2], right - left)]
    options = {"colors": BLACK, "linewidths": 1.0}
    axes.add_collection(LineCollection([line[:, :2] for line in drawn], zorder=1.5, **options), autolim=False)
    front = [part for line in drawn for part in in_front(fine(line, (right - left) / 300), picture)]
    axes.add_collection(LineCollection(front, zorder=3, **options), autolim=False)


def _lines(frame: Frame, towards: Array, size: float) -> list[Array]:
    """``[P, 3]`` points of each joint, seen from a direction in a picture of a size."""
    found = []
    for joint in joints.find(frame.file):
        a, b = (frame.position[end] if isinstance(end, int) else np.array(end) for end in joint["ends"])
        found.append(_spring(a, b, towards, size) if joint["kind"] == "spring" else _line(frame, joint, a, b))
    return found


def _spring(a: Array, b: Array, towards: Array, size: float) -> Array:
    """A zigzag across the line of sight."""
    count = 4 * COILS + 2
    aside = np.cross(b - a, towards)
    aside *= WIDE * size / max(float(np.linalg.norm(aside)), 1e-300)
    swing = np.array([0.0, 1.0, 0.0, -1.0])[np.arange(count + 1) % 4]
    swing[-1] = 0.0
    return a + (np.arange(count + 1) / count)[:, None] * (b - a) + swing[:, None] * aside


def _line(frame: Frame, joint: dict[str, Any], a: Array, b: Array) -> Array:
    """A straight line; a slack string sags by about the excess of its length."""
    square = float((b - a) @ (b - a))
    spare = max(0.0, float(joint["length"]) ** 2 - square) if joint["kind"] == "string" and joint["length"] else 0.0
    pull = experiment.gravity(frame.file)
    if spare <= 1e-6 * square or not pull.any():
        return np.stack([a, b])
    x = np.linspace(0.0, 1.0, PIECES + 1)[:, None]
    sag = np.sqrt(3 / 16 * spare) * pull / np.linalg.norm(pull)
    return a + x * (b - a) + 4 * x * (1 - x) * sag
