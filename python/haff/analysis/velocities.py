"""Distributions of velocities."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from ..common.arguments import count, positive
from ..errors import NotApplicableError
from ..files.layout import Array
from .checked import checked
from .energies import temperature

if TYPE_CHECKING:
    from ..files.frames import Frame


@checked
def scaled_velocities(frame: Frame) -> Array:
    """``[M, d]`` velocities c = (v − V)/√(2T/m) of the bodies of finite mass, T the temperature of the frame.

    v − V is :attr:`Frame.thermal_velocity`. Raises :class:`NotApplicableError` if there is no such body.
    """
    mobile = np.isfinite(frame.mass)
    if not mobile.any():
        raise NotApplicableError("no body of finite mass: there is no distribution of velocities")
    mass, velocity = frame.mass[mobile], frame.thermal_velocity[mobile, : frame.box.dimension]
    return velocity / np.sqrt(2 * temperature(frame) / mass)[:, None]


@checked
def sonine_a2(frame: Frame) -> float:
    """a₂ = d⟨v⁴⟩/[(d + 2)⟨v²⟩²] − 1 of the velocities v − V, each scaled by its own thermal speed."""
    square = np.sum(scaled_velocities(frame) ** 2, axis=1)
    d = frame.box.dimension
    return float(d * np.mean(square**2) / ((d + 2) * np.mean(square) ** 2) - 1)


@checked
def velocity_histogram(frames: Iterable[Frame], bins: int = 61, reach: float = 5.0) -> tuple[Array, Array]:
    """Distribution of the components of scaled velocities (:func:`scaled_velocities`), averaged over frames.

    Returns the centres of the bins between -``reach`` and ``reach`` and the density. A Maxwell distribution gives the
    normal density with variance 1/2.
    """
    bins, reach = count("bins", bins), positive("reach", reach)
    edges = np.linspace(-reach, reach, bins + 1)
    counts, total = np.zeros(bins), 0
    for frame in frames:
        values = scaled_velocities(frame)[:, : frame.box.dimension].ravel()
        counts += np.histogram(values, edges)[0]
        total += len(values)
    if total == 0:
        raise NotApplicableError("no frames")
    return 0.5 * (edges[1:] + edges[:-1]), counts / (total * (edges[1] - edges[0]))
