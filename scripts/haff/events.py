"""The event log of a file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import h5py
import numpy as np
import pandas as pd

from .errors import MissingDataError
from .layout import Array, complete, component, reading

if TYPE_CHECKING:
    from .reader import File

__all__ = ["Events"]

_EVENT_COLUMNS = (
    "time", "kind", "i", "j", "approach_speed", "impulse", "energy_loss", "carnot_energy", "normal", "position",
)  # fmt: skip


class Events:
    """The event log, one row per event, read column by column or piece by piece.

    ``len(events)``, ``events["energy_loss"]`` (NumPy), ``events[a:b]`` and ``events.chunks()`` (pandas) read
    only what they name. Vector columns become ``normal_x``, ``normal_y``, … in data frames. A scene may ask for
    some columns only (``output.events = { columns = […] }``); the others raise :class:`MissingDataError`.
    """

    def __init__(self, file: File) -> None:
        self._file = file
        group = file.hdf.get("events")
        if not isinstance(group, h5py.Group) or "time" not in group:
            raise MissingDataError(f"{file.path}: no event log (set output.events = true in the scene)")
        self._group = group
        self._columns = [n for n in _EVENT_COLUMNS if n in group]
        self._columns += [n for n in group if n not in self._columns and isinstance(group[n], h5py.Dataset)]
        length = min((group[n].shape[0] for n in self._columns), default=0)
        with reading(file.path):
            self._length = complete(group["time"], length)

    @property
    def columns(self) -> list[str]:
        """Names of the recorded columns."""
        return list(self._columns)

    @cached_property
    def kinds(self) -> dict[int, str]:
        """Meaning of the codes of column ``kind``."""
        names = h5py.check_enum_dtype(self._group["kind"].dtype) if "kind" in self._group else None
        return {code: name for name, code in sorted((names or {}).items(), key=lambda item: item[1])}

    def __len__(self) -> int:
        return self._length

    @overload
    def __getitem__(self, key: str) -> Array: ...
    @overload
    def __getitem__(self, key: slice) -> pd.DataFrame: ...
    def __getitem__(self, key: str | slice) -> Array | pd.DataFrame:
        if isinstance(key, str):
            self._require(key)
            with reading(self._file.path):
                return self._group[key][: self._length]
        start, stop, step = key.indices(self._length)
        if step != 1:
            return self.to_pandas().iloc[key]
        return self._read(start, stop, self._columns)

    def to_pandas(self, columns: Sequence[str] | None = None) -> pd.DataFrame:
        """The whole log, or some columns of it, as a data frame; ``kind`` is a categorical."""
        return self._read(0, self._length, self._columns if columns is None else list(columns))

    def chunks(self, size: int = 1_000_000, columns: Sequence[str] | None = None) -> Iterator[pd.DataFrame]:
        """Data frames of up to ``size`` rows, in order: for logs larger than memory."""
        names = self._columns if columns is None else list(columns)
        for start in range(0, self._length, size):
            yield self._read(start, min(start + size, self._length), names)

    def _require(self, name: str) -> None:
        if name in self._columns:
            return
        found = ", ".join(self._columns)
        if name in _EVENT_COLUMNS:
            raise MissingDataError(
                f"{self._file.path}: the event log lacks {name!r}: the scene asked for {found} (output.events)"
            )
        raise KeyError(f"no event column {name!r}; there are {found}")

    def _read(self, start: int, stop: int, names: Sequence[str]) -> pd.DataFrame:
        columns: dict[str, Any] = {}
        stop = max(start, stop)
        for name in names:
            self._require(name)
            with reading(self._file.path):
                values = self._group[name][start:stop]
            if name == "kind" and self.kinds:
                position = {code: k for k, code in enumerate(self.kinds)}
                lookup = np.full(256, -1, np.int8)
                for code, k in position.items():
                    lookup[code] = k
                columns[name] = pd.Categorical.from_codes(lookup[values], categories=list(self.kinds.values()))
            elif values.ndim == 2:
                columns |= {f"{name}_{component(c, values.shape[1])}": values[:, c] for c in range(values.shape[1])}
            else:
                columns[name] = values
        return pd.DataFrame(columns, index=pd.RangeIndex(start, stop, name="event"))

    def __repr__(self) -> str:
        return f"<Events: {self._length} rows, columns {', '.join(self._columns)}>"
