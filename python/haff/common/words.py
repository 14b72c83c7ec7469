"""Messages in the words of their reader: keywords for Python, options for the command.

The command has its own messages in both forms: the package runs it with ``HAFF_WORDS=python``.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

__all__ = ["for_command", "say", "warn"]

_COMMAND: ContextVar[bool] = ContextVar("haff_command", default=False)


def say(python: str, command: str) -> str:
    """The words for the present caller."""
    return command if _COMMAND.get() else python


@contextmanager
def for_command() -> Iterator[None]:
    """Messages made in this block are for users of the command."""
    before = _COMMAND.set(True)
    try:
        yield
    finally:
        _COMMAND.reset(before)


def warn(texts: Iterable[str], *, stacklevel: int) -> None:
    """Show warnings of the engine as Python's; ``stacklevel`` counts from the caller of this function."""
    for text in texts:
        warnings.warn(text, RuntimeWarning, stacklevel=stacklevel + 1)
