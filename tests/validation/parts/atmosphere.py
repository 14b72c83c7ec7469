"""The barometric profile of an elastic gas over a floor."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import haff
from haff import theory

from ..registry import Part
from ..rows import Row, compare
from ..runs import Context

GRAVITY = 0.05
EDGES = (0.15, 0.5, 1.0, 1.5, 2.0, 3.0)
"""Slabs, in scale heights above the lowest centre."""


class Profile(NamedTuple):
    """Results of a run: T, the mean height, and in each slab the share of particles and the temperature."""

    temperature: float
    height: float
    shares: NDArray[np.float64]
    temperatures: NDArray[np.float64]
    column: float
    """Particles per area of the floor."""


def profile(file: haff.File, report: dict[str, Any]) -> Profile:
    """Averages over the frames after the first quarter."""
    frames = [f for f in file.frames if f.time > 0.25 * report["simulated_time"]]
    n = len(file)
    square = np.array([np.sum(f.velocity**2, axis=1) for f in frames])
    # The momentum along the floor is conserved and zero: two degrees of freedom less.
    T = float(np.sum(square) / len(frames) / (3 * n - 2))
    height = np.array([f.position[:, 2] for f in frames]) - 0.5
    edges = np.array(EDGES) * T / GRAVITY
    count = np.histogram(height, edges)[0]
    energy = np.histogram(height, edges, weights=square)[0]
    area = float(file.box.size[0] * file.box.size[1])
    return Profile(T, float(height.mean()), count / height.size, energy / count / 3, n / area)


def hydrostatic(T: float, column: float) -> tuple[float, NDArray[np.float64]]:
    """Mean height and shares of the slabs for dP/dz = −mgn with P = nT Z(n)."""
    scale, top = T / GRAVITY, 25.0

    def above(start: float) -> tuple[float, Any]:
        def slope(_: float, y: NDArray[np.float64]) -> list[float]:
            eta = float(theory.packing_fraction(np.exp(y[0]), 1.0))
            step = 1e-4 * eta
            # d(ηZ)/dη, so that d ln n/dz = −1/(scale · d(nZ)/dn).
            stiff = np.diff([x * theory.kolafa_labik_malijevsky(x) for x in (eta - step, eta + step)])[0] / (2 * step)
            n = float(np.exp(y[0]))
            return [-1 / stiff, n * scale, n * scale**2 * _]

        found = solve_ivp(slope, (0, top), [np.log(start), 0.0, 0.0], rtol=1e-9, atol=1e-12, dense_output=True)
        return float(found.y[1, -1]), found

    start = brentq(lambda n0: above(n0)[0] - column, 1e-3 * column / scale, 2 * column / scale, xtol=1e-12)
    found = above(start)[1]
    cumulative = found.sol(np.array(EDGES))[1] / column
    return float(found.y[2, -1] / column), np.diff(cumulative)


def barometric(context: Context) -> list[Row]:
    """500 elastic spheres under gravity, scale height 20 diameters, 8 seeds, averaged over all but the first
    quarter. The profile is that of hydrostatic balance, dP/dz = −mgn, with the equation of state of Kolafa,
    Labík and Malijevský, at the temperature of the run; the temperature is the same at all heights. Stated
    uncertainty: 0.3 % for the layer at the floor, which a local equation of state does not describe, and for the
    fixed energy of 500 spheres.
    """
    given = [{"seed": seed, "run.until": context.effort(6000, 1000)} for seed in context.seeds()]
    found = context.each("atmosphere", given, profile)
    balance = [hydrostatic(p.temperature, p.column) for p in found]
    system, doubt = "500 spheres over a floor, T/mg = 20", 3e-3
    rows = [
        compare(
            system,
            "mean height/hydrostatic",
            [p.height / height for p, (height, _) in zip(found, balance)],
            1.0,
            "hydrostatic, Kolafa–Labík–Malijevský",
            doubt,
        )
    ]
    for k, (low, high) in enumerate(itertools.pairwise(EDGES)):
        values = [p.shares[k] / shares[k] for p, (_, shares) in zip(found, balance)]
        quantity = f"density/hydrostatic, {low:g} to {high:g} scale heights"
        rows.append(compare(system, quantity, values, 1.0, "hydrostatic, Kolafa–Labík–Malijevský", doubt))
    for k in (0, len(EDGES) - 2):
        values = [p.temperatures[k] / p.temperature for p in found]
        quantity = f"T(z)/T, {EDGES[k]:g} to {EDGES[k + 1]:g} scale heights"
        rows.append(compare(system, quantity, values, 1.0, "equipartition", 2 / 500))
    return rows


PARTS = (Part("barometric", "Barometric profile", barometric, 100),)
