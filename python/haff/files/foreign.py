"""States of other programs that scenes start from: GSD, extended XYZ, CSV, and those of :mod:`.programs`."""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..common.output import library
from ..errors import FileError, HaffError
from ..text import brief
from . import programs
from .layout import AXES, Array

SINGLE = 1e-6
"""Relative precision of what a file in single precision holds."""


class State(NamedTuple):
    """One frame. What a file does not have is ``None``."""

    position: Array
    """``[N, 3]`` centres [length], from the lower corner of the box on."""
    radius: Array
    """``[N]`` radii [length]."""
    size: Array | None = None
    """``[3]`` edges of the box along the axes [length]."""
    edges: Array | None = None
    """``[3, 3]`` edge vectors of a tilted box, one a row [length]."""
    velocity: Array | None = None
    """``[N, 3]`` velocities [length/time]."""
    mass: Array | None = None
    """``[N]`` masses [mass]."""
    precision: float = 0.0
    """Relative precision of the numbers, if it is less than that of doubles."""


def read(path: str | os.PathLike[str], index: int = -1) -> State:
    """The frame ``index`` of a file, from the end if negative. The ending of its name, of ``ENDINGS``, is the format.

    Raises
    ------
    FileError
        The file is missing or damaged, has no such frame, or lacks radii.
    """
    path = Path(path)
    reader = _READERS[path.suffix.lower()]
    if not path.is_file():
        raise FileError(f"{path}: there is no such file")
    try:
        state = reader(path, index)
    except HaffError:
        raise
    except (OSError, RuntimeError, ValueError, KeyError, UnicodeDecodeError) as error:  # pandas raises ValueErrors
        raise FileError(f"{path}: cannot be read: {brief(str(error) or type(error).__name__)}") from error
    for name in ("position", "radius", "velocity", "mass", "size", "edges"):
        values = getattr(state, name)
        if values is not None and not np.isfinite(values[values != np.inf] if name == "mass" else values).all():
            what = f"{name} that are" if name == "edges" else f"a {name} that is"
            raise FileError(f"{path}: frame {index} has {what} not finite")
    return state


def _chosen(path: Path, index: int, count: int) -> int:
    if not -count <= index < count:
        raise FileError(f"{path}: has {count} frame{'s' if count != 1 else ''}; there is no frame {index}")
    return index % count


def _gsd(path: Path, index: int) -> State:
    gsd = library("gsd.hoomd", "export")
    with gsd.open(str(path), "r") as trajectory:
        k = _chosen(path, index, len(trajectory))
        frame = trajectory[k]
        particles = frame.particles

        def stored(name: str) -> bool:
            # A chunk that a frame lacks is that of the first frame.
            return any(trajectory.file.chunk_exists(frame=at, name=f"particles/{name}") for at in (k, 0))

        size, tilt = np.asarray(frame.configuration.box[:3], float), np.asarray(frame.configuration.box[3:], float)
        if stored("diameter"):
            radius = 0.5 * np.asarray(particles.diameter, float)
        else:
            shapes = [shape.get("diameter") for shape in particles.type_shapes or []]
            if len(shapes) < len(particles.types) or None in shapes:
                raise FileError(f"{path}: lacks radii: it has neither particles/diameter nor spheres in type_shapes")
            radius = 0.5 * np.asarray(shapes, float)[np.asarray(particles.typeid)]
        flat = frame.configuration.dimensions == 2
        position = np.asarray(particles.position, float) + np.where([True, True, not flat], 0.5 * size, 0.0)
        size = np.where(size > 0, size, np.nan) if not flat else np.array([size[0], size[1], 1.0])
        edges = np.diag(size)
        edges[[1, 2, 2], [0, 0, 1]] = tilt * size[[1, 2, 2]]
        return State(
            position,
            radius,
            size,
            edges if np.any(tilt != 0) else None,
            np.asarray(particles.velocity, float) if stored("velocity") else None,
            np.asarray(particles.mass, float) if stored("mass") else None,
            SINGLE,
        )


