"""The coloring with which a page begins, and its range, if it is fixed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from ..common import arguments
from ..errors import ArgumentError, MissingDataError
from ..reader import File
from ..text import quoted

COLORINGS = {
    "speed": "speed",
    "species": "species",
    "loss": "soFar",
    "recent-loss": "recent",
    "density": "density",
}
"""Names of colorings, and what they are called in a page."""


class Coloring(NamedTuple):
    """A coloring by its name in :data:`COLORINGS`, ``None`` for that of the page; both ends of its range, if fixed."""

    name: str | None
    range: tuple[float, float] | None

    def require_no_losses(self, file: File) -> None:
        """Raises :class:`MissingDataError` for a coloring that needs losses of energy."""
        if self.name in ("loss", "recent-loss"):
            raise MissingDataError(f"{file.path}: color {self.name}: the file has no event log with losses of energy")

    def header(self) -> dict[str, Any]:
        """As in the header of a page."""
        return {"name": COLORINGS[self.name] if self.name else None, "range": self.range}


def checked(color: str | None, color_range: Sequence[float] | None) -> Coloring:
    """A coloring and its range, ``(min, max)`` in units of the quantity; a range alone is that of speeds.

    Raises
    ------
    ArgumentError
        There is no such coloring, or the range is none.
    """
    if color is not None and not (isinstance(color, str) and color in COLORINGS):
        raise ArgumentError(f"color {quoted(color)}: must be one of {', '.join(COLORINGS)}")
    if color_range is None:
        return Coloring(color, None)
    name = color or "speed"
    if name == "species":
        raise ArgumentError("color range: goes with a quantity, not with species")
    try:
        low, high = arguments.reals("color_range", color_range)
    except (TypeError, ValueError):
        raise ArgumentError(f"color range {quoted(color_range)}: must be two numbers, min and max") from None
    given = f"color range {low:g} {high:g}"
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ArgumentError(f"{given}: must be two finite numbers, the first below the second")
    if name == "recent-loss" and low <= 0:
        raise ArgumentError(f"{given}: the scale of recent-loss is logarithmic, so both must be positive")
    return Coloring(name, (low, high))
