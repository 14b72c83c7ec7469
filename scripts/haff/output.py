"""Files that are written whole or not at all, and libraries that may be missing."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from .errors import ArgumentError, FileError, MissingPackageError


@contextmanager
def replacing(path: Path, *, source: Path | None = None, overwrite: bool = False) -> Iterator[Path]:
    """A name beside ``path`` to write to; it becomes ``path`` when all is written, and is removed if that fails.

    Raises
    ------
    ArgumentError
        ``path`` exists and ``overwrite`` is false, or it is ``source`` itself.
    """
    if source is not None and path.exists() and path.samefile(source):
        raise ArgumentError(f"{path}: is the file that is read")
    if path.is_dir():
        raise FileError(f"{path}: is a directory")
    if path.exists() and not overwrite:
        raise ArgumentError(f"{path}: exists; --overwrite (overwrite=True) replaces it")
    if not path.parent.is_dir():
        raise FileError(f"{path.parent}: no such directory")
    # The suffix stays: writers go by it.
    part = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield part
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def library(name: str, extra: str) -> ModuleType:
    """Imports an optional library; the error says which extra of the package brings it."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise MissingPackageError(f"needs the Python package {error.name}: pip install 'haff[{extra}]'") from None
