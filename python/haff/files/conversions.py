"""Frames as the objects of other libraries: freud and MDAnalysis."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ..common.output import library
from .layout import Array

if TYPE_CHECKING:
    import freud

    from .box import Box

__all__ = ["Placed", "Unwrapping", "frame_system", "freud_system"]


class Placed(Protocol):
    """Particles in a box: a :class:`haff.Frame`, or the like."""

    @property
    def box(self) -> Box: ...
    @property
    def position(self) -> Array: ...
    @property
    def radius(self) -> Array: ...


def freud_system(box: Box, position: Array, edges: Array | None = None) -> tuple[freud.box.Box, Array]:
    """A box for freud, with the ``edges`` [length] of the box if they are not given, and the positions in it.

    freud keeps its box centred at the origin, in single precision. Its matrix of edge vectors is triangular: where the
    gradient of a sheared box is an axis before that of the flow, both are exchanged. Distances stay the same.
    """
    freud = library("freud", package="freud-analysis")
    d = box.dimension
    edges = box.size[:d] if edges is None else edges
    points = np.zeros((len(position), 3))
    points[:, :d] = position[:, :d] - edges / 2
    if box.displacement is None:
        return freud.box.Box(*edges, is2D=d == 2), points
    gradient, flow, length = box.displacement
    order = [0, 1, 2]
    if flow > gradient:
        order[flow], order[gradient] = gradient, flow
        flow, gradient = gradient, flow
    tilts = {(1, 0): "xy", (2, 0): "xz", (2, 1): "yz"}
    size = box.size[order]
    tilt = {tilts[gradient, flow]: length / size[gradient]}
    cell = freud.box.Box(*size[:d], is2D=d == 2, **tilt)
    # Positions in [0, L) are not in freud's box, which leans.
    return cell, cell.wrap(points[:, order])


def frame_system(frame: Placed) -> tuple[freud.box.Box, Array]:
    """A frame as a system of freud: see :meth:`haff.Frame.to_freud`."""
    box, d = frame.box, frame.box.dimension
    if box.fully_periodic:
        return freud_system(box, frame.position)
    # freud looks for pairs in periodic boxes only. In a box of twice the extent no image is nearer than the extent,
    # and freud accepts no distance from half of its box on: no pair is found across these faces.
    middle, edges, diameter = 0.5 * box.size[:d], box.size[:d].copy(), 2 * float(frame.radius.max(initial=0.0))
    for k in np.flatnonzero(~box.periodic[:d]):
        there = frame.position[:, k] if len(frame.position) else middle[k : k + 1]
        low, high = float(there.min()), float(there.max())
        if box.boundary[k] == "wall":
            low, high = min(low, 0.0), max(high, float(box.size[k]))
        middle[k], edges[k] = 0.5 * (low + high), 2 * max(high - low, diameter or float(box.size[k]))
    position = frame.position.copy()
    position[:, :d] += 0.5 * edges - middle
    return freud_system(box, position, edges)


class Unwrapping:
    """A transformation for trajectories of MDAnalysis: positions that do not jump at periodic faces.

    It has a file of its own, opened at first use, and again in other processes, which MDAnalysis sends it to.
    """

    def __init__(self, path: Path, open_file: Callable[[Path], Any]) -> None:
        self.path, self._open = path.resolve(), open_file
        self._frames: Any = None

    def __call__(self, step: Any) -> Any:
        """Replaces the positions of a time step."""
        if self._frames is None:
            self._frames = self._open(self.path).frames
        step.positions = self._frames[step.frame].unwrapped
        return step

    def __getstate__(self) -> dict[str, Any]:
        return {"path": self.path, "_open": self._open, "_frames": None}
