"""Pairs of particles near contact by k-d trees, in rectangular and sheared boxes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import NotApplicableError
from ..files.layout import Array

if TYPE_CHECKING:
    from ..files.box import Box

SLACK = 1e-9
"""Relative rounding of distances: searches reach farther by it."""
MOST_IMAGES = 10_000
"""Images of a box that are searched: ten edges away in all directions."""


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
        every = np.arange(len(position))
        blocks = iter([within(box, folded(box, position), every, every, reach)[0]])
    else:
        from scipy.spatial import cKDTree

        blocks = iter([cKDTree(position, boxsize=sides).query_pairs(reach, output_type="ndarray")])
    for pairs in blocks:
        gap = box.nearest(position[pairs[:, 1]] - position[pairs[:, 0]])
        yield pairs, np.linalg.norm(gap, axis=1)


def _all_pairs(count: int) -> Iterator[NDArray[np.intp]]:
    """Every pair once, about a million at a time: for boxes too small for a periodic tree."""
    rows = max(1, (1 << 20) // count)
    for first in range(0, count, rows):
        i, j = np.meshgrid(np.arange(first, min(first + rows, count)), np.arange(count), indexing="ij")
        yield np.stack([i[i < j], j[i < j]], axis=1)


def folded(box: Box, position: Array) -> Array:
    """Positions within the edge vectors, which lean in a sheared box; those that are there keep all their digits."""
    d = box.dimension
    cells = np.where(box.periodic[:d], np.floor(position[:, :d] @ np.linalg.inv(box.edges[:d, :d])), 0.0)
    position = position.copy()
    position[:, :d] -= cells @ box.edges[:d, :d]
    return position


def within(
    box: Box, position: Array, first: NDArray[np.int64], second: NDArray[np.int64], reach: float
) -> tuple[NDArray[np.int64], Array]:
    """Rows ``[P, 2]`` of all pairs of two groups within a distance, and the vectors between them ``[P, 3]``.

    All images count, so that a box may be of any width: each pair of images is found once. ``second`` may be ``first``.
    Positions are :func:`folded`.
    """
    from scipy.spatial import cKDTree

    d = box.dimension
    owner, points, forward = _images(box, position, second, reach)
    tree = cKDTree(position[first, :d])
    found = tree.sparse_distance_matrix(cKDTree(points[:, :d]), reach, output_type="ndarray")
    i, image = first[found["i"]], found["j"]
    j, sign = owner[image], forward[image]
    # Within one group each pair is found from both of its particles.
    once = (sign > 0) | ((sign == 0) & (i < j)) if first is second else np.ones(len(i), bool)
    i, j, image = i[once], j[once], image[once]
    return np.stack([i, j], axis=1).astype(np.int64), points[image] - position[i]


def _images(
    box: Box, position: Array, rows: NDArray[np.int64], reach: float
) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
    """Particles and their images within ``reach`` of the box: rows, places, and the sign of each shift.

    The sign is 0 for the particles themselves and opposite for opposite shifts.
    """
    d = box.dimension
    edges, width = box.edges[:d, :d], reach / box.widths[:d]
    place = position[rows, :d] @ np.linalg.inv(edges)
    most = np.where(box.periodic[:d], np.ceil(width), 0.0)
    if not np.prod(2 * most + 1) <= MOST_IMAGES:
        narrow = box.widths[:d][box.periodic[:d]].min()
        raise NotApplicableError(f"the box is too small for pairs up to {reach:.6g}: it is {narrow:.6g} wide")
    owner, points, signs = [], [], []
    for shift in itertools.product(*(range(-m, m + 1) for m in most.astype(int))):
        moved = place + shift
        near = ((moved >= -width - SLACK) & (moved <= 1 + width + SLACK)) | (np.array(shift) == 0)
        kept = np.flatnonzero(near.all(axis=1))
        copies = position[rows[kept]]
        copies[:, :d] += np.array(shift) @ edges
        owner.append(rows[kept])
        points.append(copies)
        signs.append(np.full(len(kept), next((np.sign(n) for n in shift if n), 0)))
    return np.concatenate(owner), np.concatenate(points), np.concatenate(signs)