def _xyz(path: Path, index: int) -> State:
    import pandas as pd

    starts, counts = _xyz_frames(path)
    k = _chosen(path, index, len(starts))
    with path.open("rb") as file:
        file.seek(starts[k])
        file.readline()
        comment = file.readline().decode("utf-8")
        table = pd.read_csv(file, sep=r"\s+", header=None, nrows=counts[k], comment=None)
    keys = dict(word.partition("=")[::2] for word in shlex.split(comment) if "=" in word)
    properties = keys.get("Properties", keys.get("properties", ""))
    words = properties.split(":")
    if len(words) < 3 or len(words) % 3:
        raise FileError(f"{path}: is not extended XYZ: frame {index} has no Properties=NAME:TYPE:COLUMNS…")
    columns, at = {}, 0
    for name, width in zip(words[::3], map(int, words[2::3])):
        columns[name.lower()] = slice(at, at + width)
        at += width
    if len(table) != counts[k] or table.shape[1] != at:
        raise FileError(f"{path}: frame {index} has {table.shape} values; its header has ({counts[k]}, {at})")

    def values(*names: str) -> Array | None:
        for name in names:
            if name in columns:
                found = table.iloc[:, columns[name]].to_numpy(float)
                return found[:, 0] if found.shape[1] == 1 else found
        return None

    position, radius = values("pos", "positions"), values("radius", "radii")
    if position is None or position.ndim != 2:
        raise FileError(f"{path}: lacks positions: its properties are {brief(', '.join(columns))}; one must be pos:R:3")
    if radius is None:
        diameter = values("diameter", "diameters")
        if diameter is None:
            raise FileError(
                f"{path}: lacks radii: its properties are {brief(', '.join(columns))}; one must be radius:R:1"
            )
        radius = 0.5 * diameter
    size = edges = None
    if "Lattice" in keys:
        lattice = np.array(keys["Lattice"].split(), float).reshape(3, 3)
        size = np.diag(lattice)
        edges = lattice if np.any(lattice != np.diag(size)) else None
        position = position - np.array(keys.get("Origin", "0 0 0").split(), float)
    return State(position, radius, size, edges, values("velo", "vel", "velocities"), values("mass", "masses"))


def _xyz_frames(path: Path) -> tuple[list[int], list[int]]:
    """Where each frame starts [bytes], and its number of particles."""
    starts, counts = [], []
    with path.open("rb") as file:
        while True:
            start = file.tell()
            first = file.readline()
            if not first.strip():
                return starts, counts
            if not re.fullmatch(rb"\s*\d+\s*", first):
                raise FileError(f"{path}: is not XYZ: {brief(first.decode('utf-8', 'replace').strip())} is no number")
            starts.append(start)
            counts.append(int(first))
            for _ in range(counts[-1] + 1):
                if not file.readline():
                    raise FileError(f"{path}: frame {len(starts) - 1} ends early")


def _csv(path: Path, index: int) -> State:
    import pandas as pd

    table = pd.read_csv(path)
    table.columns = [str(name).strip().lower() for name in table.columns]
    for name in ("frame", "step", "time"):
        if name in table:
            frames = table[name].drop_duplicates().to_numpy()
            table = table[table[name] == frames[_chosen(path, index, len(frames))]]
            break
    else:
        _chosen(path, index, 1)

    def values(*choices: tuple[str, ...]) -> Array | None:
        for names in choices:
            if set(names) <= set(table.columns):
                found = table[list(names)].to_numpy(float)
                return found[:, 0] if len(names) == 1 else found
        return None

    def vectors(*prefixes: str) -> Array | None:
        three = [tuple(f"{prefix}{axis}" for axis in AXES) for prefix in prefixes]
        found = values(*three)
        if found is None:
            found = values(*(names[:2] for names in three))
            found = None if found is None else np.column_stack([found, np.zeros(len(found))])
        return found

    position, radius = vectors("", "position_", "r"), values(("radius",))
    if position is None:
        raise FileError(f"{path}: lacks positions: its columns are {brief(', '.join(table.columns))}; it needs x, y, z")
    if radius is None:
        diameter = values(("diameter",))
        if diameter is None:
            raise FileError(
                f"{path}: lacks radii: its columns are {brief(', '.join(table.columns))}; one must be radius"
            )
        radius = 0.5 * diameter
    return State(position, radius, None, None, vectors("v", "velocity_"), values(("mass",)))


def _program(path: Path, index: int) -> State:
    try:
        found = programs.read(path, index)
    except ValueError as error:
        raise FileError(f"{path}: {brief(str(error).removeprefix(f'{path}: '))}") from error
    table = found.table
    velocity = table[programs.VELOCITIES].to_numpy(float) if programs.VELOCITIES[0] in table else None
    mass = table["mass"].to_numpy(float) if "mass" in table else None
    position, radius = table[[*AXES]].to_numpy(float), table["radius"].to_numpy(float)
    return State(position, radius, found.size, found.edges, velocity, mass)


_READERS = {".gsd": _gsd, ".xyz": _xyz, ".extxyz": _xyz, ".csv": _csv} | dict.fromkeys(programs.ENDINGS, _program)
ENDINGS = tuple(_READERS)
"""Endings of the names of files of other programs."""


def main(path: str, index: int) -> int:
    """Writes a state to the standard output, for the command: one line of JSON, then all numbers as doubles."""
    try:
        state = read(path, index)
    except HaffError as error:
        print(error, file=sys.stderr)
        return 1
    header: dict[str, Any] = {
        "count": len(state.radius),
        "size": None if state.size is None else [float(x) if np.isfinite(x) else 0.0 for x in state.size],
        "edges": None if state.edges is None else state.edges.tolist(),
        "precision": state.precision,
        "velocity": state.velocity is not None,
        "mass": state.mass is not None,
    }
    out = sys.stdout.buffer
    out.write(json.dumps(header).encode() + b"\n")
    for values in (state.position, state.radius, state.velocity, state.mass):
        if values is not None:
            out.write(np.ascontiguousarray(values, "<f8").tobytes())
    out.flush()
    return 0
