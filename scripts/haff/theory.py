r"""Kinetic theory of smooth inelastic hard spheres and disks.

Closed forms to hold a simulation against. All functions are vectorised: every number may be an array,
and arrays broadcast. Units are those of the scene with :math:`k_B = 1`; temperatures are energies,
:math:`T = m\langle|v - V|^2\rangle/d` in ``d`` dimensions.

====================  ==========================================================================
symbol                meaning
====================  ==========================================================================
``d``                 dimension, 2 (disks) or 3 (spheres)
``n``                 number density, particles per volume (3D) or area (2D)
``eta``               packing fraction, :math:`\pi n\sigma^3/6` (3D) or :math:`\pi n\sigma^2/4` (2D)
``sigma``             diameter
``e``                 coefficient of restitution, in [0, 1]
``T``, ``m``          temperature [energy] and mass
====================  ==========================================================================

Sources
-------
* N. F. Carnahan, K. E. Starling, *J. Chem. Phys.* **51**, 635 (1969)
* D. Henderson, *Mol. Phys.* **30**, 971 (1975)
* J. Kolafa, S. Labík, A. Malijevský, *Phys. Chem. Chem. Phys.* **6**, 2335 (2004)
* P. K. Haff, *J. Fluid Mech.* **134**, 401 (1983)
* T. P. C. van Noije, M. H. Ernst, *Granular Matter* **1**, 57 (1998)
* T. Boublík, *J. Chem. Phys.* **53**, 471 (1970); G. A. Mansoori et al., *ibid.* **54**, 1523 (1971) (BMCSL)
* A. Santos, S. B. Yuste, M. López de Haro, *J. Chem. Phys.* **123**, 234512 (2005)
* J. T. Jenkins, F. Mancini, *J. Appl. Mech.* **54**, 27 (1987)
* J. F. Lutsko, *Phys. Rev. E* **63**, 061211 (2001)
* N. V. Brilliantov, T. Pöschel, *Kinetic Theory of Granular Gases*, Oxford (2004)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "MixtureRates",
    "carnahan_starling",
    "collision_frequency",
    "compressibility",
    "contact_value",
    "contact_value_after_collision",
    "critical_length",
    "haff_temperature",
    "haff_time",
    "henderson",
    "kolafa_labik_malijevsky",
    "loss_distribution",
    "maxwell_component",
    "mean_free_time",
    "mixture_contact_values",
    "mixture_rates",
    "number_density",
    "packing_fraction",
    "sonine_a2",
    "sonine_component",
    "sonine_polynomial",
    "viscoelastic_restitution",
]

Array = NDArray[np.float64]


def _dimension(d: int) -> int:
    if d not in (2, 3):
        raise ValueError(f"d = {d} must be 2 or 3")
    return d


# --- density -----------------------------------------------------------------------------------


def packing_fraction(n: ArrayLike, sigma: ArrayLike, d: int = 3) -> Array:
    r"""Packing fraction, :math:`\eta = \pi n\sigma^3/6` (3D) or :math:`\pi n\sigma^2/4` (2D)."""
    n, sigma = np.asarray(n, float), np.asarray(sigma, float)
    return np.pi * n * sigma**3 / 6 if _dimension(d) == 3 else np.pi * n * sigma**2 / 4


def number_density(eta: ArrayLike, sigma: ArrayLike, d: int = 3) -> Array:
    """Number density of a packing fraction: the inverse of :func:`packing_fraction`."""
    eta, sigma = np.asarray(eta, float), np.asarray(sigma, float)
    return 6 * eta / (np.pi * sigma**3) if _dimension(d) == 3 else 4 * eta / (np.pi * sigma**2)


# --- equilibrium structure and pressure ----------------------------------------------------------


def carnahan_starling(eta: ArrayLike) -> Array:
    r"""Contact value of 3D spheres, :math:`g_0 = (1 - \eta/2)/(1 - \eta)^3` (Carnahan–Starling 1969).

    Low by about 0.3 % in pressure at mid density.
    """
    eta = np.asarray(eta, float)
    return (1 - eta / 2) / (1 - eta) ** 3


def henderson(eta: ArrayLike) -> Array:
    r"""Contact value of 2D disks, :math:`g_0 = (1 - 7\eta/16)/(1 - \eta)^2` (Henderson 1975).

    High by 0.14 % in pressure at :math:`\eta = 0.4` and by 0.5 % at 0.5.
    """
    eta = np.asarray(eta, float)
    return (1 - 7 * eta / 16) / (1 - eta) ** 2


# Coefficients of x^k, x = η/(1 − η): modified Kolafa–Labík–Malijevský equation of state.
_KLM = {
    0: 1.0,
    1: 4.0,
    2: 6.0,
    3: 2.3647684,
    4: -0.8698551,
    5: 1.1062803,
    6: -1.1014221,
    7: 0.66605866,
    8: -0.03633431,
    10: -0.20965164,
    14: 0.10555569,
    22: -0.0087238,
}


def kolafa_labik_malijevsky(eta: ArrayLike) -> Array:
    r"""Compressibility :math:`Z = PV/NT` of the elastic 3D fluid, good to about 4e-5.

    Modified equation of Kolafa, Labík and Malijevský (2004), a polynomial in
    :math:`x = \eta/(1 - \eta)`; fluid phase only, :math:`\eta < 0.494`.
    """
    eta = np.asarray(eta, float)
    x = eta / (1 - eta)
    return sum(c * x**k for k, c in _KLM.items()) + np.zeros_like(x)


def contact_value(eta: ArrayLike, d: int = 3, equation: str | None = None) -> Array:
    r"""Pair distribution at contact, :math:`g_0 = g(\sigma^+)`, of the elastic fluid.

    Parameters
    ----------
    equation
        ``"carnahan-starling"`` or ``"klm"`` in 3D (default: the former), ``"henderson"`` in 2D.
        ``"klm"`` takes :math:`g_0 = (Z - 1)/(4\eta)` from :func:`kolafa_labik_malijevsky`, and 1 at
        :math:`\eta = 0`.
    """
    equation = equation or ("carnahan-starling" if _dimension(d) == 3 else "henderson")
    if (d, equation) == (3, "carnahan-starling"):
        return carnahan_starling(eta)
    if (d, equation) == (3, "klm"):
        eta = np.asarray(eta, float)
        safe = np.where(eta > 0, eta, 1e-3)
        return np.where(eta > 0, (kolafa_labik_malijevsky(safe) - 1) / (4 * safe), 1.0)
    if (d, equation) == (2, "henderson"):
        return henderson(eta)
    raise ValueError(f"no equation of state {equation!r} in d = {d}: carnahan-starling, klm (3D), henderson (2D)")


def contact_value_after_collision(g0: ArrayLike, e: ArrayLike) -> Array:
    r"""Contact value seen in a frame of an inelastic gas, :math:`g(\sigma^+) = g_0(1 + e)/(2e)`.

    :math:`g_0` counts approaching pairs; separating pairs are slower by ``e`` and so linger at contact
    longer by ``1/e`` (Lutsko 2001). Infinite at e = 0.
    """
    g0, e = np.asarray(g0, float), np.asarray(e, float)
    with np.errstate(divide="ignore"):
        return g0 * (1 + e) / (2 * e)


def compressibility(eta: ArrayLike, e: ArrayLike = 1.0, d: int = 3, equation: str | None = None) -> Array:
    r"""Compressibility :math:`Z = PV/NT`.

    :math:`Z = 1 + 2(1 + e)\eta g_0` in 3D, :math:`1 + (1 + e)\eta g_0` in 2D; at e < 1 this assumes
    molecular chaos.
    """
    eta, e = np.asarray(eta, float), np.asarray(e, float)
    factor = 2.0 if _dimension(d) == 3 else 1.0
    return 1 + factor * (1 + e) * eta * contact_value(eta, d, equation)


# --- collisions ----------------------------------------------------------------------------------


def collision_frequency(
    n: ArrayLike,
    sigma: ArrayLike,
    T: ArrayLike = 1.0,
    m: ArrayLike = 1.0,
    g0: ArrayLike = 1.0,
    d: int = 3,
    a2: ArrayLike = 0.0,
) -> Array:
    r"""Collisions per particle and time [1/time] (Enskog).

    :math:`\omega = 4 n\sigma^2 g_0\sqrt{\pi T/m}` in 3D, :math:`2 n\sigma g_0\sqrt{\pi T/m}` in 2D, each
    times :math:`1 - a_2/16`. The whole gas makes :math:`N\omega/2` collisions per time.
    """
    n, sigma, T, m, g0, a2 = (np.asarray(x, float) for x in (n, sigma, T, m, g0, a2))
    factor = 4 * n * sigma**2 if _dimension(d) == 3 else 2 * n * sigma
    return factor * g0 * np.sqrt(np.pi * T / m) * (1 - a2 / 16)


def mean_free_time(
    n: ArrayLike,
    sigma: ArrayLike,
    T: ArrayLike = 1.0,
    m: ArrayLike = 1.0,
    g0: ArrayLike = 1.0,
    d: int = 3,
    a2: ArrayLike = 0.0,
) -> Array:
    r"""Mean time between collisions of one particle [time], :math:`1/\omega` of :func:`collision_frequency`."""
    return 1 / collision_frequency(n, sigma, T, m, g0, d, a2)


def loss_distribution(x: ArrayLike) -> Array:
    r"""Probability density of :math:`x = \Delta T/[(1 - e^2) T]`, the scaled energy loss of a collision.

    Approach speeds of colliding pairs have the density :math:`\propto v_n e^{-\mu v_n^2/2T}`, so that
    :math:`\tfrac12\mu v_n^2/T`, and with it the loss (2.16), is exponentially distributed: :math:`e^{-x}`.
    Maxwell velocities; any masses, both dimensions.
    """
    return np.exp(-np.asarray(x, float))


# --- homogeneous cooling -------------------------------------------------------------------------


def sonine_a2(e: ArrayLike, d: int = 3) -> Array:
    r"""Second Sonine coefficient of the homogeneous cooling state (van Noije–Ernst 1998).

    .. math:: a_2 = \frac{16(1 - e)(1 - 2e^2)}{9 + 24d - (41 - 8d)e + 30(1 - e)e^2},

    defined by :math:`a_2 = d\langle v^4\rangle/[(d + 2)\langle v^2\rangle^2] - 1`.
    """
    e, d = np.asarray(e, float), _dimension(d)
    return 16 * (1 - e) * (1 - 2 * e**2) / (9 + 24 * d - (41 - 8 * d) * e + 30 * (1 - e) * e**2)


def haff_time(e: ArrayLike, omega0: ArrayLike, d: int = 3, a2: ArrayLike | None = None) -> Array:
    r"""Time constant of Haff's law [time], :math:`1/\tau = (1 - e^2)\,\omega_0\,(1 + 3a_2/16)/(2d)`.

    Parameters
    ----------
    omega0
        :func:`collision_frequency` at the initial temperature, without its :math:`a_2` factor.
    a2
        Sonine coefficient; default :func:`sonine_a2` of ``e`` and ``d``. Infinite at e = 1.
    """
    e, omega0 = np.asarray(e, float), np.asarray(omega0, float)
    a2 = sonine_a2(e, d) if a2 is None else np.asarray(a2, float)
    with np.errstate(divide="ignore"):
        return 1 / ((1 - e**2) * omega0 * (1 + 3 * a2 / 16) / (2 * d))


def haff_temperature(t: ArrayLike, T0: ArrayLike, tau: ArrayLike) -> Array:
    r"""Haff's law, :math:`T(t) = T_0/(1 + t/\tau)^2`, while the gas stays homogeneous."""
    t, T0, tau = (np.asarray(x, float) for x in (t, T0, tau))
    return T0 / (1 + t / tau) ** 2


