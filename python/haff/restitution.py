"""The inverse problem: the coefficient of restitution from measurements (Set 2.1, Problem 2.1)."""

from __future__ import annotations

import inspect
import numbers
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import curve_fit
from uncertainties import nominal_value, std_dev, ufloat, wrap

from . import mechanics
from .analysis import Estimate, experiment
from .common import arguments
from .errors import ArgumentError, FileError, MissingDataError, NotApplicableError
from .files.layout import computing
from .reader import File
from .reader import open as open_file
from .text import brief, quoted

__all__ = ["restitution_from"]

Array = NDArray[np.float64]
Source: TypeAlias = File | pd.DataFrame | Mapping[str, ArrayLike] | str | os.PathLike[str]


def restitution_from(
    source: Source,
    kind: str | None = None,
    *,
    error: float | Sequence[float] | None = None,
    masses: tuple[Any, Any] | None = None,
) -> Estimate:
    r"""Coefficient of restitution e, with its standard error, from bounces or from pendulums.

    Parameters
    ----------
    source
        A run (:class:`File`, or its path) or a measured table (data frame, mapping, or the path of a ``.csv`` file).
        Columns of a table, in order of time:

        * ``height``: clear heights of the drop and of each rebound [length]; :math:`H_k = e^{2k}H`
        * ``time``: times of the impacts on the floor [time]; each flight lasts e times as long as the one before
        * ``alpha``, ``beta``: angles [rad] of the release of one pendulum and of the rise of the other after their
          first impact; one row an experiment

        NaN marks missing measurements. A run must have recorded frames and the event log.
    kind
        ``"heights"``, ``"times"`` or ``"angles"``; default: the first of these that the source has.
    error
        Standard error of every height, time or angle; for angles also a pair, of α and of β. Default: the columns
        ``height_error``, ``time_error``, ``alpha_error``, ``beta_error`` of a table, or else an estimate from
        the scatter; that is NaN without degrees of freedom left, as with one experiment.
    masses
        Of the released and of the struck bob, numbers or ``uncertainties.ufloat``. Default: those of the run, or equal
        ones.

    Returns
    -------
    Estimate
        ``mean`` and ``error`` of e; its ``z`` compares with an expected value.

    Raises
    ------
    MissingDataError
        The source lacks a column, the frames or the event log.
    NotApplicableError
        e does not follow from it: too few numbers, heights that are not positive, a run in which nothing bounces.
    FileError
        The file cannot be read.
    ArgumentError
        ``kind``, ``error`` or ``masses`` is invalid.

    Notes
    -----
    Heights and times are fitted by :func:`scipy.optimize.curve_fit`, with the height of the drop, or the first impact
    and the first flight, free as well; its covariance carries the errors over. Angles go through Set 2.1,
    :func:`haff.mechanics.pendulum_restitution`, and their errors, with those of the masses, through the package
    ``uncertainties``; experiments are averaged by their weights.

    Examples
    --------
    >>> import haff
    >>> found = haff.restitution_from({"height": [1.0, 0.641, 0.409, 0.262]}, error=0.002)
    >>> print(f"e = {found.mean:.4f} ± {found.error:.4f}")
    e = 0.7999 ± 0.0007
    >>> found = haff.restitution_from({"alpha": [0.80], "beta": [0.64]}, error=0.01, masses=(2.0, 2.0))
    >>> print(f"e = {found.mean:.2f} ± {found.error:.2f}")
    e = 0.62 ± 0.03
    """
    if kind is not None:
        arguments.choice("kind", kind, _WAYS)
    if masses is not None and not _are_masses(masses):
        raise ArgumentError(f"masses = {quoted(masses)}: must be two positive numbers")
    if error is not None:
        arguments.reals("error", error)
    if not isinstance(source, (File, pd.DataFrame, Mapping, str, os.PathLike)):
        raise ArgumentError(f"source = {quoted(source)}: must be a file, a table, a dict of columns, or a path")
    if isinstance(source, (str, os.PathLike)):
        source = arguments.file("source", source)
    if isinstance(source, (str, os.PathLike)) and Path(source).suffix.lower() != ".csv":
        with open_file(source) as run:
            return restitution_from(run, kind, error=error, masses=masses)
    if isinstance(source, File):
        kind = kind or ("angles" if source.scene.get("pendulum") else "heights")
        name, table = str(source.path), _WAYS[kind].seen(source)
        masses = masses or table.attrs.get("masses")
    else:
        name, table = _table(source)
    if kind is None:
        kind = next((kind for kind, way in _WAYS.items() if set(way.columns) <= set(table)), None)
    if kind is None:
        known = ", or ".join(" and ".join(way.columns) for way in _WAYS.values())
        raise MissingDataError(f"{name}: columns {brief(', '.join(map(str, table))) or 'none'}; needed: {known}")
    way = _WAYS[kind]
    values = np.stack([_column(table, column, name) for column in way.columns])
    errors = _errors(table, way, error, name)
    seen = np.isfinite(values if errors is None else np.concatenate([values, errors])).all(axis=0)
    # Rows are numbered before any is left out: a bounce without a measurement still counts.
    index = np.flatnonzero(seen).astype(float)
    if len(index) < way.least:
        raise NotApplicableError(f"{name}: {len(index)} {kind}; e follows from {way.least} or more")
    with computing(Path(name), "restitution"):
        return way.estimate(
            name, index, values[:, seen], None if errors is None else errors[:, seen], masses or (1.0, 1.0)
        )


