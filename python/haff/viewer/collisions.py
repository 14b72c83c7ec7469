"""From the event log: the collisions to highlight, and the energy lost by each particle."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..reader import File
from .blobs import Blobs

MOST = 200_000
"""Events that a page holds; of more, every second, third, … is shown."""
DECADES = 4.0
"""Losses since the frame before are shown on a logarithmic scale of so many decades below the largest."""


class Losses(NamedTuple):
    """Energy lost by each particle, half of a collision's loss to each partner."""

    total: np.ndarray
    """``[K, N]`` so far, in 255ths of the largest"""
    recent: np.ndarray
    """``[K, N]`` since the frame before, in 255ths of a logarithmic scale"""
    largest: tuple[float, float]
    """of both [energy]"""


class Log:
    """The event log of a file, read piece by piece."""

    def __init__(self, file: File) -> None:
        self._events, self._count = file.events, len(file)
        self._pairs = [code for code, name in self._events.kinds.items() if name in ("collision", "stick")]

    @classmethod
    def of(cls, file: File) -> Log | None:
        """The log, if the file has one with times and particles."""
        if "events" not in file or not {"time", "kind", "i", "j"} <= set(file.events.columns):
            return None
        return cls(file) if len(file.events) else None

    def _pieces(self, columns: list[str]):
        names = self._events.kinds
        paired = [names[code] for code in self._pairs]
        for piece in self._events.chunks(columns=["time", "kind", "i", "j", *columns]):
            i = piece["i"].to_numpy(np.int64)
            # A partner that is a wall or a joint is no particle: the event then counts for i alone.
            j = np.where(piece["kind"].isin(paired), piece["j"].to_numpy(np.int64), i)
            inside = (i < self._count) & (j < self._count)
            yield (
                piece["time"].to_numpy()[inside],
                i[inside],
                j[inside],
                *(piece[c].to_numpy()[inside] for c in columns),
            )

    def losses(self, time: np.ndarray) -> Losses | None:
        """Energy lost up to each time; ``None`` if the log has no losses, or nothing was lost."""
        if "energy_loss" not in self._events.columns:
            return None
        recent = np.zeros((len(time), self._count), np.float32)
        for when, i, j, loss in self._pieces(["energy_loss"]):
            # Losses before the first frame count for it; those after the last are not shown.
            row = np.searchsorted(time, when, side="left")
            seen = row < len(time)
            for body in (i, j):
                np.add.at(recent, (row[seen], body[seen]), loss[seen] / 2)
        total = np.cumsum(recent, axis=0, dtype=np.float32)
        most, top = float(total.max(initial=0.0)), float(recent.max(initial=0.0))
        if not (most > 0 and top > 0):
            return None
        with np.errstate(divide="ignore"):
            decades = 1 + np.log10(np.maximum(recent, 0) / top) / DECADES
        return Losses(_shades(total / most), _shades(decades), (most, top))

    def sample(self, blobs: Blobs, start: float, end: float, notes: list[str]) -> dict[str, Any]:
        """Writes times (since ``start``) and particles of the events up to ``end``, evenly thinned."""
        every = -(-len(self._events) // MOST)
        columns: list[list[np.ndarray]] = [[], [], []]
        row = 0
        for when, i, j in self._pieces([]):
            taken = slice(-row % every, None, every)
            row += len(when)
            inside = (when[taken] >= start) & (when[taken] <= end)
            for column, values in zip(columns, (when[taken] - start, i[taken], j[taken])):
                column.append(values[inside])
        if every > 1:
            notes.append(f"one in {every:,} collisions is in this page")
        time, i, j = (np.concatenate(column) for column in columns)
        return {"every": every, **blobs.add(time.astype(np.float32), i.astype(np.uint32), j.astype(np.uint32))}


def _shades(share: np.ndarray) -> np.ndarray:
    return (np.clip(share, 0, 1) * 255).astype(np.uint8)