def critical_length(n: ArrayLike, sigma: ArrayLike, e: ArrayLike, d: int = 3) -> Array:
    r"""Box side [length] above which a dilute cooling gas becomes unstable to shear.

    :math:`L_c \approx 2.43/(n\sigma^2\sqrt{1 - e^2})` in 3D, :math:`2\sqrt\pi/(n\sigma\sqrt{1 - e^2})` in
    2D. Infinite at e = 1.
    """
    n, sigma, e = (np.asarray(x, float) for x in (n, sigma, e))
    with np.errstate(divide="ignore"):
        if _dimension(d) == 3:
            return 2.43 / (n * sigma**2 * np.sqrt(1 - e**2))
        return 2 * np.sqrt(np.pi) / (n * sigma * np.sqrt(1 - e**2))


def viscoelastic_restitution(speed: ArrayLike, coefficient: ArrayLike) -> Array:
    r"""Restitution of viscoelastic spheres, :math:`1 - 1.15344\delta + 0.79826\delta^2`, first two terms.

    :math:`\delta =` ``coefficient`` :math:`v_n^{1/5}` (Brilliantov–Pöschel 2004, ch. 3). A gas of such
    spheres cools as :math:`T\propto t^{-5/3}` at late times. For small :math:`\delta` only.
    """
    delta = np.asarray(coefficient, float) * np.asarray(speed, float) ** 0.2
    return 1 - 1.15344 * delta + 0.79826 * delta**2


