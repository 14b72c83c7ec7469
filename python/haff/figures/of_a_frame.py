"""What figures of frames share: which frames they are of, and disks in their box, with those across periodic faces."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.collections import Collection, EllipseCollection

from .. import analysis
from ..common import arguments
from ..errors import NotApplicableError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..files.frames import Frame
    from ..files.layout import Array
    from ..files.recording import Recording


def chosen(file: Recording, index: int) -> Frame:
    """The frame of an index, from the end if it is negative."""
    frames = file.frames
    if len(frames) == 0:
        raise NotApplicableError("no frames")
    index = arguments.count("index", index, -arguments.MOST_ROWS, arguments.MOST_ROWS)
    if not -len(frames) <= index < len(frames):
        raise NotApplicableError(f"frame {index} of {len(frames)}")
    return frames[index]


def drawn(file: Recording, index: int | None, most: int) -> list[Frame]:
    """The frames of a figure of several: the one of an index, or up to ``most`` spread over the file."""
    return analysis.drawn_frames(file, most) if index is None else [chosen(file, index)]


def disks(
    axes: Axes, frame: Frame, room: tuple[Array, Array], colors: Array, *, edge: str, style: str = "-", rows=slice(None)
) -> None:
    """Some particles as disks of ``colors`` ``[N]`` in a region from a corner to the opposite one, and its edge.

    Those across a periodic face are drawn on both sides.
    """
    (low, high), position, radius = (corner[:2] for corner in room), frame.position[rows, :2], frame.radius[rows]
    owners, centers = [np.arange(len(radius))], [position]
    for shift in itertools.product((-1, 0, 1), repeat=2):
        if not any(shift) or np.any(np.array(shift, bool) & ~frame.box.periodic[:2]):
            continue
        moved = position + np.array(shift) @ frame.box.edges[:2, :2]
        near = np.all((moved > low - radius[:, None]) & (moved < high + radius[:, None]), axis=1)
        owners.append(np.flatnonzero(near))
        centers.append(moved[near])
    owner = np.concatenate(owners)
    diameter = 2 * radius[owner]
    drawn = EllipseCollection(
        diameter, diameter, np.zeros(len(owner)), units="xy", offsets=np.concatenate(centers),
        offset_transform=axes.transData, facecolors=np.asarray(colors)[rows][owner], edgecolors=edge,
        linewidths=0.4 if len(owner) < 3000 else 0.0, zorder=1,
    )  # fmt: skip
    axes.add_collection(drawn)
    clip(axes, frame, room, drawn)
    axes.add_patch(mpl.patches.Rectangle(low, *(high - low), fill=False, ec="#333333", lw=1.0, ls=style, zorder=3))
    margin = 0.02 * (high - low).max()
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)


def clip(axes: Axes, frame: Frame, room: tuple[Array, Array], drawn: Collection) -> None:
    """Cuts off what reaches out of the region of a periodic box."""
    if frame.box.periodic[:2].any():
        low, high = (corner[:2] for corner in room)
        drawn.set_clip_path(mpl.patches.Rectangle(low, *(high - low), transform=axes.transData))
