"""Gases of rough spheres, cooling and heated: the temperatures of translation and rotation."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np

import haff
from haff import theory

from .. import dsmc
from ..registry import Part
from ..rows import Row, compare
from ..runs import Context

ETA, COUNT = 0.005, 4000
"""Packing fraction and number of particles, of configs/validation/rough_cooling.toml and rough_heated.toml."""
SETTLE = {(0.9, -0.9): 220, (0.7, -0.5): 120}
"""Collisions per particle until the state is steady; 65 in the other cases."""
STEP = dsmc.HEATING_STEP
"""Collisions per particle between two kicks, as in the reference."""


def settle(case: tuple[float, float]) -> int:
    return SETTLE.get(case, 65)


def enskog() -> tuple[float, float]:
    """Number density, and Enskog's factor of the rate of collisions."""
    g0 = theory.periodic_contact_value(ETA, COUNT, 3)
    return float(theory.number_density(ETA, 1.0)), float(g0 * theory.periodic_rate_factor(COUNT, 3))


def late(file: haff.File, case: tuple[float, float]) -> Any:
    """Rows after the transient, at equal numbers of collisions: half a collision per particle between two."""
    table = file.observables
    count = 2 * table["collisions"].to_numpy() / len(file)
    levels = np.arange(settle(case), count[-1], 0.5)
    return table.iloc[np.searchsorted(count, levels).clip(max=len(table) - 1)]


def cooling(case: tuple[float, float], file: haff.File, report: dict[str, Any]) -> float:
    """T_rot/T of a cooling gas."""
    found = late(file, case)
    return float((found["rotational_temperature"] / found["temperature"]).mean())


def heated(case: tuple[float, float], file: haff.File, report: dict[str, Any]) -> tuple[float, float]:
    """T and T_rot/T of a heated gas."""
    found = late(file, case)
    T, rotation = found["temperature"].mean(), found["rotational_temperature"].mean()
    return float(T), float(rotation / T)


def rough_gas(context: Context) -> list[Row]:
    """T_rot/T of cooling and of heated rough spheres (q = 2/5, no bound of friction), and T of the heated ones, 8 seeds
    each. Against the solution of the Boltzmann equation by direct simulation Monte Carlo (`tests/validation/dsmc.py`).
    """
    rows = []
    density, chi = enskog()
    source = "Boltzmann's equation by DSMC"
    for case in dsmc.CASES:
        e, beta = case
        system = f"{COUNT} rough spheres, φ = {ETA:g}, e = {e:g}, β = {beta:g}"
        law = {"contact.restitution": e, "contact.tangential_restitution": beta}
        length = settle(case) + context.effort(150, 12)
        # Correlated velocities, in proportion to density as in the gas of smooth spheres.
        doubt = 1.6 * ETA * (1 - e**2)

        expected, error = dsmc.COOLING[case]
        cold = {"initial.rotational_temperature": expected, "run.collisions_per_particle": length}
        runs = [law | cold | {"seed": seed} for seed in context.seeds(8)]
        ratios = context.each("rough_cooling", runs, functools.partial(cooling, case))
        tolerance = math.hypot(error, doubt * expected)
        rows.append(compare(f"cooling, {system}", "T_rot/T", ratios, expected, source, tolerance))

        unit, ratio = dsmc.maxwellian_heated(e, beta, density=density, chi=chi)
        interval = STEP / dsmc.collision_rate(1.0, density, chi, 3)
        noise = {
            "initial.rotational_temperature": ratio,
            "drive.0.strength": unit**-1.5,
            "drive.0.interval": interval,
            "run.collisions_per_particle": length,
            "output.observables": 10 * interval,
        }
        evaluate = functools.partial(heated, case)
        found = context.each("rough_heated", [law | noise | {"seed": s} for s in context.seeds(8)], evaluate)
        T, dT, ratio, error = dsmc.HEATED[case]
        temperatures, ratios = [t for t, _ in found], [r for _, r in found]
        # Kicks whose mean is taken out heat by N − 1 of N parts, and the motion of the center of mass is no part of T.
        share = (1 - 1 / COUNT) ** (2 / 3)
        where = f"heated, {system}"
        rows.append(compare(where, "T", temperatures, T * share, f"Enskog, {source}", math.hypot(dT, doubt * T)))
        rows.append(compare(where, "T_rot/T", ratios, ratio, source, math.hypot(error, doubt * ratio)))
    return rows


PARTS = (Part("rough_gas", "Rough gas", rough_gas, 120),)
