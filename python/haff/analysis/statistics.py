"""Means of correlated series, and the frames that statistics are taken from."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..common import arguments
from ..common.compiled import compiled
from ..errors import ArgumentError
from ..text import quoted
from .checked import checked

if TYPE_CHECKING:
    from uncertainties import Variable

    from ..files.frames import Frame
    from ..files.recording import Recording


class Estimate(NamedTuple):
    """A mean with its standard error."""

    mean: float
    error: float

    @property
    def ufloat(self) -> Variable:
        """The same as a number of the package ``uncertainties``: what is computed from it has an error, too."""
        return _ufloat(self.mean, self.error)

    def z(self, expected: float, uncertainty: float = 0.0) -> float:
        """(mean − expected) in standard errors; ``uncertainty`` of the expectation is added in quadrature."""
        expected = arguments.real("expected", expected)
        if arguments.real("uncertainty", uncertainty) < 0:
            raise ArgumentError(f"uncertainty = {quoted(uncertainty)}: must not be negative")
        return (self.mean - expected) / float(np.hypot(self.error, uncertainty))


class Mean(NamedTuple):
    """The mean of a correlated series over its stationary part."""

    mean: float
    error: float
    """Its standard error; NaN of fewer than 16 values."""
    start: int
    """Index of the first value of the stationary part."""
    independent: float
    """Number of independent values that would have the same error; of fewer than some 30 it is a lower bound."""
    slope: float
    """The slope of the stationary part in its standard errors."""
    drifts: bool
    """Whether the series is not stationary: the mean then depends on the length of the run."""

    @property
    def ufloat(self) -> Variable:
        """The same as a number of the package ``uncertainties``: what is computed from it has an error, too."""
        return _ufloat(self.mean, self.error)

    def z(self, expected: float, uncertainty: float = 0.0) -> float:
        """(mean − expected) in standard errors; ``uncertainty`` of the expectation is added in quadrature."""
        return Estimate(self.mean, self.error).z(expected, uncertainty)


def _ufloat(mean: float, error: float) -> Variable:
    from uncertainties import ufloat

    return ufloat(mean, error)


def mean(values: ArrayLike) -> Mean:
    """Mean of a correlated series at equal intervals, with a standard error that takes correlation into account.

    The error is that of means over blocks (Flyvbjerg and Petersen 1989) of the size of Lee et al. (2011). What comes
    before the stationary part is left out where that makes the error smaller (White 1997). Values at the start that are
    NaN, as of means over intervals, are left out.

    Raises :class:`ArgumentError` if there is no number, or a later value is none.
    """
    series = arguments.reals("values", values)
    found = compiled().mean(np.ascontiguousarray(series, float)) if series.ndim == 1 else None
    if found is None:
        raise ArgumentError(f"values = {quoted(values)}: must be one series of finite numbers")
    return Mean(**found)


def block_average(values: ArrayLike, blocks: int = 20, weights: ArrayLike | None = None) -> Estimate:
    """Mean of a correlated series with its standard error from block averages (Flyvbjerg–Petersen 1989).

    The series is cut into ``blocks`` pieces of equal length (a remainder at the start is left out); blocks
    should be much longer than the correlation time.
    """
    series, blocks = arguments.reals("values", values), arguments.count("blocks", blocks, 2)
    # The first sample of a mean over an interval is NaN; it is in the remainder, or makes the result NaN.
    if series.ndim != 1 or np.isinf(series).any():
        raise ArgumentError(f"values = {quoted(values)}: must be one series of finite numbers")
    if len(series) < 2 * blocks:
        raise ArgumentError(f"{len(series)} values are too few for {blocks} blocks")
    weight = np.ones_like(series) if weights is None else arguments.reals("weights", weights)
    if weight.shape != series.shape or not (np.isfinite(weight).all() and (weight > 0).all()):
        raise ArgumentError(f"weights = {quoted(weights)}: must be a positive number for each of {len(series)} values")
    length = len(series) // blocks
    cut = slice(len(series) - blocks * length, None)
    weight, series = weight[cut].reshape(blocks, length), series[cut].reshape(blocks, length)
    means = np.sum(weight * series, axis=1) / np.sum(weight, axis=1)
    return Estimate(float(np.mean(means)), float(np.std(means, ddof=1) / np.sqrt(blocks)))


@checked
def drawn_frames(file: Recording, count: int, after: float = 5.0) -> list[Frame]:
    """Up to ``count`` frames spread over the file, without the first ``after`` collisions per particle.

    From the second half of the file if all of it is shorter than twice ``after``. A file that goes on from another run
    begins with its own first frame. Of a run whose box changes with time it is the last frame alone: its density is
    another one in each.
    """
    count = arguments.count("count", count, 1, arguments.MOST_ROWS)
    if arguments.number("after", after) < 0:
        raise ArgumentError(f"after = {quoted(after)}: must not be negative")
    frames = file.frames
    if file.compression is not None:
        return list(frames[-1:])
    steps = np.asarray(frames.step, float)
    steps = steps - steps[:1]
    threshold = min(after * len(file) / 2, steps[-1] / 2) if len(frames) else 0.0
    late = np.flatnonzero(steps >= threshold)
    chosen = np.unique(np.round(np.linspace(0, len(late) - 1, min(count, len(late)))).astype(int))
    return [frames[int(late[k])] for k in chosen]
