"""Rough gases that cool or are heated, and sheared smooth gases, from the Boltzmann equation by direct Monte Carlo.

Bird's no-time-counter scheme in a homogeneous gas. Candidate pairs are drawn at random and collide with probability
g/bound, g being the relative speed; the line of centers n then has the density ∝ g·n of hard spheres. Candidates
collide in the order in which they were drawn, all that share no particle with an earlier one in one numpy call, so
that collisions have no time step. Heating and shear are exact, and split from the collisions symmetrically: the error
is of second order in the step. Only molecular chaos is assumed, and no code is shared with haff.

Mass and diameter σ are 1. u = R ω stands for the spin: T_rot = I⟨ω²⟩/d_rot = q⟨u²⟩/d_rot, with d_rot = 3 for spheres
and 1 for disks, which are kept as vectors in a plane with spins normal to it.

Cooling and heated smooth gases are in :mod:`validation.boltzmann`.

    PYTHONPATH=tests python -m validation.dsmc cooling     # five cases; also heated, shear, suspension
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .monte_carlo import Array, Gas, Law, collision_rate

COOLING = {
    (0.9, -0.9): (52.018, 0.051),
    (0.9, 0.0): (0.54677, 0.00043),
    (0.8, 0.5): (1.02151, 0.00034),
    (0.7, -0.5): (3.5416, 0.0034),
    (0.95, 0.9): (1.01094, 0.00039),
}
"""T_rot/T_tr of cooling rough spheres and its standard error by (e, β), as the command above prints them."""
HEATED = {
    (0.9, -0.9): (1.00166, 0.00076, 0.01465, 0.00002),
    (0.9, 0.0): (1.00017, 0.00043, 0.21651, 0.00009),
    (0.8, 0.5): (0.99843, 0.00035, 0.45627, 0.00026),
    (0.7, -0.5): (0.99906, 0.00033, 0.08526, 0.00004),
    (0.95, 0.9): (1.00118, 0.00046, 0.84155, 0.00043),
}
"""Of rough spheres heated by white noise, by (e, β), with ``--replicas 8``: T_tr in units of that of
:func:`maxwellian_heated`, and T_rot/T_tr, each followed by its standard error."""

ADDED = {
    (3, 0.7): (9.60536, 0.00181, -0.05314, 0.00013),
    (3, 0.85): (36.50154, 0.00784, -0.03274, 0.00013),
    (3, 0.95): (319.71247, 0.07822, -0.01237, 0.00027),
}
"""T/(m Δ²) and a₂ of :func:`added_speed`, each followed by its standard error, by dimension and e."""
SUSPENSION = {
    0.7: (0.73262, 0.00022, 0.01927, 0.00023),
    0.85: (0.82553, 0.00019, 0.01083, 0.00024),
    0.95: (0.92696, 0.00020, 0.00976, 0.00020),
}
"""T in units of the temperature of the bath and a₂ of :func:`suspension` with its default bath and ``--replicas 8``,
each followed by its standard error, by e."""
HEATED_SPINS = {
    (0.9, 0.0): (1.14453, 0.00048, 0.77907, 0.00039),
    (0.8, 0.5): (1.28845, 0.00048, 1.01926, 0.00065),
    (0.7, -0.5): (1.05718, 0.00039, 1.28519, 0.00067),
}
"""As HEATED, of gases whose spins are heated, too: with ``rotational=True``."""

TABLES = ("cooling", "heated", "shear", "suspension")
CASES = ((0.9, -0.9), (0.9, 0.0), (0.8, 0.5), (0.7, -0.5), (0.95, 0.9))
"""Normal and tangential restitution of the table."""
SHEARED = (0.7, 0.9)
"""Restitution of the sheared gases of the table."""
SHEAR = {
    0.7: ((0.66825, 0.00019), (1.42836, 0.00039), (0.76306, 0.00024), (0.80857, 0.00030), (-0.50422, 0.00017)),
    0.9: ((0.36423, 0.00013), (1.15497, 0.00022), (0.91267, 0.00024), (0.93236, 0.00019), (-0.33171, 0.00015)),
}
"""Reduced rate a*, and P_xx, P_yy, P_zz, P_xy by p, each with its standard error, by e."""
BATCH = 0.05
"""Collisions per particle between two bounds on the relative speed in a gas that cools: no time step."""
HEATING_STEP, SHEAR_STEP = 0.05, 0.025
"""Collisions per particle between two kicks or shears. The error is ∝ step²: at e = 0.7 from 0.5 to 0.25 P_xy/p changes
by 0.0042, a* by 0.0028 and T_tr of the heated gas by 0.0013, so that at these steps 1e-5, 1e-5 and 2e-5 remain."""
SAMPLING = 0.5
"""Collisions per particle between two samples."""


@dataclass(frozen=True)
class Estimate:
    """A mean over independent replicas with its standard error."""

    mean: float
    error: float

    def __str__(self) -> str:
        return f"{self.mean:.5f} ± {self.error:.5f}"


@dataclass(frozen=True)
class Cooling:
    """Cooling state of a rough gas."""

    ratio: Estimate
    """T_rot/T_tr."""
    a2: Estimate
    """d⟨v⁴⟩/((d + 2)⟨v²⟩²) − 1."""
    settle: float
    """Collisions per particle that were left out at the start."""
    drift: float
    """Change of the ratio from the first to the second half of the samples, in standard errors."""


@dataclass(frozen=True)
class Heated:
    """Steady state of a rough gas under white noise."""

    T_tr: Estimate
    ratio: Estimate
    """T_rot/T_tr."""
    a2: Estimate
    """d⟨v⁴⟩/((d + 2)⟨v²⟩²) − 1."""
    settle: float
    """As in :class:`Cooling`."""
    drift: float
    """As in :class:`Cooling`, of T_tr."""


@dataclass(frozen=True)
class Shear:
    """Steady uniform shear flow of smooth spheres; p = nT, P_xy < 0 where the flow along x grows with y."""

    a: Estimate
    """a* = γ/((16/5) √π n σ² √(T/m))."""
    xx: Estimate
    yy: Estimate
    zz: Estimate
    xy: Estimate
    settle: float
    """As in :class:`Cooling`."""
    drift: float
    """As in :class:`Cooling`, of T."""


def maxwellian_cooling_ratio(e: float, beta: float, q: float | None = None, dimension: int = 3) -> float:
    """T_rot/T_tr of the cooling state without friction if velocities and spins were those of Maxwell.

    The positive root of B r² + (C − A) r − B' = 0 of :meth:`Law.rates`. For spheres it is h + √(1 + h²), with
    h = (1+q)²/[2q(1+β)²] [1 − e² − (1−q)/(1+q) (1−β²)].
    """
    a, b, b2, c = Law(e, beta, _inertia(q, dimension)).rates(dimension)
    return (a - c + math.sqrt((a - c) ** 2 + 4 * b * b2)) / (2 * b)


def maxwellian_heated(
    e: float,
    beta: float,
    q: float | None = None,
    dimension: int = 3,
    *,
    strength: float = 1.0,
    density: float = 0.01,
    chi: float = 1.0,
) -> tuple[float, float]:
    """T_tr and T_rot/T_tr of the heated gas in the approximation of :func:`maxwellian_cooling_ratio`.

    B' = C r, and strength = (4/d) ω(T) (A − B r) T.
    """
    a, b, b2, c = Law(e, beta, _inertia(q, dimension)).rates(dimension)
    ratio = b2 / c if c > 0 else 0.0
    loss = 4 / dimension * (a - b * ratio) * collision_rate(1.0, density, chi, dimension)
    if loss <= 1e-12:
        raise ValueError("collisions dissipate nothing: there is no steady state")
    return math.pow(strength / loss, 2 / 3), ratio


def rough_cooling(
    e: float,
    beta: float,
    q: float | None = None,
    friction: float | None = None,
    dimension: int = 3,
    *,
    particles: int = 20_000,
    replicas: int = 16,
    settle: float | None = None,
    collisions: float = 150.0,
    start: float | None = None,
    seed: int = 1,
) -> Cooling:
    """T_rot/T_tr of the homogeneous cooling state of rough spheres (q = 2/5) or disks (q = 1/2).

    g = v₁ − v₂ − n × (R ω₁ + R ω₂), P_n = μ_r (1+e) g_n, P_t = μ_r (1+β) q/(1+q) g_t, at most `friction` P_n
    (Walton's law). The gas starts with T_rot/T_tr = `start`: of Huthmann and Zippelius by default, with friction at
    most 1. Under friction there may be no cooling state. A sliding contact slows a spin by an amount that does not
    grow with the spin, so that the gas cools faster than its few fastest spins, and the ratio grows forever in the
    end: at e = 0.9, β = 0.5, μ = 0.3 some 10 of 20 000 spins do this. Then `drift` and the error are large.
    Samples cover this many `collisions` per particle after `settle`, which by default is 20 and 7 relaxation times of
    the ratio in the Maxwellian approximation. Velocities are scaled back to T_tr = 1 at each sample.
    """
    if beta <= -1:
        raise ValueError("spins of smooth spheres do not change: T_rot/T_tr has no limit")
    law = Law(e, beta, _inertia(q, dimension), friction)
    ratio = maxwellian_cooling_ratio(e, beta, q, dimension)
    if start is None:
        start = ratio if friction is None else min(ratio, 1.0)
    if settle is None:
        a, b, b2, c = _slowest(law).rates(dimension)
        settle = 20 + 7 * dimension / 4 / math.sqrt((a - c) ** 2 + 4 * b * b2)
    # T_tr = 1 where a batch starts.
    span = BATCH / collision_rate(1.0, 1.0, 1.0, dimension)
    runs: list[Array] = []
    for rng in _generators(seed, replicas):
        gas = Gas(rng, law, dimension, particles, 1.0, start)
        samples: list[tuple[float, float]] = []
        done = since = 0.0
        while done < settle + collisions:
            moved = 2 * gas.collide(span) / particles
            done, since = done + moved, since + moved
            if since >= SAMPLING:
                since = 0.0
                gas.center()
                gas.scale(1 / math.sqrt(gas.temperature()))
                if done > settle:
                    samples.append((gas.rotational_temperature(), gas.fourth()))
        gas.check()
        runs.append(np.array(samples))
    return Cooling(
        ratio=_estimate([run[:, 0].mean() for run in runs]),
        a2=_estimate([run[:, 1].mean() for run in runs]),
        settle=settle,
        drift=_drift([run[:, 0] for run in runs]),
    )


def rough_heated(
    e: float,
    beta: float,
    q: float | None = None,
    friction: float | None = None,
    dimension: int = 3,
    *,
    strength: float = 1.0,
    density: float = 0.01,
    chi: float = 1.0,
    rotational: bool = False,
    particles: int = 20_000,
    replicas: int = 16,
    settle: float | None = None,
    collisions: float = 150.0,
    step: float = HEATING_STEP,
    seed: int = 1,
) -> Heated:
    """T_tr and T_rot/T_tr of the gas of :func:`rough_cooling`, its velocities heated by white noise.

    Each component of a velocity gets N(0, strength · dt), the mean over all particles taken out, in steps of `step`
    collisions per particle; with `rotational` each component of u gets N(0, strength · dt/q). `density` is nσ³
    (nσ² of disks), `chi` Enskog's contact value, 1 in the dilute limit. Transient and samples
    as in :func:`rough_cooling`. By dimension, T_tr ∝ (strength/(density chi))^(2/3).
    """
    law = Law(e, beta, _inertia(q, dimension), friction)
    T, ratio = maxwellian_heated(e, beta, q, dimension, strength=strength, density=density, chi=chi)
    if settle is None:
        # The eigenvalues of the linear equations for T_tr, whose loss is ∝ T_tr^(3/2), and for T_rot.
        a, b, b2, c = _slowest(law).rates(dimension)
        matrix = np.array([[1.5 * a - 0.5 * b * ratio, -b], [-b2, c]]) if c > 0 else np.array([[1.5 * a]])
        settle = 20 + 7 * dimension / 4 / float(np.linalg.eigvals(matrix).real.min())
    each = max(round(SAMPLING / step), 1)
    runs: list[Array] = []
    for rng in _generators(seed, replicas):
        gas = Gas(rng, law, dimension, particles, T, ratio * T)

        def heat(dt: float, gas: Gas = gas, rng: np.random.Generator = rng) -> None:
            kick = rng.standard_normal((dimension, particles))
            kick -= kick.mean(axis=1, keepdims=True)
            kick *= math.sqrt(strength * dt)
            gas.v[:dimension] += kick
            if rotational and gas.u is not None and law.q is not None:
                axes = gas.u[gas.spin_axes]
                axes += math.sqrt(strength * dt / law.q) * rng.standard_normal(axes.shape)

        samples: list[tuple[float, float, float]] = []
        dt = step / collision_rate(T, density, chi, dimension)
        for sample in range(math.ceil((settle + collisions) / (each * step))):
            settled = sample * each * step >= settle
            if not settled:
                dt = step / collision_rate(gas.temperature(), density, chi, dimension)
            gas.advance(each, dt, density * chi * dt, heat)
            gas.center()
            if settled:
                samples.append((gas.temperature(), gas.rotational_temperature(), gas.fourth()))
        gas.check()
        runs.append(np.array(samples))
    return Heated(
        T_tr=_estimate([run[:, 0].mean() for run in runs]),
        ratio=_estimate([run[:, 1].mean() / run[:, 0].mean() for run in runs]),
        a2=_estimate([run[:, 2].mean() for run in runs]),
        settle=settle,
        drift=_drift([run[:, 0] for run in runs]),
    )


def maxwellian_added_speed(e: float) -> float:
    """T/(m Δ²) of :func:`added_speed` if velocities were those of Maxwell.

    A contact takes (1 − e²)v²/4 − e v Δ − Δ² in units of m, with ⟨v⟩ = √(πT/m) and ⟨v²⟩ = 4T/m over contacts.
    """
    b = math.sqrt(math.pi) * e
    return ((b + math.sqrt(b * b + 4 * (1 - e * e))) / (2 * (1 - e * e))) ** 2


def added_speed(
    e: float,
    *,
    particles: int = 20_000,
    replicas: int = 16,
    settle: float = 60.0,
    collisions: float = 150.0,
    dimension: int = 3,
    seed: int = 1,
) -> tuple[Estimate, Estimate]:
    """T/(m Δ²) and a₂ of the steady state of a smooth gas whose contacts add 2Δ to their speed, Δ = 1.

    The density sets the scale of time alone. Samples once per collision of a particle, after `settle` of them.
    """
    runs: list[Array] = []
    for rng in _generators(seed, replicas):
        gas = Gas(rng, Law(e, added=1.0), dimension, particles, maxwellian_added_speed(e))
        samples: list[tuple[float, float]] = []
        done = 0.0
        while done < settle + collisions:
            span = 0.5 / collision_rate(gas.temperature(), 1.0, 1.0, dimension)
            done += 2 * gas.collide(span) / particles
            gas.center()
            if done > settle:
                samples.append((gas.temperature(), gas.fourth()))
        gas.check()
        runs.append(np.array(samples))
    return _estimate([run[:, 0].mean() for run in runs]), _estimate([run[:, 1].mean() for run in runs])


def suspension(
    e: float,
    *,
    damping: float = 5.0,
    kicks: float = 50.0,
    particles: int = 20_000,
    replicas: int = 16,
    settle: float = 60.0,
    collisions: float = 150.0,
    step: float = HEATING_STEP,
    seed: int = 1,
) -> tuple[Estimate, Estimate]:
    """T/T_bath and a₂ of smooth spheres in a bath: a drag dv/dt = −v/τ, and kicks at the times of a Poisson process.

    T_bath = ξ²τ/2 is the temperature without collisions. `damping` is the number of collisions of a particle in the
    time τ at T_bath, `kicks` that of its kicks, each N(0, ξ²τ/kicks) for each component. In a step, halves of the decay
    are before and after the kicks: the error is of second order, also that of collisions.
    """
    rate = collision_rate(1.0, 1.0, 1.0, 3)
    tau = damping / rate
    each = max(round(SAMPLING / step), 1)
    runs: list[Array] = []
    for rng in _generators(seed, replicas):
        gas = Gas(rng, Law(e), 3, particles)

        def bath(dt: float, gas: Gas = gas, rng: np.random.Generator = rng) -> None:
            decay = math.exp(-0.5 * dt / tau)
            number = rng.poisson(kicks * dt / tau, particles)
            gas.v *= decay
            gas.v += np.sqrt(2 / kicks * number) * rng.standard_normal((3, particles))
            gas.v *= decay

        samples: list[tuple[float, float]] = []
        dt = step / rate
        for sample in range(math.ceil((settle + collisions) / (each * step))):
            gas.advance(each, dt, dt, bath)
            if sample * each * step >= settle:
                samples.append((gas.temperature(), gas.fourth()))
        gas.check()
        runs.append(np.array(samples))
    return _estimate([run[:, 0].mean() for run in runs]), _estimate([run[:, 1].mean() for run in runs])


def uniform_shear(
    e: float,
    *,
    particles: int = 20_000,
    replicas: int = 16,
    settle: float = 40.0,
    collisions: float = 150.0,
    step: float = SHEAR_STEP,
    seed: int = 1,
) -> Shear:
    """Steady uniform shear flow of smooth inelastic spheres: reduced rate and kinetic pressure tensor.

    Peculiar velocities c = v − γ y x̂ in the Lagrangian frame: ∂f/∂t − γ ∂(c_y f)/∂c_x = J[f, f], that is
    dc_x = −γ c_y dt between collisions. γ is chosen for T = 1 in the kinetic model (Brey, Ruiz-Montero, Moreno 1997;
    a*² = 3ζν²/(2(ν−ζ)), ν = (1+e)(3−e)/4, ζ = 5(1−e²)/12). Transient and samples in collisions per particle.
    """
    if not 0 < e < 1:
        raise ValueError("e must be in (0, 1): an elastic gas heats up under shear")
    nu, zeta = (1 + e) * (3 - e) / 4, 5 * (1 - e * e) / 12
    unit = 16 / 5 * math.sqrt(math.pi)
    gamma = unit * nu * math.sqrt(1.5 * zeta / (nu - zeta))
    each = max(round(SAMPLING / step), 1)
    runs: list[Array] = []
    for rng in _generators(seed, replicas):
        gas = Gas(rng, Law(e), 3, particles)

        def flow(dt: float, gas: Gas = gas) -> None:
            gas.v[0] -= gamma * dt * gas.v[1]

        samples: list[tuple[float, ...]] = []
        dt = step / collision_rate(1.0, 1.0, 1.0, 3)
        for sample in range(math.ceil((settle + collisions) / (each * step))):
            settled = sample * each * step >= settle
            if not settled:
                dt = step / collision_rate(gas.temperature(), 1.0, 1.0, 3)
            gas.advance(each, dt, dt, flow)
            gas.center()
            if settled:
                x, y, z = gas.v
                samples.append(tuple(float(np.vdot(*pair)) / particles for pair in ((x, x), (y, y), (z, z), (x, y))))
        gas.check()
        runs.append(np.array(samples))
    means = np.array([run.mean(axis=0) for run in runs])
    T = means[:, :3].mean(axis=1)
    parts = [_estimate(column / T) for column in means.T]
    return Shear(
        a=_estimate(gamma / (unit * np.sqrt(T))),
        xx=parts[0],
        yy=parts[1],
        zz=parts[2],
        xy=parts[3],
        settle=settle,
        drift=_drift([run[:, :3].mean(axis=1) for run in runs]),
    )


def _inertia(q: float | None, dimension: int) -> float:
    """q = I/(m R²): by default that of a homogeneous sphere or disk."""
    if q is not None:
        return q
    return 0.4 if dimension == 3 else 0.5


def _slowest(law: Law) -> Law:
    """The law without friction, with a β that couples spins no better than the friction: P_t/g_t < μ P_n/⟨g_t⟩."""
    if law.friction is None or law.q is None:
        return law
    sticking = law.q * (1 + law.beta) / (1 + law.q)
    sliding = law.friction * (1 + law.e)
    return Law(law.e, (1 + law.beta) * min(1.0, sliding / max(sticking, 1e-300)) - 1, law.q)


def _generators(seed: int, replicas: int) -> list[np.random.Generator]:
    """An independent stream for each replica."""
    return [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(replicas)]


def _estimate(values: Sequence[float] | Array) -> Estimate:
    """Mean and standard error of one value of each replica."""
    found = np.asarray(values, float)
    return Estimate(float(found.mean()), float(found.std(ddof=1) / math.sqrt(len(found))))


def _drift(runs: Sequence[Array]) -> float:
    """Mean of the second half less that of the first, in standard errors."""
    change = _estimate([float(run[len(run) // 2 :].mean() - run[: len(run) // 2].mean()) for run in runs])
    return change.mean / change.error if change.error > 0 else 0.0


def main(arguments: Sequence[str] | None = None) -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description="Direct Monte Carlo solution of the Boltzmann equation.")
    parser.add_argument("tables", nargs="*", default=["cooling", "heated", "shear"], metavar="|".join(TABLES))
    parser.add_argument("--dimension", type=int, default=3, choices=(2, 3), help="of the rough gases")
    parser.add_argument("--friction", type=float, help="Coulomb's coefficient of the rough gases")
    parser.add_argument("--particles", type=int, default=20_000, help="of each replica")
    parser.add_argument("--replicas", type=int, default=16)
    parser.add_argument("--collisions", type=float, default=150.0, help="per particle, of which samples are taken")
    parser.add_argument("--step", type=float, help="collisions per particle between kicks or shears")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args(arguments)
    if unknown := set(given.tables) - set(TABLES):
        parser.error(f"no such table: {', '.join(sorted(unknown))}")
    size = {"particles": given.particles, "replicas": given.replicas, "seed": given.seed}

    def show(system: str, row: str, began: float) -> None:
        print(f"{system:24} {row}  ({time.perf_counter() - began:.0f} s)", flush=True)

    for e, beta in CASES if "cooling" in given.tables else ():
        began = time.perf_counter()
        cool = rough_cooling(e, beta, None, given.friction, given.dimension, collisions=given.collisions, **size)
        theory = maxwellian_cooling_ratio(e, beta, None, given.dimension)
        row = f"T_rot/T_tr = {cool.ratio}, Maxwellian {theory:.5f}; a₂ = {cool.a2}"
        show(f"cooling e={e:g} β={beta:g}", f"{row}; settle {cool.settle:.0f}, drift {cool.drift:+.1f}", began)
    for e, beta in CASES if "heated" in given.tables else ():
        began = time.perf_counter()
        # Strength and density of T_tr = 1 in the Maxwellian approximation.
        unit, theory = maxwellian_heated(e, beta, None, given.dimension)
        heat = rough_heated(
            e,
            beta,
            None,
            given.friction,
            given.dimension,
            strength=unit**-1.5,
            collisions=given.collisions,
            step=given.step or HEATING_STEP,
            **size,
        )
        row = f"T_tr/Maxwellian = {heat.T_tr}, T_rot/T_tr = {heat.ratio}, Maxwellian {theory:.5f}; a₂ = {heat.a2}"
        show(f"heated e={e:g} β={beta:g}", f"{row}; settle {heat.settle:.0f}, drift {heat.drift:+.1f}", began)
    for e in SHEARED if "shear" in given.tables else ():
        began = time.perf_counter()
        shear = uniform_shear(e, collisions=given.collisions, step=given.step or SHEAR_STEP, **size)
        row = f"a* = {shear.a}, P/p: xx {shear.xx}, yy {shear.yy}, zz {shear.zz}, xy {shear.xy}"
        show(f"shear e={e:g}", f"{row}; settle {shear.settle:.0f}, drift {shear.drift:+.1f}", began)
    for e in SUSPENSION if "suspension" in given.tables else ():
        began = time.perf_counter()
        T, a2 = suspension(e, collisions=given.collisions, step=given.step or HEATING_STEP, **size)
        show(f"suspension e={e:g}", f"T/T_bath = {T}, a₂ = {a2}", began)


if __name__ == "__main__":
    main()
