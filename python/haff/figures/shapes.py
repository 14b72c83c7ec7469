"""The walls of a scene as pages and figures draw them: where they are at a time, and the region with them in it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..files import joints, pistons
from ..files.container import scaled
from ..files.extent import Extent
from ..files.layout import Array
from ..files.mesh import MeshFault, Triangles, triangles_of
from ..files.scene import mean_displacement, shape_of, shaped_walls
from ..text import quoted
from .meshes import mesh
from .solids import Form, cone, cylinder, is_circle, plane, rectangle, sphere, unit

if TYPE_CHECKING:
    from ..files.recording import Recording

__all__ = ["Scenery", "Shape", "build", "displacement", "find", "turned"]

LARGEST = 1e30
"""Coordinates of what is drawn: pages have single precision [length]."""
WHOLE = 20.0
"""Size of walls that are shown whole, in units of the longest side of the region of the particles."""
FARTHEST = 3.0
"""How far larger walls enlarge this region on each side, in the same units."""


class Shape(NamedTuple):
    """A wall as it is drawn."""

    wall: dict[str, Any]
    """Its entry of ``[[wall]]``"""
    side: str
    """Where the particles are: ``inside``, ``outside`` or ``both``"""
    form: Form

    @property
    def passes(self) -> bool:
        """Whether some particles pass through it."""
        return bool(self.wall.get("passes"))

    @property
    def rate(self) -> float:
        """Angular velocity about its axis [1/time]."""
        return float(self.wall.get("rotation", {}).get("rate", 0.0))


class Scenery(NamedTuple):
    """The walls of a scene that have a shape of their own."""

    shapes: list[Shape]
    room: Extent
    """The region with these walls and the fixed ends of joints in it."""
    missing: list[str]
    """Notes: which walls are not drawn, and why."""


def find(file: Recording, room: Extent, start: float, end: float | None = None, *, planes: bool = False) -> Scenery:
    """The walls at the time ``start``, and the region with them, and with the fixed ends of joints.

    Parameters
    ----------
    room
        The region of the particles; it grows along open axes, so that walls of finite size are in it.
    end
        The walls move until then: they are at their mean positions at ``start``, and the region is that of their
        motion. By default they are where they are at ``start``.
    planes
        Whether planes without end are among them, cut at the region.
    """
    d, grown = file.dimension, room
    reach = float(room.size[:d].max(initial=0.0))
    found: dict[int, Shape] = {}
    missing = []
    walls = list(enumerate(wall for wall in shaped_walls(file.scene) if shape_of(wall) != "surface"))
    # Those without end are cut at the region with the others in it, planes at that with all of them.
    for k, wall in sorted(walls, key=lambda one: _order(one[1], d)):
        order = _order(wall, d)
        if order == 2 and not planes:
            continue
        wall = _present(file, wall, start)
        shift = displacement(file, wall, start) if end is None else np.array(mean_displacement(wall, start))
        try:
            shape = build(wall, d, grown, shift, triangles_of(file))
        except MeshFault as fault:
            missing.append(f"the wall {quoted(wall.get('name', ''))} is not drawn: {fault}")
            continue
        bounds = shape.form.bounds
        if bounds is None:
            continue
        if max(np.abs(bounds[0]).max(), np.abs(bounds[1]).max()) > LARGEST:
            missing.append(f"the wall {quoted(wall.get('name', ''))} is not drawn: it is too large")
            continue
        found[k] = shape
        if order < 2:
            low, high = _swept(wall, bounds, start, start if end is None else end)
            if np.ptp(bounds, axis=0).max() > WHOLE * reach:
                low = np.maximum(low, room.origin - FARTHEST * reach)
                high = np.minimum(high, room.origin + room.size + FARTHEST * reach)
            grown = _with(grown, low, high, d)
    fixed = joints.anchors(joints.find(file))
    if len(fixed):
        grown = _with(grown, fixed.min(axis=0), fixed.max(axis=0), d)
    return Scenery([found[k] for k in sorted(found)], grown, missing)


def _present(file: Recording, wall: dict[str, Any], time: float) -> dict[str, Any]:
    """A wall at its size at a time."""
    rates = file.compression
    if rates is None or file.box.container is None:
        return wall
    return scaled(wall, 1.0 - float(rates[0]) * time)


def displacement(file: Recording, wall: dict[str, Any], time: float) -> Array:
    """``[3]`` how far a wall is at a time from where its shape has it [length]."""
    moved = np.array(mean_displacement(wall, time))
    if (path := pistons.path(file, wall, exact=False)) is not None:
        return path.at(time) * unit(wall["plane"]["normal"])
    if (motion := wall.get("motion")) is None:
        return moved
    sine = math.sin(2 * math.pi * motion["frequency"] * time + motion.get("phase", 0.0))
    form = sine if motion["kind"] == "sine" else 2 / math.pi * math.asin(sine)
    return moved + motion["amplitude"] * form * _direction(wall)


def _direction(wall: dict[str, Any]) -> Array:
    """``[3]`` the unit vector along which a wall oscillates."""
    given = wall["plane"]["normal"] if shape_of(wall) == "plane" else wall["motion"].get("direction", ())
    return unit(given) if len(given) else np.zeros(3)


def turned(shape: Shape, time: float) -> list[Array]:
    """The marks of a wall at a time: they are at their first place at time 0."""
    point, axis = shape.form.axis
    angle = math.remainder(shape.rate * time, 2 * math.pi)
    c, s = math.cos(angle), math.sin(angle)
    lines = []
    for line in shape.form.marks:
        r = line - point
        lines.append(point + c * r + s * np.cross(axis, r) + (1 - c) * (r @ axis)[:, None] * axis)
    return lines


def _order(wall: dict[str, Any], d: int) -> int:
    """0 for walls of finite size, 1 for cylinders and cones without end, 2 for planes without end."""
    kind = shape_of(wall)
    if kind == "plane":
        return 2
    endless = kind in ("cylinder", "cone") and "length" not in wall[kind]
    return int(endless and not (kind == "cylinder" and is_circle(wall[kind], d)))


def _swept(wall: dict[str, Any], bounds: tuple[Array, Array], start: float, end: float) -> tuple[Array, Array]:
    """The box around a wall, and around all its places until a time."""
    way = np.array(mean_displacement(wall, end)) - mean_displacement(wall, start)
    swing = np.zeros(3)
    if end != start and "motion" in wall:
        swing = wall["motion"]["amplitude"] * np.abs(_direction(wall))
    return bounds[0] + np.minimum(way, 0.0) - swing, bounds[1] + np.maximum(way, 0.0) + swing


def _with(room: Extent, low: Array, high: Array, d: int) -> Extent:
    """The region enlarged along its open axes."""
    free = ~room.bounded & (np.arange(3) < d)
    origin = np.where(free, np.minimum(room.origin, low), room.origin)
    end = np.where(free, np.maximum(room.origin + room.size, high), room.origin + room.size)
    return room._replace(origin=origin, size=end - origin)


def build(wall: dict[str, Any], d: int, room: Extent, shift: Array, triangles: Triangles) -> Shape:
    """A wall with a shape, displaced by ``shift`` ``[3]`` [length]. Raises :class:`MeshFault`."""
    kind = str(shape_of(wall))
    if kind == "mesh":
        side = wall["mesh"].get("side", "both")
        return Shape(wall, side, mesh(wall["mesh"], side, shift, triangles))
    if kind == "plane":
        side = "both" if "hole" in wall["plane"] or wall["plane"].get("two-sided") else "inside"
    else:
        side = wall[kind].get("side", "inside") if kind != "rectangle" else "both"
    return Shape(wall, side, _MAKERS[kind](wall, side, d, room, shift))


_MAKERS = {"cone": cone, "cylinder": cylinder, "plane": plane, "rectangle": rectangle, "sphere": sphere}
