"""The deepest overlap of a frame."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .checked import checked
from .trees import near_pairs

if TYPE_CHECKING:
    from ..files.frames import Frame


class Overlap(NamedTuple):
    """The deepest overlap of a frame."""

    depth: float
    """(R_i + R_j − |r_ij|)/(R_i + R_j), relative to the contact distance; negative: the closest pair is apart."""
    pair: tuple[int, int]
    """Rows of the two particles, (−1, −1) if no pair is near contact."""


@checked
def max_overlap(frame: Frame) -> Overlap:
    """Deepest overlap of all close pairs of a frame, relative to the pair's contact distance.

    A k-d tree finds every pair nearer than the largest contact distance, across periodic faces too, those of a sheared
    box among them; sizes may differ. Pairs of two bodies of infinite mass are excluded: they may overlap by
    construction.
    """
    radius = frame.radius
    if len(radius) < 2:
        return Overlap(-np.inf, (-1, -1))
    heavy = np.isinf(frame.mass)
    deepest = Overlap(-np.inf, (-1, -1))
    for pairs, distance in near_pairs(frame.box, frame.position, 2 * radius.max() * (1 + 1e-9)):
        mobile = ~(heavy[pairs[:, 0]] & heavy[pairs[:, 1]])
        pairs, distance = pairs[mobile], distance[mobile]
        contact = radius[pairs[:, 0]] + radius[pairs[:, 1]]
        depth = (contact - distance) / contact
        if depth.max(initial=-np.inf) > deepest.depth:
            worst = int(np.argmax(depth))
            deepest = Overlap(float(depth[worst]), (int(pairs[worst, 0]), int(pairs[worst, 1])))
    return deepest
