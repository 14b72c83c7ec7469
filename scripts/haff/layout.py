"""What frames, observables and events have in common in a file."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .errors import FileError

SCHEMA = 1
"""Version of scene and layout, as the command writes it."""

AXES = ("x", "y", "z")
Array = NDArray[Any]


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Names the file where HDF5 cannot read, of which h5py tells no name: whoever reads may be writing another file."""
    try:
        yield
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise FileError(f"{path}: cannot read: {reason}") from error


def complete(time: h5py.Dataset, length: int) -> int:
    """Rows that are there: a flush cut short by a kill may leave rows without a time at the end."""
    while length > 0 and np.isnan(time[length - 1]):
        length -= 1
    return length


def component(c: int, width: int) -> str:
    """Suffix of the column of component ``c`` of ``width``: an axis, or a number."""
    return AXES[c] if width == 3 else str(c)
