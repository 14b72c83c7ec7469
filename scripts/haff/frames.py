"""The trajectory of a file: its frames, and the box they are in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import h5py
import numpy as np
from numpy.typing import NDArray

from .errors import MissingDataError
from .layout import Array, complete, reading

if TYPE_CHECKING:
    from .reader import File

__all__ = ["Box", "Frame", "Frames"]


class Box:
    """The simulation box [0, L) per axis.

    Attributes
    ----------
    size : ``[3]`` edge lengths L [length]; a placeholder along open axes
    boundary : per axis ``"periodic"``, ``"wall"`` or ``"open"``
    dimension : 2 or 3
    """

    def __init__(self, size: Array, boundary: Sequence[str], dimension: int) -> None:
        self.size = np.asarray(size, float)
        self.boundary = tuple(boundary)
        self.dimension = dimension

    @property
    def periodic(self) -> NDArray[np.bool_]:
        """``[3]``, true where the axis is periodic."""
        return np.array([b == "periodic" for b in self.boundary])

    @property
    def fully_periodic(self) -> bool:
        """Whether every axis that particles move along is periodic."""
        return bool(self.periodic[: self.dimension].all())

    @property
    def volume(self) -> float:
        """Volume [length³], or area [length²] in 2D."""
        return float(np.prod(self.size[: self.dimension]))

    def __repr__(self) -> str:
        sides = " × ".join(f"{s:g} ({b})" for s, b in zip(self.size[: self.dimension], self.boundary))
        return f"Box({self.dimension}D, {sides})"


class Frame:
    """All particles at one time; arrays are read on first use and then kept.

    Rows are particles in the order of the scene.
    """

    def __init__(self, frames: Frames, row: int) -> None:
        self._frames = frames
        self._row = row

    @property
    def file(self) -> File:
        """The file that this frame belongs to."""
        return self._frames._file

    @property
    def index(self) -> int:
        """Row of the frame in the file."""
        return self._row

    @cached_property
    def time(self) -> float:
        """Simulated time [time]."""
        return float(self._frames._item(self._frames._group["position/time"], self._row))

    @cached_property
    def step(self) -> int:
        """Collisions and wall collisions so far."""
        return int(self._frames._item(self._frames._group["position/step"], self._row))

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """``[N, 3]`` centres [length], within [0, L) along periodic axes; z = 0 in 2D."""
        return self._read("position")

    @cached_property
    def velocity(self) -> NDArray[np.float64]:
        """``[N, 3]`` velocities [length/time]; z = 0 in 2D."""
        return self._read("velocity")

    @cached_property
    def image(self) -> NDArray[np.int32]:
        """``[N, 3]`` how often each particle has left through the periodic faces (upper +1, lower −1)."""
        return self._read("image")

    @property
    def unwrapped(self) -> NDArray[np.float64]:
        """``[N, 3]`` positions that do not jump at periodic faces, position + image · L [length]."""
        return self.position + self.image * np.where(self.box.periodic, self.box.size, 0.0)

    @property
    def box(self) -> Box:
        """The simulation box."""
        return self.file.box

    @property
    def mass(self) -> NDArray[np.float64]:
        """``[N]`` masses; infinite for fixed and driven bodies."""
        return self.file.mass

    @property
    def radius(self) -> NDArray[np.float64]:
        """``[N]`` radii [length]."""
        return self.file.radius

    @property
    def species(self) -> NDArray[np.int64]:
        """``[N]`` species indices."""
        return self.file.species

    def _read(self, name: str) -> Array:
        return self._frames._item(self._frames._dataset(name), self._row)

    def __repr__(self) -> str:
        return f"<Frame {self._row}: t = {self.time:g}, step = {self.step}, N = {len(self.mass)}>"


class Frames(Sequence["Frame"]):
    """The trajectory: a lazy sequence of :class:`Frame`. Slices are sequences too."""

    def __init__(self, file: File, rows: range | None = None) -> None:
        self._file = file
        try:
            self._group: h5py.Group = file.hdf["particles/all"]
            self._dataset("position")
        except KeyError:
            raise MissingDataError(f"{file.path}: no frames (output.frames = false in the scene)") from None
        if rows is None:
            names = [n for n in ("position", "velocity", "image") if n in self._group]
            columns = [f"{n}/{part}" for n in names for part in ("value", "step", "time")]
            length = min(self._group[c].shape[0] for c in columns if c in self._group)
            with reading(file.path):
                rows = range(complete(self._group["position/time"], length))
        self._rows = rows

    @property
    def file(self) -> File:
        """The file that the frames belong to."""
        return self._file

    def _dataset(self, name: str) -> h5py.Dataset:
        return self._group[f"{name}/value"]

    def _item(self, dataset: h5py.Dataset, key: int | slice) -> Any:
        with reading(self._file.path):
            return dataset[key]

    def _take(self, dataset: h5py.Dataset) -> Array:
        # h5py wants increasing selections: read the span, then stride in memory.
        if not self._rows:
            return dataset[:0]
        low, high = min(self._rows[0], self._rows[-1]), max(self._rows[0], self._rows[-1])
        if self._rows.step > 0:
            return self._item(dataset, slice(low, high + 1, self._rows.step))
        return self._item(dataset, slice(low, high + 1))[np.array(self._rows) - low]

    @property
    def time(self) -> NDArray[np.float64]:
        """``[F]`` times of the frames [time]."""
        return self._take(self._group["position/time"])

    @property
    def step(self) -> NDArray[np.int64]:
        """``[F]`` events before each frame."""
        return self._take(self._group["position/step"])

    def array(self, name: str) -> Array:
        """All frames of one quantity at once, ``[F, N, 3]``.

        ``name`` is ``"position"``, ``"velocity"``, ``"image"`` or ``"unwrapped"``.
        """
        if name == "unwrapped":
            box = self._file.box
            return self.array("position") + self.array("image") * np.where(box.periodic, box.size, 0.0)
        return self._take(self._dataset(name))

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, key: int) -> Frame: ...
    @overload
    def __getitem__(self, key: slice) -> Frames: ...
    def __getitem__(self, key: int | slice) -> Frame | Frames:
        if isinstance(key, slice):
            return Frames(self._file, self._rows[key])
        try:
            return Frame(self, self._rows[key])
        except IndexError:
            raise IndexError(f"frame {key} of {len(self)}") from None

    def __iter__(self) -> Iterator[Frame]:
        return (Frame(self, row) for row in self._rows)

    def __repr__(self) -> str:
        if not self:
            return "<Frames: none>"
        return f"<Frames: {len(self)}, t = {self[0].time:g} … {self[-1].time:g}>"
