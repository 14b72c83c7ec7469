"""``haff table``: the impacts of a run as a table for a report."""

from __future__ import annotations

from collections.abc import Callable
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
FORMATS = ("markdown", "csv", "latex")


def write(file: File, output: Path | None, to: str | None, *, overwrite: bool = False) -> str | None:
    """The table as text; written to ``output`` instead, if one is given.

    CSV has all columns and digits; the others six digits, without components that are 0 throughout.
    """
    if to is None:
        to = {".csv": "csv", ".tex": "latex", ".md": "markdown"}.get(
            "" if output is None else output.suffix, "markdown"
        )
    if to not in FORMATS:
        raise ArgumentError(f"to = {quoted(to)}: must be one of {', '.join(FORMATS)}")
    table = impacts(file)
    writers: dict[str, Callable[[pd.DataFrame], str]] = {
        "csv": lambda found: found.to_csv(index=False),
        "markdown": _markdown,
        "latex": _latex,
    }
    text = writers[to](table)
    if output is None:
        return text
    with replacing(output, source=file.path, overwrite=overwrite) as part:
        part.write_text(text, encoding="utf-8")
    return None


def _cells(table: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    """Headings and rows as text, without velocities that are 0 or unknown throughout."""
    empty = [
        name
        for name in table
        if name.endswith(("_x", "_y", "_z")) and not np.any(np.nan_to_num(table[name].to_numpy(float)))
    ]
    shown = table.drop(columns=empty)
    rows = [
        [value if isinstance(value, str) else "–" if np.isnan(value) else f"{value:.{DIGITS}g}" for value in row]
        for row in shown.itertuples(index=False)
    ]
    return [str(name).replace("_", " ") for name in shown], rows


def _markdown(table: pd.DataFrame) -> str:
    names, rows = _cells(table)
    rows = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(names, *rows)]
    lines = [names, ["-" * width for width in widths], *rows]
    return "".join(f"| {' | '.join(map(str.ljust, line, widths))} |\n" for line in lines)


def _latex(table: pd.DataFrame) -> str:
    names, rows = _cells(table)
    marks = str.maketrans({mark: f"\\{mark}" for mark in "&%$#_{}"} | {"–": "--"})
    lines = [" & ".join(cell.translate(marks) for cell in row) + r" \\" for row in (names, *rows)]
    head = f"\\begin{{tabular}}{{{'r' * len(names)}}}\n\\hline\n{lines[0]}\n\\hline\n"
    return head + "\n".join(lines[1:]) + "\n\\hline\n\\end{tabular}\n"
