"""Geometry of walls: cylinders, cones, spheres, rectangles and planes as triangles and lines.

Corners are on the surface, chords inside of circles. What has no end is cut at a region. Faces run counterclockwise as
seen from outside of the volume that a shape encloses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..files.extent import Extent
from ..files.layout import Array

__all__ = ["Form", "Outline", "cone", "cut", "cylinder", "is_circle", "plane", "rectangle", "sphere", "unit", "vector"]

SEGMENTS = 96
"""Corners of a circle, a multiple of the next two."""
MERIDIANS, MARKS = 8, 6
"""Lines along a surface of revolution: those that show its form, and those that turn with it."""
PARALLELS = 3
"""Circles on a sphere that show its form."""
_CLOSE = 1e-9
"""Coordinates that differ by this part of the region count as equal."""


class Outline(NamedTuple):
    """A line of a wall in two dimensions; a closed one ends with its first point."""

    points: Array
    """``[n, 2]`` [length]"""
    away: Array
    """``[n, 2]`` directions away from the particles; displaced by s times them, the line has the distance s"""


class Form(NamedTuple):
    """A wall as it is drawn, at one time [length]."""

    vertices: Array
    """``[V, 3]``"""
    faces: NDArray[np.int64]
    """``[F, 3]`` corners of triangles; in two dimensions those that fill an obstacle"""
    edges: list[Array]
    """Lines ``[n, 3]``: ends and sharp edges"""
    wires: list[Array]
    """Lines ``[n, 3]`` that show the form beside its edges"""
    marks: list[Array]
    """Lines ``[n, 3]`` that turn with a wall that rotates"""
    outlines: list[Outline]
    """In two dimensions the wall itself"""
    axis: tuple[Array, Array]
    """A point of the axis about which it can rotate, and its unit vector, ``[3]`` each"""

    @property
    def bounds(self) -> tuple[Array, Array] | None:
        """Lower and upper corner, ``[3]`` each, of the box around it; ``None`` if nothing is to be drawn."""
        flat = [np.pad(line.points, ((0, 0), (0, 1))) for line in self.outlines]
        points = np.concatenate([self.vertices, *self.edges, *flat])
        return (points.min(axis=0), points.max(axis=0)) if len(points) else None


def vector(given: Sequence[float]) -> Array:
    """A vector of a scene as ``[3]``."""
    return np.array([*map(float, given), 0.0, 0.0, 0.0][:3])


def unit(given: Sequence[float]) -> Array:
    """A direction of a scene as a unit vector ``[3]``; 0 stays 0."""
    found = vector(given)
    largest = np.abs(found).max()
    if largest == 0:
        return found
    # By its largest component first, so that tiny and huge vectors do not under- or overflow.
    found = found / largest
    return found / np.linalg.norm(found)


def is_circle(given: dict[str, Any], d: int) -> bool:
    """Whether a cylinder is a circle: in two dimensions, with the axis z."""
    return d == 2 and not np.any(vector(given.get("axis", ()))[:2])


def cut(corners: Array, axis: int, height: float) -> Array:
    """``[n, 2, 3]`` ends of the lines in which a plane across an axis cuts triangles ``[F, 3, 3]``."""
    side, found = corners[..., axis] - height, []
    for k in range(3):
        # The corner k is alone on its side: the plane cuts the two edges from there.
        others = [(k + 1) % 3, (k + 2) % 3]
        alone = np.all((side[:, [k]] > 0) != (side[:, others] > 0), axis=1)
        at, a = corners[alone], side[alone][:, k, None]
        ends = [at[:, k] + (at[:, n] - at[:, k]) * a / (a - side[alone][:, n, None]) for n in others]
        found.append(np.stack(ends, axis=1))
    return np.concatenate(found)


def cylinder(wall: dict[str, Any], side: str, d: int, room: Extent, shift: Array) -> Form:
    """A cylinder; in two dimensions a circle, or two lines along its axis."""
    given = wall["cylinder"]
    point, radius = vector(given["point"]) + shift, float(given["radius"])
    if is_circle(given, d):
        return _circle(point, radius, side, wall)
    axis = unit(given.get("axis", ()))
    axis = axis if axis.any() else np.array([0.0, 0.0, 1.0])
    low, high = (0.0, float(given["length"])) if "length" in given else (-math.inf, math.inf)
    return _revolved(wall, side, d, room, (point, axis), (radius, 0.0), (low, high))


def cone(wall: dict[str, Any], side: str, d: int, room: Extent, shift: Array) -> Form:
    """A cone; in two dimensions a wedge."""
    given = wall["cone"]
    point, axis = vector(given["apex"]) + shift, unit(given["axis"])
    ends = float(given.get("start", 0.0)), float(given.get("length", math.inf))
    return _revolved(wall, side, d, room, (point, axis), (0.0, math.tan(given["angle"])), ends)


def sphere(wall: dict[str, Any], side: str, d: int, room: Extent, shift: Array) -> Form:
    """A sphere; in two dimensions a circle. Its poles are on the axis of its rotation."""
    given = wall["sphere"]
    center, radius = vector(given["center"]) + shift, float(given["radius"])
    if d == 2:
        return _circle(center, radius, side, wall)
    axis = _turning(wall, np.array([0.0, 0.0, 1.0]))
    outward = _around(axis)
    polar = np.linspace(0.0, math.pi, SEGMENTS // 2 + 1)[:, None, None]
    width = np.sin(polar)
    width[[0, -1]] = 0.0
    grid = center + radius * (width * outward - np.cos(polar) * axis)
    step = (len(grid) - 1) // (PARALLELS + 1)
    parallels = [_closed(grid[row]) for row in range(step, len(grid) - 1, step)]
    wires = parallels + [grid[:, j] for j in range(0, SEGMENTS, SEGMENTS // MERIDIANS)]
    marks = [grid[:, j] for j in range(0, SEGMENTS, SEGMENTS // MARKS)]
    return Form(*_faces(grid, np.ones(SEGMENTS, bool)), [], wires, marks, [], (center, axis))


def rectangle(wall: dict[str, Any], side: str, d: int, room: Extent, shift: Array) -> Form:
    """A plane of finite extent; in two dimensions a line."""
    given = wall["plane"]
    point, normal = vector(given["point"]) + shift, unit(given["normal"])
    extent = [*map(float, given["extent"])]
    if d == 2:
        along = np.array([-normal[1], normal[0], 0.0])
        ends = point + np.array([[-0.5], [0.5]]) * extent[0] * along
        return _flat([Outline(ends[:, :2], np.tile(normal[:2], (2, 1)))], side, (point, normal))
    along = vector(given.get("along", ()))
    along = along - normal * (along @ normal)
    if not np.linalg.norm(along) > _CLOSE:
        # The axis that is the nearest to the plane, the first of equal ones.
        along = np.eye(3)[np.argmin(np.abs(normal))]
        along = along - normal * (along @ normal)
    along = along / np.linalg.norm(along)
    half = extent[0] / 2 * along, extent[-1] / 2 * np.cross(normal, along)
    corners = np.array([point + a * half[0] + b * half[1] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    return Form(corners, _fan(4), [_closed(corners)], [], [], [], (point, normal))


def plane(wall: dict[str, Any], side: str, d: int, room: Extent, shift: Array) -> Form:
    """A plane without end, where it is in a region; with its hole."""
    given = wall["plane"]
    point, normal = vector(given["point"]) + shift, unit(given["normal"])
    hole = given.get("hole")
    center, radius = (vector(hole["center"]) + shift, float(hole["radius"])) if hole else (point, 0.0)
    if d == 2:
        along = np.array([-normal[1], normal[0], 0.0])
        all_around = room._replace(bounded=np.arange(3) < 2)
        low, high = (float(end[0]) for end in _within(point[None], along[None], -math.inf, math.inf, all_around))
        gap = (center - point) @ along
        parts = [(low, gap - radius), (gap + radius, high)] if hole else [(low, high)]
        ends = [point + np.clip([[a], [b]], low, high) * along for a, b in parts if a < high and b > low and low < high]
        lines = [Outline(line[:, :2], np.tile(-normal[:2], (2, 1))) for line in ends]
        return _flat(lines, side, (point, normal))
    corners = _section(point, normal, room)
    rims = [_closed(center + radius * _around(normal))] if hole else []
    axis = vector(wall.get("rotation", {}).get("point", ())) if "rotation" in wall else point
    axis = axis - normal * ((axis - point) @ normal)
    edges = [_closed(corners)] if len(corners) else []
    return Form(corners, _fan(len(corners)), edges, rims, [], [], (axis, normal))


def _revolved(
    wall: dict[str, Any],
    side: str,
    d: int,
    room: Extent,
    axis: tuple[Array, Array],
    profile: tuple[float, float],
    ends: tuple[float, float],
) -> Form:
    """A cylinder or a cone: of the radius a + b z at the height z, for the two numbers of ``profile``."""
    (origin, direction), (radius, slope), (low, high) = axis, profile, ends
    # In two dimensions the lines on both sides of the axis.
    outward = _around(direction) if d == 3 else np.array([1.0, -1.0])[:, None] * [-direction[1], direction[0], 0.0]
    foot, along = origin + radius * outward, direction + slope * outward
    bottom, top = np.full(len(foot), low), np.full(len(foot), high)
    if math.isinf(low) or math.isinf(high):
        height, width = _reach(origin, direction, room, d)
        low, high = (height[0] if math.isinf(low) else low), min(high, height[1])
        if slope > 0:
            # A flat cone is cut at twice the width of the region.
            high = min(high, 2 * width / slope)
        bottom, top = _within(foot, along, low, high, room)
    shown = bottom < top
    # Flat ends, and the apex of a cone.
    closed = [side != "both" and radius + slope * end > 0 and end in ends for end in (low, high)]
    pointed = radius + slope * low == 0
    bottom, top = np.where(shown, bottom, 0.0), np.where(shown, top, 0.0)
    rims = [foot + along * bottom[:, None], foot + along * top[:, None]]
    turning = (origin, _turning(wall, direction))
    if d == 2:
        return _profile(
            rims, shown, [closed[0] or pointed, closed[1]], origin + direction * (low + high) / 2, side, turning
        )
    centers = [np.broadcast_to(origin + direction * end, rims[0].shape) for end in (low, high)]
    rows = [centers[0]] * closed[0] + rims + [centers[1]] * closed[1]
    grid = np.stack(rows)
    edges = [line for rim, is_point in zip(rims, (pointed, False)) if not is_point for line in _runs(rim, shown)]
    wires = [np.stack([rims[0][j], rims[1][j]]) for j in range(0, SEGMENTS, SEGMENTS // MERIDIANS) if shown[j]]
    marks = [grid[:, j] for j in range(0, SEGMENTS, SEGMENTS // MARKS) if shown[j]]
    return Form(*_faces(grid, shown), edges, wires, marks, [], turning)


def _reach(origin: Array, direction: Array, room: Extent, d: int) -> tuple[tuple[float, float], float]:
    """Lowest and highest coordinate of a region along an axis, and its largest distance from the axis."""
    sizes = np.where(np.arange(3) < d, room.size, 0.0)
    start = np.where(np.arange(3) < d, room.origin, 0.0)
    corners = start + sizes * (np.arange(8)[:, None] >> np.arange(3) & 1) - origin
    height = corners @ direction
    width = np.linalg.norm(corners - height[:, None] * direction, axis=1).max()
    return (float(height.min()), float(height.max())), float(width)


def _within(foot: Array, along: Array, low: float, high: float, room: Extent) -> tuple[Array, Array]:
    """``[n]`` ranges of s for which foot + s along, ``[n, 3]`` each, is in the box along its bounded axes."""
    bottom, top = np.full(len(foot), low), np.full(len(foot), high)
    for k in np.flatnonzero(room.bounded):
        # A surface that touches a face is on it, but for rounding.
        slack = _CLOSE * max(room.size[k], abs(room.origin[k]))
        faces = room.origin[k] - slack, room.origin[k] + room.size[k] + slack
        speed = np.where(np.abs(along[:, k]) > _CLOSE, along[:, k], 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            times = np.sort([(face - foot[:, k]) / speed for face in faces], axis=0)
        inside = (foot[:, k] >= faces[0]) & (foot[:, k] <= faces[1])
        still = speed == 0
        bottom = np.where(still, np.where(inside, bottom, math.inf), np.maximum(bottom, times[0]))
        top = np.where(still, top, np.minimum(top, times[1]))
    return bottom, top


def _profile(
    ends: list[Array], shown: NDArray[np.bool_], closed: list[bool], middle: Array, side: str, axis: tuple[Array, Array]
) -> Form:
    """Two lines ``[2, 3]`` from their lower to their upper ends, joined at the lower and the upper ones if closed."""
    (left, right), low, high = (0, 1), *ends
    if not shown.all():
        lines = [np.stack([low[k], high[k]]) for k in (left, right) if shown[k]]
    elif all(closed):
        lines = [np.stack([high[left], low[left], low[right], high[right], high[left]])]
    elif closed[0]:
        lines = [np.stack([high[left], low[left], low[right], high[right]])]
    elif closed[1]:
        lines = [np.stack([low[left], high[left], high[right], low[right]])]
    else:
        lines = [np.stack([low[k], high[k]]) for k in (left, right)]
    corners = np.stack([high[left], low[left], low[right], high[right]]) if shown.all() else np.zeros((0, 3))
    return _flat([_outline(line[:, :2], middle[:2], side) for line in lines], side, axis, corners)


def _circle(center: Array, radius: float, side: str, wall: dict[str, Any]) -> Form:
    axis = np.array([0.0, 0.0, 1.0])
    around = _around(axis)
    points = center + radius * around
    line = _closed(points)
    away = _closed(around)[:, :2] * (-1 if side == "outside" else 1)
    # Spokes of a disk, ticks at the edge of a container.
    inner, outer = {"outside": (0.0, 1.0), "inside": (1.0, 1.06)}.get(side, (0.97, 1.03))
    spokes = around[:: SEGMENTS // MARKS]
    marks = [center + radius * np.array([[inner], [outer]]) * spoke for spoke in spokes]
    form = _flat([Outline(line[:, :2], away)], side, (center, _turning(wall, axis)), points)
    return form._replace(marks=marks)


def _flat(lines: list[Outline], side: str, axis: tuple[Array, Array], corners: Array | None = None) -> Form:
    """A wall in two dimensions; the polygon of its corners is filled if it is an obstacle."""
    filled = corners if corners is not None and side == "outside" else np.zeros((0, 3))
    return Form(filled, _fan(len(filled)), [], [], [], lines, axis)


def _outline(points: Array, middle: Array, side: str) -> Outline:
    """A line ``[n, 2]`` of a convex outline around ``middle``."""
    points = points[np.append(True, np.linalg.norm(np.diff(points, axis=0), axis=1) > 0)]
    along = np.diff(points, axis=0)
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    inward = np.sum(normal * (points[:-1] - middle), axis=1) < 0
    normal[inward] *= -1
    before, after = np.vstack([normal[:1], normal]), np.vstack([normal, normal[-1:]])
    if np.array_equal(points[0], points[-1]):
        before[0], after[-1] = normal[-1], normal[0]
    # At a corner both lines have the same distance; not at any length, where it is sharp.
    away = (before + after) / np.maximum(1 + np.sum(before * after, axis=1), 0.2)[:, None]
    return Outline(points, -away if side == "outside" else away)


def _turning(wall: dict[str, Any], direction: Array) -> Array:
    """The unit vector about which a wall turns; by default that of its shape."""
    given = unit(wall.get("rotation", {}).get("axis", ()))
    return given if given.any() else direction


def _around(axis: Array) -> Array:
    """``[SEGMENTS, 3]`` unit vectors perpendicular to an axis, by the right-hand rule about it."""
    first = np.eye(3)[np.argmin(np.abs(axis))]
    first = first - axis * (first @ axis)
    first = first / np.linalg.norm(first)
    angle = 2 * math.pi / SEGMENTS * np.arange(SEGMENTS)[:, None]
    return np.cos(angle) * first + np.sin(angle) * np.cross(axis, first)


def _closed(points: Array) -> Array:
    return np.concatenate([points, points[:1]])


def _runs(points: Array, shown: NDArray[np.bool_]) -> list[Array]:
    """The shown parts ``[n, 3]`` of a closed line ``[N, 3]``."""
    if shown.all():
        return [_closed(points)]
    start = int(np.flatnonzero(~shown)[0])
    points, shown = np.roll(points, -start, axis=0), np.roll(shown, -start)
    pieces = np.split(np.arange(len(points)), np.flatnonzero(np.diff(shown.astype(int))) + 1)
    return [points[piece] for piece in pieces if shown[piece[0]] and len(piece) > 1]


def _faces(grid: Array, shown: NDArray[np.bool_]) -> tuple[Array, NDArray[np.int64]]:
    """Vertices ``[V, 3]`` and triangles ``[F, 3]`` of a surface of revolution.

    ``grid`` ``[K, N, 3]``: each of N lines around the axis has K points, from its lower end on.
    """
    rows, columns = grid.shape[:2]
    number = np.arange(rows * columns).reshape(rows, columns)
    drawn = np.flatnonzero(shown & np.roll(shown, -1))
    here, there = number[:, drawn], number[:, (drawn + 1) % columns]
    quads = np.stack([here[:-1], there[:-1], there[1:], here[1:]], axis=-1).reshape(-1, 4)
    faces = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    vertices = grid.reshape(-1, 3)
    a, b, c = vertices[faces.T]
    # Triangles at the axis have two corners in one place.
    apart = np.any(a != b, axis=1) & np.any(b != c, axis=1) & np.any(c != a, axis=1)
    faces = faces[apart]
    used, faces_of_used = np.unique(faces, return_inverse=True)
    return vertices[used], faces_of_used.reshape(-1, 3)


def _fan(count: int) -> NDArray[np.int64]:
    """Triangles of a convex polygon of as many corners."""
    k = np.arange(1, max(count - 1, 1))
    return np.stack([np.zeros_like(k), k, k + 1], axis=1)


def _section(point: Array, normal: Array, room: Extent) -> Array:
    """``[n, 3]`` corners of the polygon in which a plane cuts a box, in order around its center."""
    bits = np.arange(8)[:, None] >> np.arange(3) & 1
    corners = room.origin + room.size * bits
    height = (corners - point) @ normal
    found = []
    for a in range(8):
        for k in range(3):
            b = a | 1 << k
            if b == a or height[a] * height[b] > 0 or height[a] == height[b]:
                continue
            found.append(corners[a] + (corners[b] - corners[a]) * height[a] / (height[a] - height[b]))
    if len(found) < 3:
        return np.zeros((0, 3))
    points = np.array(found)
    around = _around(normal)
    r = points - points.mean(axis=0)
    return points[np.argsort(np.arctan2(r @ around[SEGMENTS // 4], r @ around[0]))]
