"""The trajectory of a file: its frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from ..common import arguments
from ..common.notebook import table
from ..common.readonly import ReadOnly
from ..errors import MissingDataError
from . import conversions
from .box import Box
from .column import Column, complete
from .layout import AXES, Array

if TYPE_CHECKING:
    import freud
    import pandas as pd

    from .header import Header

__all__ = ["Frame", "Frames"]

_PISTONS = {"piston_position": "position", "piston_velocity": "velocity"}
"""What frames have of each piston, and where it is in the file."""
_VECTORS = {"position": "f", "velocity": "f", "image": "iu", "angular_velocity": "f"}
"""What has a vector for each particle in a frame, and what NumPy calls the kind of its components."""


class Frame(ReadOnly):
    """All particles at one time; arrays are read on first use and then kept.

    Rows are particles in the order of the scene. Where particles come and go by inlets and outlets, only those that
    are there at this time: :attr:`id` says which.
    """

    def __init__(self, frames: Frames, row: int) -> None:
        self._frames = frames
        self._row = row
        self._made = True

    def __reduce__(self) -> tuple[Any, ...]:
        return Frame, (self._frames, self._row)

    @property
    def file(self) -> Header:
        """The file that this frame belongs to."""
        return self._frames._file

    @property
    def index(self) -> int:
        """Row of the frame in the file."""
        return self._row

    @cached_property
    def time(self) -> float:
        """Simulated time [time]."""
        return float(self._frames._times(range(self._row, self._row + 1))[0])

    @cached_property
    def step(self) -> int:
        """Collisions and wall collisions so far."""
        return int(self._frames._steps(range(self._row, self._row + 1))[0])

    @cached_property
    def id(self) -> NDArray[np.int64]:
        """``[N]`` rows of the particles in the file: all, or with inlets or outlets those that are there."""
        present = self.present
        return np.arange(len(present)) if present.all() else np.flatnonzero(present)

    @cached_property
    def present(self) -> NDArray[np.bool_]:
        """Whether each particle of the file is there: all are, unless there are inlets or outlets."""
        return self._frames._presence(range(self._row, self._row + 1))[0]

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """``[N, 3]`` centres [length], within [0, L) along periodic axes; z = 0 in 2D."""
        return self._read("position")

    @cached_property
    def velocity(self) -> NDArray[np.float64]:
        """``[N, 3]`` velocities [length/time]; z = 0 in 2D. In a box that deforms the flow is part of them."""
        return self._read("velocity")

    @property
    def peculiar_velocity(self) -> NDArray[np.float64]:
        """``[N, 3]`` velocities relative to the flow of a box that deforms [length/time]; else the velocities.

        The flow of a sheared box is γ̇ y x̂, that of a compressed one −γ x/(1 − γ t) along each periodic axis. Along
        axes between walls there is none.
        """
        shear, rates = self.file.shear, self.file.compression
        if rates is not None:
            moving = np.where(self.file.box.periodic, rates, 0.0)
            left = 1 - moving * self.time
            if not (left > 0).all():
                raise self.file.stored.wrong(
                    "particles/all/position/time", f"{self.time:g}: the box has no volume then"
                )
            return self.velocity + moving / left * self.position
        if shear is None:
            return self.velocity
        found = self.velocity.copy()
        found[:, shear.flow] -= shear.rate * self.position[:, shear.gradient]
        return found

    @property
    def thermal_velocity(self) -> NDArray[np.float64]:
        """``[N, 3]`` velocities of which temperature and pressure are made, v − V [length/time].

        V is the velocity of the center of mass of the bodies of finite mass along the axes on which momentum is
        conserved (:attr:`File.conserved_momentum`), and 0 along the others. In a box that deforms v is
        relative to the flow.
        """
        velocity, mobile = self.peculiar_velocity, np.isfinite(self.mass)
        if not mobile.any():
            return velocity
        common = np.average(velocity[mobile], axis=0, weights=self.mass[mobile])
        return velocity - np.where(self.file.conserved_momentum, common, 0.0)

    @cached_property
    def angular_velocity(self) -> NDArray[np.float64] | None:
        """``[N, 3]`` angular velocities [1/time], along z in 2D; ``None`` if the scene has no spin."""
        return self._read("angular_velocity") if "angular_velocity" in self._frames._columns else None

    @cached_property
    def image(self) -> NDArray[np.int32]:
        """``[N, 3]`` how often each particle has left through the periodic faces (upper +1, lower −1)."""
        return self._read("image")

    @cached_property
    def piston_position(self) -> NDArray[np.float64]:
        """``[P, 3]`` a point of each piston [length], in the order of :attr:`File.pistons`."""
        return self._frames._of_pistons("piston_position", range(self._row, self._row + 1))[0]

    @cached_property
    def piston_velocity(self) -> NDArray[np.float64]:
        """``[P, 3]`` velocity of each piston [length/time]."""
        return self._frames._of_pistons("piston_velocity", range(self._row, self._row + 1))[0]

    @property
    def unwrapped(self) -> NDArray[np.float64]:
        """``[N, 3]`` positions that do not jump at periodic faces, position + Σ image · edge vector [length]."""
        return self.box.unwrap(self.position, self.image)

    @cached_property
    def box(self) -> Box:
        """The simulation box, at the time of the frame if it deforms."""
        return self._frames._boxes(range(self._row, self._row + 1))[0]

    @property
    def mass(self) -> NDArray[np.float64]:
        """``[N]`` masses; infinite for fixed and driven bodies."""
        return self._of_all(self.file.mass)

    @property
    def radius(self) -> NDArray[np.float64]:
        """``[N]`` radii [length]."""
        return self._of_all(self.file.radius)

    @property
    def inertia(self) -> NDArray[np.float64] | None:
        """``[N]`` numbers q = I/(m R²) of the moments of inertia I; ``None`` if the scene has no spin."""
        return None if self.file.inertia is None else self._of_all(self.file.inertia)

    @property
    def species(self) -> NDArray[np.int64]:
        """``[N]`` species indices."""
        return self._of_all(self.file.species)

    def _of_all(self, values: Array) -> Array:
        """Those of the particles that are there, of values of all."""
        return values if self._frames._present is None else values[self.id]

    def spread(self, values: Array) -> Array:
        """Values of the particles of the frame, a row each, as those of all of the file: NaN, or 0 of integers, for
        particles that are not there."""
        if self._frames._present is None:
            return values
        found = np.full((len(self.file), *values.shape[1:]), np.nan if values.dtype.kind == "f" else 0, values.dtype)
        found[self.id] = values
        return found

    def to_freud(self) -> tuple[freud.box.Box, NDArray[np.float64]]:
        """The frame as a system of freud: its box, and ``[N, 3]`` positions in it [length]; z = 0 in 2D.

        ``freud.order.Steinhardt(6).compute(frame.to_freud(), {"num_neighbors": 12})``, and so all functions of freud
        that take a system. freud's box is centred at the origin, so positions are shifted. The box of a sheared frame
        leans. Where its gradient is an axis before that of the flow, both axes are exchanged, since freud's edge
        vectors are triangular: distances stay the same. freud computes in single precision.

        freud finds pairs in periodic boxes only. Along axes that are not, its box is twice as long as this one, or as
        what the particles take up along open ones, so that no pair is found across a face: neighbors are right, but
        densities by the volume of freud's box, such as those that its RDF divides by, are not.

        Raises :class:`MissingPackageError` without freud: ``pip install freud-analysis``.
        """
        return conversions.frame_system(self)

    def to_pandas(self, unwrapped: bool = False) -> pd.DataFrame:
        """The frame as a table of pandas, one row for each particle.

        Columns: ``id`` (row in the file), ``species`` (its name), positions ``x``, ``y``, ``z`` [length], velocities
        ``vx``, ``vy``, ``vz`` [length/time], ``image_x``, …, with spin ``angular_velocity_x``, … [1/time], ``radius``
        [length] and ``mass``. ``attrs`` has ``frame``, ``time`` and ``step``.

        ``unwrapped``: positions that do not jump at periodic faces. Raises :class:`ArgumentError` unless it is true or
        false.
        """
        return _table(self, arguments.flag("unwrapped", unwrapped))

    def _read(self, name: str) -> Array:
        return self._of_all(self._frames._values(name, range(self._row, self._row + 1))[0])

    def _repr_html_(self) -> str:
        """A table for notebooks; reads no vectors."""
        rows = [("time", f"{self.time:g}"), ("events so far", f"{self.step:,}"), ("particles", f"{len(self.mass):,}")]
        return table(f"Frame {self._row}", [("file", self.file.path), *rows, ("box", self.box)])

    def __repr__(self) -> str:
        return f"<Frame {self._row}: t = {self.time:g}, step = {self.step}, N = {len(self.mass)}>"


class Frames(ReadOnly, Sequence["Frame"]):
    """The trajectory: a lazy sequence of :class:`Frame`. Slices are sequences too."""

    def __init__(self, file: Header, rows: range | None = None) -> None:
        self._file = file
        stored, base = file.stored, "particles/all"
        if stored.find(f"{base}/position") is None:
            raise MissingDataError(f"{file.path}: no frames (output.frames = false in the scene)")
        self._time = stored.column(f"{base}/position/time", (None,), "f")
        self._step = stored.column(f"{base}/position/step", (None,), "iu")
        self._columns: dict[str, Column] = {}
        for name, kinds in _VECTORS.items():
            if name == "position" or stored.find(f"{base}/{name}") is not None:
                self._columns[name] = stored.column(f"{base}/{name}/value", (None, len(file), 3), kinds)
        self._present: Column | None = None
        if stored.find(f"{base}/present") is not None:
            self._present = stored.column(f"{base}/present/value", (None, len(file)), "iu")
        self._pistons: dict[str, Column] = {}
        if file.pistons:
            for name, place in _PISTONS.items():
                self._pistons[name] = stored.column(f"{base}/pistons/{place}/value", (None, len(file.pistons), 3), "f")
        self._edges: Column | None = None
        if file.shear is not None or file.compression is not None:
            shape = (None, 3) if file.shear is None else (None, 3, 3)
            self._edges = stored.column(f"{base}/box/edges/value", shape, "f")
        if rows is None:
            moving = [column for column in (self._edges, self._present) if column is not None]
            columns = (*moving, *self._columns.values(), *self._pistons.values())
            length = min(map(len, (self._time, self._step, *columns)))
            rows = range(complete(self._time, length))
        self._rows = rows
        self._made = True

    def __reduce__(self) -> tuple[Any, ...]:
        return Frames, (self._file, self._rows)

    @property
    def file(self) -> Header:
        """The file that the frames belong to."""
        return self._file

    def _presence(self, rows: range) -> NDArray[np.bool_]:
        """``[F, N]`` whether each particle is there in some frames."""
        if self._present is None:
            return np.ones((len(rows), len(self._file)), bool)
        values = _take(self._present, rows)
        self._present.require(values, values <= 1, "0 or 1", rows)
        return values.astype(bool)

    @property
    def present(self) -> NDArray[np.bool_]:
        """``[F, N]`` whether each particle is there: all are, unless there are inlets or outlets."""
        return self._presence(self._rows)

    def _values(self, name: str, rows: range) -> Array:
        """``[F, N, 3]`` of some frames, checked; NaN for particles that are not there."""
        if name not in self._columns:
            raise MissingDataError(f"{self._file.path}: no {name} in the frames")
        column, box = self._columns[name], self._file.box
        values = _take(column, rows)
        # Where there is nothing, any number is as good.
        absent = False if self._present is None else ~self._presence(rows)[:, :, None]
        if name != "image":
            column.require_finite(values if absent is False else np.where(absent, 0.0, values), rows)
            values = values if absent is False else np.where(absent, np.nan, values)
        if name == "position":
            size = box.size
            if self._edges is not None and self._file.shear is None:
                size = np.array([one.size for one in self._boxes(rows)]).reshape(-1, 1, 3)
            inside = (values >= -1e-9 * size) & (values <= (1 + 1e-9) * size)
            column.require(
                values, inside | ~box.periodic | absent, f"in the box, [0, L) along periodic axes of {box!r}", rows
            )
        return values

    def _of_pistons(self, name: str, rows: range) -> Array:
        """``[F, P, 3]`` of some frames, checked."""
        if name not in self._pistons:
            return np.zeros((len(rows), 0, 3))
        values = _take(self._pistons[name], rows)
        self._pistons[name].require_finite(values, rows)
        return values

    def _boxes(self, rows: range) -> list[Box]:
        """The boxes of some frames."""
        if self._edges is None:
            return [self._file.box] * len(rows)
        return self._file._boxes(self._edges, _take(self._edges, rows), rows)

    def boxes(self) -> list[Box]:
        """The box of each frame."""
        return self._boxes(self._rows)

    def _times(self, rows: range) -> Array:
        time = _take(self._time, rows)
        self._time.require_order(time[:: _sign(rows)], rows[:: _sign(rows)])
        return time

    def _steps(self, rows: range) -> Array:
        step = _take(self._step, rows)
        self._step.require(step, step >= 0, "0 or more", rows)
        self._step.require_order(step[:: _sign(rows)], rows[:: _sign(rows)])
        return step

    @property
    def time(self) -> NDArray[np.float64]:
        """``[F]`` times of the frames [time]."""
        return self._times(self._rows)

    @property
    def step(self) -> NDArray[np.int64]:
        """``[F]`` events before each frame."""
        return self._steps(self._rows)

    def array(self, name: str) -> Array:
        """All frames of one quantity at once, ``[F, N, 3]``; NaN for particles that are not there.

        ``name`` is ``"position"``, ``"velocity"``, ``"image"``, ``"unwrapped"`` or, if the scene has spin,
        ``"angular_velocity"``. ``"piston_position"`` and ``"piston_velocity"`` are ``[F, P, 3]``.
        """
        if isinstance(name, str) and name in _PISTONS:
            return self._of_pistons(name, self._rows)
        if isinstance(name, str) and name == "unwrapped":
            position, image = np.asarray(self.array("position"), float), self.array("image")
            if self._edges is None:
                return self._file.box.unwrap(position, image)
            for k, box in enumerate(self._boxes(self._rows)):
                position[k] = box.unwrap(position[k], image[k])
            return position
        return self._values(arguments.choice("name", name, (*_VECTORS, "unwrapped", *_PISTONS)), self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, key: int) -> Frame: ...
    @overload
    def __getitem__(self, key: slice) -> Frames: ...
    def __getitem__(self, key: int | slice) -> Frame | Frames:
        place = arguments.rows("frames", key, len(self), "the number of a frame or a slice")
        if isinstance(place, slice):
            return Frames(self._file, self._rows[place])
        return Frame(self, self._rows[place])

    def __iter__(self) -> Iterator[Frame]:
        return (Frame(self, row) for row in self._rows)

    def __repr__(self) -> str:
        if not self:
            return "<Frames: none>"
        return f"<Frames: {len(self)}, t = {self[0].time:g} … {self[-1].time:g}>"


def _sign(rows: range) -> int:
    return 1 if rows.step > 0 else -1


def _take(column: Column, rows: range) -> Array:
    # h5py accepts only increasing selections: read the span, then stride in memory.
    if not rows:
        return column[:0]
    low, high = min(rows[0], rows[-1]), max(rows[0], rows[-1])
    if rows.step > 0:
        return column[low : high + 1 : rows.step]
    return column[low : high + 1][np.array(rows) - low]


def _table(frame: Frame, unwrapped: bool) -> pd.DataFrame:
    """A frame as a table: see :meth:`haff.Frame.to_pandas`."""
    import pandas as pd

    names = frame.file.species_names
    columns: dict[str, Any] = {"id": frame.id}
    columns["species"] = pd.Categorical(np.asarray(names)[frame.species], categories=list(dict.fromkeys(names)))
    vectors = {"": frame.unwrapped if unwrapped else frame.position, "v": frame.velocity, "image_": frame.image}
    if frame.angular_velocity is not None:
        vectors["angular_velocity_"] = frame.angular_velocity
    for name, values in vectors.items():
        columns |= {f"{name}{axis}": values[:, k] for k, axis in enumerate(AXES)}
    table = pd.DataFrame(columns | {"radius": frame.radius, "mass": frame.mass})
    table.attrs = {"frame": frame.index, "time": frame.time, "step": frame.step}
    return table
