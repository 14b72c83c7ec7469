"""Velocity distributions of cooling and heated gases from the Boltzmann equation alone, by direct Monte Carlo.

Two of N particles are drawn at random, and a direction for the line of centers; they collide with a probability
proportional to their approach speed (Bird's direct simulation Monte Carlo as Kac's process). It shares no code with
haff and assumes only molecular chaos: no expansion, no time step. It decides between haff and a formula where they
disagree.

    PYTHONPATH=tests python -m validation.boltzmann cooling     # prints A2 below; half an hour on one core
    PYTHONPATH=tests python -m validation.boltzmann heated      # prints HEATED below; some minutes
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

A2 = {
    0.5: (0.04779, 0.00020),
    0.6: (0.02108, 0.00016),
    0.7: (-0.00057, 0.00018),
    0.8: (-0.01458, 0.00016),
    0.9: (-0.01594, 0.00018),
    0.95: (-0.01042, 0.00013),
    0.99: (-0.00283, 0.00017),
}
"""a₂ and its standard error by restitution, as the command above prints them."""

HEATED = {
    (3, 0.6): (0.99797, 0.00034, 0.01226, 0.00019),
    (3, 0.8): (1.00093, 0.00028, -0.00961, 0.00022),
    (3, 0.95): (1.00068, 0.00035, -0.00913, 0.00022),
    (2, 0.6): (0.99782, 0.00038, 0.01723, 0.00028),
    (2, 0.8): (1.00223, 0.00038, -0.01522, 0.00023),
    (2, 0.95): (1.00229, 0.00034, -0.01660, 0.00029),
}
"""Of a gas heated by white noise, by dimension and restitution: T, in units of that at which Maxwell velocities would
balance the heating, and a₂, each followed by its standard error."""
KICKS = 20
"""Kicks of a particle in its mean time between collisions at T = 1: rarer kicks, which are larger, change a₂."""

SETTLE = 15
"""Collisions per particle until the distribution has its shape."""
SAMPLES = 2
"""Samples per collision of a particle."""
BLOCKS = 25
"""Parts of a run that its error comes from."""


def draw_pairs(rng: np.random.Generator, particles: int) -> NDArray[np.int64]:
    """Independent pairs ``[M, 2]`` up to the first with a repeated particle: together they collide as in turn."""
    pairs = rng.integers(particles, size=(max(int(0.6 * particles**0.5), 1), 2))
    drawn = pairs.ravel()
    order = np.argsort(drawn, kind="stable")
    again = order[1:][drawn[order][1:] == drawn[order][:-1]]
    return pairs[: again.min() // 2] if len(again) else pairs


def collide(rng: np.random.Generator, v: NDArray[np.float64], e: float, bound: float) -> int:
    """Collides pairs of `v` ``[N, d]`` in place; returns their number; no approach speed exceeds `bound`."""
    return collide_pairs(rng, v, e, bound, draw_pairs(rng, len(v)))


def collide_pairs(
    rng: np.random.Generator, v: NDArray[np.float64], e: float, bound: float, pairs: NDArray[np.int64]
) -> int:
    """:func:`collide` for pairs that have been drawn."""
    i, j = pairs.T
    n = rng.standard_normal((len(i), v.shape[1]))
    n /= np.linalg.norm(n, axis=1)[:, None]
    approach = np.einsum("ij,ij->i", v[i] - v[j], n)
    assert np.all(np.abs(approach) <= bound)
    hit = rng.random(len(i)) * bound < np.abs(approach)
    impulse = 0.5 * (1 + e) * approach[hit, None] * n[hit]
    v[i[hit]] -= impulse
    v[j[hit]] += impulse
    return int(np.count_nonzero(hit))


def sonine_a2(e: float, particles: int = 200_000, collisions: float = 300, seed: int = 1) -> tuple[float, float]:
    """a₂ = 3⟨v⁴⟩/5⟨v²⟩² − 1 over this many collisions per particle, after `SETTLE`, with its standard error."""
    rng = np.random.default_rng(seed)
    v = rng.standard_normal((particles, 3))
    found: list[float] = []
    for sample in range(int(SAMPLES * (SETTLE + collisions))):
        v -= v.mean(axis=0)
        square = np.einsum("ij,ij->i", v, v)
        temperature = square.mean() / 3
        if sample >= SAMPLES * SETTLE:
            found.append(float(np.mean(square**2) / (15 * temperature**2) - 1))
        v /= np.sqrt(temperature)
        # The factor 2.2 is a margin: until the next sample a particle can become faster than the fastest one is now.
        bound = 2.2 * np.sqrt(square.max() / temperature)
        done = 0
        while done < particles / (2 * SAMPLES):
            done += collide(rng, v, e, bound)
    means = np.array([np.mean(block) for block in np.array_split(found, BLOCKS)])
    return float(means.mean()), float(means.std(ddof=1) / np.sqrt(BLOCKS))


def heated(
    e: float, dimension: int, particles: int = 100_000, collisions: float = 300, seed: int = 1
) -> tuple[float, float, float, float]:
    """T and a₂ of the steady state of a heated gas, each with its standard error, as in :data:`HEATED`.

    Each component of a velocity gets (1 − e²)/d in the mean time between collisions of a particle at T = 1, in `KICKS`
    kicks; at T = 1 Maxwell velocities lose as much. Half of a kick before and half after each step of collisions.
    """
    rng = np.random.default_rng(seed)
    v = rng.standard_normal((particles, dimension))
    spread = np.sqrt((1 - e * e) / (dimension * KICKS) / 2)
    temperatures: list[float] = []
    fourths: list[float] = []
    for step in range(int(KICKS * (SETTLE + collisions))):
        v += spread * rng.standard_normal(v.shape)
        # Momentum is not a degree of freedom of the gas.
        v -= v.mean(axis=0)
        # No pair can approach faster than twice the fastest particle, which a few collisions do not make faster
        # than by this margin.
        bound = 2.2 * np.sqrt(np.einsum("ij,ij->i", v, v).max())
        # A particle takes part in 2/√π of collisions per unit of |g·n| at T = 1.
        attempts = particles * bound * np.sqrt(np.pi) / (4 * KICKS)
        attempts = int(attempts + rng.random())
        while attempts > 0:
            pairs = draw_pairs(rng, particles)[:attempts]
            collide_pairs(rng, v, e, bound, pairs)
            attempts -= len(pairs)
        v += spread * rng.standard_normal(v.shape)
        if step >= KICKS * SETTLE and step % (KICKS // SAMPLES) == 0:
            c = v - v.mean(axis=0)
            square = np.einsum("ij,ij->i", c, c)
            temperatures.append(float(square.mean() / dimension))
            fourths.append(float(dimension * np.mean(square**2) / ((dimension + 2) * np.mean(square) ** 2) - 1))
    found = []
    for values in (temperatures, fourths):
        means = np.array([np.mean(block) for block in np.array_split(values, BLOCKS)])
        found += [float(means.mean()), float(means.std(ddof=1) / np.sqrt(BLOCKS))]
    return found[0], found[1], found[2], found[3]


if __name__ == "__main__":
    import sys

    if sys.argv[1:] == ["heated"]:
        from .parts.heated import CASES

        for dimension, e in CASES:
            T, dT, a2, da2 = heated(e, dimension)
            print(f"    ({dimension}, {e}): ({T:.5f}, {dT:.5f}, {a2:.5f}, {da2:.5f}),", flush=True)
    else:
        from .parts.cooling import RESTITUTIONS

        for restitution in RESTITUTIONS:
            value, error = sonine_a2(restitution)
            print(f"    {restitution}: ({value:.5f}, {error:.5f}),", flush=True)
