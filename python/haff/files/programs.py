"""States of LAMMPS, MercuryDPM and DynamO: dumps, data files and configurations, told by their first lines."""

from __future__ import annotations

import bz2
import io
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..text import brief
from .layout import AXES as _AXES

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["ENDINGS", "VELOCITIES", "ForeignState", "read"]

ENDINGS = (".lammpstrj", ".dump", ".data", ".lmp", ".xml", ".bz2")
"""Endings of the names of these files."""
AXES = [*_AXES]
VELOCITIES = ["vx", "vy", "vz"]
TILTED = "the box is tilted, xy xz yz = {}: haff has boxes with right angles, and sheared ones (domain.shear)"


class ForeignState(NamedTuple):
    """One frame of another program."""

    table: pd.DataFrame
    """A row per particle: x, y, z from the lower corner of the box [length], radius, species from 1 on; vx, vy, vz
    and mass if the file has them."""
    size: np.ndarray
    """``[3]`` edges of the box [length]."""
    periodic: np.ndarray
    """``[3]`` whether the box repeats along each axis."""
    shear: str = ""
    """The value of `domain.shear`, if the box is sheared."""
    notes: tuple[str, ...] = ()
    """What the file does not say, and what is taken instead."""
    edges: np.ndarray | None = None
    """``[3, 3]`` edge vectors of a sheared box, one a row [length]."""


def read(path: Path, index: int = -1) -> ForeignState:
    """The frame ``index`` of a file, from the end if negative. Its first lines say which program it is of.

    Raises ``ValueError`` for a file of none of the programs, or without what a scene needs.
    """
    try:
        return _reader(path)(path, index)
    except (IndexError, StopIteration, ET.ParseError) as error:
        raise ValueError(f"{path}: is damaged: {brief(str(error) or type(error).__name__)}") from error


def _chosen(index: int, count: int) -> int:
    if not -count <= index < count:
        raise ValueError(f"has {count} frame{'s' if count != 1 else ''}; there is no frame {index}")
    return index % count


def _reader(path: Path) -> Callable[[Path, int], ForeignState]:
    """The function that reads a file, by its first lines.

    Raises ``ValueError`` for a file of none of the programs.
    """
    if path.suffix in (".xml", ".bz2"):
        return _dynamo
    with path.open(errors="replace") as file:
        head = [file.readline() for _ in range(40)]
    if head[0].startswith("ITEM: "):
        return _lammps
    if any(re.search(r"\b(atoms|xhi)\s*(#|$)", line) for line in head):
        return _lammps_atoms
    if len(head[0].split()) in (6, 8) and all(_is_number(word) for word in head[0].split()):
        return _mercury
    raise ValueError(
        f"is neither a dump nor a data file of LAMMPS, nor of MercuryDPM or DynamO: it begins with {_first(head[0])}"
    )


def _lammps(path: Path, index: int) -> ForeignState:
    """A frame of ``dump custom``: positions in any of LAMMPS's forms, and radii or diameters.

    ``type`` and ``id`` are optional, and so are velocities (``vx vy vz``) and ``mass``.

    Raises ``ValueError`` for a file that is no dump, lacks these columns, or has a tilted box.
    """
    import pandas as pd

    text = path.read_text()
    frames = text.split("ITEM: TIMESTEP\n")[1:]
    frame = frames[_chosen(index, len(frames))].splitlines()
    # Step, item, N, item with two letters for each axis, bounds of three axes, item with the names, rows.
    if not text.startswith("ITEM: ") or len(frame) < 8 or not frame[3].startswith("ITEM: BOX BOUNDS"):
        raise ValueError(f"{path}: is no dump of LAMMPS (dump custom): it begins with {_first(text)}")
    words, names = frame[3].split()[3:], frame[7].split()[2:]
    try:
        bounds = np.array([row.split() for row in frame[4:7]], float)
    except ValueError:
        raise ValueError(f"{path}: the bounds of the box are no numbers: {' | '.join(frame[4:7])}") from None
    if bounds.shape == (3, 3) and np.any(bounds[:, 2] != 0):
        raise ValueError(f"{path}: {TILTED.format(bounds[:, 2].tolist())}")
    table = pd.read_csv(io.StringIO("\n".join(frame[8:])), sep=r"\s+", names=names)
    low, size = bounds[:, 0], bounds[:, 1] - bounds[:, 0]
    forms = [suffix for suffix in ("", "u", "s", "su") if {axis + suffix for axis in AXES} <= set(names)]
    if not forms:
        raise ValueError(f"{path}: lacks positions x, y, z (or xu, xs, xsu, …); the columns are {', '.join(names)}")
    place = table[[axis + forms[0] for axis in AXES]].to_numpy(float)
    found = pd.DataFrame(place * size if forms[0].startswith("s") else place - low, columns=AXES)
    if set(VELOCITIES) <= set(names):
        found[VELOCITIES] = table[VELOCITIES]
    if "radius" in names or "diameter" in names:
        found["radius"] = table["radius"] if "radius" in names else 0.5 * table["diameter"]
    else:
        raise ValueError(f"{path}: lacks radius or diameter; the columns are {', '.join(names)}")
    if "mass" in names:
        found["mass"] = table["mass"]
    found["species"] = table["type"] if "type" in names else 1
    order = table["id"] if "id" in names else pd.Series(range(len(table)))
    found = found.assign(id=order).sort_values(["species", "id"], kind="stable")
    return ForeignState(found, size, np.array(words[-3:]) == "pp")


