"""``haff table``: the impacts of a run as a table for a report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..analysis import impacts
from ..common.output import replacing
from ..errors import ArgumentError
from ..text import quoted

if TYPE_CHECKING:
    import pandas as pd

    from ..reader import File

DIGITS, MOST_DIGITS = 6, 17
FORMATS = {"markdown": "pipe", "csv": "", "latex": "latex"}
"""Formats, and what tabulate calls them."""
ENDINGS = {".csv": "csv", ".tex": "latex"}


def write(
    file: File,
    output: Path | None,
    to: str | None,
    columns: str | None = None,
    *,
    digits: int | None = None,
    overwrite: bool = False,
) -> str | None:
    """The table as text; written to ``output`` instead, if one is given.

    Without ``columns`` and ``digits`` CSV has all of both, and the others six digits, without components that are 0
    throughout.
    """
    if to is None:
        to = ENDINGS.get("" if output is None else output.suffix, "markdown")
    if to not in FORMATS:
        raise ArgumentError(f"to = {quoted(to)}: must be one of {', '.join(FORMATS)}")
    if digits is not None and not 1 <= digits <= MOST_DIGITS:
        raise ArgumentError(f"digits = {digits}: must be from 1 to {MOST_DIGITS}")
    table = impacts(file)
    if columns is not None:
        table = table[_chosen(columns, list(table))]
    elif to != "csv":
        table = table.drop(columns=_empty(table))
    if to == "csv":
        text = table.to_csv(index=False, float_format=None if digits is None else f"%.{digits}g")
    else:
        text = _rounded(table, FORMATS[to], digits or DIGITS)
    if output is None:
        return text
    with replacing(output, source=file.path, overwrite=overwrite) as part:
        part.write_text(text, encoding="utf-8")
    return None


def _chosen(columns: str, known: list[str]) -> list[str]:
    """The columns with these names; the headings of the table, with spaces, are names, too."""
    names = [name.strip().replace(" ", "_") for name in columns.split(",")]
    for name in names:
        if name not in known:
            raise ArgumentError(f"columns = {quoted(name)}: must be one of {', '.join(known)}")
    return names


def _empty(table: pd.DataFrame) -> list[str]:
    """Velocities that are 0 or unknown throughout."""
    components = [name for name in table if name.endswith(("_x", "_y", "_z"))]
    return [name for name in components if not np.any(np.nan_to_num(table[name].to_numpy(float)))]


def _rounded(table: pd.DataFrame, form: str, digits: int) -> str:
    from tabulate import tabulate

    def cell(value: str | float) -> str:
        if isinstance(value, str):
            return value.replace("|", "\\|") if form == "pipe" else value
        return "" if np.isnan(value) else f"{value:.{digits}g}"

    rows = [[cell(value) for value in row] for row in table.itertuples(index=False)]
    headers = [str(name).replace("_", " ") for name in table]
    return tabulate(rows, headers, form, disable_numparse=True) + "\n"
