"""The common layout of frames, observables and events in a file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..errors import HaffError, NotApplicableError
from ..text import brief

SCHEMA = 1
"""Version of scene and layout, as the command writes it."""

AXES = ("x", "y", "z")
Array = NDArray[Any]


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


def component(c: int, width: int) -> str:
    """Suffix of the column of component ``c`` of ``width``: an axis, or a number."""
    return AXES[c] if width == 3 else str(c)
