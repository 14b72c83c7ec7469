"""The table of a study: the totals of its runs, what is measured in each file, and means over seeds."""

from __future__ import annotations

import json
import keyword
import numbers
import os
import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common import arguments
from ..common.compiled import compiled
from ..errors import ArgumentError, FileError, MissingDataError
from ..reader import File
from ..reader import open as open_file
from ..text import brief, quoted

if TYPE_CHECKING:
    import xarray

__all__ = ["Measure", "Table", "open_study"]

Measure = Callable[[File], Any]
"""A function of an open file: a number, or a dict of numbers."""

# Totals that are text; all others are numbers.
_TEXTS = ("status", "stopped", "state_hash", "file", "error")
# Names that no dimension can have, beside those of variables: arguments of xarray's sel, and other coordinates.
_TAKEN = ("run_seed", "seed", "time", "observable", "indexers", "method", "tolerance", "drop")


def open_study(
    folder: str | os.PathLike[str],
    *,
    series: Sequence[str] = (),
    measure: Measure | None = None,
    dims: str = "names",
) -> xarray.Dataset:
    """Open the study in a folder, as :func:`haff.sweep` returns it, without making any run.

    Parameters
    ----------
    folder
        Folder of a study of :func:`haff.sweep` or ``haff sweep``. Its ``manifest.json`` is read, which the command with
        ``--list`` brings up to date where runs have been made one by one.
    series, measure, dims
        As for :func:`haff.sweep`.

    Returns
    -------
    xarray.Dataset
        As :func:`haff.sweep` returns it; keys with a single value are coordinates without a dimension.

    Raises
    ------
    FileError
        There is no study, its manifest is damaged or of another version, or a file cannot be read.
    ArgumentError
        An argument is not one of those allowed.

    Examples
    --------
    >>> import haff
    >>> study = haff.open_study("study")                                                        # doctest: +SKIP
    >>> study.status.values                                                                     # doctest: +SKIP
    """
    place = arguments.file("folder", folder).absolute()
    table = Table(place, dims, series, measure)
    path = place / "manifest.json"
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}; there is no study in this folder") from None
    except ValueError as error:
        raise FileError(f"{path}: is not a manifest of haff sweep: {brief(error)}") from None
    if not isinstance(found, dict) or found.get("manifest") != 1:
        raise FileError(f"{path}: is not a manifest of this version of haff")
    try:
        rows = found["runs"]
        keys = [text.partition("=")[0] for text in found["set"]]
        values = {key: _distinct(row["parameters"][key] for row in rows) for key in keys}
        seeds = found["seeds"]
        whole = len(rows) > 0 and len(rows) == (seeds or 1) * int(
            np.prod([len(several) for several in values.values()])
        )
    except (KeyError, TypeError, AttributeError):
        whole = False
    if not whole:
        raise FileError(f"{path}: its runs are not those of its values and seeds")
    fixed = {key: several[0] for key, several in values.items() if len(several) == 1 and key != "seed"}
    varied = {key: several for key, several in values.items() if key not in fixed}
    return table.of(rows, varied, fixed, seeds)


def _distinct(values: Iterable[Any]) -> list[Any]:
    found: list[Any] = []
    for value in values:
        if value not in found:
            found.append(value)
    return found


