"""Text of files where it could be taken for something else: on a terminal, in tables, in messages."""

from __future__ import annotations

import unicodedata

__all__ = ["brief", "cell", "escaped"]

# Spreadsheets compute a cell that begins with one of these. The apostrophe, which marks a cell as text, is doubled, so
# that taking one away always gives the name.
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "'")


def escaped(text: object) -> str:
    """Text for one line of a terminal: control characters and line ends as ``\\x1b``, ``\\n``, …"""
    whole = str(text)
    if whole.isprintable():
        return whole
    return "".join(c if _harmless(c) else c.encode("unicode_escape").decode("ascii") for c in whole)


def _harmless(character: str) -> bool:
    # Spaces other than the plain one are not "printable", but do nothing to a terminal.
    return character.isprintable() or unicodedata.category(character) == "Zs"


def brief(text: object, most: int = 120) -> str:
    """Escaped text for a message, shortened."""
    whole = escaped(str(text)[: most + 1])
    return whole if len(whole) <= most else whole[:most] + "…"


def cell(text: str) -> str:
    """Text of a CSV table that spreadsheets show and do not compute, on one line."""
    return ("'" if text.startswith(_FORMULA) else "") + escaped(text)
