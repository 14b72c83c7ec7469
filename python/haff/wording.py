"""Messages in the words of their reader: keywords for Python, options for the command.

The package's own messages are made by :func:`say`. Those of the command reach Python as text, which :func:`in_python`
translates. A test compares its table with the messages in the sources of the command.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

__all__ = ["for_command", "in_python", "say", "warn"]

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


_LEFT_OUT = re.compile(r"\s*$|Usage: |For more information, |\s*tip: ")
"""Lines of the parser of arguments that are of no use in Python."""

# Phrases of the command and of Python. Patterns include words around an option, because a message may contain names of
# files.
_PHRASES = [
    (r"^error: ", ""),
    (r"^invalid value '([^']*)' for '--([a-z]+) <[A-Z]+>': \S+ is not in (?=\d)", r"\2 = \1: must be in "),
    (r"^invalid value '([^']*)' for '--([a-z]+) <[A-Z]+>': ", r"\2 = \1: "),
    # Files.
    (r"\(--overwrite\)", "(overwrite=True)"),
    (r"(^|: )--overwrite (?=replaces |with )", r"\1overwrite=True "),
    (r"\bfolder \(-o\)", "folder (output=…)"),
    (r" \(-o\)", " (file=…)"),
    (r": -o DIR$", ": output=…"),
    (r"\bhaff run --resume (.+)$", r'haff.resume("\1")'),
    (r'haff\.resume\("FILE"\)', "haff.resume(file)"),
    (r"\bwith --resume(?=[ :])", "in haff.resume"),
    # Values.
    (r"^(--set|overwrite=True) in haff\.resume (?=changes)", "another value in haff.resume "),
    (r"^nothing to vary: .*", "nothing to vary: give values, {KEY: [V1, V2, …]}, or seeds=N"),
    (r"^--seeds derives seeds .*", 'seeds=N derives seeds from one: give either it or {"seed": [S1, S2]}'),
    (r"\bno --seeds\b", "no seeds"),
    (r"--seeds (\d+|\{n\})", r"seeds=\1"),
    (r"^--index (\d+|\{index\}):", r"run \1:"),
    (r"^--threads: ", "threads: "),
    (r"^--set ", ""),
    (r"(?<= )--set (?=[^ ]+=|\{)", ""),
]
_TABLE = [(re.compile(pattern), words) for pattern, words in _PHRASES]


def in_python(printed: str) -> tuple[str, ...]:
    """The lines of a message of the command, in the words of Python."""
    return tuple(_translated(line) for line in printed.splitlines() if not _LEFT_OUT.match(line))


def _translated(line: str) -> str:
    for pattern, words in _TABLE:
        line = pattern.sub(words, line)
    return line


def warn(texts: Iterable[str], *, stacklevel: int) -> None:
    """Show warnings of the engine as Python's; ``stacklevel`` counts from the caller of this function."""
    for text in texts:
        warnings.warn("; ".join(in_python(text)), RuntimeWarning, stacklevel=stacklevel + 1)
