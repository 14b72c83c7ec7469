"""Frames as the objects of other libraries: freud, pandas and MDAnalysis."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.output import library
from .layout import AXES, Array

if TYPE_CHECKING:
    import freud
    import pandas as pd

    from ..reader import File
    from .frames import Box, Frame

__all__ = ["Unwrapping", "frame_system", "frame_table", "freud_system"]


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


def frame_system(frame: Frame) -> tuple[freud.box.Box, Array]:
    """A frame as a system of freud: see :meth:`haff.Frame.to_freud`."""
    box, d = frame.box, frame.box.dimension
    if box.fully_periodic:
        return freud_system(box, frame.position)
    # freud looks for pairs in periodic boxes only. In a box of twice the extent no image is nearer than the extent,
    # and freud accepts no distance from half of its box on: no pair is found across these faces.
    middle, edges = 0.5 * box.size[:d], box.size[:d].copy()
    for k in np.flatnonzero(~box.periodic[:d]):
        low, high = float(frame.position[:, k].min()), float(frame.position[:, k].max())
        if box.boundary[k] == "wall":
            low, high = min(low, 0.0), max(high, float(box.size[k]))
        middle[k], edges[k] = 0.5 * (low + high), 2 * max(high - low, 2 * float(frame.radius.max()))
    position = frame.position.copy()
    position[:, :d] += 0.5 * edges - middle
    return freud_system(box, position, edges)


def frame_table(frame: Frame, unwrapped: bool) -> pd.DataFrame:
    """A frame as a table: see :meth:`haff.Frame.to_pandas`."""
    import pandas as pd

    names = frame.file.species_names
    columns: dict[str, Any] = {"id": np.arange(len(frame.mass))}
    columns["species"] = pd.Categorical(np.asarray(names)[frame.species], categories=list(dict.fromkeys(names)))
    vectors = {"": frame.unwrapped if unwrapped else frame.position, "v": frame.velocity, "image_": frame.image}
    if frame.angular_velocity is not None:
        vectors["angular_velocity_"] = frame.angular_velocity
    for name, values in vectors.items():
        columns |= {f"{name}{axis}": values[:, k] for k, axis in enumerate(AXES)}
    table = pd.DataFrame(columns | {"radius": frame.radius, "mass": frame.mass})
    table.attrs = {"frame": frame.index, "time": frame.time, "step": frame.step}
    return table


class Unwrapping:
    """A transformation for trajectories of MDAnalysis: positions that do not jump at periodic faces.

    It has a file of its own, opened at first use, and again in other processes, which MDAnalysis sends it to.
    """

    def __init__(self, path: Path, open_file: Callable[[Path], File]) -> None:
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
