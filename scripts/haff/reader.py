"""Lazy reader of the HDF5 (H5MD 1.1) files that ``haff run`` writes.

Nothing is read before it is asked for. A file that is still growing, or whose run was killed, is read up to
the last frame, sample and event that is complete: where columns differ in length, the common length counts.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, overload

import h5py
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .errors import FileError, MissingDataError

if TYPE_CHECKING:
    import MDAnalysis
    import xarray

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib  # type: ignore[no-redef]

__all__ = ["Box", "Events", "File", "Frame", "Frames", "open"]

AXES = ("x", "y", "z")
Array = NDArray[Any]


def open(path: str | os.PathLike[str], *, locking: bool | None = None) -> File:
    """Open an output file for reading.

    Parameters
    ----------
    path
        The HDF5 file.
    locking
        ``False`` reads a file that a run is still writing, without HDF5's file lock: what has been flushed is
        sound, but do not expect the newest rows. Default: HDF5's own choice.

    Raises
    ------
    FileError
        The file is missing, unreadable, locked by a running simulation, not HDF5 or not of ``haff``.

    Examples
    --------
    >>> import haff
    >>> with haff.open("cooling.h5") as run:                          # doctest: +SKIP
    ...     run.observables.plot(x="time", y="temperature", loglog=True)
    ...     for frame in run.frames[::10]:
    ...         print(frame.time, frame.velocity.std(axis=0))
    """
    return File(path, locking=locking)


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


def _complete(time: h5py.Dataset, length: int) -> int:
    """Rows that are there: a flush cut short by a kill may leave rows without a time at the end."""
    while length > 0 and np.isnan(time[length - 1]):
        length -= 1
    return length


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
        return float(self._frames._group["position/time"][self._row])

    @cached_property
    def step(self) -> int:
        """Collisions and wall collisions so far."""
        return int(self._frames._group["position/step"][self._row])

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
        return self._frames._dataset(name)[self._row]

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
            rows = range(_complete(self._group["position/time"], length))
        self._rows = rows

    def _dataset(self, name: str) -> h5py.Dataset:
        return self._group[f"{name}/value"]

    def _take(self, dataset: h5py.Dataset) -> Array:
        # h5py wants increasing selections: read the span, then stride in memory.
        if not self._rows:
            return dataset[:0]
        low, high = min(self._rows[0], self._rows[-1]), max(self._rows[0], self._rows[-1])
        if self._rows.step > 0:
            return dataset[low : high + 1 : self._rows.step]
        return dataset[low : high + 1][np.array(self._rows) - low]

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


class Events:
    """The event log, one row per event, read column by column or piece by piece.

    ``len(events)``, ``events["energy_loss"]`` (NumPy), ``events[a:b]`` and ``events.chunks()`` (pandas) read
    only what they name. Vector columns become ``normal_x``, ``normal_y``, … in data frames. A scene may ask for
    some columns only (``output.events = { columns = […] }``); the others raise :class:`MissingDataError`.
    """

    def __init__(self, file: File) -> None:
        self._file = file
        group = file.hdf.get("events")
        if not isinstance(group, h5py.Group) or "time" not in group:
            raise MissingDataError(f"{file.path}: no event log (set output.events = true in the scene)")
        self._group = group
        self._columns = [n for n in _EVENT_COLUMNS if n in group]
        self._columns += [n for n in group if n not in self._columns and isinstance(group[n], h5py.Dataset)]
        length = min((group[n].shape[0] for n in self._columns), default=0)
        self._length = _complete(group["time"], length)

    @property
    def columns(self) -> list[str]:
        """Names of the recorded columns."""
        return list(self._columns)

    @cached_property
    def kinds(self) -> dict[int, str]:
        """Meaning of the codes of column ``kind``."""
        names = h5py.check_enum_dtype(self._group["kind"].dtype) if "kind" in self._group else None
        return {code: name for name, code in sorted((names or {}).items(), key=lambda item: item[1])}

    def __len__(self) -> int:
        return self._length

    @overload
    def __getitem__(self, key: str) -> Array: ...
    @overload
    def __getitem__(self, key: slice) -> pd.DataFrame: ...
    def __getitem__(self, key: str | slice) -> Array | pd.DataFrame:
        if isinstance(key, str):
            self._require(key)
            return self._group[key][: self._length]
        start, stop, step = key.indices(self._length)
        if step != 1:
            return self.to_pandas().iloc[key]
        return self._read(start, stop, self._columns)

    def to_pandas(self, columns: Sequence[str] | None = None) -> pd.DataFrame:
        """The whole log, or some columns of it, as a data frame; ``kind`` is a categorical."""
        return self._read(0, self._length, self._columns if columns is None else list(columns))

    def chunks(self, size: int = 1_000_000, columns: Sequence[str] | None = None) -> Iterator[pd.DataFrame]:
        """Data frames of up to ``size`` rows, in order: for logs larger than memory."""
        names = self._columns if columns is None else list(columns)
        for start in range(0, self._length, size):
            yield self._read(start, min(start + size, self._length), names)

    def _require(self, name: str) -> None:
        if name in self._columns:
            return
        found = ", ".join(self._columns)
        if name in _EVENT_COLUMNS:
            raise MissingDataError(
                f"{self._file.path}: the event log lacks {name!r}: the scene asked for {found} (output.events)"
            )
        raise KeyError(f"no event column {name!r}; there are {found}")

    def _read(self, start: int, stop: int, names: Sequence[str]) -> pd.DataFrame:
        columns: dict[str, Any] = {}
        stop = max(start, stop)
        for name in names:
            self._require(name)
            values = self._group[name][start:stop]
            if name == "kind" and self.kinds:
                position = {code: k for k, code in enumerate(self.kinds)}
                lookup = np.full(256, -1, np.int8)
                for code, k in position.items():
                    lookup[code] = k
                columns[name] = pd.Categorical.from_codes(lookup[values], categories=list(self.kinds.values()))
            elif values.ndim == 2:
                columns |= {f"{name}_{_component(c, values.shape[1])}": values[:, c] for c in range(values.shape[1])}
            else:
                columns[name] = values
        return pd.DataFrame(columns, index=pd.RangeIndex(start, stop, name="event"))

    def __repr__(self) -> str:
        return f"<Events: {self._length} rows, columns {', '.join(self._columns)}>"


_EVENT_COLUMNS = (
    "time", "kind", "i", "j", "approach_speed", "impulse", "energy_loss", "carnot_energy", "normal", "position",
)  # fmt: skip


def _component(c: int, width: int) -> str:
    return AXES[c] if width == 3 else str(c)


class File:
    """An output file of ``haff run``; see :func:`haff.open`.

    Use it as a context manager, or call :meth:`close`. The underlying :class:`h5py.File` is :attr:`hdf`.
    """

    def __init__(self, path: str | os.PathLike[str], *, locking: bool | None = None) -> None:
        self.path = Path(path)
        """Path of the file."""
        if not self.path.exists():
            raise FileError(f"{self.path}: no such file")
        if self.path.is_dir():
            raise FileError(f"{self.path}: is a directory, not an HDF5 file")
        try:
            self.hdf: h5py.File = h5py.File(self.path, "r", locking=locking)
            """The open :class:`h5py.File`."""
        except BlockingIOError:
            raise FileError(
                f"{self.path}: in use by a running simulation; wait for it, or haff.open(…, locking=False)"
            ) from None
        except PermissionError:
            raise FileError(f"{self.path}: permission denied") from None
        except OSError as error:
            reason = "not an HDF5 file" if not _is_hdf5(self.path) else f"damaged HDF5 file ({_first_line(error)})"
            raise FileError(f"{self.path}: {reason}") from None
        if "particles/all" not in self.hdf:
            self.hdf.close()
            raise FileError(f"{self.path}: HDF5, but not an output file of haff (no group particles/all)")

    # --- life ------------------------------------------------------------------------------------

    def close(self) -> None:
        """Close the file; arrays read before stay valid."""
        self.hdf.close()

    def __enter__(self) -> File:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __contains__(self, part: object) -> bool:
        """Whether the file holds ``"frames"``, ``"observables"`` or ``"events"``."""
        try:
            return part in ("frames", "observables", "events") and getattr(self, str(part)) is not None
        except MissingDataError:
            return False

    def __repr__(self) -> str:
        if not getattr(self, "hdf", None):
            return f"<haff.File {str(self.path)!r}, closed>"
        lines = [f"<haff.File {str(self.path)!r}: {self.title or 'untitled'}"]
        lines.append(f"  particles    {len(self):,} ({', '.join(self.species_names)})")
        lines.append(f"  box          {self.box!r}")
        for part in ("frames", "observables", "events"):
            if part not in self:
                lines.append(f"  {part:<12} not recorded")
            elif part == "observables":
                table = self.observables
                lines.append(f"  {part:<12} {len(table):,} samples of {', '.join(self._observable_names())}")
            else:
                lines.append(f"  {part:<12} {repr(getattr(self, part))[1:-1].split(': ', 1)[1]}")
        return "\n".join(lines) + ">"

    # --- what was simulated ----------------------------------------------------------------------

    def __len__(self) -> int:
        """Number of particles N."""
        return len(self.mass)

    def __bool__(self) -> bool:
        return True

    def _particles(self, name: str) -> Array:
        try:
            return self.hdf["particles/all"][name][()]
        except KeyError:
            raise FileError(f"{self.path}: particles/all/{name} is missing") from None

    @cached_property
    def mass(self) -> NDArray[np.float64]:
        """``[N]`` masses; infinite for fixed and driven bodies."""
        return self._particles("mass")

    @cached_property
    def radius(self) -> NDArray[np.float64]:
        """``[N]`` radii [length]."""
        return self._particles("radius")

    @cached_property
    def species(self) -> NDArray[np.int64]:
        """``[N]`` species indices into :attr:`species_names`."""
        return self._particles("species").astype(np.int64)

    @cached_property
    def species_names(self) -> list[str]:
        """Names by species index: species in scene order, then named particles."""
        stored = self._parameter("species_names")
        count = int(np.max(self.species, initial=-1)) + 1
        if stored is not None:
            names = [n.decode() if isinstance(n, bytes) else str(n) for n in np.atleast_1d(stored)]
        else:
            names = [s.get("name", "") for s in self.scene.get("species", [])]
            for particle in self.scene.get("particle", []):
                if (name := particle.get("name", "particle")) not in names:
                    names.append(name)
        names = [n or f"species {k}" for k, n in enumerate(names)]
        return names + [f"species {k}" for k in range(len(names), count)]

    @cached_property
    def box(self) -> Box:
        """The simulation box."""
        group = self.hdf["particles/all/box"]
        edges = group["edges"]
        if isinstance(edges, h5py.Group):
            value = edges["value"]
            stored = self._parameter("box_size") if value.shape[0] == 0 else value[0]
            size = np.full(3, np.nan) if stored is None else np.asarray(stored, float)
        else:
            size = np.asarray(edges[()], float)
        size = np.diag(size) if size.ndim == 2 else size
        # H5MD knows "periodic" and "none"; the scene tells walls from open sides.
        declared = list(self.scene.get("domain", {}).get("boundary", ()))
        boundary = []
        for axis, stored in enumerate(group.attrs.get("boundary", ())):
            name = stored.decode() if isinstance(stored, bytes) else str(stored)
            told = declared[axis] if axis < len(declared) else "open"
            boundary.append("periodic" if name == "periodic" else "wall" if told == "wall" else "open")
        boundary += ["open"] * (3 - len(boundary))
        return Box(size, boundary, self.dimension)

    @cached_property
    def dimension(self) -> int:
        """2 for disks in the plane z = 0, 3 for spheres."""
        stored = self._parameter("dimension")
        return int(self.scene.get("dimension", 3) if stored is None else stored)

    @cached_property
    def scene_text(self) -> str:
        """The resolved scene as TOML text; empty if the file has none."""
        return str(self._parameter("scene") or "")

    @cached_property
    def scene(self) -> dict[str, Any]:
        """The resolved scene, parsed."""
        try:
            return tomllib.loads(self.scene_text)
        except tomllib.TOMLDecodeError as error:
            raise FileError(f"{self.path}: the recorded scene is not valid TOML: {error}") from None

    @property
    def title(self) -> str:
        """Title of the scene."""
        return str(self.scene.get("title") or self._parameter("title") or "")

    def _parameter(self, name: str) -> Any:
        """``parameters/name``, dataset or attribute; ``None`` if it is neither."""
        group = self.hdf.get("parameters")
        if group is None:
            return None
        if name in group and isinstance(group[name], h5py.Dataset):
            value = group[name][()]
        elif name in group.attrs:
            value = group.attrs[name]
        else:
            return None
        return value.decode() if isinstance(value, bytes) else value

    @cached_property
    def parameters(self) -> dict[str, Any]:
        """Everything under ``parameters`` but the scene: seed, version, git revision, …"""
        group = self.hdf.get("parameters")
        if group is None:
            return {}
        names = [n for n in group if isinstance(group[n], h5py.Dataset)] + list(group.attrs)
        return {n: self._parameter(n) for n in names if n != "scene"}

    # --- what happened -----------------------------------------------------------------------------

    @property
    def frames(self) -> Frames:
        """The trajectory. Raises :class:`MissingDataError` if the scene recorded none."""
        return Frames(self)

    @property
    def events(self) -> Events:
        """The event log. Raises :class:`MissingDataError` if the scene recorded none."""
        return Events(self)

    def _observable_names(self) -> list[str]:
        group = self.hdf.get("observables")
        names = [] if group is None else [n for n in group if isinstance(group[n], h5py.Group) and "value" in group[n]]
        if not names:
            raise MissingDataError(f"{self.path}: no observables (output.observables = false in the scene)")
        return names

    def _observable_arrays(self) -> tuple[Array, Array, dict[str, Array]]:
        group = self.hdf["observables"] if "observables" in self.hdf else {}
        names = self._observable_names()
        length = min(group[n][part].shape[0] for n in names for part in ("value", "step", "time"))
        clock = group[names[0]]
        length = _complete(clock["time"], length)
        return clock["time"][:length], clock["step"][:length], {n: group[n]["value"][:length] for n in names}

    @cached_property
    def observables(self) -> pd.DataFrame:
        """The samples: columns ``time``, ``step`` and one per observable.

        Vectors are expanded (``momentum_x``, …), values per species are named after them
        (``species_temperature_grain``). Raises :class:`MissingDataError` if the scene recorded none.
        :meth:`to_xarray` keeps vectors whole.
        """
        time, step, arrays = self._observable_arrays()
        columns: dict[str, Array] = {"time": time, "step": step}
        for name, values in arrays.items():
            if values.ndim == 1:
                columns[name] = values
                continue
            labels = self._labels(name, values.shape[1])
            columns |= {f"{name}_{label}": values[:, k] for k, label in enumerate(labels)}
        return pd.DataFrame(columns)

    def _labels(self, name: str, width: int) -> list[str]:
        if name.startswith("species_") and width == len(self.species_names):
            return self.species_names
        return [_component(c, width) for c in range(width)]

    def to_xarray(self) -> xarray.Dataset:
        """The observables as a dataset with dimensions ``time``, ``axis`` and ``species``.

        Needs xarray: ``pip install haff[analysis]``.
        """
        import xarray

        time, step, arrays = self._observable_arrays()
        variables: dict[str, Any] = {"step": ("time", step)}
        coords: dict[str, Any] = {"time": time}
        for name, values in arrays.items():
            if values.ndim == 1:
                variables[name] = ("time", values)
                continue
            dim = "species" if name.startswith("species_") else "axis" if values.shape[1] == 3 else f"{name}_component"
            variables[name] = (("time", dim), values)
            coords[dim] = self._labels(name, values.shape[1])
        return xarray.Dataset(variables, coords, attrs={"title": self.title, "file": str(self.path)})

    def to_mdanalysis(self) -> MDAnalysis.Universe:
        """The trajectory as an MDAnalysis universe; needs ``pip install haff[analysis]``.

        Atoms carry ``masses``, ``radii``, ``types`` (species names) and ids. MDAnalysis must know nothing of
        units here: the file has none, so no conversion takes place.
        """
        import MDAnalysis

        universe = MDAnalysis.Universe.empty(len(self), trajectory=False, velocities=True)
        universe.load_new(str(self.path), format="H5MD", convert_units=False)
        universe.add_TopologyAttr("masses", np.where(np.isfinite(self.mass), self.mass, 0.0))
        universe.add_TopologyAttr("radii", self.radius)
        universe.add_TopologyAttr("types", [self.species_names[s] for s in self.species])
        universe.add_TopologyAttr("ids", np.arange(len(self)))
        return universe

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The run in a few numbers: what is there, how far it came, what the ledger says."""
        found: dict[str, Any] = {
            "title": self.title,
            "particles": len(self),
            "dimension": self.dimension,
            "packing_fraction": packing_fraction(self),
            "seed": int(self._parameter("seed") or 0),
        }
        for part in ("frames", "events"):
            found[part] = len(getattr(self, part)) if part in self else 0
        found["samples"] = 0
        if "observables" in self and len(self.observables):
            last = self.observables.iloc[-1]
            found["samples"] = len(self.observables)
            found["simulated_time"] = float(last["time"])
            for name in ("collisions", "wall_collisions"):
                if name in last:
                    found[name] = int(last[name])
            for name in ("temperature", "kinetic_energy", "potential_energy", "dissipated_energy"):
                if name in last:
                    found[name] = float(last[name])
            if "ledger_residual" in self.observables:
                found["ledger_residual"] = float(self.observables["ledger_residual"].abs().max())
        elif found["frames"]:
            found["simulated_time"] = self.frames[-1].time
        return found


def packing_fraction(file: File) -> float:
    """Volume (area) of the particles over that of the box; NaN with open axes, whose size is a placeholder."""
    if "open" in file.box.boundary[: file.dimension]:
        return float("nan")
    d, r = file.dimension, file.radius
    volume = np.sum(4 / 3 * np.pi * r**3) if d == 3 else np.sum(np.pi * r**2)
    return float(volume / file.box.volume)


def _is_hdf5(path: Path) -> bool:
    try:
        return bool(h5py.is_hdf5(path))
    except OSError:
        return False


def _first_line(error: BaseException) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
