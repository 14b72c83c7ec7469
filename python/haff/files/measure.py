"""Profiles and correlations in time, of files and of live simulations, as xarray datasets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import MissingDataError
from .column import complete
from .layout import AXES, Array

if TYPE_CHECKING:
    import xarray

    from .header import Header

_FIELDS = {
    "density": ("number density", "1/length^d", 0),
    "mass_density": ("mass density", "mass/length^d", 0),
    "velocity": ("velocity", "length/time", 1),
    "temperature": ("granular temperature", "energy", 0),
    "pressure": ("pressure tensor", "energy/length^d", 2),
}
"""Long name, unit, and number of axes of the value in a cell."""
_OF_SPECIES = "species_"
"""What the names of the fields of species begin with."""
_CORRELATIONS = {
    "msd": ("mean square displacement", "length^2"),
    "vacf": ("autocorrelation of velocities", "length^2/time^2"),
    "stress": ("autocorrelation of P_xy", "energy^2/length^2d"),
    "helfand": ("mean square of the integral of P_xy", "energy^2 time^2/length^2d"),
}
"""Long name and unit."""


class Rows(NamedTuple):
    """The rows of one profile as arrays."""

    time: Array
    """``[R]`` ends of the intervals [time]."""
    centers: Mapping[str, Array]
    """Centers of the cells [length], by axis."""
    fields: Mapping[str, Array]
    """``[R, cells…]`` by name, with the axes of vectors and tensors last; of species ``[R, S, cells…]``."""
    species: Sequence[str] = ()
    """``[S]`` names of the species that have fields of their own."""


def profiles(file: Header) -> dict[str, xarray.Dataset]:
    """All profiles of a file, by the letters of their axes; see :attr:`haff.File.profiles`."""
    return {name: profile(file.dimension, *rows) for name, rows in profile_rows(file).items()}


def profile_rows(file: Header) -> dict[str, Rows]:
    """As :func:`profiles`, but arrays, which need no xarray."""
    stored, found = file.stored, {}
    for name in stored.members("profiles"):
        place = f"profiles/{name}"
        axes = tuple(name)
        if not axes or not set(axes) <= set(AXES) or len(set(axes)) != len(axes):
            raise stored.wrong(place, f"must be named by axes, one or several of {', '.join(AXES)}")
        d = len(axes)
        grid = stored.column(f"{place}/position/value", (None,) * d + ((d,) if d > 1 else ()), "f")[:]
        stored.column(f"{place}/position/value", grid.shape, "f").require_finite(grid)
        bins = grid.shape[:d]
        time = stored.column(f"{place}/density/time", (None,), "f")
        columns = {
            field: stored.column(f"{place}/{field}/value", (None, *bins, *_shape(rank, file.dimension)), "f")
            for field, (_, _, rank) in _FIELDS.items()
        }
        species = _species(file, place)
        if species:
            columns |= {
                _OF_SPECIES + field: stored.column(
                    f"{place}/{_OF_SPECIES}{field}/value",
                    (None, len(species), *bins, *_shape(rank, file.dimension)),
                    "f",
                )
                for field, (_, _, rank) in _FIELDS.items()
            }
        rows = complete(time, min(map(len, (time, *columns.values()))))
        when = time[:rows]
        time.require_order(when)
        fields = {field: column[:rows] for field, column in columns.items()}
        first = [(slice(None) if k == axis else 0) for axis in range(d) for k in range(d)]
        centers = {
            letter: grid if d == 1 else grid[(*first[d * axis : d * (axis + 1)], axis)]
            for axis, letter in enumerate(axes)
        }
        found[name] = Rows(when, centers, fields, species)
    if not found:
        raise MissingDataError(f"{file.path}: no profiles (set measure.profiles in the scene)")
    return found


def _species(file: Header, place: str) -> list[str]:
    """Names of the species that a profile or a correlation has fields or curves of."""
    given = file.stored.attribute(place, "species")
    if given is None:
        return []
    names = file.species_names
    indices = np.atleast_1d(np.asarray(given))
    if indices.dtype.kind not in "iu" or indices.ndim != 1 or not all(0 <= k < len(names) for k in indices):
        raise file.stored.wrong(f"{place}@species", "must be indices of species")
    return [names[k] for k in indices]


def _shape(rank: int, dimension: int) -> tuple[int, ...]:
    return ((), (3,), (dimension, dimension))[rank]


def in_dimension(unit: str, dimension: int) -> str:
    """A unit with the dimension for its letter: ``1/length^d`` is ``1/length^2`` in two dimensions."""
    return unit.replace("^2d", f"^{2 * dimension}").replace("^d", f"^{dimension}")


def profile(
    dimension: int,
    time: Array,
    centers: Mapping[str, Array],
    fields: Mapping[str, Array],
    species: Sequence[str] = (),
) -> xarray.Dataset:
    """Rows of one profile as a dataset with the dimensions ``time``, the axes, and those of vectors and tensors.

    Fields of ``species`` have the dimension ``species`` after the time.
    """
    import xarray

    variables: dict[str, Any] = {}
    coords: dict[str, Any] = {"time": ("time", time, {"long_name": "time", "units": "time"})}
    for axis, values in centers.items():
        coords[axis] = (axis, values, {"long_name": f"{axis}, center of the cell", "units": "length"})
    if species:
        coords["species"] = list(species)
    for name, values in fields.items():
        about, unit, rank = _FIELDS[name.removeprefix(_OF_SPECIES)]
        of_species = ("species",) if name.startswith(_OF_SPECIES) else ()
        dims = ("component",) if rank == 1 else ("row", "column")[:rank]
        for dim, length in zip(dims, values.shape[values.ndim - rank :] if rank else ()):
            coords[dim] = list(AXES[:length])
        about += " of the species" if of_species else ""
        attributes = {"long_name": about, "units": in_dimension(unit, dimension)}
        variables[name] = (("time", *of_species, *centers, *dims), values, attributes)
    return xarray.Dataset(variables, coords)


def correlations(file: Header) -> dict[str, xarray.Dataset]:
    """All correlations of a file, by name; see :attr:`haff.File.correlations`."""
    return {name: correlation(file.dimension, name, columns) for name, columns in correlation_columns(file).items()}


def correlation_columns(file: Header) -> dict[str, dict[str, Array]]:
    """As :func:`correlations`, but arrays ``lag``, ``value``, ``error`` and ``count``, which need no xarray.

    With curves of species values and errors are ``[L, S]``, and ``species`` has their names.
    """
    stored, found = file.stored, {}
    for name in stored.members("correlations"):
        if name not in _CORRELATIONS:
            raise stored.wrong(f"correlations/{name}", f"must be one of {', '.join(_CORRELATIONS)}")
        place = f"correlations/{name}"
        species = _species(file, place)
        curves = (len(species),) if species else ()
        kinds = {"lag": ("f", ()), "value": ("f", curves), "error": ("f", curves), "count": ("iu", ())}
        columns = {
            part: stored.column(f"{place}/{part}", (None, *shape), kind) for part, (kind, shape) in kinds.items()
        }
        # Each column is replaced as a whole: after a kill between two of them, the common length counts.
        rows = min(map(len, columns.values()))
        lag = columns["lag"][:rows]
        columns["lag"].require_order(lag)
        found[name] = {part: column[:rows] for part, column in columns.items()}
        if species:
            found[name]["species"] = np.array(species, dtype=object)
    if not found:
        raise MissingDataError(
            f"{file.path}: no correlations (set measure.msd, vacf or stress_correlation in the scene)"
        )
    return found


def curves(columns: Mapping[str, Array]) -> dict[str, dict[str, Array]]:
    """The curves of a correlation, by the name of the species; one of all particles has an empty name."""
    if "species" not in columns:
        return {"": dict(columns)}
    same = {part: columns[part] for part in ("lag", "count")}
    return {
        str(name): same | {part: columns[part][:, k] for part in ("value", "error")}
        for k, name in enumerate(columns["species"])
    }


def correlation(dimension: int, name: str, columns: Mapping[str, Array]) -> xarray.Dataset:
    """A correlation as a dataset with the dimension ``lag``, and ``species`` if it has curves of species."""
    import xarray

    about, unit = _CORRELATIONS[name]
    unit = in_dimension(unit, dimension)
    dims = ("lag", "species") if "species" in columns else ("lag",)
    variables = {
        "value": (dims, columns["value"], {"long_name": about, "units": unit}),
        "error": (dims, columns["error"], {"long_name": f"standard error of the {about}", "units": unit}),
        "count": ("lag", np.asarray(columns["count"]), {"long_name": "number of pairs of states", "units": "1"}),
    }
    coords: dict[str, Any] = {"lag": ("lag", columns["lag"], {"long_name": "lag", "units": "time"})}
    if "species" in columns:
        coords["species"] = list(columns["species"])
    return xarray.Dataset(variables, coords)
