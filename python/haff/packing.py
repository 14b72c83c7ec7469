"""Packings: :class:`haff.Packing`, the end of a run whose particles have grown, or of any dense run.

Its contacts and rattlers are those of :mod:`haff.analysis`; :func:`haff.pack` makes packings.
"""

from __future__ import annotations

import copy
import json
import os
import shutil
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import analysis, reader
from .analysis import BondOrder, ContactNetwork, JammingFit, PairDistributions, RadialPorosity
from .common import arguments
from .common.notebook import table
from .common.output import replacing
from .common.readonly import ReadOnly
from .common.temporary import TemporaryFolder
from .errors import ArgumentError, MissingDataError, NotApplicableError
from .files.box import Box
from .files.frames import Frame
from .files.header import packing_fraction
from .scenes.keywords import dotted
from .text import quoted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Packing", "open_packing"]

REACH = 5.0
"""Default of the largest distance of g(r) [mean diameters]."""
JAMMED = 1e6
"""Reduced pressure from which on a packing counts as jammed: its gaps are a millionth of its particles."""


def open_packing(path: str | os.PathLike[str]) -> Packing:
    """The last frame of an output file as a packing.

    Raises
    ------
    FileError
        As :func:`haff.open`.
    NotApplicableError, MissingDataError
        The file has no complete frame.

    Examples
    --------
    >>> import haff
    >>> packing = haff.open_packing("packing.h5")                       # doctest: +SKIP
    >>> packing.packing_fraction, packing.contact_number                # doctest: +SKIP
    """
    return Packing(reader.open(path))


