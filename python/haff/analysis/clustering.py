"""Clusters of particles that are nearly in contact."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arguments import positive
from ..layout import computing
from .pairs import close_pairs, require_room

if TYPE_CHECKING:
    from ..frames import Frame

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


def clusters(frame: Frame, distance: float = 1.1) -> Clusters:
    """Clusters of a frame: particles that are linked, directly or by others.

    Two particles are linked if their centers are at most ``distance`` contact distances R_i + R_j apart (for equal
    ones, diameters), as nearest images across periodic faces, those of sheared boxes among them. A particle without a link is
    a cluster of one. Bodies of infinite mass count as others do.

    Raises
    ------
    ArgumentError
        ``distance`` is not positive.
    NotApplicableError
        A periodic edge is not longer than twice the longest link.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    distance = positive("distance", distance)
    radius = frame.radius
    reach = 2 * distance * float(radius.max())
    require_room(frame.box, reach, "links of clusters")
    first, second = [], []
    with computing(frame.file.path, "clusters"):
        for pairs in close_pairs(frame.box, frame.position, reach):
            linked = pairs.distance <= distance * (radius[pairs.first] + radius[pairs.second])
            linked &= pairs.first < pairs.second
            first.append(pairs.first[linked])
            second.append(pairs.second[linked])
    i, j = np.concatenate(first), np.concatenate(second)
    graph = coo_array((np.ones(len(i), np.int8), (i, j)), shape=(len(radius), len(radius)))
    _, found = connected_components(graph, directed=False)
    sizes = np.bincount(found)
    where = np.full(len(sizes), len(found))
    np.minimum.at(where, found, np.arange(len(found)))
    order = np.lexsort((where, -sizes))
    rank = np.empty(len(sizes), np.int64)
    rank[order] = np.arange(len(sizes))
    return Clusters(sizes[order].astype(np.int64), rank[found])
