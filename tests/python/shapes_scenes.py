"""Scenes with walls of all shapes, the distances of points from their surfaces, and their arrays in pages."""

from __future__ import annotations

import math
import struct

import matplotlib as mpl
import numpy as np

from haff.figures.walls import WALL
from haff.files.scene import SHAPES

SIZE = 8.0
MOVES = {
    "still": {},
    "steady": {"velocity": [0.05, 0.02, 0.03], "offset": [0.02, -0.01, 0.03], "reference_time": 0.2},
    "sine": {"motion": {"kind": "sine", "amplitude": 0.1, "frequency": 0.4, "phase": 0.3, "direction": [1, 1, 2]}},
    "triangle": {"motion": {"kind": "triangle", "amplitude": 0.1, "frequency": 0.3, "direction": [0, 3, 0]}},
}
SPACE = {
    "tube": {"cylinder": {"point": [4, 4, 1], "axis": [0, 0, 2], "radius": 3.0}},
    "rod": {"cylinder": {"point": [4, 4, 4], "axis": [1, 1, 0], "radius": 0.7, "side": "outside"}},
    "drum": {"cylinder": {"point": [4, 0.5, 4], "axis": [0, 1, 0], "radius": 3.4, "length": 7.0}},
    "open tube": {"cylinder": {"point": [4, 4, 1], "axis": [0, 1, 1], "radius": 1.5, "length": 3.0, "side": "both"}},
    "ball": {"sphere": {"center": [4, 4, 4], "radius": 1.5, "side": "outside"}},
    "globe": {"sphere": {"center": [4, 4, 4], "radius": 4.0}},
    "shell": {"sphere": {"center": [4, 4, 4], "radius": 2.0, "side": "both"}},
    "hopper": {"cone": {"apex": [4, 4, -2], "axis": [0, 0, 1], "angle": 0.6, "start": 1.0}},
    "spike": {"cone": {"apex": [4, 4, 6], "axis": [0, 0, -1], "angle": 0.3, "length": 4.0, "side": "outside"}},
    "funnel": {
        "cone": {"apex": [4, 4, 2], "axis": [0, 1, 2], "angle": 0.5, "start": 1.0, "length": 3.0, "side": "both"}
    },
    "plate": {"plane": {"point": [4, 4, 4], "normal": [0, 1, 1], "extent": [3.0, 2.0]}},
    "turned plate": {"plane": {"point": [4, 4, 4], "normal": [1, 0, 0], "extent": [3.0, 2.0], "along": [0, 1, 1]}},
}
PLANE = {
    "circle": {"cylinder": {"point": [4, 4], "radius": 4.0}},
    "disk": {"sphere": {"center": [4, 4], "radius": 1.2, "side": "outside"}},
    "ring": {"cylinder": {"point": [4, 4], "axis": [0, 0, 1], "radius": 2.0, "side": "both"}},
    "channel": {"cylinder": {"point": [4, 4], "axis": [1, 0], "radius": 3.0}},
    "bar": {"cylinder": {"point": [2, 2], "axis": [1, 1], "radius": 0.6, "length": 4.0, "side": "outside"}},
    "wedge": {"cone": {"apex": [4, -1], "axis": [0, 1], "angle": 0.8, "start": 1.0, "side": "both"}},
    "roof": {"cone": {"apex": [4, 6], "axis": [0, -1], "angle": 0.5, "length": 3.0, "side": "outside"}},
    "line": {"plane": {"point": [4, 4], "normal": [1, 1], "extent": [3.0]}},
}
ALL = [*((name, 3) for name in SPACE), *((name, 2) for name in PLANE)]
NAMES = [f"{name} {d}D" for name, d in ALL]


def three(given):
    return np.array([*given, 0.0, 0.0, 0.0][:3], float)


def unit(given):
    return three(given) / np.linalg.norm(given)


def place(wall, time):
    """[3] displacement of a wall at a time, from the keys of the scene."""
    at = three(wall.get("offset", ())) + three(wall.get("velocity", ())) * (time - wall.get("reference_time", 0.0))
    if "motion" in wall:
        motion = wall["motion"]
        cycles = motion["frequency"] * time + motion.get("phase", 0.0) / (2 * np.pi)
        wave = np.sin(2 * np.pi * cycles) if motion["kind"] == "sine" else 1 - abs(4 * ((cycles + 0.25) % 1) - 2)
        at = at + motion["amplitude"] * wave * unit(motion["direction"])
    return at


