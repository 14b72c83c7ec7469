"""Collision rates, and the distribution of the energy loss."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ._common import Array, check_dimension, numeric


@numeric
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
    factor = 4 * n * sigma**2 if check_dimension(d) == 3 else 2 * n * sigma
    return factor * g0 * np.sqrt(np.pi * T / m) * (1 - a2 / 16)


@numeric
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


@numeric
def periodic_rate_factor(particles: ArrayLike, d: int = 3) -> Array:
    r"""Ratio of the collision rate of ``particles`` at fixed momentum and energy to :func:`collision_frequency`.

    .. math:: \sqrt{\frac N{N - 1}}\,\sqrt{\frac f2}\,\frac{\Gamma(f/2)}{\Gamma((f + 1)/2)},\qquad f = d(N - 1),

    because velocities are spread evenly over a sphere in ``f`` dimensions. Exact for elastic spheres or disks of one
    mass, if :math:`g_0` is :func:`periodic_contact_value`.
    """
    from scipy.special import poch

    particles = np.asarray(particles, float)
    freedom = check_dimension(d) * (particles - 1)
    spread = np.sqrt(freedom / 2) / poch(freedom / 2, 0.5)
    return np.sqrt(particles / (particles - 1)) * spread


@numeric
def loss_distribution(x: ArrayLike) -> Array:
    r"""Probability density of :math:`x = \Delta T/[(1 - e^2) T]`, the scaled energy loss of a collision.

    Approach speeds of colliding pairs have the density :math:`\propto v_n e^{-\mu v_n^2/2T}`, so that
    :math:`\tfrac12\mu v_n^2/T`, and with it the loss (2.16), is exponentially distributed: :math:`e^{-x}`.
    Maxwell velocities; any masses, both dimensions.
    """
    return np.exp(-np.asarray(x, float))
