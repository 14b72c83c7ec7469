"""Conduction of heat in the elastic fluid: its coefficient, and a dilute gas between plates with jumps at the walls."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ._common import Array, check_dimension, numeric
from .equilibrium import contact_value, packing_fraction

# Factors of higher Sonine polynomials over the first approximation: Chapman and Cowling; Gass (1971).
_CONDUCTIVITY = {3: 1.02513, 2: 1.029}

# Jump of the temperature at a wall with complete accommodation in units of the mean free path: hard spheres, from the
# linearized Boltzmann equation (Sone, Ohwada, Aoki 1989: d₁ = 2.4001, times √π/2).
_JUMP = 2.4001 * np.sqrt(np.pi) / 2


@numeric
def thermal_conductivity(
    n: ArrayLike,
    sigma: ArrayLike,
    T: ArrayLike = 1.0,
    m: ArrayLike = 1.0,
    g0: ArrayLike | None = None,
    d: int = 3,
) -> Array:
    r"""Thermal conductivity [1/(length^(d−2) time)] of elastic spheres or disks by Enskog's theory.

    .. math:: \lambda_E = \lambda_0 \Bigl[\frac1{g_0} + \frac65 y' + 0.7574\,y'^2 g_0\Bigr],\qquad
              \lambda_0 = 1.02513\cdot\frac{75}{64\sigma^2}\sqrt{\frac{T}{\pi m}},\quad y' = \tfrac23\pi n\sigma^3

    (Chapman and Cowling); of disks :math:`\lambda_0 = 1.029\cdot\frac2\sigma\sqrt{T/\pi m}` and
    :math:`1/g_0 + \frac32 y' + 0.8718\,y'^2 g_0` with :math:`y' = \frac12\pi n\sigma^2` (Gass 1971). The flow of
    heat is :math:`q = -\lambda\,\nabla T`, with temperatures as energies.

    Parameters
    ----------
    g0
        Contact value; default :func:`contact_value`.
    """
    d = check_dimension(d)
    n, sigma, T, m = (np.asarray(x, float) for x in (n, sigma, T, m))
    g = np.asarray(contact_value(packing_fraction(n, sigma, d), d) if g0 is None else g0, float)
    factor = _CONDUCTIVITY[d]
    if d == 3:
        covolume = 2 / 3 * np.pi * n * sigma**3
        dilute = factor * 75 / 64 * np.sqrt(T / (np.pi * m)) / sigma**2
        return dilute * (1 / g + 1.2 * covolume + (9 / 25 + 32 / (25 * np.pi * factor)) * covolume**2 * g)
    covolume = 1 / 2 * np.pi * n * sigma**2
    dilute = factor * 2 * np.sqrt(T / (np.pi * m)) / sigma
    return dilute * (1 / g + 1.5 * covolume + (9 / 16 + 1 / (np.pi * factor)) * covolume**2 * g)


@numeric
def temperature_jump(n: ArrayLike, sigma: ArrayLike, accommodation: ArrayLike = 1.0) -> Array:
    r"""Length by which a wall seems to be farther away for the flow of heat in a dilute gas of spheres [length].

    .. math:: T_\mathrm{gas} - T_\mathrm{wall} = \zeta\,\frac{\partial T}{\partial x_n},\qquad
              \zeta = \frac{2 - \alpha}\alpha\,2.127\,\ell

    with the mean free path :math:`\ell = 1/(\sqrt2\,\pi n\sigma^2)`: the profile of the temperature away from the wall,
    continued to it, ends at this temperature. 2.127 is that of the linearized Boltzmann equation for complete
    accommodation α = 1 (Sone, Ohwada, Aoki 1989); the dependence on α is Maxwell's, which is an approximation.

    Parameters
    ----------
    n
        Number density at the wall.
    """
    n, sigma, accommodation = (np.asarray(x, float) for x in (n, sigma, accommodation))
    path = 1 / (np.sqrt(2) * np.pi * n * sigma**2)
    return (2 - accommodation) / accommodation * _JUMP * path


@numeric
def heat_flux(
    hot: ArrayLike,
    cold: ArrayLike,
    width: ArrayLike,
    n: ArrayLike,
    sigma: ArrayLike,
    m: ArrayLike = 1.0,
    accommodation: ArrayLike = 1.0,
) -> Array:
    r"""Heat that flows through a dilute gas of spheres between two plates, per area and time.

    .. math:: q = \frac23\,\lambda_1\,\frac{T_h^{3/2} - T_c^{3/2}}{L + \zeta_h + \zeta_c}

    with the conductivity :math:`\lambda_1\sqrt T` of :func:`thermal_conductivity` at low density and the lengths
    :math:`\zeta` of :func:`temperature_jump`, of the densities at uniform pressure. Of first order in the mean free
    path over the distance of the plates.

    Parameters
    ----------
    hot, cold
        Temperatures of the plates [energy].
    width
        Distance L between the places where the centers of spheres touch the plates [length]: that of the plates less a
        diameter.
    n
        Mean number density between these places.
    """
    hot, cold, width, n, sigma, m = (np.asarray(x, float) for x in (hot, cold, width, n, sigma, m))
    # T^(3/2) is linear in the place, and n T is uniform: the mean of 1/T over the place is n̄/p.
    with np.errstate(invalid="ignore", divide="ignore"):
        inverse = 3 * (np.sqrt(hot) - np.sqrt(cold)) / (hot**1.5 - cold**1.5)
    inverse = np.where(hot == cold, 1 / hot, inverse)
    jumps = sum(temperature_jump(n / (inverse * T), sigma, accommodation) for T in (hot, cold))
    unit = _CONDUCTIVITY[3] * 75 / 64 / (np.sqrt(np.pi * m) * sigma**2)
    return 2 / 3 * unit * (hot**1.5 - cold**1.5) / (width + jumps)
