"""Files that are written completely or not at all, and imports of optional libraries."""

from __future__ import annotations

import importlib
import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType

from ..errors import ArgumentError, FileError, MissingPackageError
from .words import say


def require_free(path: Path, *, source: Path | None = None, overwrite: bool = False) -> None:
    """Raises the errors of :func:`replacing` for a file that exists."""
    if source is not None and path.exists() and path.samefile(source):
        raise ArgumentError(f"{path}: is the file that is read")
    if path.is_dir():
        raise FileError(f"{path}: is a directory")
    if path.exists() and not overwrite:
        raise ArgumentError(f"{path}: exists; {say('overwrite=True', '--overwrite')} replaces it")


@contextmanager
def replacing(path: Path, *, source: Path | None = None, overwrite: bool = False) -> Iterator[Path]:
    """An empty file beside ``path`` to write to; it becomes ``path`` when all is written, and is removed if that fails.

    The file has the permissions of any new one, as the umask and the folder say, also if a library asks for others.

    Raises
    ------
    ArgumentError
        ``path`` exists and ``overwrite`` is false, or it is ``source`` itself.
    FileError
        It cannot be written, such as to a full disk.
    """
    require_free(path, source=source, overwrite=overwrite)
    if not path.parent.is_dir():
        raise FileError(f"{path.parent}: no such directory")
    # The suffix is kept: writers choose the format by it.
    part = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        part.write_bytes(b"")
        mode = part.stat().st_mode
        yield part
        if part.stat().st_mode != mode:
            part.chmod(mode)
        part.replace(path)
    except OSError as error:
        # Errors of h5py about the file that is read have no errno, or another file name.
        if isinstance(error, FileError) or error.errno is None or error.filename not in (None, str(part), part):
            raise
        raise FileError(f"{path}: cannot write: {os.strerror(error.errno)}") from error
    finally:
        # The folder may not be writable.
        with suppress(OSError):
            part.unlink()


class Sink(io.FileIO):
    """A file for HDF5 to write through, which hides errors from it: HDF5 crashes if it closes a file after an error.

    The first error is raised by :meth:`check`, or at the end of the ``with`` block; nothing is written after it.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")
        self._failure: OSError | None = None

    def write(self, data) -> int:
        """Writes all of ``data``; after an error, nothing."""
        rest = memoryview(data).cast("B")
        size = len(rest)
        try:
            while rest and self._failure is None:
                rest = rest[super().write(rest) :]
        except OSError as error:
            self._failure = error
        return size

    def check(self) -> None:
        """Raises the first error."""
        if self._failure is not None:
            raise self._failure

    def __exit__(self, kind, error, trace) -> None:
        super().__exit__(kind, error, trace)
        self.check()


def library(name: str, extra: str = "", *, package: str = "") -> ModuleType:
    """Imports a library; the error names what installs it: an extra of haff, or a package."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        install = package or f"'haff[{extra}]'"
        raise MissingPackageError(f"needs the Python package {error.name}: pip install {install}") from None
