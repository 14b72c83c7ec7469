"""The samples of a file: energies, temperature, pressure, momenta, counts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import h5py
import pandas as pd

from .errors import MissingDataError
from .layout import Array, complete, component, reading

if TYPE_CHECKING:
    import xarray

    from .reader import File


def names(file: File) -> list[str]:
    """Names of the observables. Raises :class:`MissingDataError` if there are none."""
    group = file.hdf.get("observables")
    found = [] if group is None else [n for n in group if isinstance(group[n], h5py.Group) and "value" in group[n]]
    if not found:
        raise MissingDataError(f"{file.path}: no observables (output.observables = false in the scene)")
    return found


def arrays(file: File) -> tuple[Array, Array, dict[str, Array]]:
    """Time, step and values, by name, of the samples that are complete."""
    columns = names(file)
    group = file.hdf["observables"]
    length = min(group[n][part].shape[0] for n in columns for part in ("value", "step", "time"))
    clock = group[columns[0]]
    with reading(file.path):
        length = complete(clock["time"], length)
        return clock["time"][:length], clock["step"][:length], {n: group[n]["value"][:length] for n in columns}


def table(file: File) -> pd.DataFrame:
    """One row per sample, one column per component; see :attr:`haff.File.observables`."""
    time, step, values = arrays(file)
    columns: dict[str, Array] = {"time": time, "step": step}
    for name, value in values.items():
        if value.ndim == 1:
            columns[name] = value
        else:
            columns |= {f"{name}_{label}": value[:, k] for k, label in enumerate(_labels(file, name, value.shape[1]))}
    return pd.DataFrame(columns)


def dataset(file: File) -> xarray.Dataset:
    """The samples with vectors kept whole; see :meth:`haff.File.to_xarray`."""
    import xarray

    time, step, values = arrays(file)
    variables: dict[str, Any] = {"step": ("time", step)}
    coords: dict[str, Any] = {"time": time}
    for name, value in values.items():
        if value.ndim == 1:
            variables[name] = ("time", value)
            continue
        dim = "species" if name.startswith("species_") else "axis" if value.shape[1] == 3 else f"{name}_component"
        variables[name] = (("time", dim), value)
        coords[dim] = _labels(file, name, value.shape[1])
    return xarray.Dataset(variables, coords, attrs={"title": file.title, "file": str(file.path)})


def _labels(file: File, name: str, width: int) -> list[str]:
    if name.startswith("species_") and width == len(file.species_names):
        return file.species_names
    return [component(c, width) for c in range(width)]