# --- velocity distributions ------------------------------------------------------------------------


def maxwell_component(c: ArrayLike) -> Array:
    r"""Maxwell density of one component of :math:`c = v/\sqrt{2T/m}`, :math:`e^{-c^2}/\sqrt\pi`."""
    return np.exp(-(np.asarray(c, float) ** 2)) / np.sqrt(np.pi)


def sonine_polynomial(x: ArrayLike, d: int = 3) -> Array:
    r"""Sonine polynomial :math:`S_2(x) = x^2/2 - (d + 2)x/2 + d(d + 2)/8` with :math:`x = c^2`.

    ``d = 1`` is that of a single velocity component.
    """
    x = np.asarray(x, float)
    return x**2 / 2 - (d + 2) * x / 2 + d * (d + 2) / 8


def sonine_component(c: ArrayLike, a2: ArrayLike) -> Array:
    r"""Density of one velocity component with its first Sonine correction.

    Integrating :math:`f = f_M[1 + a_2 S_2(c^2)]` over the other components leaves the polynomial of one
    dimension, whatever ``d``: :math:`f(c_x) = f_M(c_x)\,[1 + a_2(c_x^4/2 - 3c_x^2/2 + 3/8)]`.
    """
    c = np.asarray(c, float)
    return maxwell_component(c) * (1 + np.asarray(a2, float) * sonine_polynomial(c**2, d=1))


