"""The cooling law expected for a file's gas, and the steady state of a heated one."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .. import theory
from ..errors import NotApplicableError
from ..files.layout import Array
from . import conditions
from .checked import checked
from .energies import temperature

if TYPE_CHECKING:
    from ..files.recording import Recording

FIRST = 1.0
"""Collisions per particle from which on the law is fitted: a lattice delays the first ones."""
DEVIATION = 0.1
"""Relative deviation of the temperature from Haff's law from which on the law does not hold, beside noise."""


class CoolingLaw(NamedTuple):
    """Haff's law for the gas of a file, without fitted parameters: T(t) = T₀/(1 + (t − start)/τ)²."""

    T0: float
    """Temperature at ``start`` [energy]."""
    tau: float
    """Time constant [time]; infinite if elastic."""
    omega0: float
    """Collisions per particle and time at T0, without the a₂ factor [1/time]."""
    restitution: float
    """The one coefficient of restitution."""
    a2: float
    """Sonine coefficient of the homogeneous cooling state; 0 for mixtures, whose theory here is Maxwellian."""
    contact_value: float
    """g₀ of one species, NaN for a mixture."""
    critical_length: float
    """Box side above which the gas becomes unstable [length]; NaN for a mixture."""
    monodisperse: bool
    """Whether all particles have one radius and one mass."""
    start: float = 0.0
    """Time of the first sample [time]: above 0 in a file that goes on from another run with changed keys."""

    def temperature(self, time: Array) -> Array:
        """T at times from ``start`` on [energy]."""
        return theory.haff_temperature(np.asarray(time) - self.start, self.T0, self.tau)


class Fit(NamedTuple):
    """Haff's law fitted to the samples for which it holds."""

    tau: float
    """τ of T = T₀/(c + (t − start)/τ)² [time]."""
    until: float
    """Last time of the fit [time]."""
    complete: bool
    """Whether the law holds up to the last sample."""


class HeatedState(NamedTuple):
    """Steady state of a gas heated by white noise, without fitted parameters."""

    temperature: float
    """T [energy]."""
    a2: float
    """Sonine coefficient."""


@checked
def cooling_law(file: Recording) -> CoolingLaw:
    """The cooling law expected for the file's gas.

    It needs the conditions of :data:`.conditions.HAFF`: a periodic box at rest, without walls, fixed bodies, joints
    and drives; particles that start as a homogeneous fluid at one temperature; and smooth contacts with one constant
    restitution, short against the mean free time if the TC model is on.

    One species: Enskog rate with the Carnahan–Starling or Henderson contact value and van Noije–Ernst's a₂.
    Mixtures: Enskog rates with BMCSL contact values at equal temperatures, 1/τ = (1 − e²) R/(dN) with R the
    collisions of the whole gas per time; the non-equipartition of cooling mixtures is neglected.

    A file of a run that went on with changed keys has the law from its first sample on.

    Raises :class:`NotApplicableError` with the reason where no closed form applies.
    """
    conditions.require(file, "Haff's law", conditions.HAFF)
    box, d, e = file.box, file.dimension, conditions.restitution(file) or 0.0
    table = file.samples if "observables" in file else None
    if table is not None and len(table.get("temperature", ())) == 0:
        raise NotApplicableError("Haff's law needs samples of the temperature")
    T0 = float(table["temperature"][0]) if table is not None else temperature(file.frames[0])
    if not T0 > 0:
        raise NotApplicableError("nothing moves at the start")
    begin = conditions.start(file)
    kinds, counts = np.unique(np.stack([2 * file.radius, file.mass]), axis=1, return_counts=True)
    sigma, mass = kinds
    n = counts / box.volume
    if len(counts) == 1:
        a2 = float(theory.sonine_a2(e, d))
        g0 = float(theory.contact_value(theory.packing_fraction(n[0], sigma[0], d), d))
        omega = float(theory.collision_frequency(n[0], sigma[0], T0, mass[0], g0, d))
        tau = float(theory.haff_time(e, omega, d, a2))
        return CoolingLaw(T0, tau, omega, e, a2, g0, float(theory.critical_length(n[0], sigma[0], e, d)), True, begin)
    if len(counts) > 2000:
        # Rates are computed for all pairs of sizes: a continuous distribution is grouped by rank.
        kinds, n = _grouped(file.radius, file.mass, 200, box.volume)
        sigma, mass = kinds
    total = theory.mixture_rates(n, sigma, mass, T0, d).total * box.volume
    with np.errstate(divide="ignore"):
        tau = float(np.divide(d * len(file), (1 - e**2) * total))
    return CoolingLaw(T0, tau, 2 * total / len(file), e, 0.0, float("nan"), float("nan"), False, begin)