def _are_masses(masses: object) -> bool:
    """Whether they are two positive numbers, with or without an uncertainty."""
    try:
        pair = [nominal_value(mass) for mass in masses]  # type: ignore[attr-defined]
    except Exception:
        return False
    return len(pair) == 2 and all(isinstance(mass, numbers.Real) and 0 < mass < np.inf for mass in pair)


def _heights(name: str, k: Array, values: Array, errors: Array | None, _: tuple[Any, Any]) -> Estimate:
    (heights,) = values
    if np.any(heights <= 0):
        raise NotApplicableError(f"{name}: height = {heights[heights <= 0][0]:g} must be positive")
    # ln H_k is a straight line in k.
    slope, start = np.polyfit(k, np.log(heights), 1)

    def law(k: Array, e: float, height: float) -> Array:
        return _bounce_height(k, height, e)

    return _fitted(law, k, heights, errors, [np.exp(slope / 2), np.exp(start)])


# Fits try values of e that are slightly above 1, which are refused as arguments.
_bounce_height = inspect.unwrap(mechanics.bounce_height)
_geometric_sum = inspect.unwrap(mechanics.geometric_sum)


def _times(name: str, k: Array, values: Array, errors: Array | None, _: tuple[Any, Any]) -> Estimate:
    (times,) = values
    back = np.diff(times) <= 0
    if back.any():
        at = int(back.argmax())
        raise NotApplicableError(
            f"{name}: time = {times[at + 1]:g} must be later than the impact before, {times[at]:g}"
        )
    # The logarithms of the flights are a straight line, too.
    slope, start = np.polyfit((k[1:] + k[:-1] - 1) / 2, np.log(np.diff(times) / np.diff(k)), 1)
    e, flight = np.exp(slope), np.exp(start)
    begin = times[0] - flight * _geometric_sum(e, k[0])

    def law(k: Array, e: float, begin: float, flight: float) -> Array:
        return begin + flight * _geometric_sum(e, k)

    return _fitted(law, k, times, errors, [e, begin, flight])


def _fitted(law: Callable[..., Array], k: Array, values: Array, errors: Array | None, start: list[float]) -> Estimate:
    """The first parameter of a law that is fitted to ``values``."""
    if errors is None and len(k) == len(start):
        (e, *_), _ = curve_fit(law, k, values, start, sigma=np.ones_like(values), absolute_sigma=True, xtol=1e-14)
        return Estimate(float(e), float("nan"))
    sigma = None if errors is None else errors[0]
    (e, *_), covariance = curve_fit(law, k, values, start, sigma=sigma, absolute_sigma=sigma is not None, xtol=1e-14)
    # Numbers without scatter still have rounding errors.
    return Estimate(float(e), float(np.hypot(np.sqrt(covariance[0, 0]), 4 * np.finfo(float).eps * e)))


