"""Quantities of frames against time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.arguments import count, positive
from ..errors import ArgumentError, NotApplicableError
from ..text import quoted
from . import scattering
from .checked import checked
from .clustering import clusters

if TYPE_CHECKING:
    import pandas as pd

    from ..files.frames import Frame

__all__ = ["cluster_history", "history", "structure_history"]


@checked
def history(frames: Iterable[Frame], function: Callable[..., Any], **arguments: Any) -> pd.DataFrame:
    """What a function of one frame gives for each of several, as a table with one row for each frame.

    Parameters
    ----------
    frames
        A run, whose frames are all taken, or some of them: ``run.frames[::10]``.
    function
        It is called as ``function(frame, **arguments)``: one of this module, such as :func:`temperature`, or your own.
        It returns a number, which is in the column ``value``; or a dict or a named tuple, of which every number has
        the column of its name.

    Examples
    --------
    >>> import haff
    >>> from haff import analysis
    >>> with haff.open("gas.h5") as run:                                  # doctest: +SKIP
    ...     table = analysis.history(run, analysis.clusters, distance=1.2)
    ...     table = analysis.history(run, lambda frame: abs(frame.velocity).max())

    Raises
    ------
    ArgumentError
        The function returns something else.
    NotApplicableError
        There are no frames.
    """
    import pandas as pd

    if not callable(function):
        raise ArgumentError(f"function = {quoted(function)}: must be a function of a frame")
    rows = [{"time": frame.time} | _numbers(function(frame, **arguments)) for frame in frames]
    if not rows:
        raise NotApplicableError("no frames")
    return pd.DataFrame(rows)


def _numbers(value: Any) -> dict[str, float]:
    if hasattr(value, "_asdict"):
        # Properties are as good as fields.
        names = [*value._fields, *(name for name, of in vars(type(value)).items() if isinstance(of, property))]
        value = {name: getattr(value, name) for name in names}
    if isinstance(value, Mapping):
        found = {name: one for name, one in value.items() if np.ndim(one) == 0 and _is_number(one)}
    else:
        found = {"value": value} if np.ndim(value) == 0 and _is_number(value) else {}
    if not found:
        what = "a number, or a dict or a named tuple with numbers"
        raise ArgumentError(f"function returns {quoted(value)}: must be {what}")
    return found


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


@checked
def cluster_history(frames: Iterable[Frame], distance: float = 1.1) -> pd.DataFrame:
    """Sizes of clusters against time: the columns ``time``, ``clusters``, ``largest`` and ``mean``.

    ``mean`` is the mean number of particles of the cluster of a particle, Σ n²/N. Links are those of :func:`clusters`.
    """
    distance = positive("distance", distance)

    def sizes(frame: Frame) -> dict[str, float]:
        if not len(frame.position):
            return {"clusters": 0, "largest": 0, "mean": np.nan}
        found = clusters(frame, distance).sizes.astype(float)
        return {"clusters": len(found), "largest": int(found[0]), "mean": float(found @ found / found.sum())}

    return history(frames, sizes)


@checked
def structure_history(frames: Iterable[Frame], k_max: float, bins: int, **options: Any) -> pd.DataFrame:
    """The static structure factor against time: ``time``, ``peak``, ``peak_error``, ``peak_k`` and ``length``.

    ``peak`` is the largest S(k) of a shell up to ``k_max``, with its standard error, and ``peak_k`` where it is
    [1/length]. It depends on the width of the shells where these have few waves. ``length`` is 2π/⟨k⟩ with the mean
    wave number ⟨k⟩ = ∫ k S dk/∫ S dk up to ``k_max`` [length], a sum over the waves of the box, which does not depend
    on the shells: of a gas that clusters it grows with the clusters. It depends on ``k_max``, which is to be below the
    wave number of neighbors, about π/σ. ``options`` and errors are those of :func:`static_structure`.
    """
    k_max, bins = positive("k_max", k_max), count("bins", bins)
    return history(frames, scattering.peak, k_max=k_max, bins=bins, **options)
