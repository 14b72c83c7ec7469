"""Choosing particles by their species."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..common import arguments
from ..errors import ArgumentError
from ..text import brief, quoted

if TYPE_CHECKING:
    from ..files.frames import Frame

Species = int | str
"""A species by its index or its name."""


def index_of(frame: Frame, species: Species, argument: str = "species") -> int:
    """Index of a species. Raises :class:`ArgumentError` if the file has none of this name or index."""
    names = frame.file.species_names
    if isinstance(species, str):
        if species not in names:
            known = brief(", ".join(names))
            raise ArgumentError(f"{argument} = {quoted(species)}: no species has this name; there are {known}")
        return names.index(species)
    return arguments.count(argument, species, 0, len(names) - 1)


def mobile(frame: Frame, species: Species | None) -> NDArray[np.bool_]:
    """``[N]`` which particles of a frame have a finite mass and, unless ``species`` is None, are of the species."""
    finite = np.isfinite(frame.mass)
    return finite if species is None else finite & (frame.species == index_of(frame, species))
