"""A dataset of numbers, and checks of its values."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import h5py
import numpy as np

from ..errors import FileError
from ..text import brief
from .layout import Array

LARGEST, SMALLEST = 1e100, 1e-100
"""Numbers of this size still have a cube: beyond, volumes and energies are no numbers any more."""


_BLOCK = 4096  # rows


class Store(Protocol):
    """What holds the datasets of a file."""

    path: Path

    def read(self, place: str, key: int | slice) -> Array:
        """Rows of the dataset at a path."""

    def find(self, place: str) -> object:
        """What is at a path."""


class Column:
    """A dataset of numbers of an expected kind and shape, whose rows are stored."""

    def __init__(self, stored: Store, place: str, data: h5py.Dataset, rows: int) -> None:
        self.place = place
        """Where it stands in the file."""
        self.dtype: np.dtype = data.dtype
        self.width: tuple[int, ...] = data.shape[1:]
        """Shape of a row."""
        self._stored, self._rows = stored, rows

    def __len__(self) -> int:
        return self._rows

    def __getitem__(self, key: int | slice) -> Array:
        """Rows, in the byte order of this machine."""
        if isinstance(key, slice):
            key = slice(*key.indices(self._rows))
        values = self._stored.read(self.place, key)
        return values.astype(values.dtype.newbyteorder("="), copy=False)

    def require(self, values: Array, sound: Array, must: str, rows: range | int = 0) -> None:
        """Raises :class:`FileError` for the first invalid value; ``rows`` are the rows of ``values`` in the file."""
        if np.all(sound):
            return
        at = tuple(int(k) for k in np.argwhere(~np.atleast_1d(sound))[0])
        row = rows[at[0]] if isinstance(rows, range) else rows + at[0]
        index = ", ".join(map(str, (row, *at[1:])))
        value = np.atleast_1d(values)[at]
        raise FileError(f"{self._stored.path}: {brief(self.place)}[{index}] = {value}: must be {must}")

    def require_finite(self, values: Array, rows: range | int = 0) -> None:
        """Raises :class:`FileError` for NaN, infinities and numbers too large to compute with."""
        with np.errstate(invalid="ignore"):
            self.require(values, np.abs(values) <= LARGEST, f"a number of up to {LARGEST:g}", rows)

    def require_order(self, values: Array, rows: range | int = 0) -> None:
        """Raises :class:`FileError` for numbers that are not finite or less than their predecessor."""
        self.require_finite(values, rows)
        later = np.ones(len(values), bool)
        later[1:] = values[1:] >= values[:-1]
        self.require(values, later, "at least the one before", rows)

    def same(self, other: Column) -> bool:
        """Whether both are the same dataset, possibly under two names."""
        return self is other or self._stored.find(self.place) == other._stored.find(other.place)


def complete(time: Column, length: int) -> int:
    """Number of complete rows: a flush cut short by a kill may leave rows without a time at the end."""
    while length > 0:
        start = max(0, length - _BLOCK)
        known = np.flatnonzero(~np.isnan(time[start:length]))
        if len(known):
            return start + int(known[-1]) + 1
        length = start
    return 0
