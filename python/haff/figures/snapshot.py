"""Picture of a frame: shaded spheres in 3D, disks in 2D."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from .. import analysis
from ..common import arguments
from ..errors import NotApplicableError
from ..files.extent import Extent, extent
from ..files.frames import Frame
from .facts import facts
from .render import Camera, spheres
from .style import CYCLE, SPEED_MAP, headline, label, page

if TYPE_CHECKING:
    from ..reader import File

PIXELS = 1200

View = tuple[np.ndarray, np.ndarray, np.ndarray]


def draw(file: File, index: int = -1, *, room: Extent | None = None, pixels: int = PIXELS) -> Figure:
    """One frame, the last by default, colored by speed (few bodies: by species).

    ``room`` is the region shown, by default the box, or along open axes the extent of this frame's particles.
    """
    frames = file.frames
    if len(frames) == 0:
        raise NotApplicableError("no frames")
    index = arguments.count("index", index, -arguments.MOST_ROWS, arguments.MOST_ROWS)
    if not -len(frames) <= index < len(frames):
        raise NotApplicableError(f"frame {index} of {len(frames)}")
    frame = frames[index]
    color, scale, quantity = _colors(frame)
    view = _bounds(frame, room or extent(frames[index : index + 1 or None]))
    low, high, _ = view
    sides = np.ptp(_corners(low, high) @ Camera.looking().axes[:2].T, axis=0) if file.dimension == 3 else high - low
    legend = scale is not None or len(file.species_names) > 1
    figure = Figure(figsize=page(*sides[:2], beside=1.2 if legend else 0.3, below=0.8), layout="constrained")
    axes = figure.subplots()
    axes.set_aspect("equal")
    axes.axis("off")
    if file.dimension == 2:
        _disks(frame, axes, color, view)
    else:
        _spheres(frame, axes, color, view, pixels)
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


def _species_legend(file: File, axes) -> None:
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


def _disks(frame: Frame, axes, color, view: View) -> None:
    low, high, bound = view
    size = high - low
    centres, colors, radius = [frame.position[:, :2]], [color], [frame.radius]
    # Disks across a periodic face are drawn on both sides.
    for shift in itertools.product((-1, 0, 1), repeat=2):
        offset = np.array(shift) @ frame.box.edges[:2, :2]
        if not any(shift) or np.any(np.array(shift, bool) & ~frame.box.periodic[:2]):
            continue
        moved = frame.position[:, :2] + offset
        near = np.all((moved > low[:2] - frame.radius[:, None]) & (moved < high[:2] + frame.radius[:, None]), axis=1)
        centres.append(moved[near])
        colors.append(color[near])
        radius.append(frame.radius[near])
    diameter = 2 * np.concatenate(radius)
    edge = 0.4 if len(diameter) < 3000 else 0.0
    disks = EllipseCollection(
        diameter, diameter, np.zeros(len(diameter)), units="xy", offsets=np.concatenate(centres),
        offset_transform=axes.transData, facecolors=np.concatenate(colors), edgecolors="#222222", linewidths=edge,
    )  # fmt: skip
    axes.add_collection(disks)
    frame_of_box = mpl.patches.Rectangle((low[0], low[1]), *size[:2], fill=False, ec="#333333", lw=1.0,
                                         ls="-" if bound[:2].all() else ":")  # fmt: skip
    axes.add_patch(frame_of_box)
    if frame.box.periodic[:2].any():
        disks.set_clip_path(mpl.patches.Rectangle((low[0], low[1]), *size[:2], transform=axes.transData))
    margin = 0.02 * size[:2].max()
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)


def _spheres(frame: Frame, axes, color, view: View, pixels: int) -> None:
    low, high, bound = view
    camera = Camera.looking()
    corners = _corners(low, high)
    projected = camera.project(corners)
    reach = frame.radius.max()
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
