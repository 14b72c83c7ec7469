"""The samples of a file: energies, temperature, pressure, momenta, counts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.compiled import compiled
from ..errors import MissingDataError
from ..text import brief, quoted
from .column import Column, complete
from .layout import AXES, Array, component, computing
from .measure import in_dimension

if TYPE_CHECKING:
    import pandas as pd
    import xarray

    from .header import Header

_TAKEN = ("time", "step", "axis", "species", "piston")
_COUNTS = ("collisions", "wall_collisions")
# Terms of the balance of energies in files that do not describe them: label, and sign of the energy for the particles.
_TERMS = {"wall_work": ("work of walls", 1.0), "rest_energy": ("taken by rest", -1.0)}
# Other observables may be NaN: rates and pressure at the start, a temperature where nothing moves.
ENERGIES = (
    "kinetic_energy rotational_energy piston_energy potential_energy gravity_energy spring_energy "
    "dissipated_energy carnot_energy"
).split()
_PAIR = "pair_"
"""How names of observables begin that have a value for each pair of species."""
_WIDEST = 16
"""Components of an observable that is neither a vector nor one number a species."""


def names(file: Header) -> list[str]:
    """Names of the observables. Raises :class:`MissingDataError` if there are none."""
    stored = file.stored
    groups = [n for n in stored.members("observables") if stored.is_group(f"observables/{n}")]
    found = [n for n in groups if stored.find(f"observables/{n}/value") is not None]
    if not found:
        raise MissingDataError(f"{file.path}: no observables (output.observables = false in the scene)")
    return found


def balance(file: Header) -> dict[str, tuple[str, float]]:
    """Terms of the balance of energies beside T, that of rotation, V and the losses: label and sign by name.

    The sign is 1 for energy given to the particles and -1 for energy taken. Empty without observables.
    """
    stored, terms = file.stored, {}
    for name in stored.members("observables"):
        place = f"observables/{name}"
        if not stored.is_group(place):
            continue
        label, sign = stored.attribute(place, "label"), stored.attribute(place, "balance")
        if isinstance(label, str) and sign is not None:
            if not isinstance(sign, float | np.floating) or sign not in (1.0, -1.0):
                raise stored.wrong(f"{place}@balance", f"is {brief(sign)}; must be 1 or -1")
            terms[name] = (label, float(sign))
        elif name in _TERMS:
            terms[name] = _TERMS[name]
    return terms


def columns(file: Header) -> tuple[Column, Column, dict[str, Column]]:
    """Time, step and values, by name; reads only the data needed to check that all have the same times."""
    stored, found = file.stored, {}
    wide = {3, len(file.species_names), len(file.wall_names), *range(1, _WIDEST + 1)}
    matrices = {(file.dimension, file.dimension), (len(file.wall_names), 3)}
    matrices.add((len(file.species_names),) * 2)
    if file.pistons:
        matrices.add((len(file.pistons), 3))
    clock: tuple[Column, Column] | None = None
    for name in names(file):
        place = f"observables/{name}"
        if name in _TAKEN:
            raise stored.wrong(place, f"must not be named so; {', '.join(_TAKEN)} have other meanings")
        kinds = "iu" if name in _COUNTS else "fiu"
        column = stored.column(f"{place}/value", (None,) * min(max(stored.rank(f"{place}/value"), 1), 3), kinds)
        if len(column.width) == 2 and column.width not in matrices:
            allowed = ", ".join(f"{rows} × {columns}" for rows, columns in sorted(matrices))
            raise stored.wrong(column.place, f"has rows of {column.width} numbers; must have {allowed}")
        if len(column.width) == 1 and column.width[0] not in wide:
            raise stored.wrong(
                column.place, f"has rows of {column.width[0]} numbers; must have 1, 3, one a species or one a wall"
            )
        found[name] = column
        own = stored.column(f"{place}/time", (None,), "f"), stored.column(f"{place}/step", (None,), "iu")
        clock = clock or own
        for mine, first in zip(own, clock):
            if not mine.same(first) and not np.array_equal(mine[:], first[:], equal_nan=True):
                raise stored.wrong(mine.place, f"is not that of {first.place}; all observables have the same samples")
    assert clock is not None
    return *clock, found


def arrays(file: Header) -> tuple[Array, Array, dict[str, Array]]:
    """Time, step and values, by name, of the samples that are complete."""
    time, step, found = columns(file)
    length = complete(time, min(map(len, (time, step, *found.values()))))
    when, count = time[:length], step[:length]
    time.require_order(when)
    step.require(count, count >= 0, "0 or more")
    values = {name: column[:length] for name, column in found.items()}
    for name in (*ENERGIES, *balance(file)):
        if name in values:
            found[name].require(values[name], np.isfinite(values[name]), "a finite number")
    return when, count, values


def count(file: Header) -> int:
    """Number of complete samples; reads only times."""
    time, step, found = columns(file)
    return complete(time, min(map(len, (time, step, *found.values()))))


def by_name(file: Header) -> dict[str, Array]:
    """One array ``[S]`` per component, by name; see :attr:`haff.File.samples`."""
    time, step, values = arrays(file)
    columns: dict[str, Array] = {"time": time, "step": step}
    for name, value in values.items():
        labels = _labels(file, name, value.shape[1:])
        for index in np.ndindex(value.shape[1:]):
            suffix = _joined([labels[k][i] for k, i in enumerate(index)])
            if suffix and f"{name}{suffix}" in values:
                raise file.stored.wrong(
                    f"observables/{name}", f"has a component {quoted(suffix[1:])} that is an observable, too"
                )
            columns[f"{name}{suffix}"] = value[(slice(None), *index)]
    return columns


def of_probes(file: Header) -> list[tuple[str, str, list[str]]]:
    """Columns of probes of other crates, in their order: name, unit and names in :func:`samples`."""
    stored, found = file.stored, []
    if "observables" not in file:
        return []
    for name, column in columns(file)[2].items():
        place = f"observables/{name}"
        first, unit = stored.attribute(place, "probe"), unit_of(file, name) or "1"
        if isinstance(first, int | np.integer):
            shape = column.width
            parts = [f"{name}_{component(c, shape[0])}" for c in range(shape[0])] if shape else [name]
            found.append((int(first), name, unit, parts))
    return [(name, unit, parts) for _, name, unit, parts in sorted(found)]


def unit_of(file: Header, name: str) -> str | None:
    """The unit of an observable, ``1`` if it has none; ``None`` if the file does not say it."""
    unit = file.stored.attribute(f"observables/{name}", "unit")
    return in_dimension(unit, file.dimension) if isinstance(unit, str) else None


def table(samples: dict[str, Array]) -> pd.DataFrame:
    """One row per sample, one column per component; see :attr:`haff.File.observables`."""
    import pandas as pd

    return pd.DataFrame(samples)


def means(samples: dict[str, Array]) -> pd.DataFrame:
    """One row per component, with its mean over its stationary part; see :attr:`haff.File.means`."""
    import pandas as pd

    time, rows = samples["time"], {}
    for name, values in samples.items():
        if name not in ("time", "step"):
            found = compiled().mean(np.ascontiguousarray(values, float), np.ascontiguousarray(time, float))
            if found is not None:
                rows[name] = found
    kinds = {"mean": float, "error": float, "start": float, "independent": float, "slope": float, "drifts": bool}
    return pd.DataFrame.from_dict(rows, orient="index", columns=list(kinds)).astype(kinds)


def dataset(file: Header) -> xarray.Dataset:
    """The samples with vectors kept whole; see :meth:`haff.File.to_xarray`."""
    import xarray

    time, step, values = arrays(file)
    variables: dict[str, Any] = {"step": ("time", step)}
    coords: dict[str, Any] = {"time": time}
    for name, value in values.items():
        labels = _labels(file, name, value.shape[1:])
        dims = [_dimension(file, name, found) for found in labels]
        if len(labels) == 2 and name.startswith(_PAIR):
            dims[1] = "partner"
        elif len(labels) == 2 and not any(labels[0] is known for _, known in _named(file)):
            dims = ["row", "column"]
        coords |= zip(dims, labels)
        unit = unit_of(file, name)
        variables[name] = (("time", *dims), value, {"units": unit} if unit else {})
    with computing(file.path, "xarray"):
        return xarray.Dataset(variables, coords, attrs={"title": file.title, "file": str(file.path)})


def _labels(file: Header, name: str, shape: tuple[int, ...]) -> list[list[str]]:
    """Names of the components along each axis of a value."""
    labels = []
    for axis, width in enumerate(shape):
        # Two species or walls of the same name would share a column.
        for prefix, known in _named(file):
            if (axis == 0 or prefix == _PAIR) and name.startswith(prefix) and width == len(known) == len(set(known)):
                labels.append(known)
                break
        else:
            tensor = len(shape) == 2 and name.startswith("pressure")
            labels.append([AXES[c] if tensor else component(c, width) for c in range(width)])
    return labels


def _named(file: Header) -> tuple[tuple[str, list[str]], ...]:
    """How names of observables begin that have a value for each species, wall or piston, and the names of these."""
    species = file.species_names
    return ("species_", species), (_PAIR, species), ("wall_", file.wall_names), ("piston_", file.pistons)


def _dimension(file: Header, name: str, labels: list[str]) -> str:
    if labels is file.species_names:
        return "species"
    if labels is file.wall_names:
        return "wall"
    if labels is file.pistons:
        return "piston"
    return "axis" if len(labels) == 3 else f"{name}_component"


def _joined(labels: list[str]) -> str:
    """Suffix of a component: `_z-_x` of a wall's force, `_xy` of a tensor."""
    return "_" + ("" if all(label in AXES for label in labels) else "_").join(labels) if labels else ""
