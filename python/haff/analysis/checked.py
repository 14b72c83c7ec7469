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


def _opened(value: Any) -> Any:
    """The file of the result of a run."""
    return value.file if hasattr(value, "report") and hasattr(value, "file") else value


def _file(name: str, value: object) -> object:
    value = _opened(value)
    if not hasattr(value, "scene"):
        raise ArgumentError(f"{name} = {quoted(value)}: must be an open file, as haff.open returns it")
    return value


def _is_frame(value: object) -> bool:
    return hasattr(value, "position") and hasattr(value, "box")


def _frame(name: str, value: object) -> object:
    if not _is_frame(value):
        value = _opened(value)
        each = "; haff.analysis.history(run, function) is that of every frame" if hasattr(value, "frames") else ""
        raise ArgumentError(f"{name} = {quoted(value)}: must be a frame of a file, such as run.frames[-1]{each}")
    return value


def _frames(name: str, value: object) -> Iterable[Any]:
    """Frames, one after the other: those of a file are never all in memory. One frame is one of them."""
    allowed = "must be a frame, frames such as run.frames[::10], or a run, of which all are taken"
    if _is_frame(value):
        return [value]
    value = _opened(value)
    value = getattr(value, "frames", value)
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


_CHECKS: dict[str, Callable[[str, Any], object]] = {
    "Recording": _file,
    "Frame": _frame,
    "Iterable[Frame]": _frames,
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
            given = signature.bind(*arguments, **keywords)
        except TypeError:
            # In Python's own words.
            return function(*arguments, **keywords)
        for name, value in given.arguments.items():
            if check := _CHECKS.get(kinds[name]):
                given.arguments[name] = check(name, value)
        return function(*given.args, **given.kwargs)

    return call  # type: ignore[return-value]
