"""Checks of the arguments of public functions; the messages name the argument and say what is allowed."""

from __future__ import annotations

import inspect
import math
import numbers
import os
from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, OutOfRangeError
from ..text import quoted

__all__ = [
    "choice",
    "count",
    "file",
    "flag",
    "function",
    "names",
    "number",
    "numeric",
    "positive",
    "real",
    "reals",
    "rows",
    "shaped",
    "time",
]

F = TypeVar("F", bound=Callable[..., Any])

LARGEST, SMALLEST = 1e50, 1e-50
"""Bounds of lengths, masses and times, as in scenes."""


MOST_ROWS = 2**62
"""More rows than any file has."""


def _is_real(value: object) -> bool:
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.dtype.type()
    return isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_))


def real(name: str, value: object, allowed: str = "must be a number") -> float:
    """A real number, also NaN or infinite. Raises :class:`ArgumentError` otherwise."""
    if not _is_real(value) or np.ma.is_masked(value):
        raise ArgumentError(f"{name} = {quoted(value)}: {allowed}")
    try:
        return float(value)  # type: ignore[arg-type]
    except OverflowError:
        raise ArgumentError(f"{name} = {quoted(value)}: {allowed}") from None


def number(name: str, value: object) -> float:
    """A finite number. Raises :class:`ArgumentError` otherwise."""
    allowed = "must be a finite number"
    found = real(name, value, allowed)
    if not math.isfinite(found):
        raise ArgumentError(f"{name} = {quoted(value)}: {allowed}")
    return found


def positive(name: str, value: object) -> float:
    """A finite number above 0. Raises :class:`ArgumentError` otherwise."""
    allowed = "must be a finite number above 0"
    found = real(name, value, allowed)
    if not math.isfinite(found) or found <= 0:
        raise ArgumentError(f"{name} = {quoted(value)}: {allowed}")
    return found


def time(name: str, value: object, now: float) -> float:
    """A time that is not past, or infinity. Raises :class:`ArgumentError` otherwise."""
    allowed = f"must be a time from the present one, {now!r}, up to {LARGEST:g}, or infinite"
    found = real(name, value, allowed)
    if not (now <= found <= LARGEST or found == math.inf):
        raise ArgumentError(f"{name} = {quoted(value)}: {allowed}")
    return found


def count(name: str, value: object, least: int = 1, most: int = 10_000_000) -> int:
    """A whole number in [least, most]. Raises :class:`ArgumentError` otherwise."""
    whole = isinstance(value, numbers.Integral) and not isinstance(value, (bool, np.bool_))
    if not whole or not least <= int(value) <= most:  # type: ignore[call-overload]
        raise ArgumentError(f"{name} = {quoted(value)}: must be a whole number from {least} to {most}")
    return int(value)  # type: ignore[call-overload]


def rows(name: str, key: object, length: int, what: str = "a row or a slice") -> int | slice:
    """An index in [-length, length) or a slice of whole numbers.

    Raises :class:`OutOfRangeError` for an index beyond these, :class:`ArgumentError` for anything else.
    """

    def whole(value: object) -> bool:
        return isinstance(value, numbers.Integral) and not isinstance(value, (bool, np.bool_))

    if isinstance(key, slice):
        parts = (key.start, key.stop, key.step)
        if not all(part is None or whole(part) for part in parts) or key.step == 0:
            raise ArgumentError(f"{name}[{quoted(key)}]: a slice must have whole numbers, and no step of 0")
        return key
    if not whole(key):
        raise ArgumentError(f"{name}[{quoted(key)}]: must be {what}")
    if not -length <= int(key) < length:  # type: ignore[call-overload]
        raise OutOfRangeError(f"{name}[{quoted(key)}]: there are {length}, 0 to {length - 1}")
    return int(key)  # type: ignore[call-overload]


def flag(name: str, value: object) -> bool:
    """True or false. Raises :class:`ArgumentError` otherwise."""
    if not isinstance(value, (bool, np.bool_)):
        raise ArgumentError(f"{name} = {quoted(value)}: must be True or False")
    return bool(value)


def choice(name: str, value: object, allowed: Iterable[str]) -> str:
    """One of some words. Raises :class:`ArgumentError` otherwise."""
    words = tuple(allowed)
    if not isinstance(value, str) or value not in words:
        raise ArgumentError(f"{name} = {quoted(value)}: must be one of {', '.join(words)}")
    return value


def names(name: str, value: object) -> list[str]:
    """A list of texts, not a single one. Raises :class:`ArgumentError` otherwise."""
    listed = isinstance(value, Iterable) and not isinstance(value, (str, bytes, dict))
    try:
        found = list(value) if listed else []  # type: ignore[call-overload]
    except Exception:
        listed, found = False, []
    if not listed or not all(isinstance(one, str) for one in found):
        raise ArgumentError(f"{name} = {quoted(value)}: must be a list of names")
    return found


