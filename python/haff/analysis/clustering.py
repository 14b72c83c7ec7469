"""Clusters of particles that are nearly in contact."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..common.arguments import positive
from ..errors import NotApplicableError
from ..files.layout import computing
from .checked import checked
from .pairs import require_room
from .trees import near_pairs

if TYPE_CHECKING:
    from ..files.frames import Frame

__all__ = ["Clusters", "clusters"]


class Clusters(NamedTuple):
    """Clusters of a frame, the largest first; of equal ones that of the first particle first."""

    sizes: NDArray[np.int64]
    """``[C]`` numbers of particles."""
    label: NDArray[np.int64]
    """``[N]`` cluster of each particle, its row of ``sizes``: 0 is the largest."""

    @property
    def largest(self) -> int:
        """Number of particles of the largest cluster."""
        return int(self.sizes[0])


@checked
def clusters(frame: Frame, distance: float = 1.1) -> Clusters:
    """Clusters of a frame: particles that are linked, directly or by others.

    Two particles are linked if their centers are at most ``distance`` contact distances R_i + R_j apart; of equal ones
    these are diameters. Distances are those of nearest images across periodic faces, also in sheared boxes. A particle
    without a link is a cluster of one. Bodies of infinite mass count as others do.

    Raises
    ------
    ArgumentError
        ``distance`` is not positive.
    NotApplicableError
        A periodic edge is not longer than twice the longest link; there is no particle.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    distance = positive("distance", distance)
    radius = frame.radius
    if not len(radius):
        raise NotApplicableError(f"no particle is there at t = {frame.time:g}")
    reach = 2 * distance * float(radius.max())
    require_room(frame.box, reach, "links of clusters")
    links = []
    with computing(frame.file.path, "clusters"):
        for pairs, apart in near_pairs(frame.box, frame.position, reach * (1 + 1e-9)):
            links.append(pairs[apart <= distance * (radius[pairs[:, 0]] + radius[pairs[:, 1]])])
    i, j = np.concatenate(links).T
    graph = coo_array((np.ones(len(i), np.int8), (i, j)), shape=(len(radius), len(radius)))
    _, found = connected_components(graph, directed=False)
    sizes = np.bincount(found)
    where = np.full(len(sizes), len(found))
    np.minimum.at(where, found, np.arange(len(found)))
    order = np.lexsort((where, -sizes))
    rank = np.empty(len(sizes), np.int64)
    rank[order] = np.arange(len(sizes))
    return Clusters(sizes[order].astype(np.int64), rank[found])
