"""Mixtures of spheres and of disks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ._common import Array, check_dimension, chosen, numeric
from .equilibrium import contact_value, kolafa_labik_malijevsky


class MixtureRates(NamedTuple):
    """Collisions in a mixture, from :func:`mixture_rates`."""

    per_particle: Array
    """``[S, S]``: collisions of one particle of species i with species j [1/time]."""
    per_volume: Array
    """``[S, S]``: collisions of species i with j per volume (area) and time; pairs i = j counted once."""
    total: float
    """All collisions per volume (area) and time."""


@numeric
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
    equation = chosen(equation, d, ("bmcsl", "santos"), ("jenkins-mancini",))
    if equation == "santos":
        eta = float(np.pi / 6 * np.sum(n * sigma**3))
        z = 2 * star * np.sum(n * sigma**2) / np.sum(n * sigma**3)
        point, g0, wall = 1 / (1 - eta), contact_value(eta, 3, "klm"), kolafa_labik_malijevsky(eta)
        curve = (wall + point - 2 * g0) / 2
        return point + (g0 - point - curve) * z + curve * z**2
    if d == 3:
        xi2, xi3 = (np.pi / 6 * np.sum(n * sigma**k) for k in (2, 3))
        free = 1 - xi3
        return 1 / free + 3 * xi2 * star / free**2 + 2 * (xi2 * star) ** 2 / free**3
    xi1, xi2 = (np.pi / 4 * np.sum(n * sigma**k) for k in (1, 2))
    free = 1 - xi2
    return 1 / free + 9 / 8 * xi1 * star / free**2


@numeric
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
    if check_dimension(d) == 3:
        omega = n[None, :] * contact**2 * g * np.sqrt(8 * np.pi * spread)
    else:
        omega = n[None, :] * contact * g * np.sqrt(2 * np.pi * spread)
    pairs = n[:, None] * omega
    pairs[np.diag_indices_from(pairs)] /= 2
    return MixtureRates(omega, pairs, float(np.sum(n[:, None] * omega) / 2))


@numeric
def mixture_cooling_rates(
    n: ArrayLike,
    sigma: ArrayLike,
    m: ArrayLike,
    e: ArrayLike,
    T: ArrayLike = 1.0,
    d: int = 3,
    g: ArrayLike | None = None,
) -> Array:
    r"""Cooling rates :math:`\zeta_i = -\dot T_i/T_i` [1/time] of the species of a mixture, ``[S]``.

    Velocities are Maxwell's. Of one collision with species j a particle of species i gains, on average,

    .. math:: -(1 + e_{ij})\mu_{ij}\Bigl[\frac{2T_i}{m_i} - (1 + e_{ij})\frac{\mu_{ij}}{m_i}
              \Bigl(\frac{T_i}{m_i} + \frac{T_j}{m_j}\Bigr)\Bigr],

    :math:`\mu_{ij}` the reduced mass (Garzó–Dufty 1999); its collision rates are those of :func:`mixture_rates`.

    Parameters
    ----------
    e
        Coefficients of restitution, ``[S, S]`` or a number; the other parameters are those of :func:`mixture_rates`.
    """
    n = np.atleast_1d(np.asarray(n, float))
    m, T = np.broadcast_to(np.asarray(m, float), n.shape), np.broadcast_to(np.asarray(T, float), n.shape)
    omega = mixture_rates(n, sigma, m, T, d, g).per_particle
    reduced = m[:, None] * m[None, :] / (m[:, None] + m[None, :])
    impulse = (1 + np.asarray(e, float)) * reduced
    spread = T / m
    gain = -impulse * (2 * spread[:, None] - impulse / m[:, None] * (spread[:, None] + spread[None, :]))
    return -2 / (check_dimension(d) * T) * np.sum(omega * gain, axis=1)


@numeric
def granular_temperatures(
    n: ArrayLike, sigma: ArrayLike, m: ArrayLike, e: ArrayLike, d: int = 3, g: ArrayLike | None = None
) -> Array:
    r"""Temperatures of the species of a freely cooling mixture, :math:`T_i/T` with :math:`T = \sum n_iT_i/\sum n_i`.

    ``[S]``. In the homogeneous cooling state all species cool at one rate, :math:`\zeta_1 = \zeta_2 = …`, and for that
    the heavier must be hotter: equipartition holds for elastic mixtures only (Garzó–Dufty 1999). Parameters as in
    :func:`mixture_cooling_rates`.
    """
    from scipy.optimize import root

    n = np.atleast_1d(np.asarray(n, float))

    def unequal(logarithms: Array) -> Array:
        rates = mixture_cooling_rates(n, sigma, m, e, np.exp(np.append(0.0, logarithms)), d, g)
        return rates[1:] / rates[0] - 1 if np.any(np.asarray(e) != 1) else rates[1:] - rates[0]

    found = root(unequal, np.zeros(len(n) - 1), tol=1e-12)
    if len(n) > 1 and not found.success:
        raise ValueError(f"no homogeneous cooling state was found: {found.message}")
    T = np.exp(np.append(0.0, found.x))
    return T * np.sum(n) / np.sum(n * T)
