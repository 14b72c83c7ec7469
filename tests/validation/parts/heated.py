"""Gases heated by white noise: the temperature and the velocity distribution of the steady state."""

from __future__ import annotations

import math
from typing import Any

import haff
from haff import theory

from .. import boltzmann
from ..registry import Part
from ..rows import Row, compare
from ..runs import Context

ETA, COUNT = 0.005, 4000
"""Packing fraction and number of particles, of configs/validation/heated.toml."""
CASES = [(d, e) for d in (3, 2) for e in (0.6, 0.8, 0.95)]
"""Dimension and restitution."""
SETTLE = 15
"""Collisions per particle until the state is steady."""


def omega(dimension: int) -> float:
    """Enskog's collisions per particle and time at T = 1."""
    n = theory.number_density(ETA, 1.0, dimension)
    g0 = theory.periodic_contact_value(ETA, COUNT, dimension)
    rate = theory.collision_frequency(n, 1.0, 1.0, 1.0, g0, dimension)
    return float(rate * theory.periodic_rate_factor(COUNT, dimension))


def settings(dimension: int, e: float, collisions: float) -> dict[str, Any]:
    """White noise whose heating Maxwell velocities balance at T = 1: (1 − e²)/d between two collisions."""
    rate = omega(dimension)
    return {
        "dimension": dimension,
        "contact.restitution": e,
        "drive.0.strength": (1 - e**2) / dimension * rate,
        "drive.0.rate": boltzmann.KICKS * rate,
        "run.collisions_per_particle": collisions,
        "output.observables": 0.5 / rate,
    }


def steady_state(file: haff.File, report: dict[str, Any]) -> tuple[float, float]:
    """T and a₂ averaged over time in the steady state."""
    table = file.observables
    late = table[2 * table["collisions"] / len(file) >= SETTLE]
    return float(late["temperature"].mean()), float(late["sonine_a2"].mean())


def heated_gas(context: Context) -> list[Row]:
    """T and a₂ of gases heated by white noise, 8 seeds each. Poisson kicks give each particle the power d m ξ₀²/2,
    and collisions take (1 − e²) ω T/2 if velocities are those of Maxwell. Against the solution of the Boltzmann
    equation by direct simulation Monte Carlo with as many kicks (`tests/validation/boltzmann.py`). The rate of
    collisions is Enskog's.
    """
    rows = []
    for dimension, e in CASES:
        T, dT, a2, da2 = boltzmann.HEATED[dimension, e]
        # The center of mass takes its share of the power, and its motion is not part of T.
        share = (1 - 1 / COUNT) ** (5 / 3)
        runs = [settings(dimension, e, SETTLE + context.effort(150, 12)) | {"seed": s} for s in context.seeds(8)]
        found = context.each("heated", runs, steady_state)
        system = f"{COUNT} {'spheres' if dimension == 3 else 'disks'}, φ = {ETA:g}, e = {e:g}"
        # Correlated velocities, in proportion to density as in the cooling gas.
        doubt = 1.6 * ETA * (1 - e**2)
        source = "Enskog, Boltzmann's equation by DSMC"
        rows.append(compare(system, "T", [t for t, _ in found], T * share, source, math.hypot(dT, doubt * T)))
        rows.append(compare(system, "a₂", [a for _, a in found], a2, source, math.hypot(da2, 0.3 * doubt)))
    return rows


PARTS = (Part("heated_gas", "Heated gas", heated_gas, 65),)
