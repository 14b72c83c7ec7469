"""States of LAMMPS, MercuryDPM and DynamO for scenes of haff, and frames of haff for LAMMPS.

    python3 examples/foreign_states.py dump.lammpstrj start.csv     # last frame of `dump custom`
    python3 examples/foreign_states.py grains.data start.csv        # data file of LAMMPS, atom_style sphere
    python3 examples/foreign_states.py Chute.data start.csv         # last frame of MercuryDPM, 3D
    python3 examples/foreign_states.py config.out.xml.bz2 start.csv # DynamO, equal spheres
    python3 examples/foreign_states.py run.h5 start.data            # last frame of haff, for `read_data`

The first lines of a file say which program it is of. All but the last print what the scene needs beside
`positions = { file = "start.csv" }`. docs/howto/coming-from.md says how the programs differ.
"""

from __future__ import annotations

import bz2
import io
import re
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

import haff

AXES = ["x", "y", "z"]
VELOCITIES = ["vx", "vy", "vz"]
UNKNOWN_MASS = "# mass or density = ?"
TILTED = "the box is tilted, xy xz yz = {}: haff has boxes with right angles, and sheared ones (domain.shear)"
NO_VELOCITIES = "# initial.temperature = ?: the file has no velocities"


class State(NamedTuple):
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


def lammps(path: Path) -> State:
    """The last frame of ``dump custom``: positions in any of LAMMPS's forms, and radii or diameters.

    ``type`` and ``id`` are optional, and so are velocities (``vx vy vz``) and ``mass``.

    Raises ``ValueError`` for a file that is no dump, lacks these columns, or has a tilted box.
    """
    text = path.read_text()
    frame = text.rpartition("ITEM: TIMESTEP\n")[2].splitlines()
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
    return State(found, size, np.array(words[-3:]) == "pp")


def lammps_atoms(path: Path) -> State:
    """A data file for ``read_data`` with ``atom_style sphere``, as LAMMPS and :func:`lammps_data` write it.

    Such a file says nothing of boundaries; those of LAMMPS are periodic unless an input says otherwise.

    Raises ``ValueError`` for another style, which has no diameters, and for a tilted box.
    """
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
    return State(table.sort_values(["species", "id"]), high - low, np.full(3, True), notes=notes)


def _first(text: str) -> str:
    """The first line, shortened."""
    return repr(text.partition("\n")[0][:60])


def mercury(path: Path) -> State:
    """The last frame of a ``.data`` file of MercuryDPM in three dimensions; the box is not taken as periodic.

    The last column is the index of the species, unless the driver overrides ``getInfo``: then all are one species if it
    is no whole number.

    Raises ``ValueError`` for a file with another number of columns.
    """
    lines = path.read_text().splitlines()
    at = 0
    while at + int(lines[at].split()[0]) + 1 < len(lines):
        at += int(lines[at].split()[0]) + 1
    header, rows = lines[at].split(), lines[at + 1 :]
    if len(header) != 8 or len(rows[0].split()) < 14:
        raise ValueError(f"{path}: is no .data file in three dimensions: its frames begin with {lines[at]}")
    low, high = np.array(header[2:5], float), np.array(header[5:8], float)
    numbers = np.array([row.split() for row in rows], float)
    table = pd.DataFrame(numbers[:, :7], columns=[*AXES, *VELOCITIES, "radius"])
    whole = np.all(numbers[:, -1] == np.floor(numbers[:, -1]))
    table["species"] = numbers[:, -1].astype(int) + 1 if whole else 1
    table[AXES] -= low
    return State(table.sort_values("species", kind="stable"), high - low, np.zeros(3, bool))


