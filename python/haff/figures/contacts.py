"""Contacts of a packing as lines between centers, with its rattlers; in three dimensions those of a layer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from .. import analysis
from ..errors import NotApplicableError
from ..files.frames import Frame
from ..files.header import packing_fraction
from ..files.layout import AXES, Array
from .of_a_frame import chosen, clip, disks
from .style import BLUE, ORANGE, headline, label, number, page

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..analysis import ContactNetwork
    from ..files.recording import Recording

LEAST_PRESSURE = 10.0
"""Reduced pressure, P V/(N T), below which gaps say nothing about contacts."""
HELD, LOOSE = "#D6E4EE", ORANGE
"""Faces of particles of the backbone and of rattlers."""
EDGE = "#777777"
THICK = (0.5, 2.4)
"""Narrowest and widest line of a contact [points]."""


def draw(file: Recording, index: int = -1, *, tolerance: float | None = None) -> Figure:
    """Contacts of one frame, the last by default. ``tolerance``: largest gap, by default that of the pressure."""
    frame, d = chosen(file, index), file.dimension
    box = frame.box
    if "open" in box.boundary[:d]:
        raise NotApplicableError("needs a box with periodic faces or walls")
    pressure = None
    if tolerance is None:
        pressure = analysis.reduced_pressure(frame)
        if not pressure >= LEAST_PRESSURE:
            why = f"the reduced pressure is {pressure:.3g}, below {LEAST_PRESSURE:g}"
            raise NotApplicableError(f"contacts need a packing: {why}")
    network = analysis.contact_network(
        frame.position, frame.radius, box, reduced_pressure=pressure, tolerance=tolerance
    )
    shown, layer = _layer(frame)
    figure = Figure(figsize=page(*box.size[:2], beside=1.3, below=0.8), layout="constrained")
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.axis("off")
    room = np.zeros(3), box.size
    disks(axes, frame, room, np.where(network.rattlers, LOOSE, HELD), edge=EDGE, rows=shown)
    lines = _contacts(axes, frame, network, shown)
    clip(axes, frame, room, lines)
    _legend(axes)
    headline(figure, f"Contacts at t = {frame.time:.5g}{layer}", _facts(file, frame, network, pressure))
    return figure


def _facts(file: Recording, frame: Frame, network: ContactNetwork, pressure: float | None) -> str:
    parts = [f"N = {len(file):,}", f"packing fraction {packing_fraction(file, frame.box):.5g}"]
    parts += [] if pressure is None else [f"PV/NT = {number(pressure, 3)}"]
    if network.backbone:
        isostatic = f" (isostatic {network.isostatic_number:.3f})" if frame.box.fully_periodic else ""
        parts.append(f"Z = {network.contact_number:.3f}{isostatic}")
    loose = int(network.rattlers.sum())
    parts.append(f"{loose:,} rattler{'s'[: loose != 1]}")
    return f"{label(file.title) + '  ·  ' if file.title else ''}{',  '.join(parts)}"


def _layer(frame: Frame) -> tuple[Array, str]:
    """The particles shown, ``[N]``, and words for them: in three dimensions a layer of one mean diameter."""
    if frame.box.dimension == 2:
        return np.ones(len(frame.radius), bool), ""
    middle, half = frame.box.size[2] / 2, float(frame.radius.mean())
    inside = np.abs(frame.position[:, 2] - middle) < half
    return inside, f", layer {middle - half:.4g} < {AXES[2]} < {middle + half:.4g}"


def _contacts(axes: Axes, frame: Frame, network: ContactNetwork, shown: Array) -> LineCollection:
    """Lines from center to center, across periodic faces from both sides, and to the walls."""
    found, position = network.contacts, frame.position[:, :2]
    held = network.backbone_pairs & shown[found.pairs].all(axis=1)
    (first, second), vector = found.pairs[held].T, found.vector[held, :2]
    lines = [
        np.stack([position[first], position[first] + vector], axis=1),
        np.stack([position[second] - vector, position[second]], axis=1),
    ]
    at = shown[found.wall_rows] & ~network.rattlers[found.wall_rows] & found.wall_vector[:, :2].any(axis=1)
    start = position[found.wall_rows[at]]
    lines.append(np.stack([start, start + found.wall_vector[at, :2]], axis=1))
    width = np.clip(60 / np.sqrt(max(1, np.count_nonzero(shown))) / 4, *THICK)
    drawn = LineCollection(np.concatenate(lines), colors=BLUE, linewidths=width, capstyle="round", zorder=2)
    axes.add_collection(drawn)
    return drawn


def _legend(axes: Axes) -> None:
    from matplotlib.lines import Line2D

    marks = [
        Line2D([], [], ls="", marker="o", ms=8, mfc=HELD, mec=EDGE, label="backbone"),
        Line2D([], [], ls="", marker="o", ms=8, mfc=LOOSE, mec=EDGE, label="rattler"),
        Line2D([], [], color=BLUE, lw=2, label="contact"),
    ]
    axes.legend(handles=marks, loc="upper left", bbox_to_anchor=(1, 1))
