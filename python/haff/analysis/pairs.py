"""All pairs of particles within a distance, in rectangular and sheared boxes, by cells and matrix products."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import NotApplicableError
from ..files.layout import Array

if TYPE_CHECKING:
    from ..files.box import Box

PER_CELL = 30
"""Particles in a cell, about: fewer make many small products, more make many distances that are too long."""

FINE = 8
"""Particles in a cell of half the reach, from which on cells of that size save more distances than they cost."""

MOST_AT_ONCE = 1 << 16
"""Distances computed at once: as many as the cache holds."""

MOST_CELLS = 1 << 15
"""Cells along an axis: an open axis may be very long."""


class Pairs(NamedTuple):
    """Some pairs: each particle that is a center with all particles near it."""

    first: NDArray[np.intp]
    """``[P]`` rows of the centers."""
    second: NDArray[np.intp]
    """``[P]`` rows of the others."""
    distance: Array
    """``[P]`` distances of the nearest images [length]."""


def require_room(box: Box, reach: float, what: str) -> None:
    """Raises :class:`NotApplicableError` unless the periodic box is wider than twice ``reach`` [length]."""
    d = box.dimension
    widths = box.widths[:d][box.periodic[:d]]
    if widths.size and not reach < widths.min() / 2:
        raise NotApplicableError(f"the box is too small for {what} up to {reach:g}: at most {widths.min() / 2:.6g}")


def close_pairs(box: Box, position: Array, reach: float, centers: NDArray[np.bool_] | None = None) -> Iterator[Pairs]:
    """Pairs of particles at most ``reach`` [length] apart, in pieces.

    Every pair occurs twice, once from each of its particles; with ``centers`` (``[N]``) only from particles that it is
    true for. The box must be wider than twice ``reach`` along periodic axes (:func:`require_room`). Particles are
    sorted into cells at least as wide as ``reach``, or half of it; squares of distances of the members of a cell from
    those of the cells around it are one matrix product.
    """
    grid = _Grid(box, position, reach)
    order, starts, ends = grid.order, grid.starts, grid.ends
    for k, around in enumerate(grid.around()):
        rows = order[starts[k] : ends[k]]
        rows = rows if centers is None else rows[centers[rows]]
        if len(rows) == 0:
            continue
        others = np.concatenate([order[starts[c] : ends[c]] for c in around])
        piece = max(1, MOST_AT_ONCE // len(others))
        for start in range(0, len(rows), piece):
            some = rows[start : start + piece]
            square = grid.squares(k, some, others)
            near = np.flatnonzero(square.ravel() <= reach * reach)
            first, second = some[near // len(others)], others[near % len(others)]
            distance = np.sqrt(np.maximum(square.ravel()[near], 0.0))
            apart = first != second
            yield Pairs(first[apart], second[apart], distance[apart])


class _Grid:
    """Particles sorted by cells. Coordinates are those along the edge vectors, from 0 to 1 along periodic axes."""

    def __init__(self, box: Box, position: Array, reach: float) -> None:
        d = box.dimension
        self.edges, self.periodic = box.edges[:d, :d], box.periodic[:d]
        place = np.asarray(position, float)[:, :d] @ np.linalg.inv(self.edges)
        place[:, self.periodic] -= np.floor(place[:, self.periodic])
        self.place = place
        low = np.where(self.periodic, 0.0, place.min(axis=0, initial=np.inf))
        span = np.where(self.periodic, 1.0, place.max(axis=0, initial=-np.inf) - low)
        span = np.where(span > 0, span, 1.0)
        length = box.widths[:d] * span
        each = float(np.prod(length)) / max(len(place), 1)
        self.reach = 2 if (0.5 * reach) ** d > FINE * each else 1
        wide = max(reach * (1 + 1e-9) / self.reach, (PER_CELL * each) ** (1 / d) if self.reach == 1 else 0.0)
        cells = np.clip(np.floor(length / wide), 1, MOST_CELLS).astype(np.int64)
        # With fewer cells around the box some would be near on both sides.
        self.thin = self.periodic & (cells < 2 * self.reach + 1)
        cells[self.thin] = 1
        self.cells, self.low, self.step = cells, low, span / cells
        at = np.minimum(((place - low) / self.step).astype(np.int64), cells - 1)
        number = np.ravel_multi_index(tuple(at.T), tuple(cells))
        self.order = np.argsort(number, kind="stable")
        self.numbers, self.starts = np.unique(number[self.order], return_index=True)
        self.ends = np.append(self.starts[1:], len(number))

    def around(self) -> Iterator[NDArray[np.intp]]:
        """For each occupied cell the occupied ones around it, and itself."""
        at = np.stack(np.unravel_index(self.numbers, tuple(self.cells)), axis=1)
        steps = range(-self.reach, self.reach + 1)
        near = np.array(list(itertools.product(*(steps if c > 1 else (0,) for c in self.cells))))
        for start in range(0, len(at), 1024):
            beside = at[start : start + 1024, None] + near
            inside = np.all(self.periodic | ((beside >= 0) & (beside < self.cells)), axis=2)
            numbers = np.ravel_multi_index(tuple(np.moveaxis(beside % self.cells, 2, 0)), tuple(self.cells))
            found = np.minimum(np.searchsorted(self.numbers, numbers), len(self.numbers) - 1)
            inside &= self.numbers[found] == numbers
            yield from (row[known] for row, known in zip(found, inside))

    def squares(self, cell: int, rows: NDArray[np.intp], others: NDArray[np.intp]) -> Array:
        """``[rows, others]`` squares of distances of the nearest images."""
        if self.thin.any():
            apart = self.place[others] - self.place[rows][:, None]
            apart[..., self.periodic] -= np.rint(apart[..., self.periodic])
            return np.sum((apart @ self.edges) ** 2, axis=-1)
        # Relative to the middle of the cell, so that the differences of squares lose no digits.
        middle = np.stack(np.unravel_index(self.numbers[cell], tuple(self.cells))) + 0.5
        middle = self.low + middle * self.step
        a, b = self._local(rows, middle), self._local(others, middle)
        square = a @ (-2.0 * b.T)
        square += np.einsum("ij,ij->i", a, a)[:, None]
        square += np.einsum("ij,ij->i", b, b)
        return square

    def _local(self, rows: NDArray[np.intp], middle: Array) -> Array:
        apart = self.place[rows] - middle
        apart[:, self.periodic] -= np.rint(apart[:, self.periodic])
        return apart @ self.edges
