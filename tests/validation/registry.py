"""Discovers the parts: every module of :mod:`validation.parts` with a list ``PARTS``."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass

from . import parts
from .rows import Row
from .runs import Context


@dataclass(frozen=True)
class Part:
    """One subject of the validation, a section of the record."""

    name: str
    """What it is called on the command line."""
    title: str
    measure: Callable[[Context], list[Row]]
    """Makes the runs. Its docstring is the section's text, in Markdown: how it is measured, what it is compared with,
    and how far that is to be trusted."""
    order: int = 1000
    """Its position in the record."""

    @property
    def about(self) -> str:
        """The section's text."""
        return " ".join((self.measure.__doc__ or "").split())


def discover() -> dict[str, Part]:
    """All parts by name, in the order of the record."""
    found: list[Part] = []
    for module in pkgutil.iter_modules(parts.__path__, f"{parts.__name__}."):
        found += getattr(importlib.import_module(module.name), "PARTS", ())
    return {part.name: part for part in sorted(found, key=lambda part: (part.order, part.name))}
