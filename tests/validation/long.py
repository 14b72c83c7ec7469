"""Long elastic runs: accumulated rounding errors, measured at intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import haff

from .audit import EPS, LEAST, close_pairs, exact
from .rows import Row, at_most
from .runs import SCENES

STOPS = 20
"""Number of checks of a run after its start."""
ENERGY, MOMENTUM = 12.0, 2.4
"""Four standard deviations of the walks, in ε T and ε √(mT) by √collisions: a collision rounds by up to 3 and 0.6."""
PACKING = 0.1


class Gas(NamedTuple):
    """Elastic spheres of unit diameter and temperature: numbers by mass, and length of the run."""

    counts: tuple[int, ...]
    masses: tuple[float, ...]
    collisions: int

    @property
    def system(self) -> str:
        """In words and numbers."""
        counts = " + ".join(map(str, self.counts))
        masses = "" if len(self.masses) == 1 else ", masses " + " : ".join(f"{mass:g}" for mass in self.masses)
        power = math.floor(math.log10(self.collisions))
        return f"{counts} spheres{masses}, {self.collisions / 10**power:g}·10^{power} collisions"

    def start(self, seed: int) -> haff.Simulation:
        """In a periodic box, at random positions."""
        species = [
            {"name": f"mass {mass:g}", "count": count, "radius": 0.5, "mass": mass}
            for count, mass in zip(self.counts, self.masses)
        ]
        scene = SCENES / "fluid.toml"
        return haff.Simulation(scene, domain__packing_fraction=PACKING, species=species, seed=seed, threads=1)


class Bodies(NamedTuple):
    """The bodies in extended precision."""

    size: NDArray[np.float64]
    periodic: NDArray[np.bool_]
    radius: NDArray[np.float64]
    sliding: None = None
    """Sheared boxes are not among these."""


@dataclass
class Walk:
    """Largest errors of a run; of contacts, one for each stop."""

    energy: float = 0.0
    """Deviation from the start, in ε T √collisions."""
    momentum: float = 0.0
    """Deviation from the start, in ε √(mT) √collisions, m the largest mass."""
    contact: list[float] = field(default_factory=list)
    """Distance of two spheres from contact at the moment when they collide, root mean square [diameters]."""
    overlap: list[float] = field(default_factory=list)
    """At moments of collisions [diameters]."""
    edge: float = 0.0
    """Of the box [diameters]."""


def least_gap(simulation: haff.Simulation) -> float:
    """Gap between the two closest spheres, over their contact distance, in extended precision."""
    bodies = Bodies(np.asarray(simulation.box.size), np.asarray(simulation.box.periodic), simulation.radii)
    pairs = close_pairs(bodies, simulation.positions)
    positions, size = simulation.positions.astype(np.longdouble), bodies.size.astype(np.longdouble)
    apart = positions[pairs[:, 1]] - positions[pairs[:, 0]]
    apart -= np.rint(apart / size) * size
    sigma = bodies.radius[pairs].astype(np.longdouble).sum(axis=1)
    return float(np.min(np.sqrt((apart**2).sum(axis=1)) / sigma - 1))


def terms(simulation: haff.Simulation) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Terms of kinetic energy and momentum, `[N, 3]`; rounded by √N ε in all, far below the walk."""
    mass, velocity = simulation.masses[:, None], simulation.velocities
    return 0.5 * mass * velocity**2, mass * velocity


def change(before: NDArray[np.float64], after: NDArray[np.float64]) -> float:
    """Difference of two sums, each of which is exact to half an ulp, which for N spheres is N ε T."""
    return exact([*after, *-before])


def follow(gas: Gas, checks: int, seed: int = 1) -> Walk:
    """The walk of a gas, checked after each of `checks` collisions at each stop, when two spheres are in contact."""
    simulation = gas.start(seed)
    energy, momentum = terms(simulation)
    temperature = exact(energy) / (1.5 * len(simulation))
    walk = Walk(edge=float(max(simulation.box.size)))
    for stop in range(1, STOPS + 1):
        simulation.step(gas.collisions * stop // STOPS - simulation.collisions - checks)
        gaps = []
        for _ in range(checks):
            simulation.step(1)
            gaps.append(least_gap(simulation))
        e, p = terms(simulation)
        step = EPS * math.sqrt(simulation.collisions)
        heat = change(energy.ravel(), e.ravel())
        push = math.hypot(*(change(momentum[:, axis], p[:, axis]) for axis in range(3)))
        walk.energy = max(walk.energy, abs(heat) / (temperature * step))
        walk.momentum = max(walk.momentum, push / (math.sqrt(max(gas.masses) * temperature) * step))
        walk.contact.append(math.sqrt(np.mean(np.square(gaps))))
        walk.overlap.append(max(0.0, -min(gaps)))
    return walk


def rows(gas: Gas, walk: Walk) -> list[Row]:
    """Bounds on a run."""
    half = STOPS // 2
    early, late = (math.sqrt(np.mean(np.square(part))) for part in (walk.contact[:half], walk.contact[half:]))
    found: list[tuple[str, float, float, str]] = [
        ("energy drift / ε T √collisions", walk.energy, ENERGY, "random walk of rounding"),
        ("momentum drift / ε √(mT) √collisions", walk.momentum, MOMENTUM, "random walk of rounding"),
        ("overlap", max(walk.overlap), LEAST, "rounding"),
        ("contact off its place, rms of the first half", early, 4 * EPS * walk.edge, "rounding of coordinates"),
        ("contact off its place, second half over first", late / early, 1.5, "flat in time"),
    ]
    return [at_most(gas.system, *row) for row in found]
