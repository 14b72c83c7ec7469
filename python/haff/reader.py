"""Lazy reader of the HDF5 (H5MD 1.1) files that ``haff run`` writes.

Data are read on first use. A file that is still growing, or whose run was killed, is read up to
the last frame, sample and event that is complete: where columns differ in length, the common length counts.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .common import arguments
from .common.notebook import table
from .common.output import library
from .common.readonly import ReadOnly
from .errors import ArgumentError, FileError, HaffError, MissingDataError, NotApplicableError
from .files import measure, samples
from .files.column import LARGEST, SMALLEST, Column
from .files.conversions import Unwrapping
from .files.events import Events
from .files.frames import Box, Frames, Shear, not_triangular
from .files.layout import AXES, SCHEMA, Array
from .files.scene import SceneFault, packing_fraction, parsed
from .files.stored import Stored, reason
from .text import brief, escaped, quoted

if TYPE_CHECKING:
    import MDAnalysis
    import pandas as pd
    import xarray
    from matplotlib.figure import Figure

__all__ = ["File", "open"]


def open(path: str | os.PathLike[str], *, locking: bool | None = None) -> File:
    """Open an output file for reading.

    Parameters
    ----------
    path
        The HDF5 file.
    locking
        Whether to hold HDF5's file lock. Default: yes, unless a run is writing the file: then what has been flushed
        is read, and :attr:`File.running` is true.

    Raises
    ------
    FileError
        The file is missing, unreadable, not HDF5 or not of ``haff``. Later
        accesses raise it, too, if a dataset is damaged, has another type or shape than specified, declares
        more than the file can hold, is a link to another file, or holds a number that no run can have written.

    Examples
    --------
    >>> import haff
    >>> with haff.open("cooling.h5") as run:                          # doctest: +SKIP
    ...     run.observables.plot(x="time", y="temperature", loglog=True)
    ...     for frame in run.frames[::10]:
    ...         print(frame.time, frame.velocity.std(axis=0))
    """
    return File(path, locking=locking)


class File(ReadOnly):
    """An output file of ``haff run``; see :func:`haff.open`.

    Use it as a context manager, or call :meth:`close`. The underlying :class:`h5py.File` is :attr:`hdf`.
    """

    def __init__(self, path: str | os.PathLike[str], *, locking: bool | None = None) -> None:
        self.path = arguments.file("path", path)
        """Path of the file."""
        self.stored = Stored(self.path, None if locking is None else arguments.flag("locking", locking))
        try:
            if self.stored.find("particles/all") is None:
                raise FileError(f"{self.path}: HDF5, but not an output file of haff (no group particles/all)")
            schema = self.stored.integer("parameters/schema")
            if schema not in (None, SCHEMA):
                raise FileError(f"{self.path}: has schema {schema}; this version of haff reads schema {SCHEMA}")
        except HaffError:
            self.close()
            raise
        self._made = True

    # --- opening and closing ------------------------------------------------------------------------------------

    def close(self) -> None:
        """Close the file; arrays read before stay valid."""
        self.stored.close()

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes: a pickled file is opened again, by its path."""
        return open, (self.path.absolute(),)

    def __enter__(self) -> File:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __contains__(self, part: object) -> bool:
        """Whether the file holds ``"frames"``, ``"observables"``, ``"events"``, ``"profiles"``, ``"correlations"``."""
        if part in ("profiles", "correlations"):
            return bool(self.stored.members(str(part)))
        try:
            if part == "observables":
                return bool(samples.names(self))
            return part in ("frames", "events") and getattr(self, str(part)) is not None
        except MissingDataError:
            return False

    def __repr__(self) -> str:
        if not self.stored.hdf:
            return f"<haff.File {str(self.path)!r}, closed>"
        try:
            return self._described()
        except HaffError as error:
            return f"<haff.File {str(self.path)!r}, damaged: {error}>"

    def _repr_html_(self) -> str:
        """The same as a table, for notebooks."""
        if not getattr(self, "hdf", None):
            return table("haff.File", [("file", self.path), ("state", "closed")])
        try:
            return table(self.title or "untitled", [("file", self.path), *self._contents()])
        except HaffError as error:
            return table("haff.File", [("file", self.path), ("damaged", error)])

    def _described(self) -> str:
        lines = [f"<haff.File {str(self.path)!r}: {escaped(self.title) or 'untitled'}"]
        lines += [f"  {name:<12} {text}" for name, text in self._contents()]
        return "\n".join(lines) + ">"

    def _contents(self) -> list[tuple[str, str]]:
        """What the file holds, line by line; reads little of it."""
        found = [
            ("particles", f"{len(self):,} ({escaped(', '.join(self.species_names))})"),
            ("box", repr(self.box)),
        ]
        if self.shear is not None:
            flow, gradient, rate = self.shear
            found.append(("shear", f"flow along {AXES[flow]}, gradient along {AXES[gradient]}, rate {rate:g}"))
        if self.compression is not None:
            found.append(("compression", " × ".join(f"{rate:g}" for rate in self.compression[: self.dimension])))
        for part in ("frames", "observables", "events"):
            if part not in self:
                text = "not recorded"
            elif part == "observables":
                text = f"{samples.count(self):,} samples of {escaped(', '.join(samples.names(self)))}"
            else:
                text = repr(getattr(self, part))[1:-1].split(": ", 1)[1]
            found.append((part, text))
        for part in ("profiles", "correlations"):
            if part in self:
                found.append((part, escaped(", ".join(self.stored.members(part)))))
        return found

    @property
    def hdf(self) -> h5py.File:
        """The open :class:`h5py.File`. What is read through it is not checked."""
        return self.stored.hdf

    @property
    def running(self) -> bool:
        """Whether a run was writing the file when it was opened; what it writes later is not read."""
        return self.stored.running

    # --- what was simulated ----------------------------------------------------------------------

    def __len__(self) -> int:
        """Number of particles N."""
        return len(self._particles("mass", "f"))

    def __bool__(self) -> bool:
        return True

    def _particles(self, name: str, kinds: str) -> Column:
        return self.stored.column(f"particles/all/{name}", (None,), kinds)

    def _one_each(self, name: str, kinds: str) -> tuple[Column, Array]:
        column = self._particles(name, kinds)
        if not 0 < len(column) == len(self):
            raise self.stored.wrong(
                column.place, f"has {len(column)} rows; must have one for each of {len(self)} particles"
            )
        return column, column[:]

    @cached_property
    def mass(self) -> NDArray[np.float64]:
        """``[N]`` masses; infinite for fixed and driven bodies."""
        column, mass = self._one_each("mass", "f")
        column.require(mass, _positive(mass) | (mass == np.inf), f"in [{SMALLEST:g}, {LARGEST:g}] or infinite")
        return mass

    @cached_property
    def radius(self) -> NDArray[np.float64]:
        """``[N]`` radii [length]."""
        column, radius = self._one_each("radius", "f")
        column.require(radius, _positive(radius), f"in [{SMALLEST:g}, {LARGEST:g}]")
        return radius

    @cached_property
    def inertia(self) -> NDArray[np.float64] | None:
        """``[N]`` numbers q = I/(m R²) of the moments of inertia I; ``None`` if the scene has no spin.

        2/5 for homogeneous spheres, 1/2 for homogeneous disks.
        """
        if self.stored.find("particles/all/inertia") is None:
            return None
        column, inertia = self._one_each("inertia", "f")
        column.require(inertia, _positive(inertia), f"in [{SMALLEST:g}, {LARGEST:g}]")
        return inertia

    @cached_property
    def species(self) -> NDArray[np.int64]:
        """``[N]`` species indices into :attr:`species_names`."""
        column, species = self._one_each("species", "iu")
        most = max(len(self._recorded_names), len(self))
        column.require(species, (species >= 0) & (species < most), f"in [0, {most})")
        return species.astype(np.int64)

    @cached_property
    def conserved_momentum(self) -> NDArray[np.bool_]:
        """``[3]``, true for axes on which momentum is conserved.

        There temperatures and pressures are relative to the velocity of the center of mass
        (:attr:`Frame.thermal_velocity`). All are true in a file that does not say so, as those of other programs.
        """
        place = "parameters/conserved_momentum"
        if self.stored.find(place) is None:
            return np.full(3, True)
        column = self.stored.column(place, (3,), "iu")
        conserved = column[:]
        if conserved.shape != (3,):
            raise FileError(f"{self.path}: {place} has {conserved.size} numbers; there must be 3")
        column.require(conserved, (conserved == 0) | (conserved == 1), "0 or 1")
        return conserved == 1

    @cached_property
    def wall_names(self) -> list[str]:
        """Names of the walls, by the index that event rows use."""
        return self.stored.texts("parameters/wall_names") or []

    @cached_property
    def species_names(self) -> list[str]:
        """Names by species index: species in scene order, then named particles."""
        count = int(np.max(self.species, initial=-1)) + 1
        names = [n or f"species {k}" for k, n in enumerate(self._recorded_names)]
        return names + [f"species {k}" for k in range(len(names), count)]

    @cached_property
    def _recorded_names(self) -> list[str]:
        stored = self.stored.texts("parameters/species_names")
        if stored is not None:
            return stored
        names = [s.get("name", "") for s in self.scene.get("species", [])]
        for particle in self.scene.get("particle", []):
            if (name := particle.get("name", "particle")) not in names:
                names.append(name)
        return names

    @cached_property
    def box(self) -> Box:
        """The simulation box.

        Where it is sheared or compressed that of the first frame: each frame has its own :attr:`Frame.box`.
        """
        place, shear = "particles/all/box", self.shear
        stored = self.stored.listed(f"{place}@boundary", self.stored.attribute(place, "boundary")) or []
        if len(stored) > 3 or not set(stored) <= {"periodic", "none"}:
            raise self.stored.wrong(f"{place}@boundary", f"is {brief(stored)}; must be up to 3 of periodic, none")
        # H5MD has only "periodic" and "none"; the scene distinguishes walls from open sides.
        declared = self.scene.get("domain", {}).get("boundary", [])
        sides = [*declared, "open", "open", "open"]
        boundary = [
            "periodic" if name == "periodic" else "wall" if sides[axis] == "wall" else "open"
            for axis, name in enumerate(stored)
        ]
        sides = [*boundary, "open", "open", "open"][:3]
        if shear is not None and set(sides[: self.dimension]) != {"periodic"}:
            raise self.stored.wrong(
                f"{place}@boundary", f"is {brief(stored)}; must be periodic along all axes of a sheared box"
            )
        return self._box(self._edges(), sides, shear)

    def _edges(self) -> Array:
        """``[3, 3]`` edge vectors of the box: of the first frame, or those of the scene if there is none."""
        place, moving = "particles/all/box/edges", 0
        if self.stored.is_group(place):
            place, moving = f"{place}/value", 1
        rank = self.stored.rank(place) - moving
        edges = self.stored.column(place, (None,) * moving + (3,) * min(max(rank, 1), 2), "f")
        if moving and self.shear is not None and rank != 2:
            raise self.stored.wrong(place, "has edge lengths; a sheared box needs edge vectors, shape (any, 3, 3)")
        if len(edges) == 0:
            edges, moving = self.stored.column("parameters/box_size", (3,), "f"), 0
        found = edges[:1] if moving else edges[:]
        if found.shape[moving:] == (3,):
            edges.require(found, _positive(found), f"in [{SMALLEST:g}, {LARGEST:g}]")
            return np.diag(found[0] if moving else found)
        self._require_edges(edges, found if moving else found[None], range(1) if moving else None)
        return found[0] if moving else found

    def _require_edges(self, column: Column, edges: Array, rows: range | None) -> None:
        """Checks edge vectors, ``[F, 3, 3]``; ``rows`` are those of the file, ``None`` for one box of all frames."""

        def require(sound: Array, must: str) -> None:
            if rows is None:
                column.require(edges[0], sound[0], must)
            else:
                column.require(edges, sound, must, rows)

        diagonal, shear = np.eye(3, dtype=bool), self.shear
        require(_positive(edges) | ~diagonal, f"in [{SMALLEST:g}, {LARGEST:g}]")
        tilted = np.zeros((3, 3), bool)
        if shear is None:
            must = "0: a box without domain.shear in the scene is rectangular"
        else:
            tilted[shear.gradient, shear.flow] = True
            must = f"0: only the {AXES[shear.gradient]} edge is displaced, along {AXES[shear.flow]}"
        require((edges == 0) | diagonal | tilted, must)
        if shear is not None:
            most = 0.5 * (1 + _ROUNDING) * edges[:, shear.flow, shear.flow][:, None, None]
            require((np.abs(edges) <= most) | ~tilted, "at most half of the edge along the flow in size")

    def _sheared_boxes(self, column: Column, edges: Array, rows: range) -> list[Box]:
        """Boxes of frames of a sheared run from their edge vectors ``[F, 3, 3]``, checked."""
        self._require_edges(column, edges, rows)
        same = np.abs(edges - np.diag(self.box.size)) <= _ROUNDING * self.box.size
        must = f"that of the first frame, {' × '.join(f'{size:g}' for size in self.box.size)}"
        column.require(edges, same | ~np.eye(3, dtype=bool), must, rows)
        return [self._box(one, self.box.boundary, self.shear) for one in edges]

    def _boxes(self, column: Column, edges: Array, rows: range) -> list[Box]:
        """Boxes of frames from their edge vectors ``[F, 3, 3]``, or from edge lengths ``[F, 3]``, checked."""
        if self.shear is not None:
            return self._sheared_boxes(column, edges, rows)
        column.require(edges, _positive(edges), f"in [{SMALLEST:g}, {LARGEST:g}]", rows)
        return [Box(lengths, self.box.boundary, self.dimension) for lengths in edges]

    def _box(self, edges: Array, sides: Sequence[str], shear: Shear | None) -> Box:
        displacement = None
        if shear is not None:
            displacement = shear.gradient, shear.flow, float(edges[shear.gradient, shear.flow])
        return Box(np.diag(edges), sides, self.dimension, displacement)

    @cached_property
    def shear(self) -> Shear | None:
        """Simple shear of the box (``domain.shear`` of the scene); ``None`` if there is none."""
        given = self.scene.get("domain", {}).get("shear")
        if given is None:
            return None
        known = AXES[: self.dimension]
        for key in ("flow", "gradient"):
            if given[key] not in known:
                allowed = "x or y" if self.dimension == 2 else "x, y or z"
                raise self.stored.wrong(
                    "parameters/scene", f"domain.shear.{key} = {quoted(given[key])}: must be {allowed}"
                )
        flow, gradient = known.index(given["flow"]), known.index(given["gradient"])
        if flow == gradient:
            raise self.stored.wrong(
                "parameters/scene",
                f"domain.shear.gradient = {quoted(given['gradient'])}: must be another axis than the flow",
            )
        return Shear(flow, gradient, float(given["rate"]))

    @cached_property
    def compression(self) -> Array | None:
        """``[3]`` γ of each axis [1/time]: the edges are L (1 − γ t); ``None`` if the box keeps its size.

        It is ``domain.compression`` of the scene, or follows from its ``growth``.
        """
        growth, given = self.scene.get("growth"), self.scene.get("domain", {}).get("compression", {})
        rates = np.zeros(3)
        if growth is not None:
            rates[: self.dimension] = float(growth["rate"]) / (2 * float(self.radius.max(initial=SMALLEST)))
        elif "rates" in given and len(given["rates"]) < self.dimension:
            fault = f"domain.compression.rates = {quoted(given['rates'])}: must be {self.dimension} numbers"
            raise self.stored.wrong("parameters/scene", fault)
        elif "rates" in given:
            rates[: self.dimension] = given["rates"][: self.dimension]
        else:
            rates[: self.dimension] = float(given.get("rate", 0.0))
        return rates if rates.any() else None

    @cached_property
    def dimension(self) -> int:
        """2 for disks in the plane z = 0, 3 for spheres."""
        stored = self.stored.integer("parameters/dimension")
        if stored not in (None, 2, 3):
            raise self.stored.wrong("parameters/dimension", f"is {stored}; must be 2 or 3")
        return self.scene.get("dimension", 3) if stored is None else stored

    @cached_property
    def scene_text(self) -> str:
        """The resolved scene as TOML text; empty if the file has none."""
        return self.stored.text("parameters/scene") or ""

    @cached_property
    def scene(self) -> dict[str, Any]:
        """The resolved scene, parsed."""
        try:
            return parsed(self.scene_text)
        except SceneFault as fault:
            raise self.stored.wrong("parameters/scene", str(fault)) from None

    @property
    def title(self) -> str:
        """Title of the scene."""
        return self.scene.get("title") or self.stored.text("parameters/title") or ""

    @cached_property
    def parameters(self) -> dict[str, Any]:
        """Everything under ``parameters`` but the scene: seed, version, git revision, …"""
        names = [n for n in self.stored.members("parameters") if not self.stored.is_group(f"parameters/{n}")]
        names += [n for n in self.stored.attributes("parameters") if n not in names]
        return {n: self.stored.value(f"parameters/{n}") for n in names if n != "scene"}

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
        :attr:`samples` has the same as arrays, :meth:`to_xarray` keeps vectors whole.
        """
        return samples.table(self)

    @cached_property
    def samples(self) -> dict[str, Array]:
        """The samples as arrays ``[S]`` by name, those of :attr:`observables`; needs no pandas."""
        return samples.by_name(self)

    def to_xarray(self) -> xarray.Dataset:
        """The observables as a dataset with dimensions ``time``, ``axis`` and ``species``."""
        return samples.dataset(self)

    @cached_property
    def profiles(self) -> dict[str, xarray.Dataset]:
        """The profiles of ``measure.profiles``, by the letters of their axes: ``run.profiles["z"]``.

        Each is a dataset with the dimensions ``time`` and the axes: number density ``density``, ``mass_density``,
        ``velocity`` (``component``), ``temperature`` and ``pressure`` (``row``, ``column``); every array has its unit
        in ``attrs["units"]``. A row is the mean over the interval that ends at its time; a cell without particles has
        no velocity and no temperature, NaN. Raises :class:`MissingDataError` if the scene measured none.
        """
        return measure.profiles(self)

    @cached_property
    def correlations(self) -> dict[str, xarray.Dataset]:
        """The correlations in time of ``[measure]``: ``"msd"``, ``"vacf"``, ``"stress"`` and ``"helfand"``.

        Each is a dataset with the dimension ``lag`` [time]: ``value``, its standard ``error`` (NaN for less than eight
        pairs of states) and ``count``, the number of pairs. Raises :class:`MissingDataError` if the scene measured
        none. :func:`haff.analysis.self_diffusion` and :func:`haff.analysis.shear_viscosity` take coefficients of
        transport from them.
        """
        return measure.correlations(self)

    def to_mdanalysis(self, unwrapped: bool = False) -> MDAnalysis.Universe:
        """The trajectory as an MDAnalysis universe; needs ``pip install haff[analysis]``.

        Positions are those in the box, which jump at periodic faces; with ``unwrapped`` they are position + Σ image ·
        edge vector, which do not: displacements, and analyses such as ``MDAnalysis.analysis.msd``, need them.
        MDAnalysis has positions in single precision.

        Atoms carry ``masses``, ``radii``, ``types`` (species names) and ids. The file has no
        units, so MDAnalysis converts nothing. A sheared box has the dimensions and angles of each frame, in single
        precision. Raises :class:`NotApplicableError` if MDAnalysis cannot hold that box: its first edge is along x, and
        its second one in the plane of x and y, so that the gradient must not be an axis before that of the flow.
        :class:`ArgumentError`: ``unwrapped`` is neither true nor false; :class:`MissingDataError`: there are no images.
        """
        arguments.flag("unwrapped", unwrapped)
        mdanalysis = library("MDAnalysis", "analysis")
        # MDAnalysis reads the file by itself: the datasets that it reads are checked before.
        positions, names = self.frames, [self.species_names[s] for s in self.species]
        if len(positions) == 0:
            raise NotApplicableError(f"{self.path}: no complete frame yet")
        if fault := not_triangular(self):
            raise NotApplicableError(f"{self.path}: MDAnalysis cannot hold the box: {fault}")
        if self.shear is not None:
            positions._boxes(range(len(positions)))
        if unwrapped:
            positions[:1].array("unwrapped")
        if self.stored.find("observables") is not None:
            samples.columns(self)
        self.stored.require_attributes("h5md", "particles")
        universe = mdanalysis.Universe.empty(len(self), trajectory=False, velocities=True)
        try:
            universe.load_new(str(self.path), format="H5MD", convert_units=False)
        except Exception as error:
            raise FileError(f"{self.path}: MDAnalysis cannot read it: {reason(error)}") from error
        if unwrapped:
            universe.trajectory.add_transformations(Unwrapping(self.path, File))
        universe.add_TopologyAttr("masses", np.where(np.isfinite(self.mass), self.mass, 0.0))
        universe.add_TopologyAttr("radii", self.radius)
        universe.add_TopologyAttr("types", names)
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

    def plot(
        self, kind: str, output: str | os.PathLike[str] | None = None, *, overwrite: bool = False, **options: Any
    ) -> Figure:
        """Draws one standard figure, which notebooks show; writes it if ``output`` is given. See :func:`haff.plot`.

        Examples
        --------
        >>> run.plot("temperature")                                     # doctest: +SKIP
        >>> run.plot("snapshot", "first.pdf", index=0)                  # doctest: +SKIP
        """
        from .figures import plot

        return plot(self, kind, output, overwrite=overwrite, **options)

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Summary of the run: contents of the file, simulated time, ledger."""
        found: dict[str, Any] = {
            "title": self.title,
            "particles": len(self),
            "dimension": self.dimension,
            "packing_fraction": packing_fraction(self),
            "seed": self.stored.integer("parameters/seed") or 0,
        }
        for part in ("frames", "events"):
            found[part] = len(getattr(self, part)) if part in self else 0
        found["samples"] = len(self.samples["time"]) if "observables" in self else 0
        if found["samples"]:
            last = {name: values[-1] for name, values in self.samples.items()}
            found["simulated_time"] = float(last["time"])
            for name in ("collisions", "wall_collisions"):
                if name in last:
                    found[name] = int(last[name])
            for name in ("temperature", "rotational_temperature", *samples.ENERGIES, *samples.balance(self)):
                if name in last:
                    found[name] = float(last[name])
            if "ledger_residual" in self.samples:
                found["ledger_residual"] = _largest(self.samples["ledger_residual"])
        elif found["frames"]:
            found["simulated_time"] = self.frames[-1].time
        return found


def source_of(source: object) -> File | Path:
    """The argument ``source`` of a function that takes an open file, or a path. Raises :class:`ArgumentError`."""
    if isinstance(source, File):
        return source
    if not isinstance(source, (str, bytes, os.PathLike)):
        raise ArgumentError(f"source = {quoted(source)}: must be an open haff.File, or the path of one")
    return arguments.file("source", source)


_ROUNDING = 1e-9
"""Relative difference of lengths that is rounding."""


def _largest(values: Array) -> float:
    """Largest size of the numbers among ``values``; NaN if there is none."""
    known = np.abs(values[~np.isnan(values)])
    return float(known.max()) if len(known) else float("nan")


def _positive(values: Array) -> NDArray[np.bool_]:
    return (values >= SMALLEST) & (values <= LARGEST)
