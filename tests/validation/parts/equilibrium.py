"""Pressure and mean free time of the elastic fluid, in three and two dimensions."""

from __future__ import annotations

from typing import Any

import numpy as np

import haff
from haff import theory

from ..registry import Part
from ..rows import Row, compare
from ..runs import Context

SPHERES, DISKS = (0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.45, 0.49), (0.1, 0.3, 0.5, 0.648)
EQUATION = {3: "klm", 2: "virial"}
MELTING = 200
"""Collisions per particle before anything is measured; the start is random and has no crystal to melt."""


def settings(
    eta: float, d: int, count: int, collisions: int, samples: int, seed: int, melting: int = MELTING
) -> dict[str, Any]:
    """A fluid of `count` particles, run for `melting` and then `collisions` collisions per particle."""
    omega = float(
        theory.collision_frequency(theory.number_density(eta, 1.0, d), 1.0, g0=theory.contact_value(eta, d), d=d)
    )
    interval = collisions / samples / omega
    return {
        "domain.packing_fraction": eta,
        "species.0.count": count,
        "seed": seed,
        "run.until": (melting + collisions) / omega,
        "output.observables": interval,
    }


def means(file: haff.File, report: dict[str, Any], melting: int = MELTING) -> tuple[float, float, float]:
    """Z, T and collisions per particle and time over the run after melting."""
    table = file.observables
    steps = table["collisions"].to_numpy()
    late = table[2 * steps / len(file) > melting]
    span = np.diff(late["time"])
    # The pressure of a sample is the mean since the one before.
    pressure = float(np.average(late["pressure"].to_numpy()[1:], weights=span))
    T = float(late["temperature"].iloc[0])
    n = len(file) / file.box.volume
    rate = 2 * float(late["collisions"].iloc[-1] - late["collisions"].iloc[0]) / len(file) / float(span.sum())
    return pressure / (n * T), T, rate


def equation_of_state(eta: float, d: int, count: int) -> tuple[float, float, str]:
    """Z of `count` particles, its uncertainty, and its source."""
    expected = float(theory.periodic_compressibility(eta, count, d, EQUATION[d]))
    if d == 3:
        doubt, source = 4e-5 * (expected - 1), "Kolafa–Labík–Malijevský"
    elif eta <= 0.5:
        source = "virial series, Padé [4/5]"
        doubt = abs(float(theory.virial_disks(eta, 4) - theory.virial_disks(eta, 5)))
    else:
        # The series has too few coefficients here, and the correction for the box is below the uncertainty.
        expected = float(theory.luding_disks(eta))
        doubt, source = 1e-3 * expected, "Luding's fit to simulations"
    # Terms neglected by Lebowitz–Percus are of second order in 1/N.
    return expected, float(np.hypot(doubt, 10 * (expected - 1) / count**2)), source


def pressure(context: Context) -> list[Row]:
    """Z from the collisional virial over 600 collisions per particle, 8 seeds a density, after 200 from a
    random start. Spheres against the modified equation of state of Kolafa, Labík and Malijevský (2004), good
    to 4·10⁻⁵; disks up to φ = 0.5 against the Padé approximant of the ten virial coefficients of Clisby and
    McCoy (2006), whose uncertainty is its difference from the neighboring approximant. Both are corrected for
    the fixed number, energy and momentum of a periodic box (Lebowitz–Percus;
    `haff.theory.periodic_compressibility`), a shift of the order of 1/N. At φ = 0.648 the series is off by 0.4 %;
    Luding's fit (2001) is used there, which agrees with the 8.306 that Erpenbeck and Luban found in 1985.
    """
    count, collisions, rows = 2000, context.effort(600, 60), []
    for d, densities in ((3, SPHERES), (2, DISKS)):
        for eta in densities:
            found = context.each(
                "fluid" if d == 3 else "disks",
                [settings(eta, d, count, collisions, 10, seed) for seed in context.seeds()],
                means,
            )
            expected, doubt, source = equation_of_state(eta, d, count)
            kind = "spheres" if d == 3 else "disks"
            system = f"{count} {kind}, φ = {eta:g}"
            rows.append(compare(system, "Z = PV/NT", [z for z, _, _ in found], expected, source, doubt))
    return rows


def mean_free_time(context: Context) -> list[Row]:
    """Time between the collisions of one particle, from all collisions counted, in runs of their own. In
    equilibrium the velocities of an approaching pair are uncorrelated, so Enskog's rate is exact once the
    contact value is; that is taken from the equations of state above. With 500 particles the corrections for
    the finite box are larger than the error: they are tested along with it.
    """
    count, collisions, rows = 500, context.effort(1000, 100), []
    for d, densities in ((3, (0.01, 0.1, 0.3, 0.45)), (2, (0.1, 0.5))):
        for eta in densities:
            # Different seeds: the same runs would have the same fluctuations as the pressure.
            found = context.each(
                "fluid" if d == 3 else "disks",
                [settings(eta, d, count, collisions, 10, 1000 + seed) for seed in context.seeds()],
                means,
            )
            n = theory.number_density(eta, 1.0, d)
            g0 = theory.periodic_contact_value(eta, count, d, EQUATION[d])
            omega = float(theory.collision_frequency(n, 1.0, 1.0, 1.0, g0, d) * theory.periodic_rate_factor(count, d))
            z, doubt, source = equation_of_state(eta, d, count)
            kind = "spheres" if d == 3 else "disks"
            rows.append(
                compare(
                    f"{count} {kind}, φ = {eta:g}",
                    "mean free time × √T",
                    [np.sqrt(T) / rate for _, T, rate in found],
                    1 / omega,
                    f"Enskog, {source}",
                    doubt / (z - 1) / omega,
                )
            )
    return rows


PARTS = (
    Part("pressure", "Pressure", pressure, 10),
    Part("mean_free_time", "Mean free time", mean_free_time, 20),
)
