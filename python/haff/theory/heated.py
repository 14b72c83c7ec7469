"""The steady states of a gas that is heated: by white noise, or in its contacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ._common import Array, check_dimension, numeric
from .collisions import collision_frequency


@numeric
def sonine_a2_heated(e: ArrayLike, d: int = 3) -> Array:
    r"""Second Sonine coefficient of a gas heated by white noise.

    .. math:: a_2 = \frac{16(1 - e)(1 - 2e^2)}{73 + 56d - 24de - 105e + 30(1 - e)e^2}

    (van Noije–Ernst 1998), defined as for :func:`sonine_a2`. It leaves out the higher coefficients
    (docs/validation.md has those of the Boltzmann equation).
    """
    e, d = np.asarray(e, float), check_dimension(d)
    return 16 * (1 - e) * (1 - 2 * e**2) / (73 + 56 * d - 24 * d * e - 105 * e + 30 * (1 - e) * e**2)


@numeric
def heated_temperature(
    strength: ArrayLike,
    e: ArrayLike,
    n: ArrayLike,
    sigma: ArrayLike,
    m: ArrayLike = 1.0,
    g0: ArrayLike = 1.0,
    d: int = 3,
    a2: ArrayLike | None = None,
) -> Array:
    r"""Temperature of the steady state of a gas heated by white noise [energy].

    .. math:: \frac{d\,m\,\xi_0^2}2 = \frac{(1 - e^2)\,\omega(T)\,T}2\Bigl(1 + \frac{3a_2}{16}\Bigr)

    with :math:`\omega` of :func:`collision_frequency`, and :math:`a_2` there zero.

    Parameters
    ----------
    strength
        :math:`\xi_0^2` [length²/time³]: variance that each component of a velocity gets in a unit of time.
    a2
        Sonine coefficient; default :func:`sonine_a2_heated` of ``e`` and ``d``. Infinite temperature at e = 1.
    """
    strength, e, m = np.asarray(strength, float), np.asarray(e, float), np.asarray(m, float)
    a2 = sonine_a2_heated(e, d) if a2 is None else np.asarray(a2, float)
    rate = collision_frequency(n, sigma, 1.0, m, g0, d)
    with np.errstate(divide="ignore"):
        return (d * m * strength / ((1 - e**2) * rate * (1 + 3 * a2 / 16))) ** (2 / 3)


@numeric
def suspension_temperature(
    strength: ArrayLike,
    drag_time: ArrayLike,
    e: ArrayLike,
    n: ArrayLike,
    sigma: ArrayLike,
    m: ArrayLike = 1.0,
    g0: ArrayLike = 1.0,
    d: int = 3,
    a2: ArrayLike = 0.0,
) -> Array:
    r"""Temperature of the steady state of a granular suspension: grains with a drag and white noise [energy].

    .. math:: \frac{d\,m\,\xi_0^2}2 = \frac{d\,T}\tau + \frac{(1 - e^2)\,\omega(T)\,T}2\Bigl(1 + \frac{3a_2}{16}\Bigr)

    (Hayakawa 2003), the balance of :func:`heated_temperature` with what a drag :math:`dv/dt = -v/\tau` takes. Without
    collisions, or at e = 1, it is the temperature of the bath, :math:`m\xi_0^2\tau/2`.

    Parameters
    ----------
    strength
        :math:`\xi_0^2` [length²/time³]: variance that each component of a velocity gets in a unit of time.
    drag_time
        :math:`\tau` [time].
    a2
        Sonine coefficient; default zero, velocities of Maxwell.
    """
    strength, drag_time, e, m = (np.asarray(x, float) for x in (strength, drag_time, e, m))
    bath = 0.5 * m * strength * drag_time
    rate = collision_frequency(n, sigma, 1.0, m, g0, d) * np.sqrt(bath)
    loss = drag_time * (1 - e**2) * rate * (1 + 3 * np.asarray(a2, float) / 16) / (2 * d)
    # 1 = x² + loss x³ for x = √(T/T_bath). Its left side minus its right one is concave: Newton's method goes down to
    # the root from 1.
    x = np.ones(np.broadcast(bath, loss).shape)
    for _ in range(100):
        x = x - (x**2 + loss * x**3 - 1) / (2 * x + 3 * loss * x**2)
    return bath * x**2


@numeric
def added_speed_temperature(delta: ArrayLike, e: ArrayLike, m: ArrayLike = 1.0) -> Array:
    r"""Temperature of the steady state of a gas whose contacts add :math:`2\Delta` to their speed [energy].

    .. math:: T = m\Delta^2 \left(\frac{\sqrt\pi\,e + \sqrt{\pi e^2 + 4(1 - e^2)}}{2(1 - e^2)}\right)^2

    (Brito, Risso, Soto 2013): with velocities of Maxwell, contacts gain
    :math:`m(\Delta^2 + e\Delta\langle v_n\rangle)` and lose :math:`m(1 - e^2)\langle v_n^2\rangle/4` on average. The
    same in two and three dimensions, and at all densities. docs/validation.md has how near it is to the Boltzmann
    equation.

    Parameters
    ----------
    delta
        :math:`\Delta` [length/time], ``contact.added_speed``. Infinite temperature at e = 1.
    """
    delta, e, m = np.asarray(delta, float), np.asarray(e, float), np.asarray(m, float)
    with np.errstate(divide="ignore"):
        speed = (np.sqrt(np.pi) * e + np.sqrt(np.pi * e**2 + 4 * (1 - e**2))) / (2 * (1 - e**2))
        return m * (delta * speed) ** 2
