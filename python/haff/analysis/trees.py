"""Pairs of particles near contact by k-d trees, in rectangular and sheared boxes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..files.layout import Array

if TYPE_CHECKING:
    from ..files.frames import Box


def near_pairs(box: Box, position: Array, reach: float) -> Iterator[tuple[NDArray[np.intp], Array]]:
    """Rows ``[P, 2]`` of all pairs within ``reach`` [length], each once, and their distances ``[P]``, in pieces.

    Some pairs further apart are among them. Distances are those of the nearest images.
    """
    # A box side of 0 means "not periodic" to cKDTree; positions must lie in [0, L) where it is.
    sides = np.where(box.periodic, box.size, 0.0)
    position = np.where(box.periodic, np.mod(position, np.where(box.periodic, box.size, 1.0)), position)
    position = np.where(box.periodic & (position >= box.size), 0.0, position)
    if np.any(box.periodic & (box.size < 2 * reach)):
        blocks = _all_pairs(len(position))
    elif box.displacement is not None:
        blocks = iter([_sheared_pairs(position, box, reach)])
    else:
        from scipy.spatial import cKDTree

        blocks = iter([cKDTree(position, boxsize=sides).query_pairs(reach, output_type="ndarray")])
    for pairs in blocks:
        gap = box.nearest(position[pairs[:, 1]] - position[pairs[:, 0]])
        yield pairs, np.linalg.norm(gap, axis=1)


def _sheared_pairs(position: Array, box: Box, reach: float) -> NDArray[np.intp]:
    """Rows of all pairs within ``reach`` in a sheared box; across the faces of the gradient axis by copies there."""
    from scipy.spatial import cKDTree

    assert box.displacement is not None
    gradient, flow, _ = box.displacement
    low = np.flatnonzero(position[:, gradient] <= reach)
    copies = position[low] + box.edges[gradient]
    copies[:, flow] = np.mod(copies[:, flow], box.size[flow])
    copies[copies[:, flow] >= box.size[flow], flow] = 0.0
    sides = box.size.copy()
    sides[gradient] = 0.0
    tree = cKDTree(np.concatenate([position, copies]), boxsize=sides)
    pairs = np.concatenate([np.arange(len(position)), low])[tree.query_pairs(reach, output_type="ndarray")]
    # A particle may be near its own copy only in a box that is thinner than twice the reach.
    return pairs[pairs[:, 0] != pairs[:, 1]]


def _all_pairs(count: int) -> Iterator[NDArray[np.intp]]:
    """Every pair once, about a million at a time: for boxes too small for a periodic tree."""
    rows = max(1, (1 << 20) // count)
    for first in range(0, count, rows):
        i, j = np.meshgrid(np.arange(first, min(first + rows, count)), np.arange(count), indexing="ij")
        yield np.stack([i[i < j], j[i < j]], axis=1)
