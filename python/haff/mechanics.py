r"""Closed forms of the mechanics of impact: the exact solutions of the scenes of ``configs/textbook``.

Functions of numbers are vectorised: every number may be an array, and arrays broadcast. Equation numbers (2.x),
problems and sets are those of the chapter *Particle Impact*; units are those of the scene, angles are in radians.

====================  ==========================================================================
symbol                meaning
====================  ==========================================================================
``e``                 coefficient of restitution, in [0, 1]
``m1``, ``m2``        masses; infinite for a wall or a driven body
``n``                 contact normal, a unit vector from body 1 to body 2
``beta``              of rough contacts: coefficient of tangential restitution, -1 smooth to 1 perfectly rough
``friction``          Coulomb's coefficient μ
``q``                 I/(m R²) of the moment of inertia I: 2/5 for homogeneous spheres, 1/2 for homogeneous disks
``g``                 strength of gravity [length/time²]
``alpha``, ``beta``   angles of pendulums from hanging, of release and of the highest point
``theta``             angle of a rod to the line of flight
====================  ==========================================================================
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .common import arguments
from .errors import ArgumentError
from .text import quoted

__all__ = [
    "Impact",
    "RodImpact",
    "RoughImpact",
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
    "rough_impact",
    "spring_compression",
    "spring_impact",
    "swing",
]

Array = NDArray[np.float64]

_numeric = arguments.numeric(
    {
        "e": arguments.FRACTION,
        "m": arguments.POSITIVE,
        "m1": arguments.POSITIVE,
        "m2": arguments.POSITIVE,
        "g": arguments.POSITIVE,
        "length": arguments.POSITIVE,
        "height": arguments.NOT_NEGATIVE,
        "friction": arguments.NOT_NEGATIVE,
    }
)


def _vectors(size: int | None, **given: ArrayLike) -> list[Array]:
    """Vectors of so many components; ``None``: up to three, all the same."""
    vectors = {name: np.asarray(vector, float) for name, vector in given.items()}
    sizes = (1, 2, 3) if size is None else (size,)
    for name, vector in vectors.items():
        if vector.ndim != 1 or len(vector) not in sizes:
            allowed = " or ".join(f"[{size}]" for size in sizes)
            raise ArgumentError(f"{name} of shape {vector.shape}: must be one vector, {allowed}")
        sizes = (len(vector),)
    return list(vectors.values())


def _unit(normal: Array) -> Array:
    length = np.linalg.norm(normal)
    if length == 0:
        raise ArgumentError(f"n = {quoted(normal)}: must not be zero")
    return normal / length


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


@_numeric
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
    before_1, before_2, normal = _vectors(None, w1=w1, w2=w2, n=n)
    normal = _unit(normal)
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


class RoughImpact(NamedTuple):
    """Outcome of an impact of two rough spheres, from :func:`rough_impact`."""

    velocity_1: Array
    """``[3]`` velocity of body 1 afterwards [length/time]."""
    velocity_2: Array
    """``[3]`` velocity of body 2 afterwards [length/time]."""
    angular_velocity_1: Array
    """``[3]`` angular velocity of body 1 afterwards [1/time]."""
    angular_velocity_2: Array
    """``[3]`` angular velocity of body 2 afterwards [1/time]."""
    approach_speed: float
    r""":math:`v_n = (w_1 - w_2)\cdot n` [length/time]."""
    slip: Array
    """``[3]`` tangential relative velocity of the surfaces before, g_t [length/time]."""
    slides: bool
    """Whether the tangential impulse is that of Coulomb's law."""
    impulse: Array
    """``[3]`` impulse that body 2 receives [mass·length/time]."""
    energy_loss: float
    """Kinetic energy lost, of translation and rotation [energy]."""
    tangential_loss: float
    """The part of ``energy_loss`` by the tangential impulse [energy]."""
    carnot_energy: float
    """Energy of the lost velocities, of translation and rotation [energy]."""


