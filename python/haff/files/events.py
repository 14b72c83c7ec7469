"""The event log of a file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import h5py
import numpy as np

from ..common import arguments
from ..common.readonly import ReadOnly
from ..errors import ArgumentError, MissingDataError, UnknownNameError
from ..text import brief, escaped, quoted
from .column import Column, complete
from .layout import Array, component

if TYPE_CHECKING:
    import pandas as pd

    from .header import Header

__all__ = ["Events"]

_EVENT_COLUMNS = {
    "time": ("f", 0), "kind": ("iu", 0), "i": ("iu", 0), "j": ("iu", 0), "approach_speed": ("f", 0),
    "impulse": ("f", 0), "energy_loss": ("f", 0), "carnot_energy": ("f", 0), "normal": ("f", 3), "position": ("f", 3),
    "impulse_vector": ("f", 3), "tangential_loss": ("f", 0),
}  # fmt: skip
"""What NumPy calls their kind, and components of vectors."""
PAIRS = ("collision", "settle", "release", "stick")
"""Kinds of events whose ``j`` is a particle."""
_NO_PARTICLE = 2**32 - 1
"""``i`` and ``j`` of a change from outside."""
_OF_SCENES = {"impulse_vector": "spin or thermal walls", "tangential_loss": "spin"}
"""Columns of some scenes only, and what these have."""
_WIDEST = 16
"""Components of a column of another program."""


class Events(ReadOnly):
    """The event log, one row per event, read column by column or piece by piece.

    ``len(events)``, ``events["energy_loss"]`` (NumPy), ``events[a:b]`` and ``events.chunks()`` (pandas) read
    only what they name. Vector columns become ``normal_x``, ``normal_y``, … in data frames. A scene may ask for
    some columns only (``output.events = { columns = […] }``); the others raise :class:`MissingDataError`.

    ``impulse`` is along ``normal``. In scenes with spin or thermal walls ``impulse_vector`` is the whole impulse that
    ``j``, or the wall, receives; with spin ``tangential_loss`` is the part of ``energy_loss`` by its tangential
    component. The equations of smooth impacts hold for ``impulse`` and ``energy_loss - tangential_loss``.
    """

    def __init__(self, file: Header) -> None:
        self._file = file
        stored = file.stored
        found = stored.members("events")
        if not found:
            raise MissingDataError(f"{file.path}: no event log (set output.events = true in the scene)")
        names = ["time", *(n for n in _EVENT_COLUMNS if n in found and n != "time")]
        names += [n for n in found if n not in names and not stored.is_group(f"events/{n}")]
        self._data = {name: self._column(name) for name in names}
        self._columns = names
        self._length = complete(self._data["time"], min(map(len, self._data.values())))
        self._made = True

    def _column(self, name: str) -> Column:
        stored, place = self._file.stored, f"events/{name}"
        if name in _EVENT_COLUMNS:
            kinds, width = _EVENT_COLUMNS[name]
            return stored.column(place, (None, width) if width else (None,), kinds)
        rank = stored.rank(place)
        column = stored.column(place, (None, None) if rank == 2 else (None,))
        if rank == 2 and column.width[0] > _WIDEST:
            raise stored.wrong(place, f"has rows of {column.width[0]} numbers; must have up to {_WIDEST}")
        return column

    def __reduce__(self) -> tuple[Any, ...]:
        return Events, (self._file,)

    @property
    def columns(self) -> list[str]:
        """Names of the recorded columns."""
        return list(self._columns)

    @cached_property
    def kinds(self) -> dict[int, str]:
        """Meaning of the codes of column ``kind``."""
        if "kind" not in self._data:
            return {}
        names = h5py.check_enum_dtype(self._data["kind"].dtype)
        if not names:
            raise self._file.stored.wrong("events/kind", f"holds {self._data['kind'].dtype}; must hold an enum of HDF5")
        return {code: name for name, code in sorted(names.items(), key=lambda item: item[1])}

    def __len__(self) -> int:
        return self._length

    @overload
    def __getitem__(self, key: str) -> Array: ...
    @overload
    def __getitem__(self, key: slice) -> pd.DataFrame: ...
    def __getitem__(self, key: str | slice) -> Array | pd.DataFrame:
        if isinstance(key, str):
            return self._values(key, 0, self._length)
        if not isinstance(key, slice):
            raise ArgumentError(
                f"events[{quoted(key)}]: must be the name of a column, or a slice of rows, such as events[5:6]"
            )
        arguments.rows("events", key, self._length)
        start, stop, step = key.indices(self._length)
        if step != 1:
            return self.to_pandas().iloc[key]
        return self._read(start, stop, self._columns)

    def to_pandas(self, columns: Sequence[str] | None = None) -> pd.DataFrame:
        """The whole log, or some columns of it, as a data frame; ``kind`` is a categorical."""
        return self._read(0, self._length, self._chosen(columns))

    def chunks(self, size: int = 1_000_000, columns: Sequence[str] | None = None) -> Iterator[pd.DataFrame]:
        """Data frames of up to ``size`` rows, in order: for logs larger than memory."""
        names, size = self._chosen(columns), arguments.count("size", size, 1, arguments.MOST_ROWS)
        return (self._read(start, min(start + size, self._length), names) for start in range(0, self._length, size))

    def blocks(self, size: int = 1_000_000, columns: Sequence[str] | None = None) -> Iterator[dict[str, Array]]:
        """As :meth:`chunks`, but arrays by name: ``kind`` is a code of :attr:`kinds`, vectors are ``[rows, 3]``."""
        names, size = self._chosen(columns), arguments.count("size", size, 1, arguments.MOST_ROWS)
        return (
            {name: self._values(name, start, min(start + size, self._length)) for name in names}
            for start in range(0, self._length, size)
        )

    def _chosen(self, columns: Sequence[str] | None) -> list[str]:
        """Names of columns that there are; all by default."""
        if columns is None:
            return self._columns
        names = arguments.names("columns", columns)
        for name in names:
            self._require(name)
        return names

    def _require(self, name: str) -> None:
        if name in self._columns:
            return
        found = ", ".join(self._columns)
        if name in _EVENT_COLUMNS:
            only = f"; only scenes with {_OF_SCENES[name]} have it" if name in _OF_SCENES else ""
            raise MissingDataError(
                f"{self._file.path}: the event log lacks {quoted(name)}: "
                f"the scene asked for {found} (output.events){only}"
            )
        raise UnknownNameError(f"events: no column {quoted(name)}; the columns are {brief(found)}")

    def _values(self, name: str, start: int, stop: int) -> Array:
        """Some rows of a column, checked."""
        self._require(name)
        column, count = self._data[name], len(self._file)
        values = column[start:stop]
        if name == "time":
            column.require_order(values, start)
        elif name == "kind":
            column.require(values, np.isin(values, list(self.kinds)), f"one of {brief(self.kinds)}", start)
        elif name == "i":
            # A change from outside is of no particle.
            changes = self._are("change", start, stop) & (values == _NO_PARTICLE)
            column.require(values, (values >= 0) & (values < count) | changes, f"in [0, {count})", start)
        elif name == "j":
            # For events other than collisions, j is the index of a wall or a pendulum, or unused.
            sound = (values >= 0) & ((values < count) | ~self._are("collision", start, stop))
            column.require(values, sound, f"in [0, {count})", start)
        elif name in _EVENT_COLUMNS:
            column.require_finite(values, start)
        return values

    def _are(self, kind: str, start: int, stop: int) -> Array | np.bool_:
        """Whether some rows are of a kind; without a column of kinds a change may be anywhere, and no collision."""
        if not self.kinds:
            return np.bool_(kind == "change")
        code = next((code for code, name in self.kinds.items() if name == kind), None)
        return np.bool_(False) if code is None else self._data["kind"][start:stop] == code

    def _read(self, start: int, stop: int, names: Sequence[str]) -> pd.DataFrame:
        import pandas as pd

        columns: dict[str, Any] = {}
        stop = max(start, stop)
        for name in names:
            values = self._values(name, start, stop)
            if name == "kind":
                codes = np.searchsorted(list(self.kinds), values)
                columns[name] = pd.Categorical.from_codes(codes, categories=list(self.kinds.values()))
            elif values.ndim == 2:
                columns |= {f"{name}_{component(c, values.shape[1])}": values[:, c] for c in range(values.shape[1])}
            else:
                columns[name] = values
        return pd.DataFrame(columns, index=pd.RangeIndex(start, stop, name="event"))

    def __repr__(self) -> str:
        return f"<Events: {self._length} rows, columns {escaped(', '.join(self._columns))}>"
