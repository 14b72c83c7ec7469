"""What a file says of the whole run: its particles, its box and its scene."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from types import TracebackType
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ..common import arguments
from ..common.readonly import ReadOnly
from ..errors import FileError, HaffError
from ..text import brief, quoted
from .box import Box, Shear
from .column import LARGEST, SMALLEST, Column
from .container import Container, container_of
from .layout import AXES, SCHEMA, Array
from .scene import SceneFault, parsed
from .stored import Stored

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Header", "not_triangular", "packing_fraction"]


class Header(ReadOnly):
    """An open output file, with what holds for the whole run."""

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
        return type(self), (self.path.absolute(),)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

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
    def meshes(self) -> dict[str, NDArray[np.float64]]:
        """``[F, 3, 3]`` corners of the triangles of each mesh that the file has, by the ``mesh.hash`` of its walls.

        They are in the coordinates of the mesh's own file; the wall says where they are placed.
        """
        group, found = "parameters/meshes", {}
        for name in self.stored.members(group):
            column = self.stored.column(f"{group}/{name}", (None, 3, 3), "f")
            found[name] = column[:]
            column.require(found[name], np.abs(found[name]) <= LARGEST, f"in [-{LARGEST:g}, {LARGEST:g}]")
        return found

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
    def pistons(self) -> list[str]:
        """Names of the walls that are pistons, in the order of :attr:`Frame.piston_position`."""
        place = "parameters/pistons"
        if self.stored.find(place) is None:
            return []
        column = self.stored.column(place, (None,), "iu")
        if len(column) > len(self.wall_names):
            raise FileError(f"{self.path}: {place} has {len(column)} walls of {len(self.wall_names)}")
        rows = column[:]
        column.require(rows, rows < len(self.wall_names), f"in [0, {len(self.wall_names)})")
        return [self.wall_names[row] for row in rows]

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
    def flows(self) -> bool:
        """Whether particles come and go by inlets and outlets: frames then have those that are there."""
        return self.stored.find("particles/all/present") is not None

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
        return [self._box(np.diag(lengths), self.box.boundary, None) for lengths in edges]

    def _box(self, edges: Array, sides: Sequence[str], shear: Shear | None) -> Box:
        displacement = None
        if shear is not None:
            displacement = shear.gradient, shear.flow, float(edges[shear.gradient, shear.flow])
        return Box(np.diag(edges), sides, self.dimension, displacement, self._container(float(edges[0, 0])))

    def _container(self, edge: float) -> Container | None:
        """The container that shrinks with the box, where the first edge is this long [length]."""
        if self._whole is None:
            return None
        container, whole = self._whole
        return container.scaled(edge / whole)

    @cached_property
    def _whole(self) -> tuple[Container, float] | None:
        """The container at time 0, and the first edge of the box of the scene, which is that of time 0 [length]."""
        if (container := container_of(self.scene, self.dimension)) is None:
            return None
        return container, float(self.stored.column("parameters/box_size", (3,), "f")[:][0])

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


def packing_fraction(file: Header, box: Box | None = None) -> float:
    """Volume (area) of the particles over that of the box, or of the container that shrinks with it.

    NaN with open axes, whose size is a placeholder. ``box`` is that of a frame, where the box is compressed; by default
    that of the first frame.
    """
    box = file.box if box is None else box
    if "open" in box.boundary[: file.dimension]:
        return float("nan")
    d, r = file.dimension, file.radius
    volume = np.sum(4 / 3 * np.pi * r**3) if d == 3 else np.sum(np.pi * r**2)
    return float(volume / box.volume)


def not_triangular(file: Header) -> str | None:
    """Why programs whose box vectors are (a, 0, 0), (b, c, 0), (d, e, f) cannot hold a box; ``None`` if they can."""
    if file.shear is None or file.shear.flow < file.shear.gradient:
        return None
    flow, gradient = AXES[file.shear.flow], AXES[file.shear.gradient]
    return f"its {gradient} edge leans along {flow}; an edge can lean along axes before its own only"


_ROUNDING = 1e-9
"""Relative difference of lengths that is rounding."""


def _positive(values: Array) -> NDArray[np.bool_]:
    return (values >= SMALLEST) & (values <= LARGEST)
