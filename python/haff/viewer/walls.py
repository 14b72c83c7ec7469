"""Walls in a page: planes by a point and a normal, other shapes as triangles and lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..figures.shapes import Shape
from ..files import pistons
from ..files.layout import Array
from ..files.scene import mean_point, shape_of, shaped_walls
from ..reader import File
from ..text import escaped
from .blobs import Blobs


def vector(values) -> list[float]:
    """A vector of the scene with three numbers."""
    return [*map(float, values), 0.0, 0.0, 0.0][:3]


def of_box(file: File, key: str) -> dict[str, Any]:
    """The values of a key of walls of the box, by their names."""
    entries = [wall for wall in file.scene.get("wall", []) if shape_of(wall) is None and key in wall]
    return {escaped(wall["name"]): wall[key] for wall in entries if "name" in wall}


def planes(file: File, start: float) -> list[dict[str, Any]]:
    """The planes without end; ``point`` is where they are at ``start``, the time of the first frame.

    That of a piston is in the middle of its way, which is in the region that is drawn.
    """
    ways = [pistons.path(file, wall) for wall in shaped_walls(file.scene)]
    middle = [0.0 if way is None else float(way.displacement.max() + way.displacement.min()) / 2 for way in ways]
    return [
        {
            "name": escaped(wall.get("name", "")),
            "point": (np.array(mean_point(wall, start)) + along * _unit(wall)).tolist(),
            "since": start,
            "normal": vector(wall["plane"].get("normal", ())),
            "velocity": vector(() if "mass" in wall else wall.get("velocity", ())),
            "motion": wall.get("motion"),
            "piston": None if way is None else _knots(way, along),
            "rotation": wall.get("rotation"),
            "passes": bool(wall.get("passes")),
            "partition": "hole" in wall["plane"] or bool(wall["plane"].get("two-sided")),
            "hole": _hole(wall["plane"].get("hole")),
        }
        for wall, way, along in zip(shaped_walls(file.scene), ways, middle)
        if shape_of(wall) == "plane"
    ]


def _unit(wall: dict[str, Any]) -> Array:
    """``[3]`` the normal of a plane."""
    normal = np.array(vector(wall["plane"].get("normal", ())))
    return normal / (np.linalg.norm(normal) or 1.0)


def _knots(way: pistons.Path, middle: float) -> dict[str, Any]:
    """The path of a piston along its normal: times, displacements from ``middle`` and speeds of its knots."""
    return {"time": way.time.tolist(), "at": (way.displacement - middle).tolist(), "speed": way.speed.tolist()}


def _hole(hole: dict[str, Any] | None) -> dict[str, Any] | None:
    return None if hole is None else {"center": vector(hole["center"]), "radius": float(hole["radius"])}


def shapes(
    found: Sequence[Shape], blobs: Blobs, dimension: int, start: float, shrinks: float = 0.0
) -> list[dict[str, Any]]:
    """Walls of other shapes, at their mean positions at ``start``; ``shrinks``: the rate of their box [1/time].

    The arrays of each: vertices ``[V, 3]`` and triangles ``[F, 3]``; lines, their ends in pairs ``[2 L, 3]``: edges,
    wires, and marks that turn with the wall. In two dimensions the wall is strips along lines: their ends in pairs, and
    directions away from the particles at these ends.
    """
    entries = []
    for shape in found:
        wall, form = shape.wall, shape.form
        (point, axis), motion = form.axis, wall.get("motion")
        motion = motion if motion and "direction" in motion else None
        strips = [(_pairs(line.points), _pairs(line.away)) for line in form.outlines]
        arrays = [
            form.vertices,
            form.faces,
            *(_ends(lines) for lines in (form.edges, form.wires, form.marks if shape.rate else [])),
            *(_stacked([strip[k] for strip in strips], 2) for k in range(2)),
        ]
        small = len(form.vertices) <= 1 << 16
        kinds = [np.float32, np.uint16 if small else np.uint32, *[np.float32] * 5]
        entries.append(
            {
                "name": escaped(wall.get("name", "")),
                "kind": shape_of(wall),
                "side": shape.side,
                "passes": shape.passes,
                "since": start,
                "normal": vector(motion["direction"]) if motion else [0.0, 0.0, 1.0],
                "velocity": vector(wall.get("velocity", ())),
                "motion": motion,
                "shrinks": shrinks,
                "rotation": {"point": point.tolist(), "axis": axis.tolist(), "rate": shape.rate}
                if shape.rate
                else None,
                "arrays": blobs.add(*(array.astype(kind) for array, kind in zip(arrays, kinds))),
            }
        )
    return entries


def _pairs(points: Array) -> Array:
    """The two ends of each piece of a line ``[n, d]``, ``[2 (n − 1), d]``."""
    return np.repeat(points, 2, axis=0)[1:-1]


def _stacked(parts: Sequence[Array], d: int) -> Array:
    return np.concatenate([np.zeros((0, d)), *parts])


def _ends(lines: Sequence[Array]) -> Array:
    return _stacked([_pairs(line) for line in lines], 3)
