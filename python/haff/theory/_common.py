"""Definitions shared by the modules of the theory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..text import quoted

Array = NDArray[np.float64]


def check_dimension(d: int) -> int:
    if d not in (2, 3):
        raise ValueError(f"d = {quoted(d)} must be 2 or 3")
    return d
