"""Long runs: errors of energy and momentum are random walks, overlaps and contact errors do not grow."""

from __future__ import annotations

from ..long import Gas, follow, rows
from ..registry import Part
from ..rows import Row
from ..runs import Context

FREE_TIMES = 100_000_000
CHECKS = 50


def long(context: Context) -> list[Row]:
    """10⁹ collisions of 4,000 elastic spheres, and 10⁸ mean free times of 2, 3 and 4 + 4 of two masses, φ = 0.1.
    Energy and momentum, summed at 20 moments, drift no faster than a random walk of one rounding a
    collision. At each of these moments 50 collisions are made one by one: the two spheres must be in contact then,
    to the rounding of coordinates, late in the run as well as early, and no two overlap, all in extended precision.
    Run from Python, with `haff.Simulation`."""
    thinned = 1000 if context.quick else 1
    # N particles have N/2 collisions in a mean free time of each.
    gases = [
        Gas((4000,), (1.0,), 1_000_000_000 // thinned),
        Gas((2,), (1.0,), FREE_TIMES // thinned),
        Gas((3,), (1.0,), 3 * FREE_TIMES // 2 // thinned),
        Gas((4, 4), (1.0, 3.0), 4 * FREE_TIMES // thinned),
    ]
    context.collisions += sum(gas.collisions for gas in gases)
    found = context.map(follow, [(gas, CHECKS) for gas in gases])
    return [row for gas, walk in zip(gases, found) for row in rows(gas, walk)]


PARTS = [Part("long", "Long runs", long, order=910)]