def _angles(name: str, _: Array, values: Array, errors: Array | None, masses: tuple[Any, Any]) -> Estimate:
    for symbol, angles in zip(("alpha", "beta"), values):
        wrong = (angles == 0) | (np.abs(angles) > np.pi)
        if np.any(wrong):
            raise NotApplicableError(f"{name}: {symbol} = {angles[wrong][0]:g} must be an angle up to π [rad], not 0")
    law = wrap(lambda *arguments: float(mechanics.pendulum_restitution(*arguments)))
    if errors is None:
        found = [law(alpha, beta, *masses) for alpha, beta in values.T]
        single = [nominal_value(one) for one in found]
        scatter = np.std(single, ddof=1) / np.sqrt(len(single)) if len(single) > 1 else np.nan
        mean = sum(found) / len(found)
        return Estimate(nominal_value(mean), float(np.hypot(scatter, std_dev(mean))))
    weights, found = [], []
    for (alpha, beta), (alpha_error, beta_error) in zip(values.T, errors.T):
        own = ufloat(alpha, alpha_error), ufloat(beta, beta_error)
        found.append(law(*own, *masses))
        # The error of the masses is common to all experiments, so it does not enter their weights.
        parts = found[-1].error_components()
        weights.append(1 / sum(parts[angle] ** 2 for angle in own))
    mean = sum(weight * one for weight, one in zip(weights, found)) / sum(weights)
    return Estimate(mean.nominal_value, mean.std_dev)


class _Way(NamedTuple):
    """One method to determine e."""

    columns: tuple[str, ...]
    least: int
    """Rows without which there is no answer."""
    seen: Callable[[File], pd.DataFrame]
    estimate: Callable[..., Estimate]


_WAYS = {
    "heights": _Way(("height",), 2, experiment.heights, _heights),
    "times": _Way(("time",), 3, experiment.times, _times),
    "angles": _Way(("alpha", "beta"), 1, experiment.angles, _angles),
}


def _table(source: Source) -> tuple[str, pd.DataFrame]:
    """Name and columns of the measurements."""
    if not isinstance(source, (str, os.PathLike)):
        try:
            return "the table", pd.DataFrame(source)
        except ValueError as reason:
            raise NotApplicableError(f"the table: {reason}") from None
    try:
        return str(source), pd.read_csv(source, skipinitialspace=True, comment="#")
    except OSError as reason:
        raise FileError(f"{source}: {(reason.strerror or str(reason)).lower()}") from None
    except (ValueError, ArithmeticError, MemoryError) as reason:
        raise FileError(f"{source}: not a table: {(str(reason) or type(reason).__name__).splitlines()[0]}") from None


def _column(table: pd.DataFrame, column: str, name: str) -> Array:
    """Numbers of a column."""
    if column not in table:
        raise MissingDataError(f"{name}: no column {column}; there are {brief(', '.join(map(str, table))) or 'none'}")
    for row, value in enumerate(table[column], 1):
        try:
            float(value)
        except (TypeError, ValueError):
            raise NotApplicableError(f"{name}: {column} = {quoted(value)} in row {row} must be a number") from None
    return table[column].to_numpy(float)


def _errors(table: pd.DataFrame, way: _Way, error: float | Sequence[float] | None, name: str) -> Array | None:
    """``[columns, rows]`` standard errors, if any are known."""
    if error is not None:
        given = np.atleast_1d(np.asarray(error, float))
        if given.shape not in ((1,), (len(way.columns),)):
            raise ArgumentError(f"error = {quoted(error)} must be one number for each of {', '.join(way.columns)}")
        if not (np.isfinite(given) & (given > 0)).all():
            raise ArgumentError(f"error = {quoted(error)} must be positive")
        return np.broadcast_to(given[:, None], (len(way.columns), len(table))).copy()
    names = [f"{column}_error" for column in way.columns]
    if not any(one in table for one in names):
        return None
    errors = np.stack([_column(table, one, name) for one in names])
    for one, column in zip(names, errors):
        if np.any(column <= 0):
            raise NotApplicableError(f"{name}: {one} = {column[column <= 0][0]:g} must be positive")
    return errors
