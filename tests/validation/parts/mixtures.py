"""One temperature in elastic mixtures, several in granular ones."""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np

import haff
from haff import theory

from ..registry import Part
from ..rows import Row, compare
from ..runs import Context

SETTLE = {"granular": 30, "elastic": 300}
"""Collisions per particle until the species cool at one rate, and until masses of 1 : 100 have shared their energy."""


class Mixture(NamedTuple):
    """Two species, the light and the heavy one."""

    counts: tuple[int, int]
    heavy: float
    """Mass of a heavy particle; that of a light one is 1."""
    large: float
    """Diameter of a heavy particle."""
    eta: float
    restitution: float

    @property
    def densities(self) -> np.ndarray:
        volume = math.pi / 6 * (self.counts[0] + self.counts[1] * self.large**3) / self.eta
        return np.array(self.counts) / volume

    @property
    def sigma(self) -> list[float]:
        return [1.0, self.large]

    @property
    def mass(self) -> list[float]:
        return [1.0, self.heavy]

    @property
    def system(self) -> str:
        size = "" if self.large == 1 else f", diameters 1 : {self.large:g}"
        counts = f"{self.counts[0]} + {self.counts[1]} spheres"
        return f"{counts}, φ = {self.eta:g}, masses 1 : {self.heavy:g}{size}, e = {self.restitution:g}"

    def settings(self, collisions: float) -> dict[str, Any]:
        """Of configs/validation/mixture.toml, with samples about a collision per particle apart."""
        rates = theory.mixture_rates(self.densities, self.sigma, self.mass)
        omega = 2 * rates.total / float(np.sum(self.densities))
        settings: dict[str, Any] = {
            "domain.packing_fraction": self.eta,
            "species.0.count": self.counts[0],
            "species.1.count": self.counts[1],
            "species.1.radius": self.large / 2,
            "species.1.mass": self.heavy,
            "contact.restitution": self.restitution,
            "run.collisions_per_particle": collisions,
            "output.observables": 1 / omega,
        }
        if self.restitution < 1:
            # T^(−1/2) grows by a factor about every 6/(1 − e²) collisions per particle in a one-component gas.
            growth = (1 - self.restitution**2) / 6
            settings["output.observables"] = {"log": [math.expm1(growth) / omega / growth, math.exp(growth)]}
        return settings

    def ratio(self, light: float, heavy: float) -> float:
        """T_heavy/T_light without the share that a momentum of zero takes from each, m/M."""
        total = self.counts[0] + self.counts[1] * self.heavy
        return heavy / light * (1 - 1 / total) / (1 - self.heavy / total)


def temperatures(settle: float, file: haff.File, report: dict[str, Any]) -> tuple[float, float]:
    """Temperatures of both species over that of all, averaged over collisions in the stationary state."""
    table = file.observables
    done = 2 * table["collisions"].to_numpy() / len(file)
    table, done = table[done >= settle], done[done >= settle]
    light, heavy = (
        float(
            np.average(
                (table[f"species_temperature_{name}"] / table["temperature"]).to_numpy()[1:], weights=np.diff(done)
            )
        )
        for name in ("light", "heavy")
    )
    return light, heavy


def equipartition(context: Context) -> list[Row]:
    """Elastic species share one temperature, whatever their masses: exactly, once the share of the momentum
    that is kept zero is accounted for. Grains do not: in the homogeneous cooling state all species cool at
    one rate, and for that the heavier stay hotter. Against Garzó and Dufty (1999;
    `haff.theory.granular_temperatures`), who take the velocities of each species as Maxwell's; that is
    uncertain by 3 % of 1 − e², about the size of the neglected a₂, and Montanero and Garzó (2002) found no
    larger deviation by direct simulation Monte Carlo. 8 seeds, after 30 collisions per particle.
    """
    rows = []
    elastic = [Mixture((400, 100), 100.0, 2.0, 0.2, 1.0), Mixture((500, 500), 10.0, 1.0, 0.01, 1.0)]
    granular = [Mixture((2000, 2000), 10.0, 1.0, 0.005, e) for e in (0.95, 0.9, 0.8, 0.7)]
    granular.append(Mixture((3000, 1000), 8.0, 2.0, 0.005, 0.8))
    for mixture in elastic + granular:
        settle = SETTLE["elastic" if mixture.restitution == 1 else "granular"]
        length = settle * context.effort(4 if mixture.restitution < 1 else 5, 2)
        given = [mixture.settings(length) | {"seed": seed} for seed in context.seeds()]
        if mixture.restitution == 1:
            # The initial temperatures differ.
            given = [g | {"species.0.temperature": 1.5, "species.1.temperature": 0.5} for g in given]
        found = [
            mixture.ratio(*pair) for pair in context.each("mixture", given, functools.partial(temperatures, settle))
        ]
        if mixture.restitution == 1:
            rows.append(compare(mixture.system, "T_heavy/T_light", found, 1.0, "equipartition, exact"))
        else:
            light, heavy = theory.granular_temperatures(
                mixture.densities, mixture.sigma, mixture.mass, mixture.restitution
            )
            doubt = 0.03 * (1 - mixture.restitution**2) * heavy / light
            rows.append(compare(mixture.system, "T_heavy/T_light", found, heavy / light, "Garzó–Dufty", doubt))
    return rows


PARTS = (Part("equipartition", "Equipartition", equipartition, 90),)