@_numeric
def rough_impact(
    m1: float,
    m2: float,
    w1: ArrayLike,
    w2: ArrayLike,
    omega1: ArrayLike,
    omega2: ArrayLike,
    n: ArrayLike,
    e: float,
    beta: float,
    friction: float = np.inf,
    radii: tuple[float, float] = (0.5, 0.5),
    q: tuple[float, float] = (0.4, 0.4),
) -> RoughImpact:
    r"""Impact of two rough spheres by Walton's law; with an infinite mass, on a wall or a driven body.

    The surfaces have the relative velocity :math:`g = w_1 - w_2 - n\times(R_1\omega_1 + R_2\omega_2)`. Its normal
    component is reversed and multiplied by e, as by :func:`impact`. Its tangential component :math:`g_t` is reversed
    and multiplied by β, by the impulse

    .. math:: P_t = (1 + \beta)\,\frac{g_t}\Lambda,\qquad
              \Lambda = \frac{1 + 1/q_1}{m_1} + \frac{1 + 1/q_2}{m_2},

    or, where that is more than friction allows, :math:`|P_t| = \mu P_n` along :math:`g_t`. With
    :math:`\kappa = \Lambda|P_t|/|g_t|` the tangential loss is :math:`\tfrac12\kappa(2 - \kappa)\,g_t^2/\Lambda`, and
    Carnot's energy :math:`\tfrac12\kappa^2 g_t^2/\Lambda` (O. R. Walton, R. L. Braun, *J. Rheol.* **30**, 949 (1986)).

    Parameters
    ----------
    w1, w2
        ``[3]`` velocities before [length/time].
    omega1, omega2
        ``[3]`` angular velocities before [1/time]; that of a wall counts with its radius, 0.
    n
        ``[3]`` contact normal; it is made a unit vector.
    friction
        μ; infinite where β alone counts.
    radii
        Of the two bodies [length]; 0 for a wall.
    q
        I/(m R²) of the two bodies.

    Examples
    --------
    A sphere that slides over a floor with v = 7 and bounces on it, β = 0, then rolls with 5/7 of v:

    >>> after = rough_impact(1, np.inf, (7, 0, -1), (0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, -1), e=0.5, beta=0,
    ...                      radii=(2, 0))
    >>> print(after.velocity_1.round(12), after.angular_velocity_1.round(12), round(after.tangential_loss, 12))
    [5.  0.  0.5] [0.  2.5 0. ] 7.0
    """
    before_1, before_2, spin_1, spin_2, normal = _vectors(3, w1=w1, w2=w2, omega1=omega1, omega2=omega2, n=n)
    smooth = impact(m1, m2, w1, w2, n, e)
    normal = _unit(normal)
    relative = before_1 - before_2
    slip = relative - smooth.approach_speed * normal - np.cross(normal, radii[0] * spin_1 + radii[1] * spin_2)
    stiffness = (1 + 1 / q[0]) / m1 + (1 + 1 / q[1]) / m2
    speed = float(np.linalg.norm(slip))
    most = friction * smooth.impulse if np.isfinite(friction) else np.inf
    slides = bool((1 + beta) * speed > stiffness * most)
    # P_t = κ g_t/Λ, and 2 − κ.
    kappa = stiffness * most / speed if slides else 1 + beta
    left = 2 - kappa if slides else 1 - beta
    tangential = kappa / stiffness * slip
    loss = 0.5 * kappa * left * speed**2 / stiffness

    def spin(before: Array, m: float, radius: float, q: float) -> Array:
        return before if np.isinf(m) else before - np.cross(normal, tangential) / (q * m * radius)

    return RoughImpact(
        smooth.velocity_1 - tangential / m1,
        smooth.velocity_2 + tangential / m2,
        spin(spin_1, m1, radii[0], q[0]),
        spin(spin_2, m2, radii[1], q[1]),
        smooth.approach_speed,
        slip,
        slides,
        smooth.impulse * normal + tangential,
        smooth.energy_loss + loss,
        loss,
        smooth.carnot_energy + 0.5 * kappa**2 * speed**2 / stiffness,
    )


@_numeric
def plastic_loss_share(m1: ArrayLike, m2: ArrayLike) -> Array:
    r"""Share of its energy that body 1 loses in a plastic impact on body 2 at rest, :math:`1/(1 + m_1/m_2)` (2.18)."""
    return 1 / (1 + np.asarray(m1, float) / np.asarray(m2, float))


# --- bouncing sphere (Problem 2.1) -----------------------------------------------------------------


@_numeric
def bounce_height(k: ArrayLike, height: ArrayLike, e: ArrayLike) -> Array:
    r"""Clear height of the k-th rebound [length], :math:`H_k = e^{2k}H`; k = 0 is the drop."""
    return np.asarray(height, float) * np.asarray(e, float) ** (2 * np.asarray(k, float))


