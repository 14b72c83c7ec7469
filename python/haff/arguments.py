"""Checks of the arguments of public functions; the messages say what is allowed."""

from __future__ import annotations

import math
import numbers

import numpy as np

from .errors import ArgumentError
from .text import quoted

__all__ = ["choice", "count", "flag", "positive"]


def positive(name: str, value: object) -> float:
    """A finite number above 0. Raises :class:`ArgumentError` otherwise."""
    real = isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_))
    if not real or not math.isfinite(float(value)) or float(value) <= 0:  # type: ignore[arg-type]
        raise ArgumentError(f"{name} = {quoted(value)}: must be a finite number above 0")
    return float(value)  # type: ignore[arg-type]


def count(name: str, value: object, least: int = 1, most: int = 10_000_000) -> int:
    """A whole number in [least, most]. Raises :class:`ArgumentError` otherwise."""
    whole = isinstance(value, numbers.Integral) and not isinstance(value, bool)
    if not whole or not least <= int(value) <= most:  # type: ignore[call-overload]
        raise ArgumentError(f"{name} = {quoted(value)}: must be a whole number from {least} to {most}")
    return int(value)  # type: ignore[call-overload]


def flag(name: str, value: object) -> bool:
    """True or false. Raises :class:`ArgumentError` otherwise."""
    if not isinstance(value, (bool, np.bool_)):
        raise ArgumentError(f"{name} = {quoted(value)}: must be True or False")
    return bool(value)


def choice(name: str, value: object, allowed: tuple[str, ...]) -> str:
    """One of some words. Raises :class:`ArgumentError` otherwise."""
    if not isinstance(value, str) or value not in allowed:
        raise ArgumentError(f"{name} = {quoted(value)}: must be one of {', '.join(allowed)}")
    return value
