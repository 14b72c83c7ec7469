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
from .species import Species, mobile

if TYPE_CHECKING:
    from ..files.frames import Frame


@checked
def scaled_velocities(frame: Frame, species: Species | None = None) -> Array:
    """``[M, d]`` velocities c = (v − V)/√(2T/m) of the bodies of finite mass, T the temperature of the frame.

    v − V is :attr:`Frame.thermal_velocity`. With a ``species``, a name or an index, of its bodies alone, and T is
    theirs. Raises :class:`NotApplicableError` if there is no such body, or none moves.
    """
    chosen = mobile(frame, species)
    if not chosen.any():
        raise NotApplicableError("no body of finite mass: there is no distribution of velocities")
    if not temperature(frame, species) > 0:
        raise NotApplicableError("the bodies do not move: there is no distribution of velocities")
    mass, velocity = frame.mass[chosen], frame.thermal_velocity[chosen, : frame.box.dimension]
    return velocity / np.sqrt(2 * temperature(frame, species) / mass)[:, None]


@checked
def sonine_a2(frame: Frame, species: Species | None = None) -> float:
    """a₂ = d⟨v⁴⟩/[(d + 2)⟨v²⟩²] − 1 of the velocities v − V, each scaled by its own thermal speed.

    ``species``: as for :func:`scaled_velocities`.
    """
    square = np.sum(scaled_velocities(frame, species) ** 2, axis=1)
    d = frame.box.dimension
    return float(d * np.mean(square**2) / ((d + 2) * np.mean(square) ** 2) - 1)


@checked
def velocity_histogram(
    frames: Iterable[Frame], bins: int = 61, reach: float = 5.0, species: Species | None = None
) -> tuple[Array, Array]:
    """Distribution of the components of scaled velocities (:func:`scaled_velocities`), averaged over frames.

    With a ``species``, a name or an index, of its bodies alone.

    Returns the centres of the bins between -``reach`` and ``reach`` and the density. A Maxwell distribution gives the
    normal density with variance 1/2.
    """
    bins, reach = count("bins", bins), positive("reach", reach)
    edges = np.linspace(-reach, reach, bins + 1)
    counts, total = np.zeros(bins), 0
    for frame in frames:
        if not len(frame.position):
            continue
        values = scaled_velocities(frame, species)[:, : frame.box.dimension].ravel()
        counts += np.histogram(values, edges)[0]
        total += len(values)
    if total == 0:
        raise NotApplicableError("no frames with particles")
    return 0.5 * (edges[1:] + edges[:-1]), counts / (total * (edges[1] - edges[0]))
