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

DIGITS = 6
FORMATS = {"markdown": "pipe", "csv": "", "latex": "latex"}
"""Formats, and what tabulate calls them."""
ENDINGS = {".csv": "csv", ".tex": "latex"}


def write(file: File, output: Path | None, to: str | None, *, overwrite: bool = False) -> str | None:
    """The table as text; written to ``output`` instead, if one is given.

    CSV has all columns and digits; the others six digits, without components that are 0 throughout.
    """
    if to is None:
        to = ENDINGS.get("" if output is None else output.suffix, "markdown")
    if to not in FORMATS:
        raise ArgumentError(f"to = {quoted(to)}: must be one of {', '.join(FORMATS)}")
    table = impacts(file)
    text = table.to_csv(index=False) if to == "csv" else _rounded(table, FORMATS[to])
    if output is None:
        return text
    with replacing(output, source=file.path, overwrite=overwrite) as part:
        part.write_text(text, encoding="utf-8")
    return None


def _rounded(table: pd.DataFrame, form: str) -> str:
    """The table without velocities that are 0 or unknown throughout."""
    from tabulate import tabulate

    empty = [
        name
        for name in table
        if name.endswith(("_x", "_y", "_z")) and not np.any(np.nan_to_num(table[name].to_numpy(float)))
    ]
    shown = table.drop(columns=empty)

    def cell(value: str | float) -> str:
        if isinstance(value, str):
            return value.replace("|", "\\|") if form == "pipe" else value
        return "" if np.isnan(value) else f"{value:.{DIGITS}g}"

    rows = [[cell(value) for value in row] for row in shown.itertuples(index=False)]
    headers = [str(name).replace("_", " ") for name in shown]
    return tabulate(rows, headers, form, disable_numparse=True) + "\n"