# --- mixtures --------------------------------------------------------------------------------------


class MixtureRates(NamedTuple):
    """Collisions in a mixture, from :func:`mixture_rates`."""

    per_particle: Array
    """``[S, S]``: collisions of one particle of species i with species j [1/time]."""
    per_volume: Array
    """``[S, S]``: collisions of species i with j per volume (area) and time; pairs i = j counted once."""
    total: float
    """All collisions per volume (area) and time."""


def mixture_contact_values(n: ArrayLike, sigma: ArrayLike, d: int = 3, equation: str | None = None) -> Array:
    r"""Contact values :math:`g_{ij}` of a mixture of hard spheres or disks, ``[S, S]``.

    3D (Boublík; Mansoori, Carnahan, Starling, Leland), with :math:`\xi_k = \frac\pi6\sum_i n_i\sigma_i^k`
    and :math:`\sigma_* = \sigma_i\sigma_j/(\sigma_i + \sigma_j)`:

    .. math:: g_{ij} = \frac1{1 - \xi_3} + \frac{3\xi_2\sigma_*}{(1 - \xi_3)^2}
              + \frac{2\xi_2^2\sigma_*^2}{(1 - \xi_3)^3}

    BMCSL is low for pairs of large spheres. ``equation="santos"`` (3D; Santos, Yuste, López de Haro) is the
    parabola in :math:`z_{ij} = 2\sigma_*\langle\sigma^2\rangle/\langle\sigma^3\rangle` through the exact values of
    a point, :math:`g(z = 0) = 1/(1 - \xi_3)`, of the pure fluid, :math:`g(1) = g_0`, and of a hard wall,
    :math:`g(2) = Z`, both from :func:`kolafa_labik_malijevsky`; it is better for large pairs and low for small ones.

    2D (Jenkins–Mancini), with :math:`\xi_k = \frac\pi4\sum_i n_i\sigma_i^k`:
    :math:`g_{ij} = 1/(1 - \xi_2) + \frac98\xi_1\sigma_*/(1 - \xi_2)^2`.

    Parameters
    ----------
    n, sigma
        Number density and diameter of each species, ``[S]``.
    equation
        ``"bmcsl"`` (default) or ``"santos"`` in 3D, ``"jenkins-mancini"`` in 2D.
    """
    n, sigma = np.atleast_1d(np.asarray(n, float)), np.atleast_1d(np.asarray(sigma, float))
    star = sigma[:, None] * sigma[None, :] / (sigma[:, None] + sigma[None, :])
    equation = equation or ("bmcsl" if _dimension(d) == 3 else "jenkins-mancini")
    if (d, equation) == (3, "santos"):
        eta = float(np.pi / 6 * np.sum(n * sigma**3))
        z = 2 * star * np.sum(n * sigma**2) / np.sum(n * sigma**3)
        point, g0, wall = 1 / (1 - eta), contact_value(eta, 3, "klm"), kolafa_labik_malijevsky(eta)
        curve = (wall + point - 2 * g0) / 2
        return point + (g0 - point - curve) * z + curve * z**2
    if (d, equation) not in ((3, "bmcsl"), (2, "jenkins-mancini")):
        raise ValueError(f"no contact values {equation!r} in d = {d}: bmcsl, santos (3D), jenkins-mancini (2D)")
    if d == 3:
        xi2, xi3 = (np.pi / 6 * np.sum(n * sigma**k) for k in (2, 3))
        free = 1 - xi3
        return 1 / free + 3 * xi2 * star / free**2 + 2 * (xi2 * star) ** 2 / free**3
    xi1, xi2 = (np.pi / 4 * np.sum(n * sigma**k) for k in (1, 2))
    free = 1 - xi2
    return 1 / free + 9 / 8 * xi1 * star / free**2


