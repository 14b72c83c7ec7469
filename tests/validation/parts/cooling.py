"""The homogeneous cooling state: Haff's rate and the velocity distribution; viscoelastic spheres."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

import haff
from haff import theory

from .. import boltzmann
from ..registry import Part
from ..rows import Row, compare
from ..runs import Context

ETA, COUNT = 0.005, 8000
"""Packing fraction of the gases that cool; number of particles, of configs/validation/cooling.toml."""
RESTITUTIONS = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)
SETTLE = 8
"""Collisions per particle until a₂ has its value of the cooling state."""
CORRELATED, CORRELATED_ERROR = 0.22, 0.02
"""What correlated velocities add to a₂, in units of φ (1 − e²): with ETA = 0.02 these runs have 0.0031 ± 0.0005,
0.0024 ± 0.0003, 0.0016 ± 0.0003 and 0.0006 ± 0.0005 more than the Boltzmann equation at e = 0.5, 0.7, 0.8 and 0.9."""
COEFFICIENT, LATE = 0.01, (30.0, 3000.0)
"""Of the viscoelastic gas: δ at unit speed, and where its power law is fitted, in units of its first cooling time."""


def omega(count: int = COUNT) -> float:
    """Enskog's collisions per particle and time at T = 1."""
    n = theory.number_density(ETA, 1.0)
    g0 = theory.periodic_contact_value(ETA, count, 3, "klm")
    return float(theory.collision_frequency(n, 1.0, 1.0, 1.0, g0) * theory.periodic_rate_factor(count))


def schedule(e: float, collisions: float, per_sample: float = 1.0) -> dict[str, Any]:
    """Length of a run, and samples about `per_sample` collisions per particle apart at all temperatures."""
    tau = float(theory.haff_time(e, omega()))
    settings: dict[str, Any] = {
        "contact.restitution": e,
        "domain.packing_fraction": ETA,
        "run.collisions_per_particle": collisions,
    }
    growth = per_sample / (omega() * tau)
    if growth * collisions < 1.5:
        # T is nearly constant: equal times are equal numbers of collisions.
        return settings | {"output.observables": tau * math.expm1(growth * collisions) / collisions * per_sample}
    return settings | {"output.observables": {"log": [tau * math.expm1(growth), math.exp(growth)]}}


def cooling_state(file: haff.File, report: dict[str, Any]) -> tuple[float, float]:
    """1/τ at T = 1, and a₂, each averaged over collisions in the stationary state."""
    table = file.observables
    done = 2 * table["collisions"].to_numpy() / len(file)
    table, done = table[done >= SETTLE], done[done >= SETTLE]
    # √(1/T) grows by Δt/τ, τ at T = 1, in every interval; intervals count by their collisions.
    inverse = 1 / np.sqrt(table["temperature"].to_numpy())
    weight = np.diff(done)
    rate = np.average(np.diff(inverse) / np.diff(table["time"].to_numpy()), weights=weight)
    return float(rate), float(np.average(table["sonine_a2"].to_numpy()[1:], weights=weight))


@functools.cache
def _measured(binary: Any, quick: bool) -> dict[float, list[tuple[float, float]]]:
    """Filled by `cooling_states`: both parts use the same runs."""
    return {}


def cooling_states(context: Context) -> dict[float, list[tuple[float, float]]]:
    """Rate and a₂ of every run, by restitution."""
    found = _measured(context.binary, context.quick)
    for e in RESTITUTIONS:
        if e not in found:
            settings = schedule(e, SETTLE + context.effort(170, 12))
            seeds = context.seeds(16)
            found[e] = context.each("cooling", [settings | {"seed": seed} for seed in seeds], cooling_state)
    return found


def haff_rate(context: Context) -> list[Row]:
    """1/τ of T = T₀/(1 + t/τ)² from the growth of T^(−1/2) between samples a collision per particle apart,
    after 8 collisions per particle, 16 seeds each. Against (1 − e²) ω₀ (1 + 3a₂/16)/6 with Enskog's ω₀ and a₂
    of the Boltzmann equation. The theory assumes that the velocities of a colliding pair are
    uncorrelated. They are not quite: at φ = 0.05 the rate is off by 0.3 % at e = 0.9 and by 3 % at 0.6; in
    proportion to density that is the stated uncertainty.
    """
    rows = []
    for e, found in cooling_states(context).items():
        a2, _ = boltzmann.A2[e]
        expected = 1 / float(theory.haff_time(e, omega(), 3, a2))
        # Correlated velocities: 0.3 % at e = 0.9 and 3 % at 0.6 where φ = 0.05, as (1 − e²)², and in proportion to φ.
        chaos = 1.6 * ETA * (1 - e**2) ** 2
        doubt = expected * math.hypot(chaos, 1e-4)
        source = "Enskog, a₂ of Boltzmann's equation"
        system = f"{COUNT} spheres, φ = {ETA:g}, e = {e:g}"
        rows.append(compare(system, "1/τ at T = 1", [rate for rate, _ in found], expected, source, doubt))
    return rows


def velocity_distribution(context: Context) -> list[Row]:
    """a₂ = 3⟨v⁴⟩/5⟨v²⟩² − 1 in the same runs, against the Boltzmann equation, solved by direct simulation Monte
    Carlo (`tests/validation/boltzmann.py`). The formulas of van Noije and Ernst (1998) and of Montanero and
    Santos (2000) leave out higher coefficients, and are off by up to 0.005 and 0.002. Correlated velocities add
    to a₂ in proportion to density, 0.0024 ± 0.0003 at φ = 0.02 and e = 0.7: from there as (0.22 ± 0.02) φ (1 − e²),
    which is part of the expectation. The elastic rows are exact: velocities of N spheres are spread evenly over the
    sphere of their energy.
    """
    rows = []
    for e, found in cooling_states(context).items():
        a2, error = boltzmann.A2[e]
        expected = a2 + CORRELATED * ETA * (1 - e**2)
        doubt = math.hypot(error, CORRELATED_ERROR * ETA * (1 - e**2))
        system = f"{COUNT} spheres, φ = {ETA:g}, e = {e:g}"
        rows.append(compare(system, "a₂", [a2 for _, a2 in found], expected, "Boltzmann's equation, DSMC", doubt))
    return rows + elastic_distribution(context)


