"""Uniform shear flow: dilute gases, a gas of moderate density, and the viscosity of the elastic fluid."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import haff
from haff import analysis, theory

from .. import dsmc
from ..registry import Part
from ..rows import Row, compare
from ..runs import Context
from .transport import enskog_rate

DILUTE, COUNT = 2e-4, 4000
"""Packing fraction and number of particles of the dilute gas."""


def late(file: haff.File, strain: float) -> Any:
    """Rows of the observables after this strain."""
    table = file.observables
    rate = file.scene["domain"]["shear"]["rate"]
    return table[table["time"] * rate > strain]


def dilute(file: haff.File, report: dict[str, Any]) -> tuple[float, ...]:
    """Reduced rate a*, and the kinetic pressure tensor by p."""
    rows = late(file, 30.0)
    P = {name: float(rows[f"pressure_tensor_kinetic_{name}"].mean()) for name in ("xx", "yy", "zz", "xy")}
    p = (P["xx"] + P["yy"] + P["zz"]) / 3
    n = len(file) / file.box.volume
    T = p / n
    rate = file.scene["domain"]["shear"]["rate"]
    return (rate / (16 / 5 * math.sqrt(math.pi) * n * math.sqrt(T)), *(P[name] / p for name in P))


def sheared_gas(context: Context) -> list[Row]:
    """Steady uniform shear of a dilute gas, φ = 2·10⁻⁴, 8 seeds: the reduced rate γ̇/((16/5)√π nσ²√(T/m)) and the
    kinetic part of the pressure tensor, from strain 30 on. Against the solution of the Boltzmann equation by direct
    simulation Monte Carlo (`tests/validation/dsmc.py`), which shares no code; the correction for the density is of the
    order of φ.
    """
    rows = []
    n = float(theory.number_density(DILUTE, 1.0))
    for e in dsmc.SHEARED:
        expected = dsmc.SHEAR[e]
        # The rate for T = 1.
        rate = expected[0][0] * 16 / 5 * math.sqrt(math.pi) * n
        settings = {
            "domain.packing_fraction": DILUTE,
            "domain.shear.rate": rate,
            "species.0.count": COUNT,
            "contact.restitution": e,
            "run.until": (30 + context.effort(120, 30)) / rate,
            "output.observables": 1 / rate,
        }
        found = np.array(context.each("sheared", [settings | {"seed": s} for s in context.seeds(8)], dilute))
        system = f"{COUNT} spheres, φ = {DILUTE:g}, e = {e:g}"
        source = "Boltzmann's equation by DSMC"
        for k, name in enumerate(("γ̇*", "P_xx/p", "P_yy/p", "P_zz/p", "P_xy/p")):
            value, error = expected[k]
            # χ = 1 + 5φ/2, and a number of particles that is finite.
            doubt = abs(value) * (3 * DILUTE + 1 / COUNT)
            rows.append(compare(system, name, list(found[:, k]), value, source, math.hypot(error, doubt)))
    return rows


MODERATE = math.pi / 12
"""Packing fraction for nσ³ = 1/2."""


def free_time(file: haff.File, report: dict[str, Any]) -> tuple[float, float, float, float]:
    """γ̇ times the mean free time; T, p and P_xy in units of m, σ and γ̇."""
    rows = late(file, 80.0)
    first, last = rows.iloc[0], rows.iloc[-1]
    collisions = last["collisions"] - first["collisions"]
    shear = -0.5 * (rows["pressure_tensor_xy"] + rows["pressure_tensor_yx"]).mean()
    span = last["time"] - first["time"]
    return (
        float(len(file) * span / (2 * collisions)),
        float(rows["temperature"].mean()),
        float(rows["pressure"].mean()),
        float(shear),
    )


def sheared_fluid(context: Context) -> list[Row]:
    """Steady uniform shear at nσ³ = 1/2 (φ = 0.2618), e = 0.9, 1372 spheres, 8 seeds, from strain 80 on. The mean free
    time against the simulation that the authors of DynamO test their program with (M. N. Bannerman, R. Sargant, L. Lue,
    J. Comput. Chem. 32, 3329 (2011); `shearing_test.cpp`: γ̇ t = 0.113195634 over 10⁶ events, with a statistical error
    of about 0.3 %). Temperature, pressure and shear stress against Enskog's equation with an anisotropic Gaussian
    distribution (Jenkins and Richman 1988), which leaves out correlations: its error is put at 2 %.
    """
    settings = {
        "domain.packing_fraction": MODERATE,
        "domain.shear.rate": 1.0,
        "species.0.count": 1372,
        "contact.restitution": 0.9,
        "initial.temperature": 1.3,
        "run.until": 80 + context.effort(800, 80),
        "output.observables": 1.0,
    }
    found = np.array(context.each("sheared", [settings | {"seed": s} for s in context.seeds(8)], free_time))
    system = "1372 spheres, φ = 0.2618, e = 0.9"
    dynamo = 0.113195634
    rows = [compare(system, "γ̇ · mean free time", list(found[:, 0]), dynamo, "DynamO, shearing_test", 0.003 * dynamo)]
    model = theory.uniform_shear_enskog(0.9, MODERATE)
    expected = {"T/(m σ² γ̇²)": model.temperature, "p": model.pressure, "η": model.viscosity}
    for k, (name, value) in enumerate(expected.items(), 1):
        rows.append(compare(system, name, list(found[:, k]), float(value), "Enskog, Gaussian", 0.02 * float(value)))
    return rows


def viscosity_under_shear(file: haff.File, report: dict[str, Any]) -> float:
    """−P_xy/γ̇ at T = 1."""
    rows = late(file, 0.5)
    rate = file.scene["domain"]["shear"]["rate"]
    T = float(rows["temperature"].mean())
    return float(-0.5 * (rows["pressure_tensor_xy"] + rows["pressure_tensor_yx"]).mean() / rate / math.sqrt(T))


def green_kubo(file: haff.File, report: dict[str, Any]) -> float:
    """η/√T of the fluid at rest."""
    rate = enskog_rate(float(file.summary["packing_fraction"]))
    return float(analysis.shear_viscosity(file, 15 / rate, 30 / rate).green_kubo)


def newtonian(context: Context) -> list[Row]:
    """The elastic fluid at φ = 0.2618, 500 spheres, 16 seeds, kept at T = 1 by rescaling the velocities relative to the
    flow 4 times per mean free time: −P_xy/γ̇ at two rates of shear, extrapolated to zero with the square of the rate.
    Against the integral of Green and Kubo for the same fluid at rest.
    """
    eta = MODERATE
    rate = enskog_rate(eta)
    settings = {"species.0.count": 500, "domain.packing_fraction": eta, "measure.stress": True}
    seeds = context.seeds(16)
    rest = {
        "species.0.count": 500,
        "domain.packing_fraction": eta,
        "run.until": context.effort(16000, 400) / rate,
        "output.frames": False,
        "output.observables": 10 / rate,
        "measure.stress_correlation": True,
        "measure.interval": 0.1 / rate,
    }
    expected = np.array(context.each("fluid", [rest | {"seed": seed} for seed in seeds], green_kubo))
    found = []
    reduced = (0.06, 0.12)
    for strain_rate in reduced:
        runs = settings | {
            "contact.restitution": 1.0,
            "initial.temperature": 1.0,
            "domain.shear.rate": strain_rate * rate,
            "drive": [{"kind": "rescale", "temperature": 1.0, "interval": 0.25 / rate}],
            "run.until": context.effort(6000, 400) / rate,
            "output.observables": 10 / rate,
        }
        found.append(context.each("sheared", [runs | {"seed": seed} for seed in seeds], viscosity_under_shear))
    slow, fast = np.array(found)
    a, b = (r**2 for r in reduced)
    limit = (slow * b - fast * a) / (b - a)
    error = float(np.std(expected, ddof=1) / math.sqrt(len(expected)))
    system, source = "500 elastic spheres, φ = 0.2618", "Green and Kubo, this program"
    return [compare(system, "−P_xy/γ̇ for γ̇ → 0", list(limit), float(expected.mean()), source, error)]


PARTS = (
    Part("sheared_gas", "Sheared gas", sheared_gas, 130),
    Part("sheared_fluid", "Sheared fluid", sheared_fluid, 132),
    Part("newtonian", "Viscosity at low rates of shear", newtonian, 134),
)
