"""Escaping of text from files for terminals, tables and messages."""

from __future__ import annotations

import math
import unicodedata

__all__ = ["brief", "cell", "escaped", "quoted"]

# Spreadsheets evaluate a cell that begins with one of these. An apostrophe marks a cell as text; a leading one is
# doubled, so that removing one always gives the name.
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "'")

_FEW = 16
"""Numbers of an array that a message may show."""


def escaped(text: object) -> str:
    """Text for one line of a terminal: control characters and line ends as ``\\x1b``, ``\\n``, …"""
    whole = str(text)
    if whole.isprintable():
        return whole
    return "".join(c if _harmless(c) else c.encode("unicode_escape").decode("ascii") for c in whole)


def _harmless(character: str) -> bool:
    # Spaces other than U+0020 are not "printable", but harmless on a terminal.
    return character.isprintable() or unicodedata.category(character) == "Zs"


def brief(text: object, most: int = 120) -> str:
    """Escaped text for a message, shortened."""
    whole = escaped(str(text)[: most + 1])
    return whole if len(whole) <= most else whole[:most] + "…"


def quoted(value: object, most: int = 80) -> str:
    """A value as Python writes it, for a message, in at most ``most`` characters; a large array by type and shape."""
    shape = getattr(value, "shape", ())
    if isinstance(shape, tuple) and shape:
        few = math.prod(shape) <= _FEW and hasattr(value, "tolist")
        whole = str(value.tolist()) if few else ""  # type: ignore[attr-defined]
        if 0 < len(whole) <= most:
            return escaped(whole)
        kind = getattr(value, "dtype", None)
        return brief(f"{type(value).__name__}{'' if kind is None else f' of {kind}'}, shape {shape}", most - 1)
    try:
        whole = repr(value)
    except Exception:
        # Such as of whole numbers of more digits than Python writes.
        whole = f"<{type(value).__name__}>"
    return brief(whole, most - 1)


def cell(text: str) -> str:
    """Text of a CSV table on one line, which spreadsheets show and do not evaluate."""
    return ("'" if text.startswith(_FORMULA) else "") + escaped(text)