def fitted(file: Recording, law: CoolingLaw) -> Fit | None:
    """τ from √(T₀/T) = c + (t − start)/τ, after ``FIRST`` collisions per particle and as long as Haff's law holds.

    It holds up to the first sample whose temperature differs from the law with the τ of theory by more than
    ``DEVIATION`` and a standard deviation √(2/(dN)) of the temperature of N particles. Relative deviations have the
    same weight at all times. ``None`` for fewer than four samples.
    """
    table = file.samples
    if "collisions" not in table:
        return None
    since = table["collisions"] - table["collisions"][0]
    chosen = (2 * since >= FIRST * len(file)) & (table["temperature"] > 0)
    t, T = table["time"][chosen], table["temperature"][chosen]
    allowed = DEVIATION + np.sqrt(2 / (file.dimension * len(file)))
    off = np.abs(T / law.temperature(t) - 1) > allowed
    count = int(np.argmax(off)) if off.any() else len(t)
    if count < 4:
        return None
    root = np.sqrt(law.T0 / T[:count])
    slope, _ = np.polyfit(t[:count] - law.start, root, 1, w=1 / root)
    return Fit(float(1 / slope), float(t[count - 1]), count == len(t)) if slope > 0 else None


@checked
def heated_state(file: Recording) -> HeatedState:
    """The steady state expected for a gas heated by white noise, by Enskog's theory.

    It needs the conditions of :data:`.conditions.HEATED`: those of :func:`cooling_law` for equal particles, but
    with white noise on all of them and no other drive, whose kicks are more frequent than collisions. The temperature
    is :func:`haff.theory.heated_temperature` with the Carnahan–Starling or Henderson contact value, a₂ is
    :func:`haff.theory.sonine_a2_heated`.

    Raises :class:`NotApplicableError` with the reason where no closed form applies.
    """
    conditions.require(file, "the theory of a heated gas", conditions.HEATED)
    d, e = file.dimension, conditions.restitution(file) or 0.0
    sigma, mass, n = 2 * float(file.radius[0]), float(file.mass[0]), len(file) / file.box.volume
    strength = float(file.scene["drive"][0].get("strength", 0.0))
    g0 = theory.contact_value(theory.packing_fraction(n, sigma, d), d)
    T = theory.heated_temperature(strength, e, n, sigma, mass, g0, d)
    return HeatedState(float(T), float(theory.sonine_a2_heated(e, d)))


@checked
def gas_restitution(file: Recording) -> float:
    """The coefficient of restitution of all normal impacts of a periodic gas.

    Raises :class:`NotApplicableError` with the reason if the file is none, or does not have one constant coefficient.
    """
    conditions.require(file, "a gas with one restitution", conditions.IMPACTS_OF_A_GAS)
    return conditions.restitution(file) or 0.0


def _grouped(radius: Array, mass: Array, groups: int, volume: float) -> tuple[Array, Array]:
    order = np.lexsort((mass, radius))
    parts = np.array_split(order, groups)
    kinds = np.array([[2 * radius[p].mean() for p in parts], [mass[p].mean() for p in parts]])
    return kinds, np.array([len(p) for p in parts]) / volume
