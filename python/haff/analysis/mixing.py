"""Segregation and mixing: concentrations of a species, and Lacey's index, from profiles that a run has measured."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..common import arguments
from ..errors import ArgumentError, MissingDataError
from ..files.layout import Array
from ..files.measure import profile_rows
from ..text import brief, quoted
from .checked import checked

if TYPE_CHECKING:
    from ..files.recording import Recording

__all__ = ["Mixing", "mixing"]


class Mixing(NamedTuple):
    """Concentrations of a species in the cells of a profile, and how mixed they are, by row."""

    time: Array
    """``[R]`` ends of the intervals [time]."""
    concentration: Array
    """``[R, cells…]`` n_s/n, the part of the particles that are of the species; NaN in an empty cell."""
    mean: Array
    """``[R]`` p, the part of all particles in the grid."""
    variance: Array
    """``[R]`` σ², variance of the concentrations, each cell with the weight of its particles."""
    index: Array
    """``[R]`` Lacey's index (σ₀² − σ²)/(σ₀² − σ_r²): 0 of separate species, 1 of a random mixture."""


@checked
def mixing(file: Recording, species: str, profile: str | None = None) -> Mixing:
    """Concentrations of a species in the cells of a profile of ``measure.profiles``, and Lacey's index of mixing.

    With the part p of the particles, the variance of the concentrations is σ₀² = p(1 − p) if the species are separate,
    and σ_r² = p(1 − p)/n of a random mixture with n particles in a cell (P. M. C. Lacey, J. Appl. Chem. 4, 257 (1954)).
    Fluctuations of the states that a row averages over are not independent, so that a row of many states is less noisy
    than one state, and its index may be slightly above 1.

    Parameters
    ----------
    species
        Name of a species that the profile has fields of (``species = "each"`` in the scene).
    profile
        Letters of its axes, such as ``"z"``; by default the only one with fields of the species.

    Where all particles are of one species the index is NaN. Raises :class:`MissingDataError` if there is no such
    profile.
    """
    rows = profile_rows(file)
    known = {name: one for name, one in rows.items() if species in one.species}
    if profile is not None:
        arguments.choice("profile", profile, tuple(rows))
    if not known:
        have = sorted({name for one in rows.values() for name in one.species})
        of = f"; there are those of {brief(', '.join(have))}" if have else ""
        raise MissingDataError(
            f'{file.path}: no profile has fields of {quoted(species)} (set species = "each" in measure.profiles){of}'
        )
    if profile is None and len(known) > 1:
        raise ArgumentError(f"{file.path}: several profiles have fields of {quoted(species)}: {', '.join(known)}")
    name = profile if profile is not None else next(iter(known))
    if name not in known:
        raise MissingDataError(f"{file.path}: the profile along {name} has no fields of {quoted(species)}")
    chosen = known[name]
    of_species = chosen.fields["species_density"][:, list(chosen.species).index(species)]
    all_of = chosen.fields["density"]
    count = len(of_species)
    flat, total = of_species.reshape(count, -1), all_of.reshape(count, -1)
    with np.errstate(invalid="ignore", divide="ignore"):
        concentration = flat / total
        weights = total / total.sum(axis=1, keepdims=True)
        p = flat.sum(axis=1) / total.sum(axis=1)
        variance = np.nansum(weights * (concentration - p[:, None]) ** 2, axis=1)
        separate = p * (1 - p)
        # Particles in a cell, of the cells with particles, with the weight of these.
        in_cell = np.sum(weights * total, axis=1) * _volume(file, chosen.centers)
        random = separate / in_cell
        index = (separate - variance) / (separate - random)
    return Mixing(chosen.time, concentration.reshape(of_species.shape), p, variance, index)


def _volume(file: Recording, centers: object) -> float:
    """Volume of a cell [length^d]."""
    size, d = file.box.size, file.dimension
    widths = {axis: float(np.diff(at).mean()) if len(at) > 1 else float("nan") for axis, at in dict(centers).items()}
    edges = [widths.get(axis, float(size[k])) for k, axis in enumerate("xyz"[:d])]
    return float(np.prod([size[k] if np.isnan(edge) else edge for k, edge in enumerate(edges)]))
