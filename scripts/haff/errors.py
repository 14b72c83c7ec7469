"""Errors of the package: each message is one line, tells what is wrong and what helps."""

from __future__ import annotations

__all__ = [
    "ArgumentError",
    "FileError",
    "HaffError",
    "MissingDataError",
    "MissingPackageError",
    "NotApplicableError",
]


class HaffError(Exception):
    """Base of all errors raised on purpose by this package."""


class FileError(HaffError, OSError):
    """A file cannot be opened, is not HDF5, or is not an output file of ``haff``."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class MissingDataError(HaffError, LookupError):
    """The file is sound but the scene did not ask for this part of the output."""


class NotApplicableError(HaffError):
    """A figure or an analysis makes no sense for this file; the message is the reason."""


class ArgumentError(HaffError, ValueError):
    """An argument is not what it must be; the message tells what is allowed."""


class MissingPackageError(HaffError, ImportError):
    """An optional library is not installed; the message names the extra that brings it."""
