"""Triangles of STL and OBJ files, which walls of a scene name."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..text import brief
from .column import LARGEST

__all__ = ["MeshFault", "read"]

LONGEST = 1_200_000_000
"""Most bytes of a file, as the command reads them."""
_HEADER, _FACET = 84, 50
"""Bytes of a binary STL file before its facets, and of a facet."""


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
        The hash XXH3 (128 bits) of the file with which the run began, as 32 hexadecimal digits. It is compared if the
        package xxhash is there.

    Raises
    ------
    MeshFault
        The file is missing, has changed, or has no triangles.
    """
    for path in (Path(name), folder / name):
        try:
            if path.is_file():
                found = path.stat()
                if found.st_size > LONGEST:
                    raise MeshFault(f"{brief(name)} has {found.st_size:,} bytes; at most {LONGEST:,} are read")
                return _read(path.resolve(), found.st_mtime_ns, found.st_size, known)
        except (OSError, ValueError) as error:
            raise MeshFault(f"{brief(name)} cannot be read: {brief(error)}") from None
    raise MeshFault(f"{brief(name)} is not there")


@lru_cache(maxsize=4)  # a movie shows the same mesh in each picture
def _read(path: Path, _modified: int, _size: int, known: str | None) -> NDArray[np.float64]:
    data = path.read_bytes()
    if known is not None and not _is_known(data, known):
        raise MeshFault(f"{brief(path.name)} has changed since the run")
    makers = {".stl": _stl, ".obj": _obj}
    suffix = path.suffix.lower()
    if suffix not in makers:
        raise MeshFault(f"{brief(path.name)} is neither .stl nor .obj")
    try:
        corners = makers[suffix](data)
    except (ValueError, IndexError, UnicodeDecodeError):
        raise MeshFault(f"{brief(path.name)} is no valid {suffix[1:].upper()} file") from None
    if not len(corners) or not np.all(np.abs(corners) <= LARGEST):
        raise MeshFault(f"{brief(path.name)} has no triangles of finite size")
    corners.setflags(write=False)
    return corners


def _is_known(data: bytes, known: str) -> bool:
    try:
        import xxhash
    except ModuleNotFoundError:
        return True
    return xxhash.xxh3_128_hexdigest(data) == known


def _stl(data: bytes) -> NDArray[np.float64]:
    """Those of an STL file, binary or text. Some binary ones begin with the word of texts, so the length decides."""
    if len(data) >= _HEADER:
        count = int.from_bytes(data[_HEADER - 4 : _HEADER], "little")
        if len(data) == _HEADER + _FACET * count:
            facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
            return np.frombuffer(data, facet, count, _HEADER)["corners"].astype(float)
    words = (line.split() for line in data.splitlines())
    corners = [line[1:4] for line in words if line and line[0].lower() == b"vertex"]
    return np.array(corners, float).reshape(-1, 3, 3)


def _obj(data: bytes) -> NDArray[np.float64]:
    """Those of an OBJ file; a face of more corners is divided from its first one."""
    corners: list[list[bytes]] = []
    triangles: list[tuple[int, int, int]] = []
    for line in data.splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == b"v":
            corners.append(words[1:4])
        elif words[0] == b"f":
            given = [int(word.partition(b"/")[0]) for word in words[1:]]
            # Numbers begin with 1; negative ones count back from the last corner so far.
            face = [number - 1 if number > 0 else len(corners) + number for number in given]
            triangles += [(face[0], b, c) for b, c in pairwise(face[1:])]
    rows = np.array(triangles, int).reshape(-1, 3)
    if rows.size and not 0 <= rows.min() <= rows.max() < len(corners):
        raise ValueError
    return np.array(corners, float).reshape(-1, 3)[rows]
