"""Long elastic runs: what rounding adds up to, from the recorded frames."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import haff
from haff import theory

from .audit import EPS, LEAST, Scene, exact, overlap
from .rows import Row, at_most

FRAMES = 20
"""Frames of a run, beside the first."""
ENERGY, MOMENTUM = 6.0, 3.0
"""Four standard deviations of the walks, in ε T and ε √(mT) by √collisions: a collision rounds by some 1.3 and 0.6."""
PACKING = 0.1


def settings(count: int, collisions: int, seed: int) -> dict[str, Any]:
    """`count` elastic spheres of unit mass, diameter and temperature for about that many collisions."""
    density = theory.number_density(PACKING, 1.0, 3)
    omega = float(theory.collision_frequency(density, 1.0, g0=theory.contact_value(PACKING, 3), d=3))
    until = 2 * collisions / count / omega
    return {
        "domain.packing_fraction": PACKING,
        "species.0.count": count,
        "seed": seed,
        "run.until": until,
        "output.frames": until / FRAMES,
        "output.observables": False,
    }


def drift(file: haff.File, report: dict[str, Any]) -> dict[str, float]:
    """Worst walk of energy and momentum over all frames, and the deepest overlap in either half of them."""
    scene = Scene(file)
    mass = file.mass[:, None]
    energy = [exact(0.5 * mass * frame.velocity**2) for frame in file.frames]
    momentum = [[exact(mass[:, 0] * frame.velocity[:, axis]) for axis in range(3)] for frame in file.frames]
    temperature = energy[0] / (1.5 * len(file))
    heat = push = 0.0
    for frame, e, p in zip(file.frames, energy, momentum):
        if frame.step > 0:
            walk = EPS * math.sqrt(frame.step)
            heat = max(heat, abs(e - energy[0]) / (temperature * walk))
            push = max(push, math.dist(p, momentum[0]) / (math.sqrt(temperature) * walk))
    depth = [overlap(scene, frame.position, frame.time) for frame in file.frames]
    half = len(depth) // 2
    return {"heat": heat, "push": push, "first": float(np.max(depth[:half])), "second": float(np.max(depth[half:]))}


def rows(found: dict[str, float], count: int, collisions: int) -> list[Row]:
    """What a run of `count` spheres must keep."""
    system = f"{count} spheres, {collisions:.0e} collisions"
    return [
        at_most(system, "energy drift / ε T √collisions", found["heat"], ENERGY, "random walk of rounding"),
        at_most(system, "momentum drift / ε √(mT) √collisions", found["push"], MOMENTUM, "random walk of rounding"),
        at_most(system, "overlap, first half", found["first"], LEAST, "rounding"),
        at_most(system, "overlap, second half", found["second"], LEAST, "rounding"),
    ]
