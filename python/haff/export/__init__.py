"""Files for other programs: ``haff export``, or :meth:`haff.File.export`. docs/export.md lists programs by format.

*What to change here.* A new format: a module here, a line of :data:`FORMATS`, and the same in ``command/main.py``.

*May import* ``common``, ``files`` and ``analysis``.

*Begin with* :data:`FORMATS`, then :mod:`.extxyz`.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..common import arguments
from ..common.output import replacing
from ..common.words import say
from ..errors import ArgumentError
from ..files.layout import computing
from ..files.selection import choose
from ..text import brief, quoted
from . import extxyz, gsd, tables, vtkhdf

if TYPE_CHECKING:
    from ..files.recording import Recording

__all__ = ["FORMATS", "TABLES", "Format", "export"]

TABLES = tuple(tables.TABLES)
"""What csv and parquet can hold."""


class Format(NamedTuple):
    """One format of :func:`export`."""

    suffix: str
    write: Callable[..., None]
    trajectory: bool
    """Whether it holds frames; if not, one of :data:`TABLES`."""


MEANT = {
    ".xyz": "extxyz",
    ".vtk": "vtkhdf",
    ".vtu": "vtkhdf",
    ".hdf": "vtkhdf",
    ".txt": "csv",
    ".tsv": "csv",
    ".pq": "parquet",
}
"""Suffixes of related formats, and the format that is written."""
FORMATS = {
    "gsd": Format(".gsd", gsd.write, True),
    "extxyz": Format(".extxyz", extxyz.write, True),
    "vtkhdf": Format(".vtkhdf", vtkhdf.write, True),
    "csv": Format(".csv", tables.write_csv, False),
    "parquet": Format(".parquet", tables.write_parquet, False),
}


def export(
    file: Recording,
    output: str | os.PathLike[str] | None = None,
    *,
    to: str | None = None,
    frames: str | slice | int | None = None,
    table: str | None = None,
    unwrapped: bool = False,
    overwrite: bool = False,
) -> Path:
    """Writes a file for other programs, frame by frame; returns its path.

    Parameters
    ----------
    output
        The file to write; by default named after the input, in the current directory.
    to
        A key of :data:`FORMATS`; by default taken from the suffix of ``output``.
    frames
        The frames to write, ``"start:stop:step"`` or a slice; all by default.
    table
        For csv and parquet: ``"observables"`` (default), ``"frames"`` or ``"events"``.
    unwrapped
        Positions that do not jump at periodic faces, instead of those in the box.
    overwrite
        Whether an existing file is replaced.

    Raises
    ------
    ArgumentError
        An argument is invalid, or does not go with the format; the file exists.
    MissingDataError
        The requested data were not recorded.
    MissingPackageError
        The library that writes the format is not installed.
    """
    given = None if output is None else arguments.file("output", output)
    for name, chosen in (("unwrapped", unwrapped), ("overwrite", overwrite)):
        arguments.flag(name, chosen)
    if to is None:
        suffix = given.suffix.lower() if given is not None else ""
        to = next((name for name, format in FORMATS.items() if format.suffix == suffix), None)
        if to is None:
            raise ArgumentError(_without_format(output))
    format = FORMATS[arguments.choice("to", to, FORMATS)]
    if table is not None:
        arguments.choice("table", table, TABLES)
    if format.trajectory and table not in (None, "frames"):
        raise ArgumentError(f"table {quoted(table)}: {to} holds frames; {table} go to csv or parquet")
    table = "frames" if format.trajectory else table or "observables"
    if table != "frames" and (frames is not None or unwrapped):
        raise ArgumentError(f"a choice of frames or unwrapped positions applies to frames, not to {table}")
    if to == "gsd" and unwrapped:
        raise ArgumentError("gsd holds positions in the box and images beside them; readers unwrap them")
    name = file.path.stem + ("" if format.trajectory else f"-{table}") + format.suffix
    path = Path(name) if given is None else given
    with replacing(path, source=file.path, overwrite=overwrite) as part, computing(file.path, to):
        if format.trajectory:
            format.write(choose(file, frames), part, unwrapped=unwrapped)
        else:
            format.write(tables.TABLES[table](file, frames, unwrapped), part, file)
    return path


def _without_format(output: str | os.PathLike[str] | None) -> str:
    """Why the format of an output is not known, and how to give it."""
    formats = ", ".join(FORMATS)
    suffix = "" if output is None else Path(output).suffix
    if not suffix:
        return f"no format given: {say('to', '--to')} must be one of {formats}"
    meant = MEANT.get(suffix.lower())
    if meant is None:
        return f"unknown suffix {brief(suffix)}: {say('to', '--to')} must be one of {formats}"
    name = brief(str(Path(output or "").with_suffix(FORMATS[meant].suffix)))
    remedy = say(f"to={meant!r} or output={name!r}", f"--to {meant} or -o {name}")
    return f"unknown suffix {suffix}: use {remedy}; {say('to', '--to')} must be one of {formats}"
