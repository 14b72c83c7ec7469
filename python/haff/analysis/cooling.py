"""The cooling law expected for a file's gas."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .. import theory
from ..errors import NotApplicableError
from ..layout import Array
from ..recorded import is_rough
from .checked import checked
from .energies import temperature

if TYPE_CHECKING:
    from ..reader import File


class CoolingLaw(NamedTuple):
    """Haff's law for the gas of a file, without fitted parameters."""

    T0: float
    """Initial temperature [energy]."""
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


@checked
def cooling_law(file: File) -> CoolingLaw:
    """The cooling law expected for the file's gas: a force-free periodic gas with one constant restitution, smooth.

    One species: Enskog rate with the Carnahan–Starling or Henderson contact value and van Noije–Ernst's a₂.
    Mixtures: Enskog rates with BMCSL contact values at equal temperatures, 1/τ = (1 − e²) R/(dN) with R the
    collisions of the whole gas per time; the non-equipartition of cooling mixtures is neglected.

    Raises :class:`NotApplicableError` with the reason where no closed form applies.
    """
    box, d, e = file.box, file.dimension, gas_restitution(file)
    if is_rough(file.scene):
        raise NotApplicableError("Haff's law is for smooth contacts")
    table = file.samples if "observables" in file else None
    if table is not None and len(table.get("temperature", ())) == 0:
        raise NotApplicableError("Haff's law needs samples of the temperature")
    T0 = float(table["temperature"][0]) if table is not None else temperature(file.frames[0])
    if not T0 > 0:
        raise NotApplicableError("nothing moves at the start")
    kinds, counts = np.unique(np.stack([2 * file.radius, file.mass]), axis=1, return_counts=True)
    sigma, mass = kinds
    n = counts / box.volume
    if len(counts) == 1:
        a2 = float(theory.sonine_a2(e, d))
        g0 = float(theory.contact_value(theory.packing_fraction(n[0], sigma[0], d), d))
        omega = float(theory.collision_frequency(n[0], sigma[0], T0, mass[0], g0, d))
        tau = float(theory.haff_time(e, omega, d, a2))
        return CoolingLaw(T0, tau, omega, e, a2, g0, float(theory.critical_length(n[0], sigma[0], e, d)), True)
    if len(counts) > 2000:
        # Rates are computed for all pairs of sizes: a continuous distribution is grouped by rank.
        kinds, n = _grouped(file.radius, file.mass, 200, box.volume)
        sigma, mass = kinds
    total = theory.mixture_rates(n, sigma, mass, T0, d).total * box.volume
    with np.errstate(divide="ignore"):
        tau = float(np.divide(d * len(file), (1 - e**2) * total))
    return CoolingLaw(T0, tau, 2 * total / len(file), e, 0.0, float("nan"), float("nan"), False)


@checked
def gas_restitution(file: File) -> float:
    """The coefficient of restitution of all normal impacts of a periodic gas.

    Raises :class:`NotApplicableError` with the reason if the file is none, or does not have one constant coefficient.
    """
    if not file.box.fully_periodic:
        raise NotApplicableError("Haff's law needs a periodic box")
    if file.shear is not None:
        raise NotApplicableError("Haff's law is for gases at rest, not for sheared ones")
    if not np.all(np.isfinite(file.mass)):
        raise NotApplicableError("Haff's law does not know fixed bodies")
    if len(file) < 10:
        raise NotApplicableError(f"Haff's law needs a gas, not {len(file)} particles")
    contact = file.scene.get("contact", {})
    e = contact.get("restitution", 1.0)
    others = ["sticks" if p.get("sticks") else p.get("restitution", e) for p in contact.get("pair", [])]
    if isinstance(e, dict) or any(o != e for o in others):
        raise NotApplicableError("Haff's law needs one constant coefficient of restitution")
    if file.scene.get("wall"):
        raise NotApplicableError("Haff's law does not know walls")
    return float(e)


def _grouped(radius: Array, mass: Array, groups: int, volume: float) -> tuple[Array, Array]:
    order = np.lexsort((mass, radius))
    parts = np.array_split(order, groups)
    kinds = np.array([[2 * radius[p].mean() for p in parts], [mass[p].mean() for p in parts]])
    return kinds, np.array([len(p) for p in parts]) / volume
