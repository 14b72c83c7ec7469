"""The homogeneous cooling state and its velocity distribution."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ..common import arguments
from ._common import Array, check_dimension, numeric


@numeric
def sonine_a2(e: ArrayLike, d: int = 3, approximation: str = "van-noije-ernst") -> Array:
    r"""Second Sonine coefficient of the homogeneous cooling state.

    .. math:: a_2 = \frac{16(1 - e)(1 - 2e^2)}{9 + 24d - (41 - 8d)e + 30(1 - e)e^2}

    (van Noije–Ernst 1998), defined by :math:`a_2 = d\langle v^4\rangle/[(d + 2)\langle v^2\rangle^2] - 1`. The other
    ``approximation``, ``"montanero-santos"`` (2000), has the denominator
    :math:`25 + 24d - (57 - 8d)e - 2(1 - e)e^2` and is the better one below e = 0.6. Both leave out the higher
    coefficients: in three dimensions the Boltzmann equation itself has 0.0478 at e = 0.5, where they have 0.0525 and
    0.0498, and -0.0146 at e = 0.8 instead of -0.0126 and -0.0127 (docs/validation.md).
    """
    e, d = np.asarray(e, float), check_dimension(d)
    approximation = arguments.choice("approximation", approximation, ("van-noije-ernst", "montanero-santos"))
    if approximation == "van-noije-ernst":
        divisor = 9 + 24 * d - (41 - 8 * d) * e + 30 * (1 - e) * e**2
    else:
        divisor = 25 + 24 * d - (57 - 8 * d) * e - 2 * (1 - e) * e**2
    return 16 * (1 - e) * (1 - 2 * e**2) / divisor


@numeric
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


@numeric
def haff_temperature(t: ArrayLike, T0: ArrayLike, tau: ArrayLike) -> Array:
    r"""Haff's law, :math:`T(t) = T_0/(1 + t/\tau)^2`, while the gas stays homogeneous."""
    t, T0, tau = (np.asarray(x, float) for x in (t, T0, tau))
    return T0 / (1 + t / tau) ** 2


@numeric
def critical_length(n: ArrayLike, sigma: ArrayLike, e: ArrayLike, d: int = 3) -> Array:
    r"""Box side [length] above which a dilute cooling gas becomes unstable to shear.

    :math:`L_c \approx 2.43/(n\sigma^2\sqrt{1 - e^2})` in 3D, :math:`2\sqrt\pi/(n\sigma\sqrt{1 - e^2})` in
    2D. Infinite at e = 1.
    """
    n, sigma, e = (np.asarray(x, float) for x in (n, sigma, e))
    with np.errstate(divide="ignore"):
        if check_dimension(d) == 3:
            return 2.43 / (n * sigma**2 * np.sqrt(1 - e**2))
        return 2 * np.sqrt(np.pi) / (n * sigma * np.sqrt(1 - e**2))


@numeric
def viscoelastic_restitution(speed: ArrayLike, coefficient: ArrayLike) -> Array:
    r"""Restitution of viscoelastic spheres, :math:`1 - 1.15344\delta + 0.79826\delta^2`, first two terms.

    :math:`\delta =` ``coefficient`` :math:`v_n^{1/5}` (Brilliantov–Pöschel 2004, ch. 3). A gas of such
    spheres cools as :math:`T\propto t^{-5/3}` at late times. For small :math:`\delta` only.
    """
    delta = np.asarray(coefficient, float) * np.asarray(speed, float) ** 0.2
    return 1 - 1.15344 * delta + 0.79826 * delta**2


@numeric
def viscoelastic_restitution_pade(speed: ArrayLike, coefficient: ArrayLike) -> Array:
    r"""Restitution of viscoelastic spheres at every speed, as scenes with ``model = "viscoelastic"`` have it.

    The [1/4] Padé approximant in :math:`x = \sqrt\delta`, :math:`\delta =` ``coefficient`` :math:`v_n^{1/5}`, of Müller
    and Pöschel (2011); it starts as :func:`viscoelastic_restitution`.
    """
    x = np.sqrt(np.asarray(coefficient, float)) * np.asarray(speed, float) ** 0.1
    rest = x**2 * (1.15344 + x * (0.577977 + x * 0.532178))
    return 1 / (1 + rest / (1 + 0.501086 * x))


@numeric
def cooling_curve(
    t: ArrayLike,
    T0: float,
    omega0: float,
    restitution: Callable[[Array], ArrayLike],
    m: float = 1.0,
    d: int = 3,
) -> Array:
    r"""Temperature of a homogeneous gas whose restitution depends on the approach speed, with Maxwell velocities.

    .. math:: \frac{dT}{dt} = -\frac{\omega_0}d\sqrt{\frac T{T_0}}\;T\int_0^\infty x e^{-x}\,
              \bigl[1 - e^2\bigl(2\sqrt{xT/m}\bigr)\bigr]dx,

    integrated to 1e-9: the mean of the loss (2.16) over all collisions (:func:`loss_distribution`). A constant ``e``
    gives Haff's law with :math:`a_2 = 0`.

    Parameters
    ----------
    t
        Times, ascending from 0 or later, ``[K]``.
    omega0
        :func:`collision_frequency` at the temperature ``T0``.
    restitution
        ``e`` of an array of approach speeds.
    """
    from scipy.integrate import solve_ivp

    times = np.atleast_1d(np.asarray(t, float))
    dimension = check_dimension(d)
    # x = y⁵ makes powers of v^(1/5) polynomials, apart from the exponential.
    nodes, weights = np.polynomial.legendre.leggauss(80)
    y = (nodes + 1) * 60**0.2 / 2
    x, weights = y**5, weights * 60**0.2 / 2 * 5 * y**4 * y**5 * np.exp(-(y**5))

    def slope(_: float, logarithm: Array) -> Array:
        T = np.exp(logarithm[0])
        lost = np.sum(weights * (1 - np.asarray(restitution(2 * np.sqrt(x * T / m)), float) ** 2))
        return np.array([-omega0 / dimension * np.sqrt(T / T0) * lost])

    found = solve_ivp(slope, (0.0, times[-1]), [np.log(T0)], method="DOP853", t_eval=times, rtol=1e-10, atol=1e-10)
    return np.exp(found.y[0])


@numeric
def maxwell_component(c: ArrayLike) -> Array:
    r"""Maxwell density of one component of :math:`c = v/\sqrt{2T/m}`, :math:`e^{-c^2}/\sqrt\pi`."""
    return np.exp(-(np.asarray(c, float) ** 2)) / np.sqrt(np.pi)


@numeric
def sonine_polynomial(x: ArrayLike, d: int = 3) -> Array:
    r"""Sonine polynomial :math:`S_2(x) = x^2/2 - (d + 2)x/2 + d(d + 2)/8` with :math:`x = c^2`.

    ``d = 1`` is that of a single velocity component.
    """
    d = arguments.count("d", d, 1, 3)
    return x**2 / 2 - (d + 2) * x / 2 + d * (d + 2) / 8


@numeric
def sonine_component(c: ArrayLike, a2: ArrayLike) -> Array:
    r"""Density of one velocity component with its first Sonine correction.

    Integrating :math:`f = f_M[1 + a_2 S_2(c^2)]` over the other components leaves the polynomial of one
    dimension, whatever ``d``: :math:`f(c_x) = f_M(c_x)\,[1 + a_2(c_x^4/2 - 3c_x^2/2 + 3/8)]`.
    """
    c = np.asarray(c, float)
    return maxwell_component(c) * (1 + np.asarray(a2, float) * sonine_polynomial(c**2, d=1))
