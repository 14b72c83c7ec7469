"""Density fields: particles counted, or their volume, on a grid of cells."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..common.arguments import choice, count
from ..errors import ArgumentError, NotApplicableError
from ..files.layout import AXES, Array, computing
from ..text import quoted
from .checked import checked

if TYPE_CHECKING:
    from ..files.box import Box
    from ..files.frames import Frame

__all__ = ["DensityField", "density_field"]

QUANTITIES = ("packing_fraction", "number_density")

POINTS = 32
"""Points that stand for the volume of a particle."""

MOST_CELLS = 1 << 24


class DensityField(NamedTuple):
    """A field on a grid of ``d`` dimensions."""

    value: Array
    """``[n_x, n_y]`` or ``[n_x, n_y, n_z]`` packing fraction, or number density [1/length^d]."""
    edges: tuple[Array, ...]
    """For each axis ``[n + 1]`` limits of the cells [length]."""
    quantity: str
    """``"packing_fraction"`` or ``"number_density"``."""

    @property
    def cell_volume(self) -> float:
        """Volume of a cell [length^d]; the field times it sums to N, or to the volume of all particles."""
        return float(np.prod([edge[1] - edge[0] for edge in self.edges]))


@checked
def density_field(
    frames: Iterable[Frame], cells: int | Sequence[int], quantity: str = "packing_fraction"
) -> DensityField:
    """Packing fraction or number density on a grid over the box, averaged over frames.

    The number density counts centers. For the packing fraction the volume of a particle is spread evenly over 32 points
    within it, each of which counts in its own cell, so that a cell may be smaller than a particle. Points across a
    periodic face count on the other side, displaced in a sheared box. The sum over all cells times their volume is the
    number of particles, or their volume, to rounding.

    Parameters
    ----------
    frames
        A frame, several of one file, or a run, of which all are taken.
    cells
        Number of cells along the longest axis, the others in proportion; or one for each axis.
    quantity
        ``"packing_fraction"`` or ``"number_density"``.

    Along an open axis the grid spans the particles of all frames.

    Raises
    ------
    ArgumentError
        An argument is not one of those allowed.
    NotApplicableError
        There are no frames.
    """
    quantity = choice("quantity", quantity, QUANTITIES)
    chosen = list(frames)
    if not chosen:
        raise NotApplicableError("no frames")
    first = chosen[0]
    d = first.box.dimension
    low, size = _region(chosen, d)
    if not (np.isfinite(size) & (size > 0)).all():
        raise NotApplicableError(f"{first.file.path}: the particles fill no region that has a volume")
    numbers = _cells(cells, size)
    edges = tuple(low[k] + size[k] * np.linspace(0.0, 1.0, numbers[k] + 1) for k in range(d))
    total = np.zeros(int(np.prod(numbers)))
    volume = float(np.prod(size)) / len(total)
    offsets = _within(d) if quantity == "packing_fraction" else np.zeros((1, d))
    for frame in chosen:
        weight = np.ones(len(frame.radius))
        if quantity == "packing_fraction":
            weight = (4 / 3 * np.pi * frame.radius**3 if d == 3 else np.pi * frame.radius**2) / POINTS
        with computing(frame.file.path, "density field"):
            for offset in offsets:
                place = wrapped(frame.box, frame.position[:, :d] + frame.radius[:, None] * offset)
                at = np.clip(((place - low) / size * numbers).astype(np.int64), 0, np.array(numbers) - 1)
                total += np.bincount(np.ravel_multi_index(tuple(at.T), numbers), weight, len(total))
    return DensityField((total / (len(chosen) * volume)).reshape(numbers), edges, quantity)


def wrapped(box: Box, place: Array) -> Array:
    """Places ``[N, d]`` within [0, L) along periodic axes; across a face of a sheared box displaced."""
    place, d = np.array(place, float), box.dimension
    if box.displacement is not None:
        gradient, flow, length = box.displacement
        place[:, flow] -= np.floor(place[:, gradient] / box.size[gradient]) * length
    periodic, size = box.periodic[:d], box.size[:d]
    place[:, periodic] -= np.floor(place[:, periodic] / size[periodic]) * size[periodic]
    return place


def _region(frames: list, d: int) -> tuple[Array, Array]:
    """Lower corner and edges of the grid: the box, and along open axes what the particles take up."""
    box = frames[0].box
    low, high = np.zeros(d), box.size[:d].copy()
    for k in range(d):
        if box.boundary[k] == "open":
            low[k] = min(float((frame.position[:, k] - frame.radius).min()) for frame in frames)
            high[k] = max(float((frame.position[:, k] + frame.radius).max()) for frame in frames)
    return low, high - low


def _cells(cells: int | Sequence[int], size: Array) -> tuple[int, ...]:
    if isinstance(cells, (list, tuple)) or (isinstance(cells, np.ndarray) and cells.ndim > 0):
        if len(cells) != len(size):
            axes = ", ".join(AXES[: len(size)])
            raise ArgumentError(f"cells = {quoted(cells)}: must be one number, or {len(size)}, of {axes}")
        numbers = tuple(count(f"cells[{k}]", one) for k, one in enumerate(cells))
    else:
        most = count("cells", cells)
        numbers = tuple(max(1, round(most * float(edge / size.max()))) for edge in size)
    if np.prod(np.array(numbers, float)) > MOST_CELLS:
        raise ArgumentError(
            f"cells = {quoted(cells)}: {' × '.join(map(str, numbers))} cells; must be {MOST_CELLS} at most"
        )
    return numbers


def _within(d: int) -> Array:
    """``[POINTS, d]`` points of a ball or disk of radius 1, each for the same part of its volume.

    Spirals of the golden ratio: points of a sphere (Á. González, Math. Geosci. 42, 49 (2010)), with radii at the middle
    of shells of equal volume in an order far from that along the sphere; on a disk the sunflower.
    """
    k = np.arange(POINTS)
    turn = np.pi * (3 - np.sqrt(5)) * k
    if d == 2:
        radius = np.sqrt((k + 0.5) / POINTS)
        return radius[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    height = 1 - (2 * k + 1) / POINTS
    around = np.sqrt(1 - height**2)
    direction = np.stack([around * np.cos(turn), around * np.sin(turn), height], axis=1)
    radius = (((k * 13) % POINTS + 0.5) / POINTS) ** (1 / 3)
    return radius[:, None] * direction
