"""Whether records of a run are always taken at the same phase of something periodic.

Records at multiples of the period of a wall that oscillates, or of a drive, show this phase only: grains that rise and
fall with a floor then seem to flow. Rows of profiles are not such records by default: their states are taken at random
times (docs/format.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..files.layout import Array
from . import conditions

if TYPE_CHECKING:
    from ..files.recording import Recording

__all__ = ["phase_note", "profile_times"]

FEWEST = 4
"""Fewest records that are compared."""
SPREAD = 0.5
"""Largest mean of cos(2π phase) of records that are spread over the phases."""
SMALL = 0.01
"""Relative change of the temperature between two actions of a drive that is too small to matter."""


def phase_note(file: Recording, time: Array) -> str:
    """A note, "at one phase of …", for records at these times; empty if they are spread over the phases."""
    time = np.asarray(time, float)
    if len(time) < FEWEST:
        return ""
    between = float(np.median(np.diff(time)))
    for name, period in _periods(file):
        for harmonic in (1, 2):
            turns = harmonic * (time - time[0]) / period
            # Slower motions are followed by the records.
            followed = harmonic * between / period < 0.5
            if not followed and abs(np.exp(2j * np.pi * turns).mean()) > SPREAD:
                return f"at {'one phase' if harmonic == 1 else 'two opposite phases'} of {name}"
    return ""


def profile_times(file: Recording, axes: str, rows: Array) -> Array:
    """Times of the states in rows of a profile that end at ``rows``, if they are at equal times; else none."""
    entries = (one for one in file.scene.get("measure", {}).get("profiles", ()) if one["axis"] == axes)
    if (entry := next(entries, None)) is None or entry.get("spread", False):
        return np.zeros(0)
    samples, interval = int(entry.get("samples", 1)), float(entry["interval"])
    last = np.round(np.asarray(rows, float) / interval)
    return ((last[:, None] - 1 + np.arange(1, samples + 1) / samples) * interval).ravel()


def _periods(file: Recording) -> list[tuple[str, float]]:
    """Names and lengths of periods: those of walls, and of drives that change the temperature noticeably."""
    scene = file.scene
    found = [
        (f"the wall {wall.get('name', '')}", 1 / float(wall["motion"]["frequency"]))
        for wall in scene.get("wall", ())
        if "motion" in wall
    ]
    # A drive changes the temperature by what collisions take in its interval, (1 − e²) ω t/d.
    loss = (1 - (conditions.restitution(file) or 0.0) ** 2) / file.dimension
    for drive in scene.get("drive", ()):
        interval = float(drive.get("interval", 0.0))
        if loss * interval > SMALL * conditions.mean_free_time(file):
            found.append((f"the drive {drive['kind']}", interval))
    return found