class Table:
    """What is read from the files of a study. Arguments are checked here, before a run is made."""

    def __init__(self, folder: Path, dims: str, series: Sequence[str], measure: Measure | None) -> None:
        self.folder = folder
        self.dims = arguments.choice("dims", dims, ("keys", "names"))
        self.series = arguments.names("series", series)
        if measure is not None and not callable(measure):
            raise ArgumentError(f"measure = {quoted(measure)}: must be a function of an open file")
        self.measure = measure

    def of(
        self,
        rows: Sequence[Mapping[str, Any]],
        varied: Mapping[str, list[Any]],
        fixed: Mapping[str, Any],
        seeds: int | None,
    ) -> xarray.Dataset:
        """The dataset of these runs, in the order of the grid.

        ``varied`` are keys with a dimension each, ``fixed`` those with one value.
        """
        # The dimension `seed` counts runs.
        fixed = {key: value for key, value in fixed.items() if key != "seed"}
        rows = [{**row, "file": str(self.folder / row["file"])} for row in rows]
        study = _dataset(rows, varied, seeds, self.folder, self.series)
        study = study.assign_coords({key: _coordinate(key, [value])[0] for key, value in fixed.items()})
        _add_means(study, rows)
        if self.measure is not None:
            _add_measured(study, rows, self.measure)
        if self.dims == "keys":
            return study
        taken = [*_TAKEN, *map(str, study.data_vars)]
        return _renamed(study, _names([*varied, *fixed], taken))


def _add_measured(study: xarray.Dataset, rows: Sequence[Mapping[str, Any]], measure: Measure) -> None:
    """Adds what a function measures in the files of complete runs, and its mean over seeds with a standard error."""
    name = getattr(measure, "__name__", "")
    found: list[dict[str, float]] = []
    for row in rows:
        if row["status"] != "complete":
            found.append({})
            continue
        with open_file(row["file"]) as file:
            value = measure(file)
        found.append(_numbers_of(value, name if name.isidentifier() else "measured", row["file"]))
    dimensions = study["status"].dims
    shape = study["status"].shape
    for name in dict.fromkeys(name for one in found for name in one):
        if name in study or name in study.dims or f"{name}_mean" in study or f"{name}_error" in study:
            raise ArgumentError(f"measure gives {quoted(name)}: another variable of the study has this name")
        column = np.array([one.get(name, np.nan) for one in found]).reshape(shape)
        study[name] = (dimensions, column)
        if "seed" not in dimensions:
            continue
        with warnings.catch_warnings():
            # NumPy warns of means without a value, and of errors of a single one: both are NaN.
            warnings.simplefilter("ignore", RuntimeWarning)
            study[f"{name}_mean"] = study[name].mean("seed")
            study[f"{name}_error"] = study[name].std("seed", ddof=1) / study[name].count("seed") ** 0.5


def _add_means(study: xarray.Dataset, rows: Sequence[Mapping[str, Any]]) -> None:
    """Adds the means of the observables of complete runs, as :func:`haff.sweep` describes them."""
    names = sorted({name for row in rows for name in row.get("means", ())})
    dimensions = (*study["status"].dims, "observable")
    shape = (*study["status"].shape, len(names))
    none: dict[str, Any] = {}
    found = [[row.get("means", none).get(name, none) for name in names] for row in rows]
    for key in ("mean", "error", "start"):
        numbers = [[np.nan if one.get(key) is None else one[key] for one in row] for row in found]
        study[f"observable_{key}"] = (dimensions, np.array(numbers, dtype=float).reshape(shape))
    drifts = [[bool(one.get("drifts", False)) for one in row] for row in found]
    study["observable_drifts"] = (dimensions, np.array(drifts, dtype=bool).reshape(shape))
    study.coords["observable"] = names


def _numbers_of(value: Any, name: str, path: str) -> dict[str, float]:
    """What a function has measured, by name."""
    given = value if isinstance(value, Mapping) else {name: value}
    found = {}
    for key, number in given.items():
        is_number = isinstance(number, numbers.Real) or (isinstance(number, np.ndarray) and number.shape == ())
        if not (isinstance(key, str) and key.isidentifier() and is_number):
            raise ArgumentError(
                f"measure gives {quoted(value)} for {path}: must be a number, or a dict of numbers whose keys are "
                "names of variables"
            )
        found[key] = float(number)
    return found


def _numbers() -> list[str]:
    """Names of the variables that are numbers."""
    return ["index", *compiled().total_names()]


