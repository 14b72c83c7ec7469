"""The common layout of frames, observables and events in a file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import HaffError, NotApplicableError
from ..text import brief

if TYPE_CHECKING:
    from .column import Column

SCHEMA = 1
"""Version of scene and layout, as the command writes it."""

AXES = ("x", "y", "z")
Array = NDArray[Any]

_BLOCK = 4096  # rows


@contextmanager
def computing(path: Path, what: str) -> Iterator[None]:
    """Adds the file's name to errors of computing with numbers that are valid one by one, but not together."""
    try:
        yield
    except HaffError:
        raise
    except (ArithmeticError, ValueError, RuntimeError, MemoryError) as error:
        reason = brief(str(error).partition("\n")[0] or type(error).__name__)
        raise NotApplicableError(f"{path}: {what}: the numbers of the file do not allow it ({reason})") from error


def complete(time: Column, length: int) -> int:
    """Number of complete rows: a flush cut short by a kill may leave rows without a time at the end."""
    while length > 0:
        start = max(0, length - _BLOCK)
        known = np.flatnonzero(~np.isnan(time[start:length]))
        if len(known):
            return start + int(known[-1]) + 1
        length = start
    return 0


def component(c: int, width: int) -> str:
    """Suffix of the column of component ``c`` of ``width``: an axis, or a number."""
    return AXES[c] if width == 3 else str(c)
