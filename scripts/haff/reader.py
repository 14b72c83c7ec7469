"""Lazy reader of the HDF5 (H5MD 1.1) files that ``haff run`` writes.

Nothing is read before it is asked for. A file that is still growing, or whose run was killed, is read up to
the last frame, sample and event that is complete: where columns differ in length, the common length counts.
"""

from __future__ import annotations

import os
import re
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from . import observables
from .errors import FileError, MissingDataError
from .events import Events
from .frames import Box, Frames
from .layout import SCHEMA, Array

if TYPE_CHECKING:
    import MDAnalysis
    import xarray

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib  # type: ignore[no-redef]

__all__ = ["File", "open"]


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
            raise FileError(f"{self.path}: {_damage(self.path, error)}") from None
        if "particles/all" not in self.hdf:
            self.hdf.close()
            raise FileError(f"{self.path}: HDF5, but not an output file of haff (no group particles/all)")
        schema = int(self.hdf["parameters/schema"][()]) if "parameters/schema" in self.hdf else SCHEMA
        if schema != SCHEMA:
            self.hdf.close()
            raise FileError(f"{self.path}: has schema {schema}; this version of haff reads schema {SCHEMA}")

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
                lines.append(f"  {part:<12} {len(table):,} samples of {', '.join(observables.names(self))}")
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

    @cached_property
    def observables(self) -> pd.DataFrame:
        """The samples: columns ``time``, ``step`` and one per observable.

        Vectors are expanded (``momentum_x``, …), values per species are named after them
        (``species_temperature_grain``). Raises :class:`MissingDataError` if the scene recorded none.
        :meth:`to_xarray` keeps vectors whole.
        """
        return observables.table(self)

    def to_xarray(self) -> xarray.Dataset:
        """The observables as a dataset with dimensions ``time``, ``axis`` and ``species``.

        Needs xarray: ``pip install haff[analysis]``.
        """
        return observables.dataset(self)

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

    def export(self, output: str | os.PathLike[str] | None = None, **options: Any) -> Path:
        """Writes a file for other programs: GSD, extended XYZ, VTKHDF, CSV or Parquet; returns its path.

        ``options``: ``to``, ``frames``, ``table``, ``unwrapped`` and ``overwrite`` of :func:`haff.export.export`.

        Examples
        --------
        >>> run.export("gas.gsd", frames="::10")                        # doctest: +SKIP
        >>> run.export("events.parquet", table="events")                # doctest: +SKIP
        """
        from .export import export

        return export(self, output, **options)

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
            for name in (
                "temperature",
                "kinetic_energy",
                "potential_energy",
                "spring_energy",
                "dissipated_energy",
                "rest_energy",
            ):
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


def _damage(path: Path, error: OSError) -> str:
    """Why a file cannot be opened, in the user's words."""
    try:
        known = h5py.is_hdf5(path)
    except OSError:
        known = False
    if not known:
        return "not an HDF5 file"
    if cut := re.search(r"truncated file: eof = (\d+),.* stored_eof = (\d+)", str(error)):
        return f"truncated: {cut[1]} of its {cut[2]} bytes are there"
    return f"damaged HDF5 file ({_first_line(error)})"


def _first_line(error: BaseException) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
