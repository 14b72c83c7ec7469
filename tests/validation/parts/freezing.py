"""Two branches of one density: the supercooled fluid and the crystal."""

from __future__ import annotations

from typing import Any

import freud
import numpy as np

import haff
from haff import theory

from ..registry import Part
from ..rows import Row, at_most, compare
from ..runs import Context
from .equilibrium import MELTING, means, settings

FCC = 0.5745
"""Q₆ of the perfect fcc lattice with its 12 neighbors."""


def state(file: haff.File, report: dict[str, Any], melting: int = MELTING) -> tuple[float, float]:
    """Z after melting, and the global bond order Q₆ of the last frame."""
    frame = file.frames[-1]
    box = freud.box.Box.cube(float(frame.box.size[0]))
    order = freud.order.Steinhardt(6)
    order.compute((box, box.wrap(frame.position - frame.box.size / 2)), neighbors={"num_neighbors": 12})
    return means(file, report, melting)[0], float(order.order)


def fluid_state(file: haff.File, report: dict[str, Any]) -> tuple[float, float]:
    """State of a slow fluid: a sphere diffuses over its diameter in about 700 collisions."""
    return state(file, report, 1000)


def freezing(context: Context) -> list[Row]:
    """At φ = 0.52, between freezing at 0.494 and melting at 0.545, spheres from a random start stay fluid for
    as long as it takes to measure, and spheres from an fcc lattice stay crystalline; the stable state is a
    mixture of both. The fluid is compared with Kolafa, Labík and Malijevský (2004), fitted into the metastable
    region; the crystal with Speedy (1998), whose fit ends at melting, with an uncertainty of 0.1 % above and 0.5 %
    below. Q₆ of the last frame, by freud, shows which of the two it is: 0.57 for fcc.
    """
    count, rows = 864, []
    for name, start, eta, collisions, melting in (
        ("fluid", "random", 0.52, context.effort(2000, 200), 1000),
        ("crystal", "fcc", 0.52, context.effort(600, 200), MELTING),
        ("crystal", "fcc", 0.58, context.effort(600, 200), MELTING),
    ):
        given = [settings(eta, 3, count, collisions, 10, seed, melting) for seed in context.seeds()]
        given = [g | {"initial.positions": start, "output.frames": g["run.until"]} for g in given]
        found = context.each("fluid", given, fluid_state if name == "fluid" else state)
        if name == "fluid":
            expected, source = float(theory.periodic_compressibility(eta, count, 3, "klm")), "Kolafa–Labík–Malijevský"
            doubt = 4e-5 * expected
        else:
            expected, source = float(theory.crystal_compressibility(eta)), "Speedy, fcc"
            doubt = np.hypot(expected / count, (1e-3 if eta > 0.545 else 5e-3) * expected)
        system = f"{count} spheres, {name}, φ = {eta:g}"
        rows.append(compare(system, "Z = PV/NT", [z for z, _ in found], expected, source, doubt))
        order = [q for _, q in found]
        if name == "fluid":
            rows.append(at_most(system, "Q₆, largest", max(order), 0.1, "no crystal"))
        else:
            rows.append(at_most(system, "0.57 − Q₆, largest", FCC - min(order), 0.25, "still a crystal"))
    return rows


PARTS = (Part("freezing", "Freezing", freezing, 80),)
