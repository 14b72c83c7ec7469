"""Long runs: energy and momentum walk at random, overlaps stay what they are."""

from __future__ import annotations

from ..long import drift, rows, settings
from ..registry import Part
from ..rows import Row
from ..runs import Context

FREE_TIMES = 100_000_000


def long(context: Context) -> list[Row]:
    """10⁹ collisions of 4,000 elastic spheres, and 10⁸ mean free times of 2, 3 and 8. Energy and momentum, summed
    exactly from 20 frames, drift no faster than a random walk of one rounding a collision; the deepest overlap of the
    frames, in extended precision, is rounding early and late."""
    thinned = 1000 if context.quick else 1
    # N particles have N/2 collisions in a mean free time of each.
    runs = [(4000, 1_000_000_000), (2, FREE_TIMES), (3, 3 * FREE_TIMES // 2), (8, 4 * FREE_TIMES)]
    runs = [(count, collisions // thinned) for count, collisions in runs]
    found = context.each("fluid", [settings(count, collisions, 1) for count, collisions in runs], drift)
    return [row for (count, collisions), result in zip(runs, found) for row in rows(result, count, collisions)]


PARTS = [Part("long", "Long runs", long, order=910)]
