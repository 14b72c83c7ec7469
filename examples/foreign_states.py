"""States of LAMMPS, MercuryDPM and DynamO for scenes of haff, and frames of haff for LAMMPS.

    python3 examples/foreign_states.py dump.lammpstrj start.csv     # last frame of `dump custom`
    python3 examples/foreign_states.py grains.data start.csv        # data file of LAMMPS, atom_style sphere
    python3 examples/foreign_states.py Chute.data start.csv         # last frame of MercuryDPM, 3D
    python3 examples/foreign_states.py config.out.xml.bz2 start.csv # DynamO, equal spheres
    python3 examples/foreign_states.py run.h5 start.data            # last frame of haff, for `read_data`

Scenes start from these files directly, too: `positions = { file = "dump.lammpstrj" }`. Here the radii become so much
smaller that no particles overlap, as those of soft spheres do, and the scene is written.

The first lines of a file say which program it is of. All but the last print what the scene needs beside
`positions = { file = "start.csv" }`. docs/howto/coming-from.md says how the programs differ.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import haff
from haff.files.programs import VELOCITIES, ForeignState, read

AXES = ["x", "y", "z"]
UNKNOWN_MASS = "# mass or density = ?"
NO_VELOCITIES = "# initial.temperature = ?: the file has no velocities"


def without_overlap(state: ForeignState) -> tuple[ForeignState, float]:
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


def scene(state: ForeignState) -> str:
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


def main(source: str, target: str) -> None:
    """Converts one file."""
    path = Path(source)
    if path.suffix == ".h5":
        with haff.open(path) as run:
            lammps_data(run, Path(target))
        return
    state, factor = without_overlap(read(path))
    state.table.to_csv(target, index=False)
    if factor < 1:
        print(f"# radii times {factor:.9g}: particles overlapped")
    print(scene(state))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    try:
        main(*sys.argv[1:])
    except (OSError, ValueError, haff.HaffError) as error:
        sys.exit(f"{sys.argv[1]}: {str(error).removeprefix(f'{sys.argv[1]}: ')}")
