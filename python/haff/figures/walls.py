"""Walls in pictures of particles: lines in two dimensions, light lines along the surfaces in three."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection

from ..files.layout import Array
from ..files.scene import shape_of
from .shapes import Scenery, Shape, turned
from .solids import SEGMENTS, cut
from .style import left_out

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .render import Camera, Picture

WALL = "#9a7b32"
PIECES = 300
"""Pieces of a line as long as the picture, each of which is hidden by particles or not."""
MOST_LINES = 20_000
"""Edges of a mesh up to which they are drawn; of others the box around it."""


def draw_flat(axes: Axes, shapes: list[Shape], time: float) -> None:
    """Walls of two dimensions at a time: lines, obstacles filled; dashed if some particles pass through them."""
    for shape in shapes:
        form, style = shape.form, _style(shape)
        if len(form.faces):
            filled = PolyCollection(form.vertices[form.faces][..., :2], facecolors=WALL, alpha=0.25, linewidths=0.0)
            axes.add_collection(filled, autolim=False)
        lines = LineCollection(
            [line.points for line in form.outlines], colors=WALL, linewidths=1.6, linestyles=style, zorder=2.5
        )
        axes.add_collection(lines, autolim=False)
        if shape.rate:
            marks = [line[:, :2] for line in turned(shape, time)]
            axes.add_collection(LineCollection(marks, colors=WALL, linewidths=1.0, zorder=2.5), autolim=False)


def draw_solid(axes: Axes, shapes: list[Shape], time: float, camera: Camera, picture: Picture) -> None:
    """Walls of three dimensions at a time, as lines that particles of the picture hide."""
    left, right, bottom, top = picture.extent
    piece = max(right - left, top - bottom) / PIECES
    for shape in shapes:
        style = _style(shape)
        wires = turned(shape, time) if shape.rate else shape.form.wires
        for lines, width, opacity in ((wires, 0.7, 0.6), (_edges(shape) + _rim(shape, camera), 0.9, 0.9)):
            seen = [camera.project(line) for line in lines]
            # Below the picture of the particles, and again above those that are behind.
            options = {"colors": WALL, "linewidths": width, "linestyles": style, "alpha": opacity}
            axes.add_collection(LineCollection([at[:, :2] for at in seen], zorder=1, **options), autolim=False)
            front = [part for at in seen for part in in_front(fine(at, piece), picture)]
            axes.add_collection(LineCollection(front, zorder=3, **options), autolim=False)


def tell_missing(axes: Axes, scenery: Scenery) -> None:
    """A note of walls that are not drawn."""
    if scenery.missing:
        what, _, why = scenery.missing[0].partition(": ")
        more = f", and {len(scenery.missing) - 1} more" if len(scenery.missing) > 1 else ""
        left_out(axes, what, why + more)


def sections(shapes: list[Shape], axis: int, height: float) -> list[Array]:
    """Lines ``[n, 3]`` in which a plane across an axis cuts walls of three dimensions."""
    return [line for shape in shapes for line in cut(shape.form.vertices[shape.form.faces], axis, height)]


def _rim(shape: Shape, camera: Camera) -> list[Array]:
    """The circle as which a sphere is seen from the camera."""
    if shape_of(shape.wall) != "sphere":
        return []
    right, up, _ = camera.axes
    angle = np.linspace(0, 2 * np.pi, SEGMENTS + 1)[:, None]
    center, radius = shape.form.axis[0], float(shape.wall["sphere"]["radius"])
    return [center + radius * (np.cos(angle) * right + np.sin(angle) * up)]


def _style(shape: Shape) -> object:
    return (0, (5, 3)) if shape.passes else "-"


def _edges(shape: Shape) -> list[Array]:
    """The edges of a wall; of a mesh with many the edges of the box around it."""
    if len(shape.form.edges) <= MOST_LINES:
        return shape.form.edges
    low, high = shape.form.vertices.min(axis=0), shape.form.vertices.max(axis=0)
    corner = lambda bits: np.where(bits >> np.arange(3) & 1, high, low)  # noqa: E731
    return [np.stack([corner(a), corner(a | 1 << k)]) for a in range(8) for k in range(3) if not a >> k & 1]


def fine(line: Array, piece: float) -> Array:
    """A line with points at most about ``piece`` apart."""
    steps = np.ceil(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1) / piece).clip(1, 10 * PIECES).astype(int)
    parts = [a + (b - a) * (np.arange(n) / n)[:, None] for a, b, n in zip(line, line[1:], steps)]
    return np.concatenate([*parts, line[-1:]])


def in_front(line: Array, picture: Picture) -> list[Array]:
    """The parts ``[n, 2]`` of a line in coordinates of the camera, ``[N, 3]``, that are in front of particles."""
    left, right, bottom, top = picture.extent
    height, width = picture.depth.shape
    middle = (line[1:] + line[:-1]) / 2
    column = ((middle[:, 0] - left) / (right - left) * width).astype(int)
    row = ((top - middle[:, 1]) / (top - bottom) * height).astype(int)
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    depth = np.where(inside, picture.depth[row.clip(0, height - 1), column.clip(0, width - 1)], -np.inf)
    shown = np.isfinite(depth) & (middle[:, 2] > depth)
    starts = np.flatnonzero(shown & ~np.append(False, shown[:-1]))
    ends = np.flatnonzero(shown & ~np.append(shown[1:], False)) + 2
    return [line[a:b, :2] for a, b in zip(starts, ends)]
