"""Gases of rough spheres and disks: losses of translation and rotation, and their temperatures in the long run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ._common import Array, check_dimension, numeric


class RoughLosses(NamedTuple):
    """Mean energies that a collision takes, from :func:`rough_losses`."""

    normal: Array
    """Loss by the normal impulse [energy]."""
    tangential: Array
    """Loss by the tangential impulse [energy]."""
    translational: Array
    """What translation loses, the larger part or all of ``normal`` and ``tangential`` [energy]."""
    rotational: Array
    """What rotation loses, negative where it gains [energy]; with ``translational`` the sum of the first two."""


@numeric
def rough_losses(
    T: ArrayLike, T_rot: ArrayLike, e: ArrayLike, beta: ArrayLike, q: ArrayLike | None = None, d: int = 3
) -> RoughLosses:
    r"""Mean energies that a collision of two equal rough spheres or disks takes, without friction's bound.

    With Maxwell distributions of velocities and spins the slip in a collision has, whatever the approach speed,
    :math:`\langle g_t^2\rangle = (d - 1)(2/m)(T + T_r/q)`. With :math:`\eta = q(1 + \beta)/[2(1 + q)]`

    .. math::
        \langle\Delta T\rangle_n &= (1 - e^2)\,T,\qquad
        \langle\Delta T\rangle_t = \frac{d - 1}2\,\frac q{1 + q}(1 - \beta^2)\Bigl(T + \frac{T_r}q\Bigr), \\
        \langle\Delta T\rangle_{tr} &= (1 - e^2)\,T
            + 2(d - 1)\Bigl[\eta(1 - \eta)\,T - \frac{\eta^2}q\,T_r\Bigr], \\
        \langle\Delta T\rangle_{rot} &= 2(d - 1)
            \Bigl[\frac\eta q\Bigl(1 - \frac\eta q\Bigr)T_r - \frac{\eta^2}q\,T\Bigr]

    (M. Huthmann, A. Zippelius 1997). With :math:`\omega` of :func:`collision_frequency` a homogeneous gas has
    :math:`dT/dt = -(\omega/d)\langle\Delta T\rangle_{tr}` and
    :math:`dT_r/dt = -(\omega/r)\langle\Delta T\rangle_{rot}`, with r = 3 axes of rotation of spheres, 1 of disks.

    Parameters
    ----------
    T, T_rot
        Temperatures of translation, and of rotation, :math:`T_r = I\langle\omega^2\rangle/r` [energy].
    beta
        Coefficient of tangential restitution, in [-1, 1].
    q
        :math:`I/(mR^2)`; default 2/5 for spheres, 1/2 for disks.
    """
    T, T_rot, e, beta = (np.asarray(x, float) for x in (T, T_rot, e, beta))
    q, many = _inertia(q, d), check_dimension(d) - 1
    eta = q * (1 + beta) / (2 * (1 + q))
    normal = (1 - e**2) * T
    return RoughLosses(
        normal,
        many / 2 * q / (1 + q) * (1 - beta**2) * (T + T_rot / q),
        normal + 2 * many * (eta * (1 - eta) * T - eta**2 / q * T_rot),
        2 * many * (eta / q * (1 - eta / q) * T_rot - eta**2 / q * T),
    )


@numeric
def rough_temperature_ratio(e: ArrayLike, beta: ArrayLike, q: ArrayLike | None = None, d: int = 3) -> Array:
    r"""Ratio :math:`T_r/T` of the temperatures of rotation and translation of a rough gas that cools for long.

    .. math:: \frac{T_r}T = h + \sqrt{1 + h^2},\qquad
              h = \frac{(1 + q)^2}{2q(1 + \beta)^2}\Bigl[1 - e^2 - \frac{1 - q}{1 + q}(1 - \beta^2)\Bigr]

    for spheres, and for disks :math:`h + \sqrt{2 + h^2}`, with
    :math:`h = (1 + q)^2[1 - e^2 + 2\eta(1 - \eta) - 4(\eta/q)(1 - \eta/q)]/[q(1 + \beta)^2]` and
    :math:`\eta = q(1 + \beta)/[2(1 + q)]` (M. Huthmann, A. Zippelius 1997): the losses of :func:`rough_losses` are then
    in proportion to the energies. The ratio is 1 at e = β = 1; for smooth contacts, β = -1, it is infinite, and NaN at
    e = 1.

    It is a first approximation, since it takes velocities and spins to be independent, with Maxwell distributions, and
    leaves out friction's bound. Solutions of the Boltzmann equation by direct Monte Carlo, themselves good to 1 %, lie
    below it for spheres: at e = 0.9 by 8 % for β = -0.8, 5 % for -0.5 and 0, 2 % for 0.5, and less than 1 % for 0.9; at
    e = 0.7 by 10 %, 8 % and 2 % for -0.5, 0 and 0.5. For disks they lie 5 %, 6 % and 2 % below it at e = 0.9 and
    β = -0.5, 0 and 0.5.

    Parameters
    ----------
    beta
        Coefficient of tangential restitution, in [-1, 1].
    q
        :math:`I/(mR^2)`; default 2/5 for spheres, 1/2 for disks.
    """
    e, beta = np.asarray(e, float), np.asarray(beta, float)
    q, many = _inertia(q, d), check_dimension(d) - 1
    # Axes of translation by axes of rotation.
    ratio = 1.0 if d == 3 else 2.0
    eta = q * (1 + beta) / (2 * (1 + q))
    kept = (1 - e**2) / 4 + many / 2 * (eta * (1 - eta) - ratio * eta / q * (1 - eta / q))
    with np.errstate(divide="ignore", invalid="ignore"):
        h = kept / (many * eta**2 / q)
        root = np.sqrt(ratio + h**2)
        # For negative h without its cancellation.
        return np.where(h < 0, ratio / (root - h), h + root)


def _inertia(q: ArrayLike | None, d: int) -> Array:
    return np.asarray((0.4 if check_dimension(d) == 3 else 0.5) if q is None else q, float)
