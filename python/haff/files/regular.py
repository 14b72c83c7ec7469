"""What can be said of a file before HDF5 is loaded, which takes longer than to say it."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from ..errors import FileError

__all__ = ["require_file"]


def require_file(path: Path) -> None:
    """Raises :class:`FileError` unless there is a regular file of this name."""
    try:
        mode = os.stat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        raise FileError(f"{path}: no such file") from None
    except PermissionError:
        raise FileError(f"{path}: permission denied") from None
    if stat.S_ISDIR(mode):
        raise FileError(f"{path}: is a directory, not an HDF5 file")
    if not stat.S_ISREG(mode):
        raise FileError(f"{path}: is a device or a pipe, not an HDF5 file")
