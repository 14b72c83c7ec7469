"""Density field: the packing fraction on a grid, as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .. import analysis
from ..errors import NotApplicableError
from ..files.layout import AXES
from .facts import facts
from .of_a_frame import chosen
from .style import SPEED_MAP, headline, page

if TYPE_CHECKING:
    from ..files.recording import Recording

FEWEST = 30
PER_CELL = {2: 4, 3: 12}
"""Particles in a cell of the picture, about, by dimension."""
MOST_CELLS = 200
"""Cells along an axis."""


def draw(file: Recording, index: int = -1) -> Figure:
    """Packing fraction of one frame, the last by default; in three dimensions the mean along an axis, and a slice.

    The axis along which the view goes is the shortest one other than that of the height.
    """
    if len(file) < FEWEST:
        raise NotApplicableError(f"{len(file)} particles are too few for a density field")
    frame, d = chosen(file, index), file.dimension
    along = _view(file) if d == 3 else 2
    cells = np.empty(d, int)
    across = [k for k in range(d) if k != along]
    # One cell along the view for the projection; the slice is a layer of three.
    shape = _extent(frame, d)
    edge = float(np.sqrt(shape[across[0]] * shape[across[1]] * PER_CELL[d] / len(file)))
    cells[across] = np.clip(np.round(shape[across] / max(edge, float(shape.max()) / MOST_CELLS)), 1, MOST_CELLS)
    if d == 3:
        cells[along] = 3
    field = analysis.density_field(frame, cells)
    pictures = [("", field.value)]
    if d == 3:
        low, high = field.edges[along][1:3]
        pictures = [
            (f"mean along {AXES[along]}", field.value.mean(axis=along)),
            (f"slice {low:.4g} < {AXES[along]} < {high:.4g}", np.take(field.value, 1, axis=along)),
        ]
    return _drawn(file, frame.time, field, across, pictures)


def _drawn(file: Recording, time: float, field: analysis.DensityField, across: list[int], pictures: list) -> Figure:
    x, y = (field.edges[k] for k in across)
    width, height = page(float(np.ptp(x)), float(np.ptp(y)), beside=1.2, below=1.2)
    scale = 0.75 if len(pictures) > 1 else 1.0
    beside = len(pictures) > 1 and height > 0.5 * width
    rows, columns = (1, len(pictures)) if beside else (len(pictures), 1)
    figure = Figure(figsize=(columns * width * scale, rows * (height - 0.6) * scale + 0.6), layout="constrained")
    panels = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    top = max(float(values.max()) for _, values in pictures)
    for axes, (title, values) in zip(panels, pictures):
        picture = axes.pcolormesh(x, y, values.T, cmap=SPEED_MAP, vmin=0, vmax=top or 1.0, rasterized=True)
        axes.set_aspect("equal")
        axes.set_xlabel(f"${AXES[across[0]]}$  [length]")
        axes.set_ylabel(f"${AXES[across[1]]}$  [length]")
        axes.spines[["top", "right"]].set_visible(True)
        if title:
            axes.set_title(title, fontsize=9.5, fontweight="normal", loc="left")
    bar = figure.colorbar(picture, ax=list(panels), label=r"local packing fraction  $\varphi$", shrink=0.85, aspect=28)
    bar.outline.set_visible(False)
    headline(figure, f"Density at t = {time:.5g}", facts(file))
    return figure


def _extent(frame, d: int) -> np.ndarray:
    """Edges of the region that the particles are in [length]."""
    found = frame.box.size[:d].copy()
    for k in range(d):
        if frame.box.boundary[k] == "open":
            found[k] = float(np.ptp(frame.position[:, k]) + 2 * frame.radius.max())
    return found


def _view(file: Recording) -> int:
    """The axis that the picture is taken along."""
    try:
        upright = analysis.height_axis(file)[0]
    except NotApplicableError:
        upright = 1
    others = [k for k in (2, 1, 0) if k != upright]
    return min(others, key=lambda k: float(file.box.size[k]))
