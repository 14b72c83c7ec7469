"""The extent of the particles in some frames: the box, or along open axes the range of the positions."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .scene import pistons

if TYPE_CHECKING:
    from .box import Box
    from .frames import Frames


class Extent(NamedTuple):
    """A rectangular region that holds all particles of some frames."""

    origin: NDArray[np.float64]
    """``[3]`` lower corner [length]: 0 along periodic axes and between walls"""
    size: NDArray[np.float64]
    """``[3]`` edges [length]: those of the box, along open axes what the particles take up"""
    bounded: NDArray[np.bool_]
    """``[3]`` whether the box is real along the axis; if not, the frames decide"""

    @property
    def center(self) -> NDArray[np.float64]:
        """``[3]`` [length]"""
        return self.origin + self.size / 2

    def of(self, box: Box) -> Extent:
        """The same with the edges of the box of one frame."""
        return self._replace(size=np.where(self.bounded, box.size, self.size))


def extent(frames: Frames) -> Extent:
    """Extent of some frames; reads their positions once if an axis is open.

    Of a compressed box the longest edges; :meth:`Extent.of` is that of one frame.
    In two dimensions the region is as thick as the largest disk, about z = 0.
    """
    file = frames.file
    box, largest = file.box, float(file.radius.max(initial=0.0))
    bounded = np.array([kind != "open" for kind in box.boundary])
    bounded[box.dimension :] = False
    size = (
        np.max([one.size for one in frames.boxes()], axis=0, initial=0.0) if file.compression is not None else box.size
    )
    low, high = np.zeros(3), np.where(bounded, size, 0.0)
    reach = np.arange(3) < box.dimension
    if np.any(reach & ~bounded):
        low[~bounded], high[~bounded] = np.inf, -np.inf
        for frame in frames:
            radius = frame.radius[:, None]
            low[~bounded] = np.minimum(low, (frame.position - radius).min(axis=0, initial=np.inf))[~bounded]
            high[~bounded] = np.maximum(high, (frame.position + radius).max(axis=0, initial=-np.inf))[~bounded]
        # A piston across an open axis is an end of the region along it.
        for position, wall in zip(frames.array("piston_position").swapaxes(0, 1), pistons(file.scene)):
            normal = np.abs(np.array([*map(float, wall["plane"]["normal"]), 0.0][:3]))
            across = ~bounded & reach & (normal > 0.999 * np.linalg.norm(normal))
            low[across] = np.minimum(low, position.min(axis=0, initial=np.inf))[across]
            high[across] = np.maximum(high, position.max(axis=0, initial=-np.inf))[across]
        # No frame has a particle.
        empty = ~bounded & ~(low < high)
        low[empty], high[empty] = 0.0, box.size[empty]
    thick = largest or 0.5
    low[~reach], high[~reach] = -thick, thick
    return Extent(low, high - low, bounded)
