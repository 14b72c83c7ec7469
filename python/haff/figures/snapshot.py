"""Picture of a frame: shaded spheres in 3D, disks in 2D."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from .. import analysis
from ..files.extent import Extent, extent
from ..files.frames import Frame
from . import joints, shapes, walls
from .facts import facts
from .of_a_frame import chosen, disks
from .render import Camera, Picture, spheres
from .style import CYCLE, SPEED_MAP, headline, label, page

if TYPE_CHECKING:
    from ..files.recording import Recording

PIXELS = 1200

View = tuple[np.ndarray, np.ndarray, np.ndarray]


def draw(file: Recording, index: int = -1, *, room: Extent | None = None, pixels: int = PIXELS) -> Figure:
    """One frame, the last by default, colored by speed (few bodies: by species).

    ``room`` is the region shown, by default the box, or along open axes the extent of this frame's particles and of
    walls of finite size.
    """
    frame = chosen(file, index)
    color, scale, quantity = _colors(frame)
    particles = room or extent(file.frames[frame.index : frame.index + 1])
    scenery = shapes.find(file, particles, frame.time, planes=True)
    view = _bounds(frame, room or scenery.room)
    low, high, bound = view
    sides = np.ptp(_corners(low, high) @ Camera.looking().axes[:2].T, axis=0) if file.dimension == 3 else high - low
    legend = scale is not None or len(file.species_names) > 1
    figure = Figure(figsize=page(*sides[:2], beside=1.2 if legend else 0.3, below=0.8), layout="constrained")
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.axis("off")
    if file.dimension == 2:
        disks(axes, frame, (low, high), color, edge="#222222", style="-" if bound[:2].all() else ":")
        walls.draw_flat(axes, scenery.shapes, frame.time)
        joints.draw_flat(axes, frame)
    else:
        camera = Camera.looking()
        picture = _spheres(frame, axes, color, view, camera, pixels)
        walls.draw_solid(axes, scenery.shapes, frame.time, camera, picture)
        joints.draw_solid(axes, frame, camera, picture)
    walls.tell_missing(axes, scenery)
    if scale is not None:
        bar = figure.colorbar(scale, ax=axes, shrink=0.72, aspect=28, pad=0.02)
        bar.set_label(quantity)
        bar.outline.set_visible(False)
    elif len(file.species_names) > 1 and len(file) > 1:
        _species_legend(file, axes)
    headline(
        figure,
        f"Particles at t = {frame.time:.5g}",
        f"{facts(file)}  ·  {frame.step:,} event{'s'[: frame.step != 1]} so far",
    )
    return figure


def _colors(frame: Frame):
    """RGB per particle, and the data of the color bar."""
    mobile = np.isfinite(frame.mass)
    speed = np.linalg.norm(frame.peculiar_velocity, axis=1)
    if len(speed) < 30 or not speed[mobile].max(initial=0.0) > 0:
        rgb = np.array([mpl.colors.to_rgb(c) for c in CYCLE])
        return rgb[frame.species % len(rgb)], None, ""
    T = analysis.temperature(frame)
    unit = np.sqrt(T / np.mean(frame.mass[mobile])) if T > 0 else 1.0
    norm = Normalize(0, float(np.quantile(speed[mobile], 0.99)) / unit)
    scale = mpl.cm.ScalarMappable(norm, SPEED_MAP)
    color = np.asarray(scale.to_rgba(speed / unit))[:, :3]
    color[~mobile] = 0.55
    if frame.file.shear is not None:
        return color, scale, r"speed relative to the flow  $|v - u|\,/\,\sqrt{T/\bar m}$"
    return color, scale, r"speed  $|v|\,/\,\sqrt{T/\bar m}$"


def _species_legend(file: Recording, axes) -> None:
    from matplotlib.lines import Line2D

    present = np.unique(file.species)[:8]
    marks = [Line2D([], [], ls="", marker="o", ms=8, color=CYCLE[s % len(CYCLE)]) for s in present]
    axes.legend(marks, [label(file.species_names[s]) for s in present], loc="upper left", bbox_to_anchor=(1, 1))


def _bounds(frame: Frame, room: Extent) -> View:
    """Corners of the region drawn, and the axes along which it is the box."""
    bound, low, high = room.bounded, room.origin, room.origin + room.size
    # Not thinner than a third of the longest side, so that the picture of one falling ball is not a narrow strip.
    more = np.where(bound, 0.0, np.maximum(0.0, (high - low).max() / 3 - (high - low)) / 2)
    low, high = low - more, high + more
    return low, high, bound


def _corners(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """``[8, 3]`` corners of a box."""
    return np.array(list(itertools.product(*zip(low, high))))


def _spheres(frame: Frame, axes, color, view: View, camera: Camera, pixels: int) -> Picture:
    low, high, bound = view
    corners = _corners(low, high)
    projected = camera.project(corners)
    reach = frame.radius.max(initial=0.0)
    window = (
        projected[:, 0].min() - reach, projected[:, 0].max() + reach,
        projected[:, 1].min() - reach, projected[:, 1].max() + reach,
    )  # fmt: skip
    picture = spheres(frame.position, frame.radius, color, camera, window, pixels)
    hidden: list = []
    visible: list = []
    towards = camera.axes[2]
    far = np.where(towards > 0, low, high)
    for a, b in itertools.combinations(corners, 2):
        if np.count_nonzero(a != b) != 1:
            continue
        # Edges that meet the corner farthest from the viewer lie behind the particles.
        behind = np.array_equal(a, far) or np.array_equal(b, far)
        (hidden if behind else visible).append([camera.project(a)[:2], camera.project(b)[:2]])
    style = "-" if bound.all() else ":"
    axes.add_collection(LineCollection(hidden, colors="#999999", linewidths=0.8, linestyles=style, zorder=1))
    axes.imshow(
        (255 * picture.rgba + 0.5).astype(np.uint8), extent=picture.extent, zorder=2, interpolation="antialiased"
    )
    # The front edges cross the particles: thin, so that they frame without covering.
    axes.add_collection(LineCollection(visible, colors="#444444", linewidths=0.9, linestyles=style, zorder=3))
    axes.set_xlim(window[0], window[1])
    axes.set_ylim(window[2], window[3])
    return picture