def _dataset(
    rows: Sequence[Mapping[str, Any]],
    values: Mapping[str, list[Any]],
    seeds: int | None,
    folder: Path,
    series: Sequence[str],
) -> xarray.Dataset:
    import xarray

    coordinates = {key: _coordinate(key, several) for key, several in values.items()}
    if "seed" not in coordinates or seeds is not None:
        # A seed among the values must be a single one, from which the others are derived.
        coordinates.pop("seed", None)
        coordinates["seed"] = np.arange(seeds or 1)
    shape = tuple(map(len, coordinates.values()))
    dimensions = tuple(coordinates)
    # The command gives rows in the order of the grid: the first key slowest, derived seeds fastest.
    variables: dict[str, Any] = {}
    for name in _numbers():
        found = [row.get(name) for row in rows]
        whole = all(isinstance(value, int) for value in found)
        numbers = found if whole else [np.nan if value is None else value for value in found]
        variables[name] = (dimensions, np.array(numbers, dtype=np.int64 if whole else float).reshape(shape))
    for name in _TEXTS:
        variables[name] = (
            dimensions,
            np.array([row.get(name) or "" for row in rows], dtype=object).reshape(shape),
        )
    run_seeds = np.array([row["seed"] if row["seed"] is not None else -1 for row in rows], dtype=np.int64)
    variables["run_seed"] = (dimensions, run_seeds.reshape(shape))
    dataset = xarray.Dataset(variables, coordinates)
    for name, array in _series(rows, series).items():
        dataset[f"{name}_series"] = ((*dimensions, "time"), array.to_numpy().T.reshape((*shape, len(array))))
        dataset = dataset.assign_coords(time=array.index.to_numpy())
    dataset.attrs["folder"] = str(folder)
    return dataset


def _names(keys: Sequence[str], taken: Sequence[str]) -> dict[str, str]:
    """For each dotted key a name that is a Python name: the shortest end of the key that no other key has."""
    parts = {key: [re.sub(r"\W", "_", part) for part in key.split(".")] for key in keys}
    names: dict[str, str] = {}
    for key in keys:
        ends = ["_".join(parts[key][-depth:]) for depth in range(1, len(parts[key]) + 1)]
        others = {
            "_".join(parts[other][-depth:]) for other in keys if other != key for depth in range(1, len(ends) + 1)
        }
        free = (end for end in ends if end.isidentifier() and end not in others and end not in taken)
        name = next((end for end in free if not keyword.iskeyword(end)), f"key_{ends[-1]}")
        names[key] = key if key.isidentifier() else name
    return names


def _renamed(study: xarray.Dataset, names: Mapping[str, str]) -> xarray.Dataset:
    """The dataset with names for the keys of its dimensions, which keep the key as an attribute."""
    present = {key: name for key, name in names.items() if key in study.coords}
    study = study.rename(present)
    for key, name in present.items():
        study[name].attrs["key"] = key
    return study


def _coordinate(key: str, several: list[Any]) -> Any:
    """Numbers and text as they are, everything else as TOML."""
    plain = all(isinstance(value, (int, float, str, np.generic)) for value in several)
    return several if plain else [compiled().value(value, key) for value in several]


def _series(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> dict[str, Any]:
    """For each name a table with a row for each time of any run and a column for each run."""
    if not names:
        return {}
    import pandas

    tables = {}
    for row in rows:
        path = row["file"]
        if row["status"] == "complete":
            with open_file(path) as file:
                table = file.observables.set_index("time")
                if missing := [name for name in names if name not in table]:
                    raise MissingDataError(
                        f"{path}: no observable {quoted(missing[0])}; there are {brief(', '.join(table), 350)}"
                    )
                tables[row["index"]] = table[list(names)]
    if not tables:
        return {}
    columns = [row["index"] for row in rows]
    return {
        name: pandas.concat({k: table[name] for k, table in tables.items()}, axis=1)
        .sort_index()
        .reindex(columns=columns)
        for name in names
    }
