r"""Closed forms of the mechanics of impact: the exact solutions of the scenes of ``configs/textbook``.

Functions of numbers are vectorised: every number may be an array, and arrays broadcast. Equation numbers (2.x),
problems and sets are those of the chapter *Particle Impact*; units are those of the scene, angles are in radians.

====================  ==========================================================================
symbol                meaning
====================  ==========================================================================
``e``                 coefficient of restitution, in [0, 1]
``m1``, ``m2``        masses; infinite for a wall or a driven body
``n``                 contact normal, a unit vector from body 1 to body 2
``g``                 strength of gravity [length/time²]
``alpha``, ``beta``   angles of pendulums from hanging, of release and of the highest point
``theta``             angle of a rod to the line of flight
====================  ==========================================================================
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipj, ellipkm1

__all__ = [
    "Impact",
    "RodImpact",
    "SpringImpact",
    "bounce_height",
    "bounce_path",
    "bounce_position",
    "bounce_time",
    "geometric_sum",
    "impact",
    "pendulum_restitution",
    "pendulum_rise",
    "plastic_loss_share",
    "quarter_period",
    "rest_time",
    "rod_impact",
    "rod_stick",
    "spring_compression",
    "spring_impact",
    "swing",
]

Array = NDArray[np.float64]


# --- impact ----------------------------------------------------------------------------------------


class Impact(NamedTuple):
    """Outcome of an impact of two smooth spheres, from :func:`impact`."""

    velocity_1: Array
    """``[D]`` velocity of body 1 afterwards [length/time]."""
    velocity_2: Array
    """``[D]`` velocity of body 2 afterwards [length/time]."""
    approach_speed: float
    r""":math:`v_n = (w_1 - w_2)\cdot n` [length/time]."""
    impulse: float
    r""":math:`J = (1 + e)\,\mu v_n` [mass·length/time]."""
    energy_loss: float
    r""":math:`\Delta T = \tfrac12\mu v_n^2(1 - e^2)` [energy] (2.16)."""
    carnot_energy: float
    r""":math:`E'_c = J^2/2\mu`, the energy of the lost velocities [energy] (2.31)."""


def impact(m1: float, m2: float, w1: ArrayLike, w2: ArrayLike, n: ArrayLike, e: float) -> Impact:
    r"""Impact of two smooth spheres, (2.14), (2.19), (2.20); with an infinite mass, on a wall (2.21).

    Parameters
    ----------
    w1, w2
        ``[D]`` velocities before [length/time].
    n
        ``[D]`` contact normal; it is made a unit vector.

    Examples
    --------
    Problem 2.2:

    >>> after = impact(1.0, 1.0, (30, 10), (-10, -30), n=(1, 0), e=0.5)
    >>> after.velocity_1.tolist(), after.velocity_2.tolist()
    ([0.0, 10.0], [20.0, -30.0])
    """
    before_1, before_2, normal = (np.asarray(vector, float) for vector in (w1, w2, n))
    normal = normal / np.linalg.norm(normal)
    approach = float((before_1 - before_2) @ normal)
    reduced = 1 / (1 / m1 + 1 / m2)
    impulse = (1 + e) * reduced * approach
    return Impact(
        before_1 - impulse / m1 * normal,
        before_2 + impulse / m2 * normal,
        approach,
        impulse,
        0.5 * reduced * approach**2 * (1 - e**2),
        0.5 * impulse**2 / reduced,
    )


def plastic_loss_share(m1: ArrayLike, m2: ArrayLike) -> Array:
    r"""Share of its energy that body 1 loses in a plastic impact on body 2 at rest, :math:`1/(1 + m_1/m_2)` (2.18)."""
    return 1 / (1 + np.asarray(m1, float) / np.asarray(m2, float))


# --- bouncing sphere (Problem 2.1) -----------------------------------------------------------------


def bounce_height(k: ArrayLike, height: ArrayLike, e: ArrayLike) -> Array:
    r"""Clear height of the k-th rebound [length], :math:`H_k = e^{2k}H`; k = 0 is the drop."""
    return np.asarray(height, float) * np.asarray(e, float) ** (2 * np.asarray(k, float))


def bounce_time(k: ArrayLike, height: ArrayLike, e: ArrayLike, g: ArrayLike) -> Array:
    r"""Time of the k-th impact, k = 0, 1, …, after the drop [time], :math:`\sqrt{2H/g}\,(1 + 2e + \dots + 2e^k)`."""
    fall = np.sqrt(2 * np.asarray(height, float) / np.asarray(g, float))
    return fall * (2 * geometric_sum(e, np.asarray(k, float) + 1) - 1)


def rest_time(height: ArrayLike, e: ArrayLike, g: ArrayLike) -> Array:
    r"""Time after the drop until the sphere rests [time], :math:`\sqrt{2H/g}\,(1 + e)/(1 - e)`; infinite at e = 1."""
    e = np.asarray(e, float)
    with np.errstate(divide="ignore"):
        return np.sqrt(2 * np.asarray(height, float) / np.asarray(g, float)) * (1 + e) / (1 - e)


def bounce_path(height: ArrayLike, e: ArrayLike) -> Array:
    r"""Whole path until the sphere rests [length], :math:`H(1 + e^2)/(1 - e^2)`; infinite at e = 1."""
    e = np.asarray(e, float)
    with np.errstate(divide="ignore"):
        return np.asarray(height, float) * (1 + e**2) / (1 - e**2)


def bounce_position(t: ArrayLike, height: float, e: float, g: float) -> Array:
    """Clear height [length] of a sphere at the times ``t`` after its drop; 0 from :func:`rest_time` on."""
    t = np.asarray(t, float)
    fall = np.sqrt(2 * height / g)
    ahead = t + fall  # time since a fictitious launch from the floor
    if e >= 1:
        k = np.floor(ahead / (2 * fall))
    elif e <= 0:
        k = np.where(t < fall, 0.0, np.inf)
    else:
        # Impacts 0, 1, … end flights 0, 1, … of 2 fall e^k each.
        left = 1 - ahead * (1 - e) / (2 * fall)
        with np.errstate(divide="ignore", invalid="ignore"):
            k = np.where(left > 0, np.floor(np.log(left) / np.log(e)), np.inf)
    flying = np.isfinite(k)
    k = np.where(flying, k, 0.0)
    since = ahead - 2 * fall * geometric_sum(e, k)
    up = g * fall * np.asarray(e, float) ** k
    return np.where(flying, np.maximum(up * since - 0.5 * g * since**2, 0.0), 0.0)


def geometric_sum(e: ArrayLike, count: ArrayLike) -> Array:
    """1 + e + e² + … with ``count`` terms: total duration of flights, each e times as long as its predecessor."""
    e, count = np.asarray(e, float), np.asarray(count, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        # (e^count − 1)/(e − 1) without its cancellation near e = 1.
        found = np.expm1(count * np.log(e)) / (e - 1)
    return np.where(count == 0, 0.0, np.where(e == 1, count, found))


# --- pendulums (Problem 2.3, Set 2.1) ----------------------------------------------------------------


def quarter_period(alpha: ArrayLike, length: ArrayLike, g: ArrayLike) -> Array:
    r"""Time from rest at ``alpha`` to the lowest point [time], :math:`\sqrt{l/g}\,K(\sin^2\tfrac\alpha2)`."""
    alpha, length, g = (np.asarray(x, float) for x in (alpha, length, g))
    # K as a function of 1 − sin², since sin² rounds to 1 near the top.
    return np.sqrt(length / g) * ellipkm1(np.cos(alpha / 2) ** 2)


def swing(t: ArrayLike, alpha: ArrayLike, length: ArrayLike, g: ArrayLike) -> Array:
    r"""Angle of a pendulum at the times ``t`` after its release from rest at ``alpha``.

    :math:`\sin\tfrac\theta2 = \sin\tfrac\alpha2\;\mathrm{cd}(\sqrt{g/l}\,t)` with Jacobi's elliptic functions.
    """
    k = np.sin(np.asarray(alpha, float) / 2)
    _, cn, dn, _ = ellipj(np.sqrt(np.asarray(g, float) / np.asarray(length, float)) * np.asarray(t, float), k**2)
    return 2 * np.arcsin(k * cn / dn)


def pendulum_rise(alpha: ArrayLike, e: ArrayLike, m1: ArrayLike = 1.0, m2: ArrayLike = 1.0) -> Array:
    r"""Highest angle of the struck pendulum, of mass ``m2``, when the other is released at ``alpha``.

    :math:`1 - \cos\beta = \left(\frac{(1 + e)m_1}{m_1 + m_2}\right)^2(1 - \cos\alpha)`; for equal masses Problem 2.3.
    NaN where the bob goes over the top.
    """
    alpha, e, m1, m2 = (np.asarray(x, float) for x in (alpha, e, m1, m2))
    # In half angles: 1 − cos cancels for small ones.
    half = np.abs(np.sin(alpha / 2)) * (1 + e) * m1 / (m1 + m2)
    return 2 * np.arcsin(np.where(half <= 1, half, np.nan))


def pendulum_restitution(alpha: ArrayLike, beta: ArrayLike, m1: ArrayLike = 1.0, m2: ArrayLike = 1.0) -> Array:
    r"""Coefficient of restitution from the angles of release and of the struck bob's rise (Set 2.1).

    :math:`e = \frac{m_1 + m_2}{m_1}\sqrt{\frac{1 - \cos\beta}{1 - \cos\alpha}} - 1`
    """
    alpha, beta, m1, m2 = (np.asarray(x, float) for x in (alpha, beta, m1, m2))
    return (m1 + m2) / m1 * np.abs(np.sin(beta / 2) / np.sin(alpha / 2)) - 1


# --- spring (Problem 2.4) ------------------------------------------------------------------------------


class SpringImpact(NamedTuple):
    """Body 1 hits body 2 with e = 0; 2 and 3 are joined by a spring; all masses equal."""

    speed_after: float
    """Of 1 and 2 just after the impact, v/2 [length/time]."""
    largest_compression: float
    """v √(m/6k) [length]."""
    contact_time: float
    """From the impact to where 1 leaves 2, π √(2m/3k) [time]."""
    speed_1: float
    """Of body 1 after it has left, v/6 [length/time]."""
    speed_center: float
    """Of the center of 2 and 3 from then on, 5v/12 [length/time]."""
    smallest_energy_2: float
    """Kinetic energy, mv²/72 [energy]."""
    largest_energy_3: float
    """Kinetic energy, 2mv²/9 [energy]."""


def spring_impact(m: float, v: float, k: float) -> SpringImpact:
    """Three equal bodies and a spring of stiffness ``k``, body 1 arriving at speed ``v`` (Problem 2.4)."""
    return SpringImpact(
        v / 2,
        v * np.sqrt(m / (6 * k)),
        np.pi * np.sqrt(2 * m / (3 * k)),
        v / 6,
        5 * v / 12,
        m * v**2 / 72,
        2 * m * v**2 / 9,
    )


def spring_compression(t: ArrayLike, m: float, v: float, k: float) -> Array:
    """Compression of the spring of :func:`spring_impact` at the times ``t`` since the impact [length]; 0 before."""
    t = np.asarray(t, float)
    found = spring_impact(m, v, k)
    together = found.largest_compression * np.sin(np.sqrt(1.5 * k / m) * t)
    # At the release 2 moves at v/6 and 3 at 2v/3: the spring is pulled out.
    rate = np.sqrt(2 * k / m)
    apart = -(v / 2) / rate * np.sin(rate * (t - found.contact_time))
    return np.where(t <= 0, 0.0, np.where(t <= found.contact_time, together, apart))


# --- rod (Sets 2.2 and 2.3) ------------------------------------------------------------------------------


class RodImpact(NamedTuple):
    """A particle has hit the end of a rigid massless rod with two particles; all masses equal."""

    speed: float
    """Of the particle along its line of flight; where it sticks, of all three's center [length/time]."""
    center_speed: float
    """Of the center of mass of the rod; where the particle sticks, of all three [length/time]."""
    angular_velocity: float
    """Of the rod, positive where the hit end turns along the line of flight [1/time]."""
    energy_loss: float
    """[energy]"""


def rod_stick(m: float, v: float, length: float, theta: float) -> RodImpact:
    """The particle sticks to the end (Set 2.2): v_cm = v/3, ω = v sin θ/(2 l)."""
    omega = v * np.sin(theta) / (2 * length)
    # Masses 2m and m at l/3 and 2l/3 from the center.
    after = m * v**2 / 6 + m * (omega * length) ** 2 / 3
    return RodImpact(v / 3, v / 3, omega, m * v**2 / 2 - after)


def rod_impact(m: float, v: float, length: float, theta: float, e: float = 1.0) -> RodImpact:
    """Smooth impact on the end, the normal along the line of flight; e = 1 is Set 2.3, J = 4mv/(3 + sin²θ)."""
    compliance = (3 + np.sin(theta) ** 2) / (2 * m)
    impulse = (1 + e) * v / compliance
    return RodImpact(
        v - impulse / m,
        impulse / (2 * m),
        impulse * np.sin(theta) / (m * length),
        (1 - e**2) * v**2 / (2 * compliance),
    )
