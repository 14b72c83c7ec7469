"""Errors of the package. Each message says what is wrong and how to correct it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .text import escaped

__all__ = [
    "ArgumentError",
    "FileError",
    "HaffError",
    "MissingDataError",
    "MissingPackageError",
    "NotApplicableError",
    "OutOfRangeError",
    "SceneError",
    "SceneProblem",
    "SimulationError",
    "UnknownNameError",
]


class HaffError(Exception):
    """Base of all errors raised on purpose by this package.

    Its text is one line, or a tuple of lines, without control characters: names and titles of a file cannot add lines
    to what a terminal shows.
    """

    @property
    def lines(self) -> tuple[str, ...]:
        """The message, line by line."""
        told = self.args[0] if self.args else ()
        return tuple(map(escaped, told if isinstance(told, tuple) else (told,)))

    def __str__(self) -> str:
        return "\n".join(self.lines)


class FileError(HaffError, OSError):
    """A file cannot be opened or read, is not an output file of ``haff``, or holds values that no run can have written.

    The message names the file, the dataset or attribute, the value, and what is allowed.
    """


class MissingDataError(HaffError, LookupError):
    """The file is valid, but this part of the output was not recorded."""


class NotApplicableError(HaffError):
    """A figure or an analysis does not apply to this file; the message is the reason."""


class ArgumentError(HaffError, ValueError):
    """An argument is invalid; the message says what is allowed."""


class UnknownNameError(ArgumentError, KeyError):
    """An argument is none of the names that there are; the message lists them."""


class OutOfRangeError(ArgumentError, IndexError):
    """An index is beyond the end; the message says how many there are."""


class MissingPackageError(HaffError, ImportError):
    """An optional library is not installed; the message names the extra that brings it."""


class RunningFileError(FileError):
    """A file that a run is writing has changed too much since it was opened; it can be opened again."""


@dataclass(frozen=True)
class SceneProblem:
    """One error in a scene."""

    text: str
    """All of it on one line: ``gas.toml:12: contact.restitution = 1.2: must be in [0, 1]``."""
    file: str = ""
    """The scene file; ``scene`` for one made in Python."""
    line: int | None = None
    """Line in the file, from 1; ``None`` where there is none: scenes made in Python, overrides."""
    key: str = ""
    """Dotted path of the key."""
    value: str | None = None
    """The value, as TOML."""
    message: str = ""
    """What is wrong, and what is allowed."""
    code: str = "conflict"
    """Class of the error: ``syntax`` (no TOML), ``unreadable`` and ``not_text`` (the file), ``unknown_key``,
    ``missing`` (a key that is needed), ``type``, ``value`` (not allowed), ``conflict`` (with other keys, the particles
    or a state)."""
    allowed: str | None = None
    """What is allowed, where that can be said of the value alone: ``in [0, 1]``; for an unknown key the known ones."""
    meant: tuple[str, ...] = ()
    """Dotted paths of the keys that an unknown one may stand for."""
    set: str | None = None
    """Dotted path of the keyword that the error is in; ``None`` if it is in the scene."""

    @classmethod
    def of(cls, fields: Mapping[str, Any]) -> SceneProblem:
        """A problem as the command and the compiled module describe it."""
        return cls(**{**fields, "meant": tuple(fields["meant"])})

    def __str__(self) -> str:
        return self.text


class SceneError(HaffError, ValueError):
    """A scene is invalid. All errors found are in :attr:`problems`."""

    def __init__(self, problems: Sequence[SceneProblem]) -> None:
        super().__init__(tuple(problems))

    @property
    def problems(self) -> tuple[SceneProblem, ...]:
        """The errors, each with its place."""
        return self.args[0]


class SimulationError(HaffError, RuntimeError):
    """The simulation cannot continue, for example after an inelastic collapse. Data recorded before stay readable."""

    result: Any = None
    """The :class:`haff.Result` of the run up to there, of :func:`haff.run` and :func:`haff.resume`."""
