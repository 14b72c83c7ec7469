"""The deepest overlap of a frame."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..layout import Array

if TYPE_CHECKING:
    from ..frames import Box, Frame


class Overlap(NamedTuple):
    """The deepest overlap of a frame."""

    depth: float
    """(R_i + R_j − |r_ij|)/(R_i + R_j), relative to the contact distance; negative: the closest pair is apart."""
    pair: tuple[int, int]
    """Rows of the two particles, (−1, −1) if no pair is near contact."""


def max_overlap(frame: Frame) -> Overlap:
    """Deepest overlap of all close pairs of a frame, relative to the pair's contact distance.

    A k-d tree finds every pair nearer than the largest contact distance, across periodic faces too, those of a sheared
    box among them; sizes may differ. Pairs of two bodies of infinite mass are excluded: they may overlap by
    construction.
    """
    radius, box = frame.radius, frame.box
    if len(radius) < 2:
        return Overlap(-np.inf, (-1, -1))
    # A box side of 0 means "not periodic" to cKDTree; positions must lie in [0, L) where it is.
    sides = np.where(box.periodic, box.size, 0.0)
    position = np.where(box.periodic, np.mod(frame.position, np.where(box.periodic, box.size, 1.0)), frame.position)
    position = np.where(box.periodic & (position >= box.size), 0.0, position)
    reach = 2 * radius.max() * (1 + 1e-9)
    if np.any(box.periodic & (box.size < 2 * reach)):
        blocks = _all_pairs(len(position))
    elif box.displacement is not None:
        blocks = iter([_sheared_pairs(position, box, reach)])
    else:
        from scipy.spatial import cKDTree

        blocks = iter([cKDTree(position, boxsize=sides).query_pairs(reach, output_type="ndarray")])
    heavy = np.isinf(frame.mass)
    deepest = Overlap(-np.inf, (-1, -1))
    for pairs in blocks:
        pairs = pairs[~(heavy[pairs[:, 0]] & heavy[pairs[:, 1]])]
        gap = box.nearest(position[pairs[:, 1]] - position[pairs[:, 0]])
        contact = radius[pairs[:, 0]] + radius[pairs[:, 1]]
        depth = (contact - np.linalg.norm(gap, axis=1)) / contact
        if depth.max(initial=-np.inf) > deepest.depth:
            worst = int(np.argmax(depth))
            deepest = Overlap(float(depth[worst]), (int(pairs[worst, 0]), int(pairs[worst, 1])))
    return deepest


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