def off(wall, points, shift=0.0):
    """[n] distances of points from the surface of a wall; a mesh is the box of `BOX`."""
    kind = next(key for key in SHAPES if key in wall)
    given = wall[kind]
    points = np.asarray(points, float) - shift
    side = given.get("side", "inside")
    if kind == "sphere":
        return np.abs(np.linalg.norm(points - three(given["center"]), axis=-1) - given["radius"])
    if kind == "plane":
        normal = unit(given["normal"])
        r = points - three(given["point"])
        if len(given["extent"]) == 1:
            along = [np.array([-normal[1], normal[0], 0.0])]
        else:
            first = np.eye(3)[np.argmin(np.abs(normal))] if "along" not in given else three(given["along"])
            first = unit(first - normal * (first @ normal))
            along = [first, np.cross(normal, first)]
        beyond = [np.maximum(np.abs(r @ a) - extent / 2, 0) for a, extent in zip(along, given["extent"])]
        return np.sqrt((r @ normal) ** 2 + sum(b**2 for b in beyond))
    if kind == "mesh":
        low, high = np.array(BOX[0]), np.array(BOX[1])
        outside = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=-1)
        inside = np.min(np.minimum(points - low, high - points), axis=-1)
        return np.where(outside > 0, outside, np.abs(inside))
    # Lines of the profile (ρ, z), as ends of segments.
    start = three(given.get("point", given.get("apex")))
    axis = unit(given.get("axis", (0, 0, 1)))
    r = points - start
    z = r @ axis
    rho = np.linalg.norm(r - z[..., None] * axis, axis=-1)
    slope, radius = (0.0, given["radius"]) if kind == "cylinder" else (math.tan(given["angle"]), 0.0)
    far = 1e3
    low = given.get("start", 0.0) if kind == "cone" else (0.0 if "length" in given else -far)
    high = given.get("length", far)
    width = lambda height: radius + slope * height  # noqa: E731
    lines = [((width(low), low), (width(high), high))]
    if side != "both":
        lines += [((0.0, end), (width(end), end)) for end in (low, high) if abs(end) < far]
    return np.min([_to_segment(np.stack([rho, z], axis=-1), *map(np.array, line)) for line in lines], axis=0)


def _to_segment(points, a, b):
    length = np.sum((b - a) ** 2)
    s = np.clip((points - a) @ (b - a) / length, 0, 1) if length > 0 else np.zeros(points.shape[:-1])
    return np.linalg.norm(points - a - s[..., None] * (b - a), axis=-1)


BOX = [2.0, 2.5, 3.0], [5.0, 4.5, 6.0]


def box_triangles():
    """[12, 3, 3] triangles of `BOX`, outward."""
    low, high = np.array(BOX[0]), np.array(BOX[1])
    found = []
    for k in range(3):
        u, v = (k + 1) % 3, (k + 2) % 3
        for upper in (0, 1):
            corner = np.zeros((4, 3))
            corner[:, k] = upper
            corner[[1, 2], u] = 1
            corner[[2, 3], v] = 1
            corner = low + (high - low) * (corner if upper else corner[::-1])
            found += [corner[[0, 1, 2]], corner[[0, 2, 3]]]
    return np.array(found)


def text_stl(triangles):
    lines = ["solid a"]
    for t in triangles:
        corners = [f"vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in t]
        lines += ["facet normal 0 0 0", "outer loop", *corners, "endloop", "endfacet"]
    return "\n".join([*lines, "endsolid a"]).encode()


def binary_stl(triangles):
    facets = b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(t), 0) for t in triangles)
    return b"solid, but binary".ljust(80) + struct.pack("<I", len(triangles)) + facets


def obj(triangles):
    lines = ["# a box", "o box"]
    for t in triangles:
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in t] + ["f -3/1/1 -2//2 -1"]
    return "\n".join(lines).encode()


def scene_of(wall, d, boundary=None, **keys):
    moves = {
        key: value[:d] if isinstance(value, list) and key in ("velocity", "offset") else value
        for key, value in wall.items()
    }
    if "motion" in moves:
        moves["motion"] = {**moves["motion"], "direction": moves["motion"]["direction"][:d]}
    return {
        "schema": 1,
        "seed": 3,
        "dimension": d,
        "domain": {"size": [SIZE] * d, "boundary": boundary or ["open"] * d},
        "species": [{"name": "grain", "count": 12, "radius": 0.2, "mass": 1.0}],
        "initial": {"positions": "random", "temperature": 0.2},
        "wall": [{"name": "it", **moves}],
        "run": {"until": 1.0},
        "output": {"frames": 0.25},
        **keys,
    }


def arrays_of(page, entry, d):
    """Vertices [V, 3], triangles [F, 3], ends of lines [L, 2, 3] of edges, wires and marks, strips [S, 2, 2] twice."""
    found = page.arrays(entry["arrays"])
    shaped = [found[0].reshape(-1, 3), found[1].reshape(-1, 3), *(a.reshape(-1, 2, 3) for a in found[2:5])]
    return [
        a.astype(float if k != 1 else int) for k, a in enumerate([*shaped, *(a.reshape(-1, 2, 2) for a in found[5:])])
    ]


def is_wall(collection):
    return len(collection.get_colors()) and mpl.colors.same_color(collection.get_colors()[0][:3], WALL)