class Packing(ReadOnly):
    """A packing: the last frame of a file; see :func:`haff.pack` and :func:`haff.open_packing`.

    It holds the file open: use it as a context manager, or call :meth:`close`. A temporary file is removed with the
    packing, or when Python ends; :meth:`save` keeps a copy.
    """

    _why = "cannot be changed: a packing is what its file has"

    def __init__(self, file: reader.File, folder: TemporaryFolder | None = None) -> None:
        if not isinstance(file, reader.File):
            raise ArgumentError(f"file = {quoted(file)}: must be an open file, as haff.open returns it")
        if len(file.frames) == 0:
            raise NotApplicableError(f"{file.path}: no complete frame")
        self.file = file
        """The file of the run that made it, open; its samples and frames show how it grew."""
        # The folder lasts as long as the file is used.
        vars(file)["folder"] = folder
        self._made = True

    # --- what it is ---------------------------------------------------------------------------------------------

    @property
    def path(self) -> Path:
        """Path of the file."""
        return self.file.path

    @cached_property
    def frame(self) -> Frame:
        """The last frame, with velocities and the rest."""
        return self.file.frames[-1]

    @property
    def positions(self) -> NDArray[np.float64]:
        """``[N, 3]`` centers [length], within [0, L) along periodic axes; z = 0 in two dimensions."""
        return self.frame.position

    @property
    def radii(self) -> NDArray[np.float64]:
        """``[N]`` radii [length]."""
        return self.frame.radius

    @property
    def box(self) -> Box:
        """The box: edges [length], and which axes are periodic or between walls."""
        return self.frame.box

    @property
    def dimension(self) -> int:
        """2 for disks, 3 for spheres."""
        return self.file.dimension

    @property
    def packing_fraction(self) -> float:
        """Volume of the particles over that of the box or of the container in it, in two dimensions areas."""
        return packing_fraction(self.file, self.box)

    @cached_property
    def reduced_pressure(self) -> float:
        """p = P V/(N T) at the end, as :func:`haff.analysis.reduced_pressure`, which says what is raised."""
        return analysis.reduced_pressure(self.frame)

    @property
    def seed(self) -> int:
        """Seed of all random numbers."""
        return self.file.stored.integer("parameters/seed") or 0

    @cached_property
    def _summary(self) -> dict[str, Any]:
        try:
            found = json.loads(self.file.stored.text("parameters/summary") or "{}")
        except ValueError:
            found = {}
        return found if isinstance(found, dict) else {}

    @property
    def status(self) -> str:
        """Why the run ended: ``"packing_fraction"``, ``"reduced_pressure"``, ``"jammed"``, ``"until"``, …

        ``"jammed"`` is also a growth that has ended at a reduced pressure of 10⁶ or more. ``"unfinished"`` if it has
        not ended yet, or was killed.
        """
        stopped = self._summary.get("stopped")
        wanted = self.file.scene.get("growth", {}).get("until_reduced_pressure", 0.0)
        if stopped == "reduced_pressure" and wanted >= JAMMED:
            return "jammed"
        return stopped if isinstance(stopped, str) else "unfinished"

    @property
    def collisions(self) -> int:
        """Collisions between particles in the run."""
        if isinstance(found := self._summary.get("collisions"), int):
            return found
        if "observables" in self.file and len(found := self.file.samples.get("collisions", ())):
            return int(found[-1])
        raise MissingDataError(f"{self.path}: does not say how many collisions there were")

    # --- contacts -----------------------------------------------------------------------------------------------

    @cached_property
    def network(self) -> ContactNetwork:
        """Contacts, rattlers and numbers of contacts; which gaps are contacts follows from the reduced pressure.

        :func:`haff.analysis.contact_tolerance` is the rule. Raises what :attr:`reduced_pressure` does.
        """
        return self.contact_network()

    def contact_network(self, tolerance: float | None = None) -> ContactNetwork:
        """The same with another largest gap of contacts [contact distances].

        See :func:`haff.analysis.contact_network`. A tolerance needs no pressure.
        """
        pressure = self.reduced_pressure if tolerance is None else None
        return analysis.contact_network(
            self.positions, self.radii, self.box, reduced_pressure=pressure, tolerance=tolerance
        )

    @property
    def contacts(self) -> NDArray[np.int64]:
        """``[K, 2]`` rows of the particles in contact, those of rattlers too; :attr:`network` has gaps and walls."""
        return self.network.contacts.pairs

    @property
    def rattlers(self) -> NDArray[np.bool_]:
        """``[N]`` true for particles with fewer than d + 1 contacts, taken out in turn."""
        return self.network.rattlers

    @property
    def contact_number(self) -> float:
        """Z, the mean number of contacts of the particles that are no rattlers; isostatic: 2d, see :attr:`network`."""
        return self.network.contact_number

    # --- structure ----------------------------------------------------------------------------------------------

    def bond_order(self, neighbors: int | None = None) -> BondOrder:
        """q₆ and ŵ₆ of spheres, ψ₆ of disks; see :func:`haff.analysis.bond_order`."""
        return analysis.bond_order(self.positions, self.radii, self.box, neighbors=neighbors)

    def g_r(self, r_max: float | None = None, bins: int = 500) -> PairDistributions:
        """g(r) of all particles and of each pair of species; see :func:`haff.analysis.pair_distributions`.

        ``r_max`` [length] is five mean diameters by default, or half of a narrower box.
        """
        if r_max is None:
            widths = self.box.widths[: self.dimension]
            r_max = min(2 * REACH * float(self.radii.mean()), float(widths.min()) / 2 * (1 - 1e-9))
        return analysis.pair_distributions([self.frame], r_max, bins)

    def radial_porosity(self, bins: int = 100) -> RadialPorosity:
        """The local porosity by the distance from the wall of a cylinder, a sphere or a circle.

        See :func:`haff.analysis.radial_porosity`, which says what is raised.
        """
        return analysis.radial_porosity(self.positions, self.radii, self.box, bins)

    def jamming_fraction(self) -> JammingFit:
        """φ_J by the divergence of the pressure in the run; see :func:`haff.analysis.jamming_fraction`.

        Pressures are those of :func:`haff.analysis.reduced_pressures`, means over intervals, so φ is that of the
        middle of the interval. Raises :class:`MissingDataError` if the file has no samples of ``pressure``,
        ``temperature`` and ``packing_fraction``.
        """
        found = analysis.reduced_pressures(self.file)
        if "packing_fraction" not in self.file.samples:
            raise MissingDataError(f"{self.path}: no samples of packing_fraction")
        return analysis.jamming_fraction(found.packing_fraction, found.value, self.dimension)

    # --- files, figures, scenes ---------------------------------------------------------------------------------

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Copy the file, such as a temporary one, and return the path of the copy.

        Raises :class:`ArgumentError` if ``path`` exists and ``overwrite`` is false, :class:`FileError` if it cannot be
        written.
        """
        path = arguments.file("path", path)
        arguments.flag("overwrite", overwrite)
        with replacing(path, source=self.path, overwrite=overwrite) as part:
            shutil.copyfile(self.path, part)
        return path

    def export(self, output: str | os.PathLike[str] | None = None, **options: Any) -> Path:
        """Writes the packing for other programs: GSD, extended XYZ, VTKHDF, CSV or Parquet; returns its path.

        ``options`` are those of :meth:`haff.File.export`. ``frames=None`` writes all frames of the growth.

        Examples
        --------
        >>> packing.export("packing.gsd")                               # doctest: +SKIP
        """
        if options.setdefault("table", "frames") == "frames":
            options.setdefault("frames", -1)
        return self.file.export(output, **options)

    def plot(
        self,
        output: str | os.PathLike[str] | None = None,
        *,
        overwrite: bool = False,
        title: bool = True,
        tolerance: float | None = None,
    ) -> Figure:
        """Draws contacts as lines, and rattlers in another color; in three dimensions those of a layer.

        Parameters
        ----------
        output
            The picture to write, ``.png``, ``.pdf`` or ``.svg``; by default none.
        overwrite
            Whether an existing picture is replaced.
        title
            Whether the figure has its title.
        tolerance
            As for :meth:`contact_network`.
        """
        return self.file.plot("contacts", output, overwrite=overwrite, title=title, tolerance=tolerance)

    def scene(self, **overrides: Any) -> dict[str, Any]:
        """A scene that starts from the packing, for :func:`haff.run` and :func:`haff.save_scene`.

        Its box is that of the packing, its species those of the run; velocities are drawn for temperature 1 and
        contacts are elastic. It ends at t = 10, with ``growth`` at the end of that, unless ``run`` says when. It reads
        the file when it runs: :meth:`save` a temporary one before, or keep the packing.

        Parameters
        ----------
        overrides
            Keys of the scene, two underscores for the dot: ``contact__restitution=0.9, run__until=50``.

        Raises
        ------
        NotApplicableError
            The file has no scene with species, as one of another program.
        ArgumentError
            The scene has no place for a key.
        """
        recorded, d = self.file.scene, self.dimension
        species = copy.deepcopy(recorded.get("species", []))
        if sum(kind.get("count", 0) for kind in species) != len(self.radii):
            raise NotApplicableError(f"{self.path}: its scene does not have all particles in [[species]]")
        scene: dict[str, Any] = {
            "schema": 1,
            "title": f"From {self.path.name}",
            "seed": self.seed,
            "dimension": d,
            "domain": {"size": self.box.size[:d].tolist(), "boundary": list(self.box.boundary[:d])},
            "species": species,
            "initial": {"positions": {"file": str(self.path.absolute())}, "temperature": 1.0},
            "run": {"until": 10.0},
        }
        if (container := self.box.container) is not None:
            scene["wall"] = [copy.deepcopy(container.wall)]
        changes = dotted(overrides)
        if any(key.partition(".")[0] == "growth" for key in changes):
            del scene["run"]
        for key, value in changes.items():
            _put(scene, key, value)
        return scene

    # --- opening and closing ------------------------------------------------------------------------------------

    def close(self) -> None:
        """Close the file; arrays read before stay valid."""
        self.file.close()

    def __enter__(self) -> Packing:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __len__(self) -> int:
        """Number of particles N."""
        return len(self.radii)

    def __bool__(self) -> bool:
        return True

    def _rows(self) -> list[tuple[str, object]]:
        rows: list[tuple[str, object]] = [
            ("particles", f"{len(self):,} ({', '.join(self.file.species_names)})"),
            ("box", self.box),
            ("packing fraction", f"{self.packing_fraction:.8g}"),
        ]
        try:
            p, network = self.reduced_pressure, self.network
            rows += [
                ("reduced pressure", f"{p:.4g}"),
                ("contact number", f"{network.contact_number:.4g} (isostatic {network.isostatic_number:.4g})"),
                ("rattlers", int(network.rattlers.sum())),
            ]
        except (NotApplicableError, MissingDataError):
            rows.append(("reduced pressure", "unknown"))
        return [*rows, ("stopped by", self.status)]

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        if not self.file.stored.hdf:
            return table("haff.Packing", [("file", self.path), ("state", "closed")])
        return table("Packing", [("file", self.path), *self._rows()])

    def __repr__(self) -> str:
        if not self.file.stored.hdf:
            return f"<haff.Packing {str(self.path)!r}, closed>"
        kind = "disks" if self.dimension == 2 else "spheres"
        return f"<haff.Packing {str(self.path)!r}: {len(self):,} {kind}, packing fraction {self.packing_fraction:.6g}>"


def _put(scene: dict[str, Any], key: str, value: Any) -> None:
    """Sets a dotted key of a scene; an entry of an array of tables has its number or its name in the key."""
    *path, last = key.split(".")
    node: Any = scene
    try:
        for part in path:
            node = node[_entry(node, part)] if isinstance(node, list) else node.setdefault(part, {})
        node[int(last) if isinstance(node, list) else last] = value
    except (AttributeError, IndexError, TypeError, ValueError):
        raise ArgumentError(f"{key.replace('.', '__')} = {quoted(value)}: the scene has no such place") from None


def _entry(tables: list[Any], part: str) -> int:
    names = [one.get("name") for one in tables if isinstance(one, dict)]
    return names.index(part) if part in names else int(part)