def function(name: str, value: object) -> Callable[..., Any]:
    """Something that can be called. Raises :class:`ArgumentError` otherwise."""
    if not callable(value):
        raise ArgumentError(f"{name} = {quoted(value)}: must be a function")
    return value


def file(name: str, value: object) -> Path:
    """The path of a file or a folder. Raises :class:`ArgumentError` otherwise."""
    text = os.fsdecode(value) if isinstance(value, (str, bytes, os.PathLike)) else ""
    if not text or "\0" in text:
        raise ArgumentError(f"{name} = {quoted(value)}: must be the path of a file")
    return Path(text)


def reals(name: str, value: object) -> NDArray[np.float64]:
    """Real numbers as an array of any shape, a copy or not. Raises :class:`ArgumentError` otherwise.

    Complex numbers, masked elements, texts, truth values and objects that are no numbers are refused: NumPy would drop
    a part of them.
    """
    if np.ma.is_masked(value):
        raise ArgumentError(f"{name} = {quoted(value)}: has masked elements; all must be numbers")
    try:
        array = np.asarray(value)
        if array.dtype == object and all(map(_is_real, array.flat)):
            array = array.astype(np.float64)
    except Exception:
        # Lists of different lengths, numbers beyond the range of doubles, or whatever `__array__` raises.
        array = np.empty(0, object)
    if array.dtype.kind not in "iuf":
        raise ArgumentError(f"{name} = {quoted(value)}: must be real numbers, one or an array of them")
    return np.asarray(array, np.float64)


def shaped(name: str, value: object, shape: Sequence[int], allowed: str) -> NDArray[np.float64]:
    """Real numbers, repeated to a shape as NumPy does. Raises :class:`ArgumentError` otherwise."""
    array = reals(name, value)
    try:
        return np.broadcast_to(array, tuple(shape))
    except ValueError:
        raise ArgumentError(f"{name} = {quoted(value)}, of shape {array.shape}: must be {allowed}") from None


_PAIR = "tuple[float, float]"
function_given = function


class Range(NamedTuple):
    """Numbers that a parameter of a closed form can have. NaN stands for an unknown one."""

    low: float
    high: float
    allowed: str


FRACTION = Range(0.0, 1.0, "must be in [0, 1]")
NOT_NEGATIVE = Range(0.0, math.inf, "must not be negative")
POSITIVE = Range(math.ulp(0.0), math.inf, "must be positive")


def numeric(ranges: dict[str, Range]) -> Callable[[F], F]:
    """Decorates a function of numbers: they reach it as arrays of doubles, or as floats where its annotation is that.

    Arguments are checked by :func:`reals` and by the range of their name, if ``ranges`` has it. Pairs of numbers and
    functions are checked, too; all others are left to the function, and so is ``None`` where it is allowed.
    """

    def decorate(function: F) -> F:
        signature = inspect.signature(function)
        kinds = {name: str(parameter.annotation) for name, parameter in signature.parameters.items()}

        def checked(name: str, value: object) -> object:
            kind = kinds[name]
            if value is None and kind.endswith(" | None"):
                return value
            if kind.startswith("Callable"):
                return function_given(name, value)
            if kind.removesuffix(" | None") not in ("ArrayLike", "float", _PAIR):
                return value
            array = reals(name, value)
            if kind == _PAIR and array.shape != (2,):
                raise ArgumentError(f"{name} = {quoted(value)}: must be two numbers")
            if name in ranges:
                low, high, allowed = ranges[name]
                wrong = (array < low) | (array > high)
                if wrong.any():
                    first = f" has {array[wrong][0]:g}" if array.ndim else ""
                    raise ArgumentError(f"{name} = {quoted(value)}{first}: {allowed}")
            return float(array) if kind.startswith("float") and array.ndim == 0 else array

        @wraps(function)
        def call(*arguments: Any, **keywords: Any) -> Any:
            try:
                given = signature.bind(*arguments, **keywords).arguments
            except TypeError:
                # In Python's own words.
                return function(*arguments, **keywords)
            numbers = {name: checked(name, value) for name, value in given.items()}
            try:
                return function(**numbers)
            except ValueError as error:
                if "broadcast" not in str(error):
                    raise
                shapes = {name: value.shape for name, value in numbers.items() if np.ndim(value)}
                told = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
                raise ArgumentError(f"arrays of different shapes: {told}; must be the same, or one number") from None

        return call  # type: ignore[return-value]

    return decorate
