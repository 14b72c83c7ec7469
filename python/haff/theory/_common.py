"""Definitions shared by the modules of the theory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..common import arguments
from ..errors import ArgumentError
from ..text import quoted

Array = NDArray[np.float64]

numeric = arguments.numeric(
    {
        "e": arguments.FRACTION,
        "eta": arguments.FRACTION,
        "packing_fraction": arguments.FRACTION,
        "m": arguments.POSITIVE,
        "sigma": arguments.POSITIVE,
        "n": arguments.NOT_NEGATIVE,
        "T": arguments.NOT_NEGATIVE,
        "T0": arguments.NOT_NEGATIVE,
        "T_rot": arguments.NOT_NEGATIVE,
    }
)
"""Checks the numbers of a function of the theory."""


def check_dimension(d: int) -> int:
    return arguments.count("d", d, 2, 3)


def chosen(equation: object, d: int, spheres: tuple[str, ...], disks: tuple[str, ...]) -> str:
    """One of the equations for a dimension; ``None``: the first."""
    allowed = spheres if check_dimension(d) == 3 else disks
    if equation is None:
        return allowed[0]
    if not isinstance(equation, str) or equation not in allowed:
        known = f"{', '.join(spheres)} (d = 3), {', '.join(disks)} (d = 2)"
        raise ArgumentError(f"equation = {quoted(equation)}, d = {d}: must be one of {known}")
    return equation
