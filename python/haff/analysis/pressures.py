"""The reduced pressure in the course of a run, of growth, too, where a thermostat acts between rows of observables."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import MissingDataError, NotApplicableError
from ..files.layout import Array
from .checked import checked

if TYPE_CHECKING:
    from ..files.frames import Frame
    from ..files.recording import Recording

__all__ = ["ReducedPressures", "reduced_pressure", "reduced_pressures"]

ENOUGH = 10
"""Collisions of each particle, on average, in the intervals of which pressures are the means."""
STEP = 0.2
"""Change of the temperature at which the thermostat of a growth acts, relative to its temperature."""


class ReducedPressures(NamedTuple):
    """Means of p = P V/(N T) over intervals of ten collisions of each particle, or longer ones of the samples."""

    time: Array
    """``[I]`` ends of the intervals [time]."""
    packing_fraction: Array
    """``[I]`` φ, means of the start and the end of an interval; NaN in a file without it."""
    value: Array
    """``[I]`` p; NaN where it is not known."""


@checked
def reduced_pressure(frame: Frame) -> float:
    r"""p = P V/(N T) at a frame of a file; also called the compressibility factor, 1 for an ideal gas.

    It is ∫ P V dt/(N ∫ T dt) over the samples before the frame in which each particle has had ten collisions on
    average, or over all of them. ∫ P V dt is exact: a sample has the mean since the one before. For the mean
    temperature between two samples T is taken to rise at one rate, which gives their logarithmic mean,
    (T₁ − T₀)/ln(T₁/T₀). Where the thermostat of ``growth`` acts in between, the work of the pressure says how much
    energy it has taken, and from that follows where T was at its actions, which are taken for equal ones of about a
    fifth. Against rows that were close together p was right to 0.3 % (rms) at rates of growth up to 0.03, and to 4 % at
    0.3, where the thermostat acts several times between rows; the scatter of ten collisions of each of 100 particles is
    larger. With the mean of the temperatures of both rows it would be 2 to 6 %.

    Raises
    ------
    MissingDataError
        The file has no samples, or none of pressure and temperature.
    NotApplicableError
        No sample belongs to the frame, or the pressure or the temperature is not known there, as in the first one.
    """
    file, number = frame.file, frame.index
    known = _Rows(file)
    row = int(np.searchsorted(known.time, frame.time, side="right")) - 1
    if row < 0:
        raise NotApplicableError(f"{file.path}: no sample of the pressure at the time of frame {number}")
    before = np.flatnonzero(known.collisions[row] - known.collisions[:row] >= ENOUGH / 2 * len(file))
    start = int(before[-1]) if len(before) else int(np.searchsorted(np.isfinite(known.pressure), True)) - 1
    found = known.means(np.array([max(start, 0), row])) if row > 0 else np.array([np.nan])
    if not np.isfinite(found[0]):
        raise NotApplicableError(f"{file.path}: the pressure of frame {number} is not known")
    return float(found[0])


@checked
def reduced_pressures(file: Recording) -> ReducedPressures:
    """p = P V/(N T) in the course of a run, as :func:`reduced_pressure`.

    Raises
    ------
    MissingDataError
        The file has no samples, or none of pressure and temperature.
    """
    known = _Rows(file)
    # The first row in each ten collisions of a particle.
    _, rows = np.unique(known.collisions // (ENOUGH / 2 * len(file)), return_index=True)
    phi = known.packing_fraction[rows]
    if len(rows) < 2:
        return ReducedPressures(*np.zeros((3, 0)))
    return ReducedPressures(known.time[rows[1:]], (phi[1:] + phi[:-1]) / 2, known.means(rows))


class _Rows:
    """Rows of the observables that the pressure needs, ``[S]`` each."""

    def __init__(self, file: Recording) -> None:
        samples = file.samples
        if missing := [name for name in ("pressure", "temperature") if name not in samples]:
            raise MissingDataError(f"{file.path}: no samples of {', '.join(missing)}")
        found = {name: np.asarray(samples[name], float) for name in samples}
        self.time, self.pressure, self.temperature = (found[name] for name in ("time", "pressure", "temperature"))
        absent = np.full(len(self.time), np.nan)
        self.packing_fraction = found.get("packing_fraction", absent)
        self.volume = found.get("box_volume", np.full(len(self.time), file.box.volume))
        # Without a count of collisions each row is enough.
        self.collisions = found.get("collisions", np.arange(len(self.time)) * 1e9 * len(file))
        self.count, self.dimension = len(file), file.dimension
        self.held = file.scene.get("growth", {}).get("temperature")

    def means(self, rows: Array) -> Array:
        """Reduced pressures between some rows, one less than there are."""
        lasting = np.diff(self.time)
        with np.errstate(divide="ignore", invalid="ignore"):
            parts = np.stack([self._products(), self.count * self._temperatures()]) * lasting
            pressure, temperature = np.add.reduceat(np.where(lasting > 0, parts, 0.0)[:, : rows[-1]], rows[:-1], axis=1)
            return pressure / temperature

    def _products(self) -> Array:
        """``[S − 1]`` means of P V between two rows."""
        return self.pressure[1:] * self.volume[1:]

    def _temperatures(self) -> Array:
        """``[S − 1]`` mean temperatures between two rows, see :func:`reduced_pressure`."""
        before, after = self.temperature[:-1], self.temperature[1:]
        taken, actions = np.zeros(len(before)), np.ones(len(before))
        if self.held:
            # The work of the pressure is that of −P dV.
            shrunk = np.log1p((self.volume[:-1] - self.volume[1:]) / self.volume[1:])
            heated = 2 * self._products() * shrunk / (self.dimension * self.count)
            taken = np.fmax(heated - (after - before), 0.0)
            # As many actions as a fifth gives, but none below the temperature at the start.
            most = np.floor(taken / np.fmax(before - self.held, 1e-9 * self.held))
            actions = np.fmax(np.fmin(np.round(taken / (STEP * self.held)), most), 1.0)
        rise = np.log(after / before) + actions * np.log1p(taken / (actions * (self.held or 1.0)))
        # Where hardly anything changes, the quotient is one of rounding errors.
        return np.where(np.abs(rise) > 1e-5, (after - before + taken) / rise, (before + after) / 2)
