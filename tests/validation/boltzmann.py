"""The velocity distribution of the homogeneous cooling state from the Boltzmann equation alone, by direct Monte Carlo.

Two of N particles are drawn at random, and a direction for the line of centers; they collide with a probability
proportional to their approach speed (Bird's direct simulation Monte Carlo as Kac's process). It shares no code with
haff and assumes only molecular chaos: no expansion, no time step. It decides between haff and a formula where they
disagree.

    PYTHONPATH=tests python -m validation.boltzmann      # prints A2 below; half an hour on one core
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
    """Collides pairs of `v` ``[N, 3]`` in place; returns their number; no approach speed exceeds `bound`."""
    i, j = draw_pairs(rng, len(v)).T
    n = rng.standard_normal((len(i), 3))
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


if __name__ == "__main__":
    from .parts.cooling import RESTITUTIONS

    for restitution in RESTITUTIONS:
        value, error = sonine_a2(restitution)
        print(f"    {restitution}: ({value:.5f}, {error:.5f}),", flush=True)
