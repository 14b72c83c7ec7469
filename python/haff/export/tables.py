"""CSV and Parquet: frames, observables or events as tables."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from ..common.output import library
from ..files.selection import choose
from ..text import cell

if TYPE_CHECKING:
    from ..files.recording import Recording

ROWS = 1_000_000
"""Rows that are in memory at once, about."""


def _frames(file: Recording, frames: str | slice | int | None, unwrapped: bool) -> Iterator[pd.DataFrame]:
    waiting: list[pd.DataFrame] = []
    for frame in choose(file, frames):
        table = frame.to_pandas(unwrapped)
        for k, (name, value) in enumerate(table.attrs.items()):
            table.insert(k, name, value)
        waiting.append(table)
        if len(waiting) * len(file) >= ROWS:
            yield pd.concat(waiting, ignore_index=True)
            waiting = []
    if waiting:
        yield pd.concat(waiting, ignore_index=True)


def _observables(file: Recording, *_: object) -> Iterator[pd.DataFrame]:
    yield file.observables


def _events(file: Recording, *_: object) -> Iterator[pd.DataFrame]:
    events = file.events
    if len(events) == 0:
        yield events[:0]
    yield from events.chunks(ROWS)


TABLES: dict[str, Callable[..., Iterator[pd.DataFrame]]] = {
    "observables": _observables,
    "frames": _frames,
    "events": _events,
}


def write_csv(pieces: Iterator[pd.DataFrame], path: Path, file: Recording) -> None:
    """Writes a table as text, with a line of column names and all digits.

    A name that a spreadsheet would evaluate as a formula is prefixed with an apostrophe.
    """
    del file
    with open(path, "w", encoding="utf-8", newline="") as out:
        for k, piece in enumerate(pieces):
            _as_text(piece).to_csv(out, index=False, header=k == 0, lineterminator="\n")


def _as_text(piece: pd.DataFrame) -> pd.DataFrame:
    plain = piece.rename(columns=cell)
    for name in plain.select_dtypes("category"):
        texts = np.array([cell(text) for text in plain[name].cat.categories], object)
        plain[name] = texts[plain[name].cat.codes]
    return plain


def write_parquet(pieces: Iterator[pd.DataFrame], path: Path, file: Recording) -> None:
    """Writes a table column by column; the file's metadata has ``haff.scene`` (TOML) and ``haff.box`` (JSON)."""
    pyarrow, parquet = library("pyarrow", "export"), library("pyarrow.parquet", "export")
    box = {"size": file.box.size.tolist(), "boundary": file.box.boundary, "dimension": file.dimension}
    metadata = {"haff.scene": file.scene_text, "haff.box": json.dumps(box)}
    writer = None
    try:
        for piece in pieces:
            table = pyarrow.Table.from_pandas(piece, preserve_index=False)
            if writer is None:
                schema = table.schema.with_metadata({**(table.schema.metadata or {}), **metadata})
                writer = parquet.ParquetWriter(path, schema, compression="zstd")
            writer.write_table(table.cast(writer.schema))
    finally:
        if writer is not None:
            writer.close()
