"""Triangles of STL and OBJ files, which walls of a scene name, as the command reads them."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..common.compiled import compiled
from ..text import brief
from .column import LARGEST

__all__ = ["MeshFault", "read"]


class MeshFault(Exception):
    """The triangles of a file cannot be had."""


def read(name: str, folder: Path, known: str | None = None) -> NDArray[np.float64]:
    """``[F, 3, 3]`` corners of the triangles of a file, in its own coordinates.

    Parameters
    ----------
    name
        The path in the scene, which ends in ``.stl`` or ``.obj``.
    folder
        Where a relative path is looked for, if the current directory does not have the file.
    known
        The hash of the file with which the run began, as in its scene.

    Raises
    ------
    MeshFault
        The file is missing, has changed, or has no triangles.
    """
    for path in (Path(name), folder / name):
        try:
            if path.is_file():
                found = path.stat()
                return _read(path.resolve(), found.st_mtime_ns, found.st_size, known)
        except (OSError, ValueError) as error:
            raise MeshFault(f"{brief(name)} {brief(error)}") from None
    raise MeshFault(f"{brief(name)} is not there")


@lru_cache(maxsize=4)  # a movie shows the same mesh in each picture
def _read(path: Path, _modified: int, _size: int, known: str | None) -> NDArray[np.float64]:
    rows, found = compiled().mesh(path)
    if known not in (None, found):
        raise MeshFault(f"{brief(path.name)} has changed since the run")
    if not len(rows) or not np.all(np.abs(rows) <= LARGEST):
        raise MeshFault(f"{brief(path.name)} has no triangles of finite size")
    return rows.reshape(-1, 3, 3)