def _lammps_atoms(path: Path, index: int) -> ForeignState:
    """A data file for ``read_data`` with ``atom_style sphere``, as LAMMPS writes it.

    Such a file says nothing of boundaries; those of LAMMPS are periodic unless an input says otherwise.

    Raises ``ValueError`` for another style, which has no diameters, and for a tilted box.
    """
    import pandas as pd

    _chosen(index, 1)
    lines = [line.partition("#") for line in path.read_text().splitlines()[1:]]
    words = [before.split() for before, _, _ in lines]
    starts = [k for k, row in enumerate(words) if row and row[0][0].isalpha()]

    def section(name: str) -> tuple[str, np.ndarray]:
        """The style behind the name of a section, and its rows."""
        start = next((k for k in starts if words[k][0] == name), None)
        if start is None:
            return "", np.empty((0, 0))
        end = next((k for k in starts if k > start), len(lines))
        return lines[start][2].strip(), np.array([row for row in words[start + 1 : end] if row], float)

    header = words[: starts[0]] if starts else words
    low, high = np.zeros(3), np.zeros(3)
    for row in header:
        for k, axis in enumerate(AXES):
            if row[2:] == [f"{axis}lo", f"{axis}hi"]:
                low[k], high[k] = float(row[0]), float(row[1])
        if row[3:] == ["xy", "xz", "yz"] and any(float(tilt) != 0 for tilt in row[:3]):
            raise ValueError(f"{path}: {TILTED.format(row[:3])}")
    style, atoms = section("Atoms")
    if style != "sphere" or atoms.shape[1:] not in ((7,), (10,)):
        found = f"Atoms # {style}" if style else "Atoms without a style"
        raise ValueError(f"{path}: needs Atoms # sphere, id type diameter density x y z; it has {found}")
    table = pd.DataFrame(atoms[:, 4:7] - low, columns=AXES).assign(
        radius=0.5 * atoms[:, 2], mass=atoms[:, 3] * np.pi / 6 * atoms[:, 2] ** 3, species=atoms[:, 1].astype(int)
    )
    table["id"] = atoms[:, 0].astype(int)
    _, motion = section("Velocities")
    if len(motion):
        table = table.merge(pd.DataFrame(motion[:, :4], columns=["id", *VELOCITIES]), on="id")
    notes = ("# boundary: not in the file; LAMMPS takes periodic ones by default",)
    return ForeignState(table.sort_values(["species", "id"]), high - low, np.full(3, True), notes=notes)


def _mercury(path: Path, index: int) -> ForeignState:
    """A frame of a ``.data`` file of MercuryDPM in three dimensions; the box is not taken as periodic.

    The last column is the index of the species, unless the driver overrides ``getInfo``: then all are one species if it
    is no whole number.

    Raises ``ValueError`` for a file with another number of columns.
    """
    import pandas as pd

    lines = path.read_text().splitlines()
    starts = [0]
    while (after := starts[-1] + int(lines[starts[-1]].split()[0]) + 1) < len(lines):
        starts.append(after)
    at = starts[_chosen(index, len(starts))]
    header, rows = lines[at].split(), lines[at + 1 : at + 1 + int(lines[at].split()[0])]
    if not rows or len(header) != 8 or len(rows[0].split()) < 14:
        raise ValueError(f"{path}: is no .data file in three dimensions: its frames begin with {lines[at]}")
    low, high = np.array(header[2:5], float), np.array(header[5:8], float)
    numbers = np.array([row.split() for row in rows], float)
    table = pd.DataFrame(numbers[:, :7], columns=[*AXES, *VELOCITIES, "radius"])
    whole = np.all(numbers[:, -1] == np.floor(numbers[:, -1]))
    table["species"] = numbers[:, -1].astype(int) + 1 if whole else 1
    table[AXES] -= low
    return ForeignState(table.sort_values("species", kind="stable"), high - low, np.zeros(3, bool))


def _dynamo(path: Path, index: int) -> ForeignState:
    """A configuration of DynamO with hard spheres of one diameter, periodic or sheared.

    Raises ``ValueError`` for several interactions or a diameter that differs between particles.
    """
    import pandas as pd

    _chosen(index, 1)
    root = ET.fromstring(bz2.decompress(path.read_bytes()) if path.suffix == ".bz2" else path.read_bytes())
    diameters = [node.get("Diameter", "") for node in root.iter("Interaction")]
    if len(diameters) != 1 or not _is_number(diameters[0]):
        raise ValueError(f"{path}: needs one interaction with a number as Diameter; it has {diameters}")
    size, position, velocity = (
        np.array([[float(node.get(axis, "nan")) for axis in AXES] for node in root.iter(name)])
        for name in ("SimulationSize", "P", "V")
    )
    table = pd.DataFrame(position + size / 2, columns=AXES).assign(radius=float(diameters[0]) / 2, species=1)
    edges: np.ndarray | None = None
    shear, boundary = "", next(root.iter("BC"), ET.Element("BC"))
    if boundary.get("Type") == "LE":
        rate, offset = float(boundary.get("Rate", "1")), float(boundary.get("DXD", "0"))
        shear = f'{{ flow = "x", gradient = "y", rate = {rate!r}, offset = {offset!r} }}'
        # The mean velocity of DynamO is 0 in the middle of the box, that of haff at its lower face.
        velocity[:, 0] += 0.5 * rate * size[0, 1]
        edges = np.diag(size[0])
        edges[1, 0] = offset
    table[VELOCITIES] = velocity
    return ForeignState(table, size[0], np.full(3, boundary.get("Type") != "None"), shear, edges=edges)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _first(text: str) -> str:
    """The first line, shortened."""
    return repr(text.partition("\n")[0][:60])
