"""Energies and temperatures of a frame."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..errors import NotApplicableError
from ..files.layout import Array
from .checked import checked
from .species import Species, mobile

if TYPE_CHECKING:
    from ..files.frames import Frame


@checked
def kinetic_energy(frame: Frame) -> float:
    """Σ ½ m v² over bodies of finite mass, of translation [energy], summed exactly and rounded once.

    In a sheared box the velocities are those relative to the flow.
    """
    mobile = np.isfinite(frame.mass)
    return _energy(frame.mass[mobile], frame.peculiar_velocity[mobile])


@checked
def rotational_energy(frame: Frame) -> float:
    """Σ ½ I ω², I = q m R², over bodies of finite mass [energy], summed exactly and rounded once; 0 without spin."""
    if frame.inertia is None or frame.angular_velocity is None:
        return 0.0
    mobile = np.isfinite(frame.mass)
    moment = (frame.inertia * frame.mass * frame.radius**2)[mobile]
    return _energy(moment, frame.angular_velocity[mobile])


def _energy(mass: Array, velocity: Array) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        energies = 0.5 * mass * np.einsum("ij,ij->i", velocity, velocity)
    try:
        total = math.fsum(energies)
    except OverflowError:
        total = math.inf
    if not math.isfinite(total):
        raise NotApplicableError("the kinetic energy is too large for a number")
    return total


@checked
def temperature(frame: Frame, species: Species | None = None) -> float:
    """T = Σ m|v − V|²/(dN) over bodies of finite mass [energy], with :attr:`Frame.thermal_velocity` for v − V.

    V is the velocity of their center of mass along axes on which momentum is conserved, else 0. ``species``, a name or
    an index, restricts the sum, not V.
    """
    chosen = mobile(frame, species)
    if not chosen.any():
        return float("nan")
    energy = np.sum(frame.mass[chosen, None] * frame.thermal_velocity[chosen] ** 2)
    return float(energy / (frame.box.dimension * chosen.sum()))


@checked
def rotational_temperature(frame: Frame, species: Species | None = None) -> float:
    """T_rot = Σ I ω²/(rN) over bodies of finite mass [energy], of r = 3 axes of rotation, 1 in two dimensions.

    NaN without such bodies, or without spin. ``species``, a name or an index, restricts the sum.
    """
    chosen = mobile(frame, species)
    if frame.inertia is None or frame.angular_velocity is None:
        return float("nan")
    if not chosen.any():
        return float("nan")
    moment = (frame.inertia * frame.mass * frame.radius**2)[chosen]
    energy = np.sum(moment[:, None] * frame.angular_velocity[chosen] ** 2)
    return float(energy / ((1 if frame.box.dimension == 2 else 3) * chosen.sum()))
