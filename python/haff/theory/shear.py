"""Gases of inelastic spheres in uniform shear flow: the steady state of shear heating and inelastic cooling."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ._common import Array, numeric
from .collisions import collision_frequency
from .cooling import haff_time
from .equilibrium import contact_value, number_density
from .transport import enskog_viscosity


class DiluteShearFlow(NamedTuple):
    r"""Steady state of a dilute gas, from :func:`uniform_shear_model`: flow along x, gradient along y."""

    reduced_rate: Array
    r""":math:`a^* = \dot\gamma\big/\bigl(\tfrac{16}5\sqrt\pi\,n\sigma^2\sqrt{T/m}\bigr)`."""
    pressure_tensor: Array
    r"""``[..., 3, 3]`` the pressure tensor over the pressure, :math:`P_{ij}/nT`."""


class DenseShearFlow(NamedTuple):
    r"""Steady state at any density, from :func:`uniform_shear_enskog`: flow along x, gradient along y.

    Units are the mass m and the diameter σ of a sphere, and the shear rate :math:`\dot\gamma`: multiply temperatures
    by :math:`m\sigma^2\dot\gamma^2`, pressures by :math:`m\dot\gamma^2/\sigma` and viscosities by
    :math:`m\dot\gamma/\sigma`.
    """

    temperature: Array
    r"""Granular temperature T of the peculiar velocities [:math:`m\sigma^2\dot\gamma^2`]."""
    pressure: Array
    r"""A third of the trace of ``pressure_tensor`` [:math:`m\dot\gamma^2/\sigma`]."""
    pressure_tensor: Array
    r"""``[..., 3, 3]`` pressure tensor, kinetic and collisional part [:math:`m\dot\gamma^2/\sigma`]."""
    velocity_covariance: Array
    r"""``[..., 3, 3]`` :math:`K_{ij} = \langle c_ic_j\rangle` of peculiar velocities [:math:`\sigma^2\dot\gamma^2`]."""
    mean_free_time: Array
    r"""Mean time between collisions of one sphere [:math:`1/\dot\gamma`]."""

    @property
    def viscosity(self) -> Array:
        r""":math:`\eta = -P_{xy}/\dot\gamma` [:math:`m\dot\gamma/\sigma`]."""
        return -self.pressure_tensor[..., 0, 1]


@numeric
def uniform_shear_model(e: ArrayLike) -> DiluteShearFlow:
    r"""Steady uniform shear flow of a dilute gas of smooth inelastic spheres, by a kinetic model.

    A model equation replaces the collision operator of Boltzmann's equation by a relaxation at the rate
    :math:`\nu\nu_0` and a drag that cools at the rate :math:`\zeta\nu_0`, where
    :math:`\nu_0 = \frac{16}5\sqrt\pi\,n\sigma^2\sqrt{T/m}`,

    .. math:: \nu = \tfrac14(1 + e)(3 - e),\qquad \zeta = \tfrac5{12}(1 - e^2).

    Its equations of the second moments, with :math:`p = nT`, are

    .. math:: \nu P_{yy} = \nu P_{zz} = (\nu - \zeta)\,p,\qquad a^*P_{yy} + \nu P_{xy} = 0,\qquad
              -a^*P_{xy} = \tfrac32\zeta\,p;

    the last one is the balance of the work of the shear and the losses. They are solved by

    .. math:: a^{*2} = \frac{3\zeta\nu^2}{2(\nu - \zeta)},\qquad
              \frac{P_{yy}}p = \frac{P_{zz}}p = \frac{\nu - \zeta}\nu,\qquad
              \frac{P_{xx}}p = 3 - 2\frac{P_{yy}}p,\qquad \frac{P_{xy}}p = -a^*\,\frac{\nu - \zeta}{\nu^2}

    (J. J. Brey, J. W. Dufty, A. Santos 1999; V. Garzó 2019). All of them depend on e alone: the temperature adjusts
    itself to the shear rate, :math:`T\propto\dot\gamma^2` (:func:`uniform_shear_temperature`).

    Exact values of the Boltzmann equation, by direct Monte Carlo (standard errors of the last digits in parentheses),
    and the error of the model:

    ================  ============  ======  ============  ======
    \                 e = 0.9       model   e = 0.7       model
    ================  ============  ======  ============  ======
    :math:`a^*`       0.36423(13)   -1.5 %  0.66825(19)   -5.6 %
    :math:`P_{xx}/p`  1.15497(22)   +0.3 %  1.42836(39)   +0.4 %
    :math:`P_{yy}/p`  0.91267(24)   +0.9 %  0.76306(24)   +2.6 %
    :math:`P_{zz}/p`  0.93236(19)   -1.3 %  0.80857(30)   -3.2 %
    :math:`P_{xy}/p`  -0.33171(15)  -0.2 %  -0.50422(17)  +0.2 %
    ================  ============  ======  ============  ======

    The model has no difference between :math:`P_{yy}` and :math:`P_{zz}`, the second normal stress difference.

    Parameters
    ----------
    e
        Coefficient of restitution, in [0, 1]. At e = 1 there is no steady state: the rate is 0.
    """
    e = np.asarray(e, float)
    nu, zeta = (1 + e) * (3 - e) / 4, 5 * (1 - e**2) / 12
    rate = nu * np.sqrt(1.5 * zeta / (nu - zeta))
    stress = np.zeros((*e.shape, 3, 3))
    stress[..., 1, 1] = stress[..., 2, 2] = (nu - zeta) / nu
    stress[..., 0, 0] = 3 - 2 * stress[..., 1, 1]
    stress[..., 0, 1] = stress[..., 1, 0] = -rate * (nu - zeta) / nu**2
    return DiluteShearFlow(rate, stress)


@numeric
def uniform_shear_temperature(
    rate: ArrayLike, e: ArrayLike, n: ArrayLike, sigma: ArrayLike, m: ArrayLike = 1.0
) -> Array:
    r"""Granular temperature of the steady state of a dilute gas in uniform shear flow [energy].

    .. math:: T = m\Bigl(\frac{\dot\gamma}{\frac{16}5\sqrt\pi\,n\sigma^2\,a^*(e)}\Bigr)^2

    with :math:`a^*` of :func:`uniform_shear_model`. Infinite at e = 1. As :math:`a^*` of the model is too small, this
    is too hot, by 3 % at e = 0.9 and 12 % at e = 0.7.

    Parameters
    ----------
    rate
        Shear rate :math:`\dot\gamma` [1/time].
    """
    rate, n, sigma, m = (np.asarray(x, float) for x in (rate, n, sigma, m))
    with np.errstate(divide="ignore"):
        return m * (rate / (16 / 5 * np.sqrt(np.pi) * n * sigma**2 * uniform_shear_model(e).reduced_rate)) ** 2


@numeric
def uniform_shear_enskog(e: ArrayLike, packing_fraction: ArrayLike, g0: ArrayLike | None = None) -> DenseShearFlow:
    r"""Steady uniform shear flow of smooth inelastic spheres at any density of the fluid.

    Enskog's equation, with an anisotropic Gaussian for the distribution of peculiar velocities **c**, of the second
    moments :math:`K_{ij} = \langle c_ic_j\rangle` (J. T. Jenkins, M. W. Richman 1988). In units of m, σ and
    :math:`\dot\gamma`, the approach speed w of a pair in contact along the unit vector **k** is normal with the mean
    :math:`a = -k_xk_y`, from the shear between both centers, and the variance
    :math:`s^2 = 2\,\mathbf k\cdot K\mathbf k`. With its moments :math:`M_q = \langle w^q\,\Theta(w)\rangle` and
    :math:`h = (1 + e)/2`, collisions change K at the rate

    .. math:: C_{ij} = n g_0\int d\mathbf k\,\Bigl\{h^2k_ik_j\,M_3
              - h\,[k_i(K\mathbf k)_j + (K\mathbf k)_ik_j]\,\frac{M_3 - aM_2}{s^2}\Bigr\}

    over the unit sphere, and the steady state has :math:`C_{xx} = 2K_{xy}`, :math:`C_{xy} = K_{yy}`,
    :math:`C_{yy} = C_{zz} = 0`, which are solved for K. Then

    .. math:: P_{ij} = nK_{ij} + \tfrac12n^2g_0h\int d\mathbf k\,k_ik_j\,M_2,\qquad
              \frac1{\tau} = n g_0\int d\mathbf k\,M_1.

    Nothing is expanded in the shear rate or in 1 - e. What is left out is the deviation of the distribution from a
    Gaussian, and correlations of the velocities of colliding spheres. In a dilute gas, against
    the exact values at :func:`uniform_shear_model`, the reduced rate is too small by 0.2 % at e = 0.9 and 1.7 % at
    e = 0.7, and all :math:`P_{ij}/p` are good to 0.3 % and 0.5 %.

    Against runs of haff T and :math:`P_{xy}` are low by 4 % and 5 % at a packing fraction of 0.1 and e = 0.9 (2000
    spheres), and by 2 % and 1 % at 0.262; at 0.262 and e = 0.7 T is low by 3 %, and :math:`-P_{xy}` high by 2 %
    (1000 spheres; statistical errors of 0.5 %).

    Parameters
    ----------
    e
        Coefficient of restitution, in [0, 1). At e = 1 there is no steady state.
    packing_fraction
        :math:`\pi n\sigma^3/6`, greater than 0 and below 0.49, where hard spheres begin to freeze.
    g0
        Contact value of the pair distribution; default Carnahan and Starling's
        (:func:`~haff.theory.carnahan_starling`).

    Raises
    ------
    ValueError
        ``e`` or ``packing_fraction`` is out of range.
    """
    e, phi = np.broadcast_arrays(np.asarray(e, float), np.asarray(packing_fraction, float))
    if not np.all((e >= 0) & (e < 1)):
        raise ValueError("e must be in [0, 1): elastic spheres have no steady state in shear")
    if not np.all((phi > 0) & (phi < 0.49)):
        raise ValueError("the packing fraction must be in (0, 0.49), that of a fluid")
    g = np.broadcast_to(contact_value(phi) if g0 is None else np.asarray(g0, float), e.shape)
    K, stress, frequency = np.empty((*e.shape, 3, 3)), np.empty((*e.shape, 3, 3)), np.empty(e.shape)
    for place in np.ndindex(e.shape):
        K[place], stress[place], frequency[place] = _steady(
            float(e[place]), float(number_density(phi[place], 1.0)), float(g[place])
        )
    trace = np.einsum("...ii->...", stress) / 3
    return DenseShearFlow(np.einsum("...ii->...", K) / 3, trace, stress, K, 1 / frequency)


def _steady(e: float, n: float, g: float) -> tuple[Array, Array, float]:
    """K and the pressure tensor, ``[3, 3]`` each, and the collision frequency of a sphere, in units of m, σ and γ̇."""
    # Near the solution: where the work of Enskog's viscosity of elastic spheres is what collisions take.
    losses = 3 * n / float(haff_time(e, float(collision_frequency(n, 1.0, g0=g)), 3, 0.0))
    T = float(enskog_viscosity(n, 1.0, g0=g)) / losses
    start = T * uniform_shear_model(e).pressure_tensor

    def moments(unknown: Array) -> Array:
        xx, yy, zz, xy = unknown
        return T * np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, zz]])

    def off(unknown: Array) -> Array:
        K = moments(unknown)
        if np.linalg.eigvalsh(K)[0] <= 0:
            return np.full(4, np.inf)
        change = n * g * _collide(K, e)[0]
        # What the shear does in a unit of time: K_xx grows by -2K_xy, K_xy by -K_yy.
        return np.array([
            change[0, 0] - 2 * K[0, 1], change[1, 1], change[2, 2], change[0, 1] - K[1, 1]
        ]) / T  # fmt: skip

    found = _zero(off, start[[0, 1, 2, 0], [0, 1, 2, 1]] / T)
    if found is None:
        raise ArithmeticError(f"no steady state was found at e = {e:g}, n = {n:g}")
    K = moments(found)
    _, transfer, hits = _collide(K, e)
    return K, n * K + 0.5 * n**2 * g * transfer, n * g * hits


def _zero(off: Callable[[Array], Array], x: Array) -> Array | None:
    """Where ``off`` of a few numbers is zero, by Newton's method; ``None`` if it does not get there.

    SciPy's would take 0.4 s to load, a hundred times as long as the few steps take.
    """
    value = off(x)
    for _ in range(50):
        sides = np.cbrt(np.finfo(float).eps) * np.diag(np.maximum(np.abs(x), 1e-3))
        slopes = np.stack([(off(x + side) - off(x - side)) / (2 * side.sum()) for side in sides], axis=1)
        if not np.isfinite(slopes).all():
            return None
        step = np.linalg.solve(slopes, -value)
        near = np.abs(step).max() <= 1e-8 * np.abs(x).max()
        # Half the step as long as it goes too far; near the zero only rounding is left when no step brings it nearer.
        part = 1.0
        while not np.abs(off(x + part * step)).max() < np.abs(value).max():
            part /= 2
            if near or part < 1e-8:
                return x if near else None
        x = x + part * step
        value = off(x)
    return None


def _collide(K: Array, e: float) -> tuple[Array, Array, float]:
    """Integrals over the directions of contact, without the factors of the density.

    Of the change of K, of the momentum that is transferred, and of the number of collisions.
    """
    k, weight = _directions()
    h = (1 + e) / 2
    Kk = k @ K
    a, s = -k[:, 0] * k[:, 1], np.sqrt(2 * np.einsum("qi,qi->q", k, Kk))
    approaching, peak = _normal(a / s), np.exp(-0.5 * (a / s) ** 2) / np.sqrt(2 * np.pi)
    first = a * approaching + s * peak
    second = (a**2 + s**2) * approaching + a * s * peak
    third = (a**3 + 3 * a * s**2) * approaching + (a**2 + 2 * s**2) * s * peak
    cross = np.einsum("q,qi,qj->ij", weight * h * (third - a * second) / s**2, k, Kk)
    change = np.einsum("q,qi,qj->ij", weight * h**2 * third, k, k) - cross - cross.T
    return change, np.einsum("q,qi,qj->ij", weight * h * second, k, k), float(weight @ first)


def _normal(x: Array) -> Array:
    """The cumulative normal distribution."""
    return 0.5 * np.vectorize(math.erfc, otypes=[float])(-x / math.sqrt(2))


@cache
def _directions(polar: int = 32, azimuthal: int = 64) -> tuple[Array, Array]:
    """``[Q, 3]`` directions and ``[Q]`` weights of a quadrature over the unit sphere: Gauss along z, even around it."""
    z, weight = np.polynomial.legendre.leggauss(polar)
    angle = (np.arange(azimuthal) + 0.5) * 2 * np.pi / azimuthal
    across = np.sqrt(1 - z**2)
    x, y = np.outer(across, np.cos(angle)), np.outer(across, np.sin(angle))
    k = np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], axis=-1)
    return k.reshape(-1, 3), np.repeat(weight * 2 * np.pi / azimuthal, azimuthal)