def dynamo(path: Path) -> State:
    """A configuration of DynamO with hard spheres of one diameter, periodic or sheared.

    Raises ``ValueError`` for several interactions or a diameter that differs between particles.
    """
    root = ET.fromstring(bz2.decompress(path.read_bytes()) if path.suffix == ".bz2" else path.read_bytes())
    diameters = [node.get("Diameter", "") for node in root.iter("Interaction")]
    if len(diameters) != 1 or not _is_number(diameters[0]):
        raise ValueError(f"{path}: needs one interaction with a number as Diameter; it has {diameters}")
    size, position, velocity = (
        np.array([[float(node.get(axis, "nan")) for axis in AXES] for node in root.iter(name)])
        for name in ("SimulationSize", "P", "V")
    )
    table = pd.DataFrame(position + size / 2, columns=AXES).assign(radius=float(diameters[0]) / 2, species=1)
    shear, boundary = "", next(root.iter("BC"))
    if boundary.get("Type") == "LE":
        rate, offset = float(boundary.get("Rate", "1")), float(boundary.get("DXD", "0"))
        shear = f'{{ flow = "x", gradient = "y", rate = {rate!r}, offset = {offset!r} }}'
        # The mean velocity of DynamO is 0 in the middle of the box, that of haff at its lower face.
        velocity[:, 0] += 0.5 * rate * size[0, 1]
    table[VELOCITIES] = velocity
    return State(table, size[0], np.full(3, boundary.get("Type") != "None"), shear)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def without_overlap(state: State) -> tuple[State, float]:
    """Positions in the box and radii times the largest factor up to 1 for which no particles overlap; that factor.

    Spheres of soft-sphere programs overlap while they touch, which haff refuses. A sheared box is left alone: only
    DynamO has one here, and its spheres are hard.
    """
    if state.shear:
        return state, 1.0
    edges = np.where(state.periodic, state.size, 0.0)
    table = state.table.copy()
    position, radius = table[AXES].to_numpy(float, copy=True), table["radius"].to_numpy(float)
    for axis in np.flatnonzero(state.periodic):
        position[:, axis] = np.mod(position[:, axis], edges[axis])
        # The remainder of a tiny negative number rounds to the edge.
        position[position[:, axis] == edges[axis], axis] = 0.0
    # An edge of 0 does not repeat.
    i, j = cKDTree(position, boxsize=edges).query_pairs(2 * radius.max(), output_type="ndarray").T
    r = position[i] - position[j]
    r -= edges * np.round(r / np.where(state.periodic, edges, np.inf))
    factor = np.min(np.linalg.norm(r, axis=1) / (radius[i] + radius[j]), initial=np.inf)
    factor = 1.0 if factor >= 1 else float(factor) * (1 - 1e-12)
    table[AXES], table["radius"] = position, radius * factor
    return state._replace(table=table), factor


def scene(state: State) -> str:
    """Sections of a scene that start from the state."""
    boundary = ["periodic" if repeats else "open" for repeats in state.periodic]
    lines = ["[domain]", f"size = {state.size.tolist()}", f"boundary = {boundary}".replace("'", '"')]
    lines += [f"shear = {state.shear}"] if state.shear else []
    lines += state.notes
    if VELOCITIES[0] not in state.table:
        lines.append(NO_VELOCITIES)
    for species, rows in state.table.groupby("species"):
        low, high = rows["radius"].min(), rows["radius"].max()
        radius = repr(float(low)) if low == high else f"{{ uniform = [{low:.17g}, {high:.17g}] }}"
        lines += ["", "[[species]]", f'name = "{species}"', f"count = {len(rows)}", f"radius = {radius}"]
        masses = set(rows["mass"]) if "mass" in rows else set()
        lines += [f"mass = {float(masses.pop())!r}" if len(masses) == 1 else UNKNOWN_MASS]
    return "\n".join(lines)


def lammps_data(run: haff.File, path: Path, index: int = -1) -> None:
    """Writes a frame for ``read_data`` of LAMMPS, ``atom_style sphere``; LAMMPS has no bodies of infinite mass."""
    frame, number = run.frames[index], np.arange(1, len(run) + 1)
    density = run.mass / (4 / 3 * np.pi * run.radius**3)
    spin = np.zeros((len(run), 3)) if frame.angular_velocity is None else frame.angular_velocity
    with path.open("w") as file:
        print(f"haff, t = {frame.time!r}\n\n{len(run)} atoms\n{run.species.max() + 1} atom types\n", file=file)
        for axis, length in zip(AXES, run.box.size):
            print(f"0 {length:.17g} {axis}lo {axis}hi", file=file)
        print("\nAtoms # sphere\n", file=file)
        atoms = np.column_stack([number, run.species + 1, 2 * run.radius, density, frame.position])
        np.savetxt(file, atoms, "%d %d" + 5 * " %.17g")
        print("\nVelocities\n", file=file)
        np.savetxt(file, np.column_stack([number, frame.velocity, spin]), "%d" + 6 * " %.17g")


def reader(path: Path) -> Callable[[Path], State]:
    """The function that reads a file, by its first lines.

    Raises ``ValueError`` for a file of none of the programs.
    """
    if path.suffix in (".xml", ".bz2"):
        return dynamo
    with path.open(errors="replace") as file:
        head = [file.readline() for _ in range(40)]
    if head[0].startswith("ITEM: "):
        return lammps
    if any(re.search(r"\b(atoms|xhi)\s*(#|$)", line) for line in head):
        return lammps_atoms
    if len(head[0].split()) in (6, 8) and all(_is_number(word) for word in head[0].split()):
        return mercury
    raise ValueError(
        f"is neither a dump nor a data file of LAMMPS, nor of MercuryDPM or DynamO: it begins with {_first(head[0])}"
    )


def main(source: str, target: str) -> None:
    """Converts one file."""
    path = Path(source)
    if path.suffix == ".h5":
        with haff.open(path) as run:
            lammps_data(run, Path(target))
        return
    state, factor = without_overlap(reader(path)(path))
    state.table.to_csv(target, index=False)
    if factor < 1:
        print(f"# radii times {factor:.9g}: particles overlapped")
    print(scene(state))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    try:
        main(*sys.argv[1:])
    except (OSError, ValueError, IndexError, ET.ParseError, haff.HaffError) as error:
        sys.exit(f"{sys.argv[1]}: {str(error).removeprefix(f'{sys.argv[1]}: ')}")
