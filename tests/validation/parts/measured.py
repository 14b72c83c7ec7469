"""Coefficients of transport from the correlations that the engine measures while it runs."""

from __future__ import annotations

from typing import Any

import numpy as np

import haff
from haff import analysis, theory

from ..registry import Part
from ..rows import Row, compare
from ..runs import Context
from .transport import enskog_rate

COUNT = 500
"""Number of spheres, from a random start, which has no order to melt."""


def settings(eta: float, collisions: float, seed: int) -> dict[str, Any]:
    """A fluid with all correlations, a state every tenth of a mean free time."""
    rate = enskog_rate(eta)
    return {
        "species.0.count": COUNT,
        "domain.packing_fraction": eta,
        "run.until": collisions / rate,
        "output.frames": False,
        "output.observables": 10 / rate,
        "measure.msd": True,
        "measure.vacf": True,
        "measure.stress_correlation": True,
        "measure.interval": 0.1 / rate,
        "seed": seed,
    }


def coefficients(file: haff.File, report: dict[str, Any]) -> tuple[float, float, float, float]:
    """D and η by Einstein and by Green and Kubo."""
    rate = enskog_rate(float(file.summary["packing_fraction"]))
    D = analysis.self_diffusion(file, 75 / rate, 200 / rate)
    eta = analysis.shear_viscosity(file, 15 / rate, 30 / rate)
    return D.einstein, D.green_kubo, eta.einstein, eta.green_kubo


def measured(context: Context) -> list[Row]:
    """D and η of 500 spheres from the correlations of `[measure]`, 16 seeds: by the slopes of mean squares and by the
    integrals of autocorrelations, which must agree, against the same references as the displacements of frames
    and the moments of event logs above.
    """
    rows = []
    for eta in (0.1, 0.3):
        runs = [settings(eta, context.effort(8000, 400), seed) for seed in context.seeds(16)]
        found = np.array(context.each("fluid", runs, coefficients))
        system = f"{COUNT} spheres, φ = {eta:g}"
        n = theory.number_density(eta, 1.0)
        speedy = float(theory.diffusion_speedy(n, 1.0))
        rows.append(compare(system, "D/√T, Einstein", list(found[:, 0]), speedy, "Speedy, 500 spheres", 0.02 * speedy))
        enskog = float(theory.enskog_viscosity(n, 1.0, g0=theory.contact_value(eta, 3, "klm")))
        rows.append(compare(system, "η/√T, Einstein", list(found[:, 2]), enskog, "Enskog", 0.02 * enskog))
        for name, k in (("D", 0), ("η", 2)):
            # Both from the same run, by different lags: only their difference is compared.
            difference = found[:, k + 1] / found[:, k] - 1
            rows.append(compare(system, f"{name}: Green–Kubo/Einstein − 1", list(difference), 0.0, "the same", 0.005))
    return rows


PARTS = (Part("measured", "Measured while running", measured, 66),)
"""Self-diffusion and shear viscosity by Einstein and by Green and Kubo."""