def mixture_rates(
    n: ArrayLike, sigma: ArrayLike, m: ArrayLike, T: ArrayLike = 1.0, d: int = 3, g: ArrayLike | None = None
) -> MixtureRates:
    r"""Enskog collision rates of a mixture with Maxwell velocities.

    A particle of species i collides with species j

    .. math:: \omega_{ij} = n_j\sigma_{ij}^2 g_{ij}\sqrt{8\pi(T_i/m_i + T_j/m_j)}\ (3D),\qquad
              \omega_{ij} = n_j\sigma_{ij} g_{ij}\sqrt{2\pi(T_i/m_i + T_j/m_j)}\ (2D)

    times per unit time, :math:`\sigma_{ij} = (\sigma_i + \sigma_j)/2`. One species gives
    :func:`collision_frequency` back.

    Parameters
    ----------
    n, sigma, m, T
        Number density, diameter, mass and temperature of each species, ``[S]`` or a number.
    g
        Contact values ``[S, S]``; default :func:`mixture_contact_values`.
    """
    n, sigma = np.atleast_1d(np.asarray(n, float)), np.atleast_1d(np.asarray(sigma, float))
    m, T = np.broadcast_to(np.asarray(m, float), n.shape), np.broadcast_to(np.asarray(T, float), n.shape)
    g = mixture_contact_values(n, sigma, d) if g is None else np.asarray(g, float)
    contact = (sigma[:, None] + sigma[None, :]) / 2
    spread = T[:, None] / m[:, None] + T[None, :] / m[None, :]
    if _dimension(d) == 3:
        omega = n[None, :] * contact**2 * g * np.sqrt(8 * np.pi * spread)
    else:
        omega = n[None, :] * contact * g * np.sqrt(2 * np.pi * spread)
    pairs = n[:, None] * omega
    pairs[np.diag_indices_from(pairs)] /= 2
    return MixtureRates(omega, pairs, float(np.sum(n[:, None] * omega) / 2))
