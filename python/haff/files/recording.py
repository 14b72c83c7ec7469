"""All of a file: its header, and what happened in the run."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common import arguments
from ..common.notebook import table
from ..common.output import library
from ..errors import FileError, HaffError, MissingDataError, NotApplicableError
from ..text import escaped
from . import measure, samples
from .conversions import Unwrapping
from .events import Events
from .frames import Frames
from .header import Header, not_triangular, packing_fraction
from .layout import AXES, Array
from .stored import reason

if TYPE_CHECKING:
    import MDAnalysis
    import pandas as pd
    import xarray

__all__ = ["Recording"]


class Recording(Header):
    """All that a file holds. A :class:`haff.File` has figures and exports besides."""

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
        return samples.table(self.samples)

    @cached_property
    def means(self) -> pd.DataFrame:
        """The mean of each observable: rows by name, as the columns of :attr:`observables`.

        ``mean`` is that over the stationary part, from the time ``start`` on, and ``error`` its standard error, which
        takes correlation into account; ``independent`` is the number of independent values that would have the same
        error. ``drifts`` says that there is no stationary part, as of all that is counted since the start; ``slope`` is
        in its standard errors. Samples at other intervals count as means over them. See :func:`haff.analysis.mean`.

        Raises :class:`MissingDataError` if the scene recorded none.
        """
        return samples.means(self.samples)

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

        Atoms carry ``masses``, ``radii``, ``types`` (species names) and ids. Nothing is converted: numbers
        are in the units of the scene. ``universe.load_new(path, format="H5MD")`` reads the file alone, with Å and ps
        for the units of length and time. A sheared box has the dimensions and angles of each frame, in single
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
            universe.trajectory.add_transformations(Unwrapping(self.path, type(self)))
        universe.add_TopologyAttr("masses", np.where(np.isfinite(self.mass), self.mass, 0.0))
        universe.add_TopologyAttr("radii", self.radius)
        universe.add_TopologyAttr("types", names)
        universe.add_TopologyAttr("ids", np.arange(len(self)))
        return universe

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


def _largest(values: Array) -> float:
    """Largest size of the numbers among ``values``; NaN if there is none."""
    known = np.abs(values[~np.isnan(values)])
    return float(known.max()) if len(known) else float("nan")
