"""Checks of the files and frames that functions of the analysis are given."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator
from functools import wraps
from typing import Any, TypeVar

from ..common import arguments
from ..errors import ArgumentError
from ..text import quoted

F = TypeVar("F", bound=Callable[..., Any])

__all__ = ["checked"]


def _file(name: str, value: object) -> object:
    if not hasattr(value, "scene"):
        raise ArgumentError(f"{name} = {quoted(value)}: must be an open file, as haff.open returns it")
    return value


def _is_frame(value: object) -> bool:
    return hasattr(value, "position") and hasattr(value, "box")


def _frame(name: str, value: object) -> object:
    if not _is_frame(value):
        raise ArgumentError(f"{name} = {quoted(value)}: must be a frame of a file, such as run.frames[-1]")
    return value


def _frames(name: str, value: object) -> Iterable[Any]:
    """Frames, one after the other: those of a file are never all in memory."""
    allowed = "must be frames of a file, such as run.frames[::10]"
    try:
        found = iter(value)  # type: ignore[call-overload]
    except Exception:
        raise ArgumentError(f"{name} = {quoted(value)}: {allowed}") from None

    def each() -> Iterator[object]:
        for one in found:
            if not _is_frame(one):
                raise ArgumentError(f"{name} = {quoted(value)}: {allowed}; one is {quoted(one)}")
            yield one

    if isinstance(value, (str, bytes, dict)):
        raise ArgumentError(f"{name} = {quoted(value)}: {allowed}")
    return each()


def _one_or_more(name: str, value: object) -> object:
    return value if _is_frame(value) else _frames(name, value)


_CHECKS: dict[str, Callable[[str, Any], object]] = {
    "Recording": _file,
    "Frame": _frame,
    "Iterable[Frame]": _frames,
    "Frame | Iterable[Frame]": _one_or_more,
    "float | None": lambda name, value: None if value is None else arguments.number(name, value),
}
"""By the annotation of a parameter."""


def checked(function: F) -> F:
    """Decorates a function: its files and frames are checked, and its optional numbers."""
    signature = inspect.signature(function)
    kinds = {name: str(parameter.annotation) for name, parameter in signature.parameters.items()}

    @wraps(function)
    def call(*arguments: Any, **keywords: Any) -> Any:
        try:
            given = signature.bind(*arguments, **keywords).arguments
        except TypeError:
            # In Python's own words.
            return function(*arguments, **keywords)
        for name, value in given.items():
            if check := _CHECKS.get(kinds[name]):
                given[name] = check(name, value)
        return function(**given)

    return call  # type: ignore[return-value]
