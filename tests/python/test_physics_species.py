"""Tracers and intruders: their coefficient of diffusion by z-score."""

from __future__ import annotations

import math

import numpy as np
import pytest

import haff
from haff import analysis, theory

pytestmark = pytest.mark.physics

ETA, COUNT, TRACERS, SEEDS = 0.002, 1000, 8, 12
SIZE, MASS = 3.0, 10.0
"""Diameter and mass of an intruder in units of those of the others."""
DOUBT = 0.02
"""Enskog's theory takes impacts as independent: the flow around an intruder of the radius R, from its center to those
of the grains that it hits, takes about R/(3λ) from its friction (Millikan's law); λ is some 30 R here."""


@pytest.mark.long
def test_an_intruder_diffuses_as_enskog_says(tmp_path):
    n = float(theory.number_density(ETA, 1.0))
    edge = (COUNT / n) ** (1 / 3)
    D = float(theory.enskog_tracer_diffusion(n, 1.0, SIZE, 1.0, MASS))
    forgets = MASS * D
    scene = {
        "seed": 8,
        "domain": {"size": [edge] * 3},
        "species": [
            {"name": "grain", "count": COUNT, "radius": 0.5, "mass": 1.0},
            {"name": "intruder", "count": TRACERS, "radius": SIZE / 2, "mass": MASS},
        ],
        "initial": {"positions": "random", "temperature": 1.0},
        "measure": {"msd": {"species": "each"}, "vacf": {"species": "each"}, "interval": forgets / 20},
        "run": {"until": 400 * forgets},
        "output": {"frames": False, "observables": forgets},
    }

    def diffusion(run: haff.File) -> dict[str, float]:
        window = {"start": 4 * forgets, "end": 10 * forgets}
        T = float(run.observables["temperature"].mean())
        found = analysis.self_diffusion(run, species="intruder", **window)
        return {
            "einstein": found.einstein / math.sqrt(T),
            "green_kubo": found.green_kubo / math.sqrt(T),
            "stated": found.einstein_error / math.sqrt(T),
        }

    study = haff.sweep(scene, {}, seeds=SEEDS, output=tmp_path, measure=diffusion)
    for name in ("einstein", "green_kubo"):
        values = study[name].to_numpy().ravel()
        mean, error = values.mean(), values.std(ddof=1) / math.sqrt(len(values))
        z = (mean / D - 1) / math.hypot(error / D, DOUBT)
        assert error < 0.03 * D
        assert abs(z) < 3, f"{name}: D = {mean:.2f} ± {error:.2f}, {D:.2f}: z = {z:.1f}"
    # The error of a single run, over the length of the window, is that of the scatter of the runs.
    scatter = study["einstein"].to_numpy().std(ddof=1)
    stated = float(np.sqrt(np.mean(study["stated"].to_numpy() ** 2)))
    assert 0.5 < stated / scatter < 2, f"stated {stated:.2f}, scatter {scatter:.2f}"
