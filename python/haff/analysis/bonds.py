"""Bond order of a state: how much the neighbors of a particle lie as in a crystal."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..common import arguments
from ..common.output import library
from ..errors import NotApplicableError
from ..files.conversions import frame_system
from ..files.layout import Array
from .gaps import particles

if TYPE_CHECKING:
    from ..files.box import Box

__all__ = ["BondOrder", "bond_order"]

NEIGHBORS = {2: 6, 3: 12}
"""Nearest neighbors of a particle in the densest crystal, by dimension."""


class BondOrder(NamedTuple):
    """Bond order of N particles."""

    local: Array
    """``[N]`` q₆ in three dimensions, \\|ψ₆\\| in two."""
    third: Array | None
    """``[N]`` ŵ₆, which distinguishes crystals of the same q₆; ``None`` in two dimensions."""
    direction: Array | None
    """``[N]`` angle of the bonds in two dimensions, arg(ψ₆)/6, in (−π/6, π/6]; ``None`` in three."""
    whole: float
    """The same of all bonds together: Q₆, or \\|⟨ψ₆⟩\\|; near 0 unless all bonds have common directions."""


class _Placed(NamedTuple):
    """What conversions need of a frame."""

    position: Array
    radius: Array
    box: Box


def bond_order(positions: ArrayLike, radii: ArrayLike, box: Box, *, neighbors: int | None = None) -> BondOrder:
    r"""Bond order of the nearest neighbors, by freud.

    In three dimensions Steinhardt's :math:`q_6 = \sqrt{\tfrac{4\pi}{13}\sum_m |\bar Y_{6m}|^2}` of the mean spherical
    harmonics of the bonds and the normalized third-order invariant ŵ₆: 0.5745 and −0.0132 for fcc, 0.4848 and −0.0124
    for hcp, 0.6633 and −0.1698 for icosahedra; about 0.29 for random bonds to 12 neighbors. In two dimensions
    :math:`\psi_6 = \tfrac{1}{n}\sum_j e^{6 i \theta_j}`, of size 1 for a hexagonal crystal.

    Parameters
    ----------
    positions, radii, box
        ``[N, 3]`` or ``[N, 2]`` [length], ``[N]`` [length] and the box, as for :func:`close_gaps`.
    neighbors
        Number of nearest neighbors n, by the distance of the centers; 12 in three dimensions and 6 in two by default.
        At walls neighbors are missing, and farther ones taken.

    Raises
    ------
    ArgumentError
        As :func:`close_gaps`; ``neighbors`` is not a whole number from 1.
    NotApplicableError
        There are not more particles than neighbors.

    freud computes in single precision.
    """
    position, radius = particles(positions, radii, box)
    d = box.dimension
    count = NEIGHBORS[d] if neighbors is None else arguments.count("neighbors", neighbors, 1, 1000)
    if len(position) <= count:
        raise NotApplicableError(f"{len(position)} particles are too few for {count} neighbors each")
    freud = library("freud", package="freud-analysis")
    system = frame_system(_Placed(position, radius, box))  # type: ignore[arg-type]
    near = {"num_neighbors": count}
    if d == 2:
        psi = np.asarray(freud.order.Hexatic(k=6).compute(system, near).particle_order, complex)
        return BondOrder(np.abs(psi), None, np.angle(psi) / 6, float(np.abs(psi.mean())))
    q = freud.order.Steinhardt(6).compute(system, near)
    w = freud.order.Steinhardt(6, wl=True, wl_normalize=True).compute(system, near)
    return BondOrder(np.asarray(q.particle_order, float), np.asarray(w.particle_order, float), None, float(q.order))
