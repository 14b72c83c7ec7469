"""Triangles of STL and OBJ files, which walls of a scene name, as the command reads them."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..common.compiled import compiled
from ..text import brief
from .column import LARGEST

if TYPE_CHECKING:
    from .header import Header

__all__ = ["MeshFault", "Triangles", "read", "triangles_of"]

Triangles = Callable[[dict[str, Any]], NDArray[np.float64]]
"""Gives the triangles ``[F, 3, 3]`` of the key ``mesh`` of a wall, or raises :class:`MeshFault`."""


class MeshFault(Exception):
    """The triangles of a file cannot be had."""


def triangles_of(file: Header) -> Triangles:
    """The triangles of meshes of a run: those of their own files, or, without these, those that its file has kept."""
    return partial(_triangles, file)


def _triangles(file: Header, given: dict[str, Any]) -> NDArray[np.float64]:
    known = given.get("hash")
    try:
        return read(given["file"], file.path.parent, known)
    except MeshFault:
        if known not in file.meshes:
            raise
    return file.meshes[known]


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
