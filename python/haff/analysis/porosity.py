"""Porosity of packings in cylinders, spheres and circles, by the distance from the wall."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..common import arguments
from ..errors import NotApplicableError
from ..files.layout import Array
from .gaps import particles

if TYPE_CHECKING:
    from ..files.box import Box

__all__ = ["RadialPorosity", "radial_porosity"]

MOST = 100_000
"""Largest number of distances."""
POINTS = 32
"""Points of the quadrature over the angle that a sphere takes in a cylinder."""


class RadialPorosity(NamedTuple):
    """The part of a container that is empty, by the distance from its wall."""

    distance: NDArray[np.float64]
    """``[B]`` distances from the wall [length], rising."""
    porosity: NDArray[np.float64]
    """``[B]`` the part of the surface at that distance from the wall that is in no particle."""


def radial_porosity(positions: ArrayLike, radii: ArrayLike, box: Box, bins: int = 100) -> RadialPorosity:
    r"""The local porosity of a packing in a cylinder, a sphere or a circle.

    At a distance from the wall it is the part of the surface there (a cylinder, a sphere, a circle) that is in no
    particle: 1 at the wall, with minima in layers of particles. Spheres and circles are cut exactly. Of a cylinder the
    chords along its axis are integrated over the angle θ = θ₀ sin ψ that a particle takes, with a relative error of
    about 10⁻⁴. Those of a cylinder with ends include what is near them.

    Parameters
    ----------
    positions, radii, box
        As for :func:`contact_network`; the box has a container, such as that of :func:`haff.pack` and of frames.
    bins
        Number of distances B, at the middles of equal steps from the wall to the axis or the center.

    Raises
    ------
    ArgumentError
        As :func:`close_gaps`, or ``bins`` is no number from 1 to 100,000.
    NotApplicableError
        The box has no container, or one of another shape.

    Examples
    --------
    >>> import haff
    >>> packing = haff.pack(1000, "jammed", container="tube", seed=1)               # doctest: +SKIP
    >>> found = haff.analysis.radial_porosity(packing.positions, packing.radii, packing.box)  # doctest: +SKIP
    """
    position, radius = particles(positions, radii, box)
    count = arguments.count("bins", bins, 1, MOST)
    if box.container is None:
        raise NotApplicableError("the box has no container: a cylinder, a sphere or a circle")
    if (circular := box.container.circular(box.size)) is None:
        raise NotApplicableError("the container is neither a cylinder along an axis with a circle in it, nor a sphere")
    center, axis, outer, length = circular
    r = position - center
    r -= (r @ axis)[:, None] * axis
    rho = np.linalg.norm(r, axis=1)
    distance = (np.arange(count) + 0.5) * outer / count
    at = outer - distance
    solid = np.array([_solid(float(one), rho, radius, box.dimension, length) for one in at])
    return RadialPorosity(distance, 1.0 - solid)


def _solid(at: float, rho: Array, radius: Array, d: int, length: float | None) -> float:
    """The part of the surface at a radius that is in particles at distances ``rho`` from the axis or the center."""
    near = np.abs(rho - at) < radius
    c, a = rho[near], radius[near]
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.clip((at * at + c * c - a * a) / (2 * at * c), -1.0, 1.0)
    # All of it, if the particle is around the center.
    cosine = np.where(c == 0, -1.0, cosine)
    if length is None:
        return float(np.sum(np.arccos(cosine) / np.pi if d == 2 else (1 - cosine) / 2))
    node, weight = np.polynomial.legendre.leggauss(POINTS)
    psi, widest = np.pi / 2 * node, np.arccos(cosine)[:, None]
    angle = widest * np.sin(psi)
    square = a[:, None] ** 2 - at * at - c[:, None] ** 2 + 2 * at * c[:, None] * np.cos(angle)
    chord = 2 * np.sqrt(np.maximum(square, 0.0))
    area = (chord * np.cos(psi) * weight).sum(axis=1) * np.pi / 2 * widest[:, 0]
    return float(area.sum() / (2 * np.pi * length))