@_numeric
def bounce_time(k: ArrayLike, height: ArrayLike, e: ArrayLike, g: ArrayLike) -> Array:
    r"""Time of the k-th impact, k = 0, 1, …, after the drop [time], :math:`\sqrt{2H/g}\,(1 + 2e + \dots + 2e^k)`."""
    fall = np.sqrt(2 * np.asarray(height, float) / np.asarray(g, float))
    return fall * (2 * geometric_sum(e, np.asarray(k, float) + 1) - 1)


@_numeric
def rest_time(height: ArrayLike, e: ArrayLike, g: ArrayLike) -> Array:
    r"""Time after the drop until the sphere rests [time], :math:`\sqrt{2H/g}\,(1 + e)/(1 - e)`; infinite at e = 1."""
    e = np.asarray(e, float)
    with np.errstate(divide="ignore"):
        return np.sqrt(2 * np.asarray(height, float) / np.asarray(g, float)) * (1 + e) / (1 - e)


@_numeric
def bounce_path(height: ArrayLike, e: ArrayLike) -> Array:
    r"""Whole path until the sphere rests [length], :math:`H(1 + e^2)/(1 - e^2)`; infinite at e = 1."""
    e = np.asarray(e, float)
    with np.errstate(divide="ignore"):
        return np.asarray(height, float) * (1 + e**2) / (1 - e**2)


@_numeric
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


@_numeric
def geometric_sum(e: ArrayLike, count: ArrayLike) -> Array:
    """1 + e + e² + … with ``count`` terms: total duration of flights, each e times as long as its predecessor."""
    e, count = np.asarray(e, float), np.asarray(count, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        # (e^count − 1)/(e − 1) without its cancellation near e = 1.
        found = np.expm1(count * np.log(e)) / (e - 1)
    return np.where(count == 0, 0.0, np.where(e == 1, count, found))


# --- pendulums (Problem 2.3, Set 2.1) ----------------------------------------------------------------


@_numeric
def quarter_period(alpha: ArrayLike, length: ArrayLike, g: ArrayLike) -> Array:
    r"""Time from rest at ``alpha`` to the lowest point [time], :math:`\sqrt{l/g}\,K(\sin^2\tfrac\alpha2)`."""
    from scipy.special import ellipkm1

    alpha, length, g = (np.asarray(x, float) for x in (alpha, length, g))
    # K as a function of 1 − sin², since sin² rounds to 1 near the top.
    return np.sqrt(length / g) * ellipkm1(np.cos(alpha / 2) ** 2)


@_numeric
def swing(t: ArrayLike, alpha: ArrayLike, length: ArrayLike, g: ArrayLike) -> Array:
    r"""Angle of a pendulum at the times ``t`` after its release from rest at ``alpha``.

    :math:`\sin\tfrac\theta2 = \sin\tfrac\alpha2\;\mathrm{cd}(\sqrt{g/l}\,t)` with Jacobi's elliptic functions.
    """
    from scipy.special import ellipj

    k = np.sin(np.asarray(alpha, float) / 2)
    _, cn, dn, _ = ellipj(np.sqrt(np.asarray(g, float) / np.asarray(length, float)) * np.asarray(t, float), k**2)
    return 2 * np.arcsin(k * cn / dn)


@_numeric
def pendulum_rise(alpha: ArrayLike, e: ArrayLike, m1: ArrayLike = 1.0, m2: ArrayLike = 1.0) -> Array:
    r"""Highest angle of the struck pendulum, of mass ``m2``, when the other is released at ``alpha``.

    :math:`1 - \cos\beta = \left(\frac{(1 + e)m_1}{m_1 + m_2}\right)^2(1 - \cos\alpha)`; for equal masses Problem 2.3.
    NaN where the bob goes over the top.
    """
    alpha, e, m1, m2 = (np.asarray(x, float) for x in (alpha, e, m1, m2))
    # In half angles: 1 − cos cancels for small ones.
    half = np.abs(np.sin(alpha / 2)) * (1 + e) * m1 / (m1 + m2)
    return 2 * np.arcsin(np.where(half <= 1, half, np.nan))


@_numeric
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


@_numeric
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


@_numeric
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


@_numeric
def rod_stick(m: float, v: float, length: float, theta: float) -> RodImpact:
    """The particle sticks to the end (Set 2.2): v_cm = v/3, ω = v sin θ/(2 l)."""
    omega = v * np.sin(theta) / (2 * length)
    # Masses 2m and m at l/3 and 2l/3 from the center.
    after = m * v**2 / 6 + m * (omega * length) ** 2 / 3
    return RodImpact(v / 3, v / 3, omega, m * v**2 / 2 - after)


@_numeric
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
