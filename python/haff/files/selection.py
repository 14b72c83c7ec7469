"""Selections of frames: ``start:stop:step``, as in Python."""

from __future__ import annotations

import numbers
import re
from typing import TYPE_CHECKING

import numpy as np

from ..common import arguments
from ..errors import ArgumentError, NotApplicableError
from ..text import quoted
from .frames import Frames

if TYPE_CHECKING:
    from .recording import Recording

_FORM = re.compile(r"\s*(-?\d*)\s*(:\s*(-?\d*)\s*(:\s*(\d*)\s*)?)?")


def parse(text: str) -> slice:
    """``"10:-1:5"``, ``"::10"``, ``":100"``, or one frame: ``"3"``, ``"-1"``."""
    match = _FORM.fullmatch(text)
    numbers = [] if match is None else [match[1], match[3] or "", match[5] or ""]
    if match is None or "-" in numbers or (match[1] == "" and match[2] is None) or re.fullmatch("0+", numbers[2]):
        raise ArgumentError(
            f"frames {quoted(text)}: must be START:STOP:STEP as in Python, with a positive step, such as ::10, "
            "or one number"
        )
    start, stop, step = (int(number) if number else None for number in numbers)
    if match[2] is None and start is not None:
        return slice(start, start + 1 if start != -1 else None)
    return slice(start, stop, step)


def choose(file: Recording, frames: str | slice | int | None) -> Frames:
    """The frames chosen, at least one; all if ``frames`` is ``None``."""
    if frames is None:
        chosen = slice(None)
    elif isinstance(frames, slice):
        arguments.rows("frames", frames, 0)
        chosen = frames
    elif isinstance(frames, (bool, np.bool_)) or not isinstance(frames, (str, numbers.Integral)):
        raise ArgumentError(f'frames = {quoted(frames)}: must be "START:STOP:STEP", a slice or one number')
    else:
        chosen = parse(str(frames))
    found = file.frames
    if len(found) == 0:
        raise NotApplicableError(f"{file.path}: no complete frame yet")
    if len(found[chosen]) == 0:
        raise ArgumentError(
            f"frames {quoted(frames)}: none of the {len(found)} frames of {file.path} (0 to {len(found) - 1})"
        )
    return found[chosen]
