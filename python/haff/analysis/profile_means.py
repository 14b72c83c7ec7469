"""Means of profiles over time, with errors that take correlation into account."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..common.arguments import number
from ..errors import ArgumentError
from ..files.layout import Array
from ..files.measure import profile, profile_rows
from ..text import quoted
from .checked import checked
from .statistics import mean

if TYPE_CHECKING:
    import xarray

    from ..files.recording import Recording

__all__ = ["profile_means"]


@checked
def profile_means(file: Recording, axes: str | None = None, start: float | None = None) -> xarray.Dataset:
    """The mean of each field of a profile in each cell, with its standard error.

    Parameters
    ----------
    axes
        The letters of the axes of the profile; may be left out if there is one.
    start
        Rows are taken from this time on [time]; default: all.

    Returns
    -------
    xarray.Dataset
        The fields of ``run.profiles[axes]`` without the time, and beside each ``FIELD_error``. Means and errors are
        those of :func:`mean` over the rows, in each cell over its own stationary part; rows in which a cell is empty
        do not count for its velocity and temperature. Errors are NaN of fewer than 16 rows.

    Raises
    ------
    MissingDataError
        The run has measured no profile.
    ArgumentError
        There is no profile along these axes, or none of its rows ends after ``start``.
    """
    found = profile_rows(file)
    if axes is None:
        if len(found) > 1:
            raise ArgumentError(f"axes: must be one of {', '.join(found)}, the profiles of {file.path}")
        axes = next(iter(found))
    if not isinstance(axes, str) or axes not in found:
        raise ArgumentError(f"axes = {quoted(axes)}: must be one of {', '.join(found)}, the profiles of {file.path}")
    rows = found[axes]
    late = np.ones(len(rows.time), bool) if start is None else rows.time > number("start", start)
    if not late.any():
        raise ArgumentError(f"start = {start}: no row of the profile ends later")
    results = {name: _means(values[late]) for name, values in rows.fields.items()}
    time, fields = rows.time[late][-1:], [{name: each[k][None] for name, each in results.items()} for k in (0, 1)]
    values, errors = (profile(file.dimension, time, rows.centers, each, rows.species).isel(time=0) for each in fields)
    return values.assign({f"{name}_error": each for name, each in errors.data_vars.items()}).drop_vars("time")


def _means(rows: Array) -> tuple[Array, Array]:
    """Means of rows ``[R, …]`` and their standard errors, ``[…]`` both: :func:`mean` of the numbers of each cell."""
    flat = rows.reshape(len(rows), -1)
    found = np.full((2, flat.shape[1]), np.nan)
    for cell, series in enumerate(flat.T):
        known = series[np.isfinite(series)]
        if len(known):
            found[:, cell] = mean(known)[:2]
    return found[0].reshape(rows.shape[1:]), found[1].reshape(rows.shape[1:])
