"""Escaping of text from files for terminals, tables and messages."""

from __future__ import annotations

import unicodedata

__all__ = ["brief", "cell", "escaped"]

# Spreadsheets evaluate a cell that begins with one of these. An apostrophe marks a cell as text; a leading one is
# doubled, so that removing one always gives the name.
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "'")


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


def cell(text: str) -> str:
    """Text of a CSV table on one line, which spreadsheets show and do not evaluate."""
    return ("'" if text.startswith(_FORMULA) else "") + escaped(text)