def elastic_moments(file: haff.File, report: dict[str, Any]) -> tuple[float, float]:
    """a₂ of the velocities, and ⟨v_n⁴⟩/⟨v_n²⟩² of the approach speeds of all collisions, without the first tenth."""
    late = file.observables[file.observables["time"] > 0.1 * report["simulated_time"]]
    speed = file.events["approach_speed"]
    square = speed[len(speed) // 10 :] ** 2
    return float(late["sonine_a2"].mean()), float(np.mean(square**2) / np.mean(square) ** 2)


def elastic_distribution(context: Context) -> list[Row]:
    """Velocities on the sphere of constant energy and no momentum: exact."""
    count, collisions = 100, context.effort(8000, 800)
    rate = float(theory.collision_frequency(theory.number_density(0.3, 1.0), 1.0, g0=theory.contact_value(0.3)))
    settings = {
        "domain.packing_fraction": 0.3,
        "species.0.count": count,
        "run.until": collisions / rate,
        "output.observables": 1 / rate,
        "output.events": {"columns": ["approach_speed"]},
    }
    found = context.each("fluid", [settings | {"seed": seed} for seed in context.seeds(8)], elastic_moments)
    f = 3 * (count - 1)
    # One velocity: its three components, (1 − 1/N) of the radius each; |v|⁴ over a sphere in f dimensions.
    a2 = f / (f + 2) - 1
    # The flux weights a component u by |u|: u² has a beta distribution with the exponents 1 and (f − 1)/2.
    speeds = 2 * (f + 1) / (f + 3)
    system = f"{count} spheres, φ = 0.3, e = 1"
    exact = "microcanonical, exact"
    return [
        compare(system, "a₂", [a for a, _ in found], a2, exact),
        compare(system, "⟨v_n⁴⟩/⟨v_n²⟩² of collisions", [s for _, s in found], speeds, exact),
    ]


def power_law(file: haff.File, report: dict[str, Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times and temperatures."""
    table = file.observables
    return table["time"].to_numpy(), table["temperature"].to_numpy()


def viscoelastic(context: Context) -> list[Row]:
    """A gas whose restitution tends to 1 at low speed cools as t^(−5/3) in the end (Schwager and Pöschel
    1998; Brilliantov and Pöschel 2000). Against the kinetic equation with Maxwell velocities
    (`haff.theory.cooling_curve`), whose uncertainty is what a₂ ≈ −0.5 δ would change, and against the
    exponent, in a fit to ln(t + 5τ/3); higher orders of δ bend the curve by an amount that the kinetic
    equation gives.
    """
    count = 1000
    rate = omega(count)

    def restitution(speed: NDArray[np.float64]) -> NDArray[np.float64]:
        return theory.viscoelastic_restitution_pade(speed, COEFFICIENT)

    # The first cooling time, T/|dT/dt| at the start.
    step = 1e-3 / rate
    tau = -step / math.log(float(theory.cooling_curve([step], 1.0, rate, restitution)[0]))
    end = context.effort(int(LATE[1]), 100) * tau
    factor = 10 ** (1 / 12)
    settings = {"run.until": end, "output.observables": {"log": [0.1 * tau, factor]}, "species.0.count": count}
    found = context.each("viscoelastic", [settings | {"seed": seed} for seed in context.seeds(8)], power_law)
    times = found[0][0]
    expected = theory.cooling_curve(times, 1.0, rate, restitution)
    system = f"{count} spheres, φ = {ETA:g}, δ = {COEFFICIENT:g} v^(1/5)"
    # Neglected: a₂, which is about −0.4 · 1.15 δ here, so 1e-3 of the rate, and that to the power 5/3 of T.
    doubt = 2e-3
    rows = []
    for multiple in (1, 10, 100, 1000):
        if multiple * tau > end:
            break
        k = int(np.argmin(np.abs(times - multiple * tau)))
        rows.append(
            compare(
                system,
                f"T at t = {times[k] / tau:.3g} τ",
                [T[k] for _, T in found],
                expected[k],
                "kinetic equation, Maxwell",
                doubt * expected[k],
            )
        )

    late = (times >= min(LATE[0], 0.3 * end / tau) * tau) & (times <= end)

    def slope(T: NDArray[np.float64]) -> float:
        return float(np.polyfit(np.log(times[late] + offset), np.log(T[late]), 1)[0])

    # T ∝ (t + t₀)^(−5/3) exactly where 1 − e² ∝ v^(1/5); t₀ from the start of the curve. Higher powers of δ bend
    # the logarithm, by the amount found for the curve of the kinetic equation.
    offset = 5 / 3 * tau
    bend = slope(expected) + 5 / 3
    rows.append(
        compare(
            system,
            f"d ln T/d ln t, {LATE[0]:g} to {end / tau:g} τ, − {bend:+.4f} of higher orders",
            [slope(T) - bend for _, T in found],
            -5 / 3,
            "Schwager–Pöschel, −5/3",
            5e-4,
        )
    )
    return rows


PARTS = (
    Part("haff_rate", "Haff's rate", haff_rate, 50),
    Part("velocity_distribution", "Velocity distribution", velocity_distribution, 60),
    Part("viscoelastic", "Viscoelastic spheres", viscoelastic, 70),
)
